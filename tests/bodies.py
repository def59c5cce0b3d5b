"""Bodies and motions the tests share."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from table_one import table_one

from distretarget import Motion, RetargetResult, Skeleton, load_target, read_bvh, retarget
from distretarget.body.axes import axis_vector
from distretarget.body.body import Body
from distretarget.body.recognition import by_names
from distretarget.matching.matching import Matching, match
from distretarget.numerics.quaternions import least_rotation
from distretarget.skeleton import DEFAULT_ROOT, DEFAULT_ROTATIONS, JointMap
from distretarget.target import LoadedTarget

ROOT = Path(__file__).resolve().parents[1]
CORPUS = ROOT.parent / "shared" / "corpus"
SAMPLES = ROOT / "sample_bvh"
HERO = ROOT / "sample_characters" / "hero.glb"
UP = np.array([0.0, 1.0, 0.0])
ALONG = np.array([0.6, 0.0, 0.8])  # along the floor
SIDES = ("Left", "Right")
LEG = 0.435 + 0.453  # of `PERSON`, thigh and shin [m]
WAYS = [
    *Rotation.create_group("O"),
    Rotation.from_euler("Y", 140, degrees=True),
    Rotation.from_euler("XYZ", [20, 50, 70], degrees=True),
]
"""The 24 ways to stand along the axes, and two that are oblique."""
needs_corpus = pytest.mark.skipif(not CORPUS.is_dir(), reason="the corpus of real files is not here")


def of_samples_and_corpus(*names: str) -> pytest.MarkDecorator:
    """A test for the `path` of each sample clip, and of clips of the corpus."""
    samples = [pytest.param(path, id=path.stem) for path in sorted(SAMPLES.glob("*.bvh"))]
    others = [pytest.param(CORPUS / f"{name}.bvh", id=name, marks=needs_corpus) for name in names]
    return pytest.mark.parametrize("path", samples + others)


@cache
def sample(name: str) -> Motion:
    """A clip of the samples, such as "walk" or "supports/crawl"."""
    return read_bvh(SAMPLES / f"{name}.bvh")


@cache
def sample_target(name: str) -> LoadedTarget:
    """A target of the samples: the character "hero", or a skeleton, such as "child" or "rigs/mixamo_t"."""
    return load_target(HERO if name == "hero" else SAMPLES / f"{name}.json")


@cache
def sample_run(name: str) -> RetargetResult:
    """A clip of the samples on the character."""
    return retarget(sample(name), sample_target("hero"))


@cache
def short_walk() -> Motion:
    """The start of the sample's walk, along +Z with Y up [cm], every other frame."""
    motion = sample("walk")
    return replace(motion[:90:2], frame_time_text=str(2 * motion.frame_time))


def body_of(described: Motion | Skeleton) -> Body:
    """The body that moves in a motion, or has a skeleton."""
    return Body.of_motion(described) if isinstance(described, Motion) else Body.of(described)


def matched(source: Motion | Skeleton, target: Motion | Skeleton, joint_map: JointMap | None = None) -> Matching:
    """The matching by which a motion can be retargeted, of two bodies given by motions or skeletons."""
    return match(body_of(source), body_of(target), joint_map)


def swaying(skeleton: Skeleton, frames: int = 20, angle: float = 0.6, seed: int = 0) -> Motion:
    """Every joint turns smoothly by up to about `angle` [rad], each about other axes, and the root moves along."""
    draw = np.random.default_rng(seed)
    phases = np.linspace(0, 2, frames)[:, None, None] + draw.uniform(0, 6, (len(skeleton), 3))
    vectors = angle * np.sin(phases) * draw.uniform(-1, 1, (len(skeleton), 3))
    vectors[:, skeleton.end_sites] = 0.0
    size = skeleton.longest_path
    path = size * np.array([0.0, 0.5, 0.0]) + size * 0.2 * np.sin(phases[:, 0])
    return Motion(skeleton, path, Rotation.from_rotvec(vectors).as_quat(), "0.0333333")


def turned(skeleton: Skeleton, turn: Rotation) -> Skeleton:
    """The rest pose turned in the world."""
    return skeleton.with_offsets(turn.apply(np.array(skeleton.offsets)))


def paths_of(skeleton):
    """(joints, joints), the path lengths between all joints."""
    return skeleton.paths_among(np.arange(len(skeleton)))


def other_lengths(skeleton: Skeleton, seed: int = 1) -> Skeleton:
    """The same tree and rest directions with bones 0.6 to 1.6 times as long."""
    return skeleton.with_lengths(skeleton.lengths * np.random.default_rng(seed).uniform(0.6, 1.6, len(skeleton)))


def with_bone(skeleton: Skeleton, name: str, parent: str) -> Skeleton:
    """The body with one more joint below a joint."""
    return replace(
        skeleton,
        names=(*skeleton.names, name),
        parents=np.append(skeleton.parents, skeleton.index(parent)),
        offsets=np.append(skeleton.offsets, [[0.0, 0.0, 0.1]], axis=0),
        channels=(*skeleton.channels, ("Zrotation", "Xrotation", "Yrotation")),
        end_sites=np.append(skeleton.end_sites, False),
    )


def person() -> Skeleton:
    """The paper's skeleton with an End Site on every leaf."""
    body = table_one()
    leaves = [joint for joint in range(len(body)) if not body.children[joint]]
    ends = {"Head": (0, 0.12, 0), "RightWrist": (-0.17, 0, 0), "LeftWrist": (0.17, 0, 0)}
    return Skeleton(
        names=body.names + tuple(f"{body.names[leaf]}_End" for leaf in leaves),
        parents=np.concatenate([body.parents, leaves]),
        offsets=np.concatenate([body.offsets, [ends.get(body.names[leaf], (0, 0, 0.06)) for leaf in leaves]]),
        channels=body.channels + ((),) * len(leaves),
        end_sites=np.concatenate([body.end_sites, np.ones(len(leaves), bool)]),
    )


PERSON = person()


def tree_of(
    offsets: ArrayLike, names: Sequence[str] = (), parents: Sequence[int] = (), ends: Collection[str] = ()
) -> Skeleton:
    """Joints with these offsets and the usual channels, called joint0, joint1, ..., each below the one before if
    nothing else is said; those whose names are among `ends` are End Sites.
    """
    count = len(np.asarray(offsets))
    names = tuple(names or map("joint{}".format, range(count)))
    return Skeleton(
        names=names,
        parents=np.array(parents if len(parents) else range(-1, count - 1)),
        offsets=offsets,
        channels=tuple(
            () if name in ends else (DEFAULT_ROTATIONS if k else DEFAULT_ROOT) for k, name in enumerate(names)
        ),
        end_sites=[name in ends for name in names],
    )


def taken(skeleton: Skeleton, joints: Iterable[int]) -> Skeleton:
    """The skeleton of some joints, parents first."""
    kept = list(joints)
    return replace(
        skeleton,
        names=tuple(skeleton.names[joint] for joint in kept),
        parents=[kept.index(parent) if parent in kept else -1 for parent in skeleton.parents[kept].tolist()],
        offsets=skeleton.offsets[kept],
        channels=tuple(skeleton.channels[joint] for joint in kept),
        end_sites=skeleton.end_sites[kept],
    )


def reordered(skeleton: Skeleton, seed: int) -> tuple[Skeleton, list[int]]:
    """The skeleton with children in another order, and the old number of each joint."""
    draw = np.random.default_rng(seed)
    order, ready = [0], list(skeleton.children[0])
    while ready:
        order.append(ready.pop(draw.integers(len(ready))))
        ready.extend(skeleton.children[order[-1]])
    return taken(skeleton, order), order


def with_feet(pitch: float, foot: float = 0.125, tip: float | None = None) -> Skeleton:
    """The person whose feet, of a length [m], point down by an angle [rad]; so do tips, if these have a length."""
    body, direction = person(), np.array([0.0, -np.sin(pitch), np.cos(pitch)])
    offsets = np.array(body.offsets)
    for ending, length in (("Toe", foot), ("Toe_End", tip)):
        if length is not None:
            offsets[[body.index(side + ending) for side in SIDES]] = length * direction
    return body.with_offsets(offsets)


def lowered(skeleton: Skeleton, angle: float) -> Skeleton:
    """The body with its arms turned down at rest [degrees]."""
    forward = np.array([0.0, -1.0, 0.0]) if skeleton.up == "Z" else np.array([0.0, 0.0, 1.0])
    offsets = np.array(skeleton.offsets)
    for side, sign in (("left", -1.0), ("right", 1.0)):
        arm = skeleton.subtree(by_names(skeleton).roles[f"{side}UpperArm"])[1:]
        offsets[arm] = Rotation.from_rotvec(sign * np.radians(angle) * forward).apply(offsets[arm])
    return skeleton.with_offsets(offsets)


def nameless(skeleton: Skeleton) -> Skeleton:
    """The skeleton with names that say nothing."""
    return replace(skeleton, names=tuple(f"j{joint}" for joint in range(len(skeleton))))


def bent_chain() -> Skeleton:
    """Three joints that are no body."""
    return tree_of([[0, 0, 0], [0, 2, 0], [1, 0, 0]], "abc")


def moved(motion: Motion, turn: Rotation, shift: tuple[float, float, float] = (0, 0, 0), scale: float = 1.0) -> Motion:
    """The motion scaled, then turned and shifted in the world."""
    translations = scale * motion.translations
    translations[:, 0] = turn.apply(translations[:, 0]) + shift
    rotations = np.array(motion.rotations)
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    skeleton = motion.skeleton.with_offsets(scale * motion.skeleton.offsets)
    return Motion.of_translations(skeleton, translations, rotations, motion.frame_time_text)


def spun(turn: Rotation, x: np.ndarray) -> np.ndarray:
    """Vectors (..., 3), turned."""
    return x @ turn.as_matrix().T


def onto(up: str) -> Rotation:
    """The smallest rotation that turns Y to another up axis."""
    return Rotation.from_quat(least_rotation(axis_vector("Y")[None], axis_vector(up)[None])[0])


def in_world(motion: Motion, turn: Rotation, scale: float = 1.0) -> Motion:
    """The motion with body, rest pose and world all turned."""
    rotations = (turn * Rotation.from_quat(motion.rotations) * turn.inv()).as_quat()
    skeleton = motion.skeleton.with_offsets(scale * spun(turn, motion.skeleton.offsets))
    return Motion.of_translations(skeleton, scale * spun(turn, motion.translations), rotations, motion.frame_time_text)


def on_skeleton(motion: Motion, skeleton: Skeleton) -> Motion:
    """The motion on its skeleton with joints appended; these do not rotate."""
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(motion), len(skeleton) - len(motion.skeleton), 1))
    return replace(motion, skeleton=skeleton, rotations=np.concatenate([motion.rotations, still], axis=1))


def mirrored(motion: Motion) -> Motion:
    """The motion in a mirror across x = 0, joints keeping their names."""
    flip, turn = np.array([-1.0, 1, 1]), np.array([1.0, -1, -1, 1])
    skeleton = motion.skeleton.with_offsets(flip * motion.skeleton.offsets)
    return Motion.of_translations(skeleton, flip * motion.translations, turn * motion.rotations, motion.frame_time_text)


def posed(skeleton: Skeleton, turns: dict[str, np.ndarray], root: np.ndarray, frame_time: str = "0.02") -> Motion:
    """The named joints turned by rotation vectors, (frames, 3) or (3,), each in its parent's frame, the others not at
    all; the root follows the path `root`, (frames, 3).
    """
    vectors = np.zeros((len(root), len(skeleton), 3))
    for name, turn in turns.items():
        vectors[:, skeleton.index(name)] = turn
    return Motion(skeleton, root, Rotation.from_rotvec(vectors).as_quat(), frame_time)


APART = {"LeftHip": np.array([0.0, 0.0, 0.5]), "RightHip": np.array([0.0, 0.0, -0.5])}
"""Turns of the hips that bring the feet apart, so that no pair of joints is near."""


def standing(
    turns: dict[str, np.ndarray] | None = None,
    frames: int = 30,
    path: ArrayLike = 0.0,
    height: float = LEG + 0.1,
    body: Skeleton = PERSON,
) -> Motion:
    """A body with the hips at a height, which is carried along a path, (frames, 3), and has joints turned."""
    return posed(body, turns or {}, np.zeros((frames, 3)) + path + height * UP)


def lengthened(skeleton: Skeleton, factors: dict[str, float]) -> Skeleton:
    """The body with bones scaled by `factors`, by the word in which the name of the lower joint ends."""
    lengths = np.array(skeleton.lengths)
    for ending, factor in factors.items():
        lengths[[name.endswith(ending) for name in skeleton.names]] *= factor
    return skeleton.with_lengths(lengths)


def clapping(together: np.ndarray, frame_time: str = "0.02") -> Motion:
    """A person with legs apart whose hands come together in front: `together`, (frames,), is 0 where the forearms point
    outwards and 1 where the wrists are 2 cm apart and the hands parallel.
    """
    upper, fore = np.radians(100), np.radians(60) + np.asarray(together) * (np.arccos(-0.1726 / 0.258) - np.radians(60))
    turns = {}
    for side, sign in (("Left", -1.0), ("Right", 1.0)):
        turns[f"{side}Shoulder"] = sign * np.array([0.0, upper, 0.0])
        turns[f"{side}Elbow"] = sign * np.multiply.outer(fore - upper, [0.0, 1.0, 0.0])
        turns[f"{side}Wrist"] = sign * np.multiply.outer(np.pi / 2 - fore, [0.0, 1.0, 0.0])
        turns[f"{side}Hip"] = -sign * np.array([0.0, 0.0, 0.5])
    return posed(person(), turns, np.tile([0.0, 0.9, 0.0], (len(fore), 1)), frame_time)


def held_still(motion: Motion, names: tuple[str, ...]) -> Motion:
    """The motion in which the named joints keep the rotation of its first frame."""
    rotations = np.array(motion.rotations)
    for name in names:
        joint = motion.skeleton.index(name)
        rotations[:, joint] = rotations[0, joint]
    return replace(motion, rotations=rotations)
