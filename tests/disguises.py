"""The sample body in disguise: the same motions in the structures, names, axes and formats of other people's files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from bodies import SAMPLES, SIDES, in_world, on_skeleton
from built_rigs import with_axes
from characters import ARMATURE, LIMBS, TRUNK, Bones, Character, Mesh, Performance, box_mesh, character
from scipy.spatial.transform import Rotation
from skeleton_edits import turned_below, with_chain

from distretarget import Motion, Skeleton, load_target, read_bvh, read_motion, retarget
from distretarget.body.tree_repairs import reparented
from distretarget.skeleton import DEFAULT_ROOT
from distretarget.target import Target

MIXAMO = (
    ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"),
    ("{}Shoulder", "{}Arm", "{}ForeArm", "{}Hand", "{}UpLeg", "{}Leg", "{}Foot", "{}ToeBase"),
    SIDES,
)
UNREAL = (
    ("pelvis", "spine_01", "spine_02", "spine_03", "neck_01", "head"),
    ("clavicle_{}", "upperarm_{}", "lowerarm_{}", "hand_{}", "thigh_{}", "calf_{}", "foot_{}", "ball_{}"),
    ("l", "r"),
)
LOW_POLY = (
    ("Body", "Abdomen", "Torso", "Chest", "Neck", "Head"),
    ("Shoulder.{}", "UpperArm.{}", "LowerArm.{}", "Hand.{}", "UpperLeg.{}", "LowerLeg.{}", "Foot.{}", "Toe.{}"),
    ("L", "R"),
)

SOLE = 6.0  # how much lower the toes of `straight_below` are than those of the sample [cm]

Structure = Callable[[Motion], Motion]
"""Writes a motion of the sample body by a skeleton of another structure; every joint keeps its name and place."""


class Disguise(NamedTuple):
    """How a file differs from the sample besides its structure."""

    names: tuple[tuple[str, ...], tuple[str, ...], tuple[str, str]]  # of trunk and limbs, and the marks of both sides
    turn: Rotation = Rotation.identity()  # of the world
    scale: float = 1.0
    gltf: bool = False  # whether it is a character with an animation

    def __repr__(self) -> str:
        return f"{self.names[0][0]}{'-gltf' if self.gltf else '-bvh'}"

    @property
    def by_sample(self) -> Mapping[str, str]:
        """The names by those of the sample."""
        trunk, limbs, marks = self.names
        sides = {
            side + own: name.format(mark)
            for side, mark in zip(SIDES, marks, strict=True)
            for own, name in zip(LIMBS, limbs, strict=True)
        }
        return dict(zip(TRUNK, trunk, strict=True)) | sides

    def worn_by(self, motion: Motion, folder: Path) -> Motion:
        """The motion as a reader of such a file returns it."""
        named = self.worn(motion)
        if not self.gltf:
            return named
        made = _character(named)
        made.animate("clip", Performance.of(named), all_translations=True)
        return read_motion(made.write(_unused(folder)))

    def worn(self, motion: Motion) -> Motion:
        """The motion with names and axes of such a file."""
        return in_world(with_names(motion, self.by_sample), self.turn, self.scale)

    def target(self, structure: Structure, folder: Path) -> Target:
        """The sample's body in a structure as a reader of such a file returns it."""
        still = sample("walk")[:1]
        at_rest = replace(still, rotations=still.skeleton.rest_rotations[None])
        named = self.worn(structure(at_rest))
        if not self.gltf:
            return Target(named.skeleton, {}, "")
        mesh = box_mesh(Bones.of(self.worn(at_rest).skeleton))
        return load_target(_character(named, [mesh], stand=True).write(_unused(folder)))


def _character(motion: Motion, meshes: Sequence[Mesh] = (), *, stand: bool = False) -> Character:
    bones = Bones.of(motion.skeleton, stand=stand)
    return character(bones, axes=bones.along_bones(), above=ARMATURE, meshes=meshes)


def _unused(folder: Path) -> Path:
    return folder / f"{len([*folder.iterdir()])}.glb"


DISGUISES = (
    Disguise(MIXAMO),
    Disguise(UNREAL, Rotation.from_euler("X", 90, degrees=True), 0.01),
    Disguise(LOW_POLY, gltf=True),
)


@cache
def sample(name: str) -> Motion:
    return read_bvh(SAMPLES / f"{name}.bvh")[::3]


def with_names(motion: Motion, names: Mapping[str, str]) -> Motion:
    """The motion with other names of joints, by their names; joints named for others follow them."""
    longest = sorted(names, key=len, reverse=True)

    def name(own: str) -> str:
        found = next((each for each in longest if own.startswith(each)), "")
        return names[found] + own.removeprefix(found) if found else own

    return replace(motion, skeleton=replace(motion.skeleton, names=tuple(map(name, motion.skeleton.names))))


@cache
def targets() -> tuple[Skeleton, ...]:
    """Bodies with the sample's names, and with other ones."""
    return tuple(load_target(SAMPLES / name).skeleton for name in ("child.json", "rigs/mixamo_a.json"))


def farthest_apart(one: Motion, other: Motion) -> float:
    """How far joints of the same names are apart in two motions at most [% of the height]."""
    keys = [key for key in one.skeleton.keys if key in other.skeleton.keys]
    a, b = (each.positions[:, [each.skeleton.index(key) for key in keys]] for each in (one, other))
    return float(100.0 * np.linalg.norm(a - b, axis=-1).max() / np.ptp(one.skeleton.rest_positions, axis=0).max())


def turned_at_most(one: Motion, other: Motion, names: tuple[str, ...]) -> float:
    """How far joints whose names end with these are turned against each other in two motions at most [degrees]."""
    joints = [joint for joint, name in enumerate(one.skeleton.names) if name.endswith(names)]
    turns = [Rotation.from_quat(each.world_rotations[:, joints].reshape(-1, 4)) for each in (one, other)]
    return float(np.degrees((turns[0].inv() * turns[1]).magnitude()).max())


def plain(motion: Motion) -> Motion:
    """The structure of the sample."""
    return motion


def off(structure: Structure, disguise: Disguise, clip: str, folder: Path, target: Skeleton) -> float:
    """How far joints of the result from a clip in another structure are from those of the plain one [% of height]."""
    other = disguise.worn_by(structure(sample(clip)), folder)
    return farthest_apart(_plain_result(disguise, clip, target), retarget(other, target).motion)


@cache
def _plain_result(disguise: Disguise, clip: str, target: Skeleton) -> Motion:
    with TemporaryDirectory() as folder:
        return retarget(disguise.worn_by(sample(clip), Path(folder)), target).motion


# ---- structures


def beside(*parts: str) -> Structure:
    """Parts of both sides hang from the root."""

    def write(motion: Motion) -> Motion:
        skeleton = motion.skeleton
        parents, channels = dict(enumerate(skeleton.parents.tolist())), dict(enumerate(skeleton.channels))
        for joint in (skeleton.index(side + part) for side in SIDES for part in parts):
            parents[joint], channels[joint] = 0, DEFAULT_ROOT
        return reparented(skeleton, parents, channels).motion(motion)

    return write


def straight_below(motion: Motion) -> Motion:
    """The foot's only joint is straight below the ankle, a little behind it; an End Site is at the tip of the toes."""
    skeleton, offsets = motion.skeleton, np.array(motion.skeleton.offsets)
    for toe in (skeleton.index(f"{side}Toe") for side in SIDES):
        (tip,) = skeleton.children[toe]
        offsets[tip] += offsets[toe]
        offsets[toe] = [0.0, offsets[toe, 1] - SOLE, -0.3]
        offsets[tip] -= offsets[toe] + [0.0, SOLE, 0.0]
    return replace(motion, skeleton=skeleton.with_offsets(offsets))


def on_high_ankles(motion: Motion) -> Motion:
    """The toes are as far below the ankle as in `straight_below`."""
    skeleton, offsets = motion.skeleton, np.array(motion.skeleton.offsets)
    offsets[[skeleton.index(f"{side}Toe") for side in SIDES], 1] -= SOLE
    return replace(motion, skeleton=skeleton.with_offsets(offsets))


ARM, LEG = LIMBS[:4], LIMBS[4:]


def exchanged(*parts: str) -> Structure:
    """The names of some parts say the other side; no joint is elsewhere."""

    def write(motion: Motion) -> Motion:
        names = {one + part: other + part for part in parts for one, other in (SIDES, SIDES[::-1])}
        return with_names(motion, names)

    return write


def without_toes(motion: Motion) -> Motion:
    """Legs end at the ankles."""
    skeleton = motion.skeleton
    toes = {joint for side in SIDES for joint in skeleton.subtree(skeleton.index(f"{side}Toe"))}
    parents = {joint: parent for joint, parent in enumerate(skeleton.parents.tolist()) if joint not in toes}
    return reparented(skeleton, parents, dict(enumerate(skeleton.channels))).motion(motion)


def hips_on_floor(motion: Motion) -> Motion:
    """The hips' joint is on the floor below the pelvis, and turns with it."""
    way = np.array([0.0, -100.0, 0.0])
    skeleton, translations = motion.skeleton, motion.translations
    offsets, below = np.array(skeleton.offsets), list(skeleton.children[0])
    offsets[below] -= way
    translations[:, below] -= way
    translations[:, 0] += Rotation.from_quat(motion.rotations[:, 0]).apply(way)
    return Motion.of_translations(
        skeleton.with_offsets(offsets), translations, motion.rotations, motion.frame_time_text
    )


def with_joints_before_thighs(motion: Motion) -> Motion:
    """Each thigh hangs from one more joint at the place of the hips, which does not turn, as in CMU's files."""
    skeleton = motion.skeleton
    hips = np.sort([skeleton.index(f"{side}Hip") for side in SIDES])
    parents = skeleton.parents + (skeleton.parents[:, None] >= hips).sum(axis=1)
    parents[hips] = hips + np.arange(2)
    channels = np.empty(len(skeleton), object)
    channels[:] = skeleton.channels
    made = Skeleton(
        names=np.insert(np.array(skeleton.names, object), hips, ["HipJoint", "HipJoint2"]),
        parents=np.insert(parents, hips, 0),
        offsets=np.insert(skeleton.offsets, hips, 0.0, axis=0),
        channels=np.insert(channels, hips, channels[hips]),
        end_sites=np.insert(skeleton.end_sites, hips, values=False),
    )
    still = np.insert(motion.rotations, hips, [0.0, 0.0, 0.0, 1.0], axis=1)
    return Motion(made, motion.root_positions, still, motion.frame_time_text)


def toes_end(*way: float) -> Structure:
    """The End Sites of the toes are elsewhere: this way from the toes, in the rest pose [cm]."""

    def write(motion: Motion) -> Motion:
        skeleton, offsets = motion.skeleton, np.array(motion.skeleton.offsets)
        offsets[[skeleton.children[skeleton.index(f"{side}Toe")][0] for side in SIDES]] = way
        return replace(motion, skeleton=skeleton.with_offsets(offsets))

    return write


def twins(mark: str, *, below: bool) -> Structure:
    """Every joint but the root has a twin without length, named with a mark, and one of them has all rotations."""
    return _doubled(lambda name, offset: [(name, offset, not below), (name + mark, 0 * offset, below)])


def groups(motion: Motion) -> Motion:
    """Every joint but the root hangs from one more joint at its own place, named after it, which does not turn."""
    return _doubled(lambda name, offset: [(f"{name}_grp", offset, False), (name, 0 * offset, True)])(motion)


def nulls(motion: Motion) -> Motion:
    """Every joint but the root hangs from one more joint at the place of its parent, named after it, which does not
    turn.
    """
    return _doubled(lambda name, offset: [(f"{name}_null", 0 * offset, False), (name, offset, True)])(motion)


def with_twists(motion: Motion, parts: tuple[str, ...] = ("Elbow", "Wrist", "Knee", "Ankle")) -> Motion:
    """Elbows, wrists, knees and ankles, or some of them, hang from one more joint in the middle of their bone, which
    does not turn.
    """

    def two(name: str, offset: np.ndarray) -> Sequence[tuple[str, np.ndarray, bool]]:
        if name.endswith(parts):
            return [(f"{name}_twist", offset / 2, False), (name, offset / 2, True)]
        return [(name, offset, True)]

    return _doubled(two)(motion)


def _doubled(two: Callable[[str, np.ndarray], Sequence[tuple[str, np.ndarray, bool]]]) -> Structure:
    """Every joint but the root is two, one below the other; `two` has name and offset of each, and whether it turns."""

    def write(motion: Motion) -> Motion:
        skeleton = motion.skeleton
        names, parents, offsets, channels, ends, shown = [], [], [], [], [], []
        own: dict[int, int] = {-1: -1}  # the joint from which the children of each hang
        for joint in range(len(skeleton)):
            name, offset = skeleton.names[joint], skeleton.offsets[joint]
            single = not joint or bool(skeleton.end_sites[joint])
            own[joint] = own[skeleton.parents.item(joint)]
            for each, place, turns in [(name, offset, True)] if single else two(name, offset):
                parents.append(own[joint])
                own[joint] = len(names)
                names.append(each)
                offsets.append(place)
                channels.append(skeleton.channels[joint])
                ends.append(skeleton.end_sites[joint])
                shown.append(joint if turns else -1)
        made = Skeleton(names=names, parents=parents, offsets=offsets, channels=channels, end_sites=ends)
        still = np.concatenate([motion.rotations, np.tile([0.0, 0.0, 0.0, 1.0], (len(motion), 1, 1))], axis=1)
        return Motion(made, motion.root_positions, still[:, shown], motion.frame_time_text)

    return write


def with_heels(*heights: float) -> Structure:
    """Each foot has one more joint at the heel, at a height above the ankle [cm]."""

    def write(motion: Motion) -> Motion:
        skeleton = motion.skeleton
        for side, height in zip(SIDES, heights, strict=True):
            skeleton = with_chain(skeleton, skeleton.index(f"{side}Ankle"), {f"{side}Heel": [0.0, height, -5.0]})
        return on_skeleton(motion, skeleton)

    return write


def with_sword(motion: Motion) -> Motion:
    """A hand holds a sword."""
    named = {"Sword": [0.0, 0.0, 5.0], "Tip": [0.0, 90.0, 0.0]}
    return on_skeleton(motion, with_chain(motion.skeleton, motion.skeleton.index("RightWrist"), named))


def leaning(axis: str, degrees: float) -> Structure:
    """The rest pose leans or is turned as a whole; the body moves as before."""

    def write(motion: Motion) -> Motion:
        turn = Rotation.from_euler(axis, degrees, degrees=True)
        rotations = turn * Rotation.from_quat(motion.rotations) * turn.inv()
        rotations = rotations.as_quat()
        rotations[:, 0] = (Rotation.from_quat(motion.rotations[:, 0]) * turn.inv()).as_quat()
        offsets = turn.apply(np.array(motion.skeleton.offsets))
        return replace(motion, skeleton=motion.skeleton.with_offsets(offsets), rotations=rotations)

    return write


def striding(motion: Motion) -> Motion:
    """The rest pose is a frame of the motion."""
    return with_axes(motion, Rotation.from_quat(motion.world_rotations[0]).inv())


def resting(part: str, axis: str, degrees: float) -> Structure:
    """Both joints of a part are turned in the rest pose, as mirror images; the body moves as before."""

    def write(motion: Motion) -> Motion:
        skeleton, rotations = motion.skeleton, motion.rotations.copy()
        for side, sign in zip(SIDES, (1, 1 if axis == "x" else -1), strict=True):
            top, turn = skeleton.index(f"{side}{part}"), Rotation.from_euler(axis, sign * degrees, degrees=True)
            for joint in skeleton.subtree(top):
                above = Rotation.identity() if joint == top else turn
                rotations[:, joint] = (above * Rotation.from_quat(rotations[:, joint]) * turn.inv()).as_quat()
            skeleton = turned_below(skeleton, top, turn)
        return replace(motion, skeleton=skeleton, rotations=rotations)

    return write


def all_under_root(motion: Motion) -> Motion:
    """All joints hang from the root."""
    skeleton = motion.skeleton
    parents = {joint: 0 if joint else -1 for joint in skeleton.joints}
    return reparented(skeleton, parents, dict.fromkeys(parents, DEFAULT_ROOT)).motion(motion)
