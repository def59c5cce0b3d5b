"""The sample character: a person with a mesh of its own, joints named as in Mixamo, in T-pose.

Centimetres, Y up, facing +Z, the left side at +X. As in files of other programs, the joints' axes lie along the bones,
and a node above them rotates and scales them from Z up and centimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from gltf_file import Gltf
from numpy.typing import NDArray
from sample_mesh import Surface, behind, both_sides, cut, ellipsoid, joined, limb, surface, symmetric, weights
from scipy.spatial.transform import Rotation

from distretarget.numerics.quaternions import least_rotation
from distretarget.numerics.vectors import Array

# name, parent, place
MIDDLE = (
    ("Hips", "", (0, 93, 0)),
    ("Spine", "Hips", (0, 103, 0.5)),
    ("Spine1", "Spine", (0, 114, 0)),
    ("Spine2", "Spine1", (0, 126, -1.5)),
    ("Neck", "Spine2", (0, 145, -2)),
    ("Head", "Neck", (0, 153, -0.5)),
    ("HeadTop_End", "Head", (0, 176, 0)),
)
LEFT = (  # likewise, and the roll of the joint about its bone [rad]
    ("Shoulder", "Spine2", (3, 141, -1), 1.2),
    ("Arm", "Shoulder", (17, 140, -2), 1.6),
    ("ForeArm", "Arm", (43.5, 140, -2.8), 1.6),
    ("Hand", "ForeArm", (68, 140, -2), 1.6),
    ("UpLeg", "Hips", (9, 88, 0), 3.1),
    ("Leg", "UpLeg", (9.5, 49, 0.8), 3.1),
    ("Foot", "Leg", (10, 9, -1.5), 0.1),
    ("ToeBase", "Foot", (10.5, 2.5, 11.5), 3.0),
    ("Toe_End", "ToeBase", (11, 2.5, 18), 0.0),
)
HAND_LENGTH = 17.0
BLEND = 9.0  # length over which a joint bends the mesh

ARMATURE_SCALE = 0.01
ARMATURE_TURN = Rotation.from_euler("X", -90, degrees=True)

COLOURS = {"Suit": (0.09, 0.30, 0.46), "Skin": (0.80, 0.55, 0.42), "Dark": (0.06, 0.05, 0.07)}  # linear


@dataclass(frozen=True, eq=False)
class Joints:
    """The joints in the bind pose: parents, -1 for the root, positions and ends of bones, (joints, 3), rotations."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    places: Array
    ends: Array
    rotations: Rotation


def joints() -> Joints:
    """The joints of the sample character."""
    rows = [(*row, 0.0) for row in MIDDLE]
    names = {name for name, *_ in LEFT}
    for side, sign in (("Left", 1), ("Right", -1)):
        rows += [
            (side + name, side + parent if parent in names else parent, (sign * x, y, z), sign * roll)
            for name, parent, (x, y, z), roll in LEFT
        ]
    order = tuple(name for name, *_ in rows)
    parents = tuple(order.index(parent) if parent else -1 for _, parent, *_ in rows)
    places, rolls = np.array([row[2] for row in rows], float), np.array([row[3] for row in rows])
    ends = np.array([_end(joint, order, parents, places) for joint in range(len(order))])
    along = ends - places
    least = Rotation.from_quat(least_rotation(np.tile([0.0, 1.0, 0.0], (len(along), 1)), along))
    return Joints(order, parents, places, ends, least * Rotation.from_rotvec(rolls[:, None] * [0.0, 1.0, 0.0]))


def _end(joint: int, names: tuple[str, ...], parents: tuple[int, ...], places: Array) -> Array:
    """The end of a joint's bone: its first child, or for leaves a point in the same direction."""
    if joint in parents:
        return places[parents.index(joint)]
    along = places[joint] - places[parents[joint]]
    return places[joint] + (HAND_LENGTH if "Hand" in names[joint] else 4.0) * along / np.linalg.norm(along)


# ---- the parts of the body

TRUNK = joined(
    [
        ellipsoid((0, 94, -0.5), (14.8, 11.5, 10.8)),
        ellipsoid((0, 108, 0), (13.6, 16, 9.6)),
        ellipsoid((0, 126.5, -1.5), (17.6, 16.5, 11)),
        limb((0, 136, -2), (0, 143, -2), 9.0, 7.0),
    ],
    6.0,
)
LEFT_ARM = joined(
    [
        limb((8, 138.5, -2), (17.5, 139, -2), 6.8, 7.0),
        limb((17, 139.4, -2), (43, 140, -2.8), 6.3, 4.8),
        limb((43, 140, -2.8), (66, 140, -2), 4.9, 3.9),
    ],
    3.0,
)
LEFT_LEG = joined(
    [
        limb((9, 88, -0.5), (9.5, 49, 0.8), 9.6, 6.2),
        limb((9.5, 49, 0.8), (10, 12, -1.5), 6.2, 5.4),
        ellipsoid((9.8, 37, -2.2), (5.7, 11, 6.0)),
    ],
    3.0,
)
CLOTHES = joined([TRUNK, both_sides(LEFT_ARM), both_sides(LEFT_LEG)], 5.0)
HEAD = joined(
    [
        limb((0, 139, -2), (0, 155, -0.5), 5.2, 5.0),
        ellipsoid((0, 164.5, 0.5), (8.8, 11.3, 10.2)),
        ellipsoid((0, 157, 3.5), (6.3, 6.4, 6.6)),
        limb((0, 162.5, 10.6), (0, 159.8, 11.8), 0.9, 1.5),
        both_sides(ellipsoid((8.5, 161, -1), (1.3, 3.0, 2.0))),
    ],
    2.2,
)
HAIR = cut(ellipsoid((0, 166, -0.6), (9.7, 11.4, 10.8)), behind((0, 168, 4.6), (0, -0.55, 1)), 1.5)
LEFT_EYE = ellipsoid((3.4, 163.6, 9.75), (1.15, 1.5, 0.9))
LEFT_HAND = joined(
    [
        limb((64, 140, -2), (70, 140, -2), 2.9, 2.6),
        ellipsoid((73, 139.8, -1.9), (5.4, 2.0, 4.6)),
        limb((70, 139.6, 1), (76, 138.6, 5), 1.8, 1.2),
        *(
            limb((76, 139.6, z), (76 + length, 138.8, 1.12 * (z + 2) - 2), 1.35, 1.0)
            for z, length in ((1.4, 7.2), (-0.8, 8.2), (-3.0, 7.6), (-5.1, 5.8))
        ),
    ],
    1.2,
)
WHOLE_SHOE = joined(
    [
        limb((10, 10, -1.8), (10, 6, -2), 3.7, 4.6),
        limb((10, 4.2, -3), (10.6, 3.4, 8), 5.2, 5.0),
        ellipsoid((10.9, 2.6, 12.5), (5.6, 4.3, 8.2)),
    ],
    3.0,
)
LEFT_SHOE = cut(WHOLE_SHOE, behind((0, 0, 0), (0, -1, 0)), 1.5)
PARTS = (  # body, name, box, cell; cells meet at x = 0 between thighs, and lie across it elsewhere
    (CLOTHES, "Suit", ((-71.4, 3, -17), (72, 156, 17)), 4.2),
    (HEAD, "Skin", ((-12.375, 131, -13), (12, 178, 16)), 2.25),
    (LEFT_HAND, "Skin", ((58, 133, -12), (90, 145, 10)), 1.5),
    (HAIR, "Dark", ((-12.15, 152, -14), (12, 180, 13)), 2.7),
    (LEFT_EYE, "Dark", ((1.5, 161, 7.5), (6, 166, 12)), 0.9),
    (LEFT_SHOE, "Dark", ((2, -2, -11), (20, 19, 24)), 2.7),
)


@dataclass(frozen=True, eq=False)
class Part:
    """The parts of the mesh of one colour."""

    name: str  # of the material
    colour: tuple[float, float, float]  # linear red, green, blue
    surface: Surface
    joints: NDArray[np.intp]  # (points, 4), of `joints()`
    shares: NDArray[np.intp]  # (points, 4), their weights in 255ths


def mesh(bones: Joints) -> list[Part]:
    """The mesh in the bind pose."""
    made = [(name, symmetric(surface(body, *box, cell))) for body, name, box, cell in PARTS]
    return [_part(name, [each for other, each in made if other == name], bones) for name in COLOURS]


def _part(name: str, surfaces: Sequence[Surface], bones: Joints) -> Part:
    points, normals = (np.concatenate([getattr(each, key) for each in surfaces]) for key in ("points", "normals"))
    starts = np.cumsum([0, *(len(each.points) for each in surfaces[:-1])])
    triangles = np.concatenate([each.triangles + start for each, start in zip(surfaces, starts, strict=True)])
    sides = np.array([name.startswith("Left") * 1 - name.startswith("Right") * 1 for name in bones.names])
    movers = np.flatnonzero([not name.endswith("_End") for name in bones.names])
    local, share = weights(points, bones.places[movers], bones.ends[movers], BLEND, sides[movers])
    shares = np.round(255 * share).astype(int)
    shares[:, 0] += 255 - shares.sum(axis=1)
    return Part(
        name, COLOURS[name], Surface(points, normals, triangles), np.where(shares > 0, movers[local], 0), shares
    )


# ---- the file


def glb() -> bytes:
    """The sample character as GLB."""
    made, bones = Gltf(), joints()
    armature = np.eye(4)
    armature[:3, :3] = ARMATURE_SCALE * ARMATURE_TURN.as_matrix()
    worlds = np.tile(np.eye(4), (len(bones.names), 1, 1))
    worlds[:, :3, :3] = ARMATURE_SCALE * bones.rotations.as_matrix()
    worlds[:, :3, 3] = 0.01 * bones.places
    turn = _numbers(ARMATURE_TURN.as_quat())
    top = made.add("nodes", name="Armature", rotation=turn, scale=[ARMATURE_SCALE] * 3, children=[])
    numbers: list[int] = []
    for joint, parent in enumerate(bones.parents):
        local = np.linalg.inv(worlds[parent] if parent >= 0 else armature) @ worlds[joint]
        scaled = local[:3, :3] / np.cbrt(np.linalg.det(local[:3, :3]))
        place, turn = _numbers(local[:3, 3]), _numbers(Rotation.from_matrix(scaled).as_quat(canonical=True), 8)
        numbers.append(made.add("nodes", name=bones.names[joint], translation=place, rotation=turn))
        made.document["nodes"][numbers[parent] if parent >= 0 else top].setdefault("children", []).append(numbers[-1])
    binds = np.linalg.inv(worlds)
    binds[:, 3] = [0, 0, 0, 1]
    skin = made.add("skins", name="Hero", joints=numbers, inverseBindMatrices=made.accessor(binds), skeleton=numbers[0])
    primitives = [_primitive(made, part) for part in mesh(bones)]
    shape = made.add("meshes", name="Hero", primitives=primitives)
    body = made.add("nodes", name="Hero", mesh=shape, skin=skin)
    made.document |= {"scene": 0, "scenes": [{"name": "Scene", "nodes": [top, body]}]}
    return made.glb()


def _numbers(values: Array, decimals: int = 6) -> list[float]:
    return (np.round(values, decimals) + 0.0).tolist()


def _primitive(made: Gltf, part: Part) -> dict:
    """A part of the mesh with one material."""
    rough = {"baseColorFactor": [*part.colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}
    normals = np.round(part.surface.normals, 4)
    attributes = {
        "POSITION": made.accessor(np.round(0.01 * part.surface.points, 5), bounds=True, target=34962),
        "NORMAL": made.accessor(normals / np.linalg.norm(normals, axis=1, keepdims=True), target=34962),
        "JOINTS_0": made.accessor(part.joints, "u1", target=34962),
        "WEIGHTS_0": made.accessor(part.shares / 255, "u1", target=34962),
    }
    material = made.add("materials", name=part.name, pbrMetallicRoughness=rough)
    indices = made.accessor(part.surface.triangles.reshape(-1), "u2", target=34963)
    return {"attributes": attributes, "indices": indices, "material": material}
