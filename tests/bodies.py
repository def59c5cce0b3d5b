"""Bodies and motions the tests share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from table_one import table_one

from distretarget import Motion, Skeleton

CORPUS = Path(__file__).resolve().parents[2] / "shared" / "corpus"
SAMPLES = Path(__file__).resolve().parents[1] / "sample_bvh"
needs_corpus = pytest.mark.skipif(not CORPUS.is_dir(), reason="the corpus of real files is not here")


def swaying(skeleton: Skeleton, frames: int = 20, angle: float = 0.6, seed: int = 0) -> Motion:
    """Every joint turns smoothly by up to about `angle` [rad] about axes of its own, and the root travels."""
    draw = np.random.default_rng(seed)
    phases = np.linspace(0, 2, frames)[:, None, None] + draw.uniform(0, 6, (len(skeleton), 3))
    vectors = angle * np.sin(phases) * draw.uniform(-1, 1, (len(skeleton), 3))
    vectors[:, skeleton.end_sites] = 0.0
    translations = np.array(np.broadcast_to(skeleton.offsets, vectors.shape))
    size = skeleton.path_lengths.max()
    translations[:, 0] = size * np.array([0.0, 0.5, 0.0]) + size * 0.2 * np.sin(phases[:, 0])
    return Motion(skeleton, translations, Rotation.from_rotvec(vectors).as_quat(), "0.0333333")


def other_lengths(skeleton: Skeleton, seed: int = 1) -> Skeleton:
    """The same tree and rest directions with bones 0.6 to 1.6 times as long."""
    return skeleton.with_lengths(skeleton.lengths * np.random.default_rng(seed).uniform(0.6, 1.6, len(skeleton)))


def person() -> Skeleton:
    """The paper's skeleton with an End Site on every leaf."""
    body = table_one()
    leaves = [joint for joint in range(len(body)) if not body.children[joint]]
    ends = {"Head": (0, 0.12, 0), "RightWrist": (-0.17, 0, 0), "LeftWrist": (0.17, 0, 0)}
    return Skeleton(
        body.names + tuple(f"{body.names[leaf]}_End" for leaf in leaves),
        np.concatenate([body.parents, leaves]),
        np.concatenate([body.offsets, [ends.get(body.names[leaf], (0, 0, 0.06)) for leaf in leaves]]),
        body.channels + ((),) * len(leaves),
        np.concatenate([body.end_sites, np.ones(len(leaves), bool)]),
    )


def moved(motion: Motion, turn: Rotation, shift: tuple[float, float, float] = (0, 0, 0), scale: float = 1.0) -> Motion:
    """The motion scaled, then turned and shifted in the world."""
    translations = scale * np.array(motion.translations)
    translations[:, 0] = turn.apply(translations[:, 0]) + shift
    rotations = np.array(motion.rotations)
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    skeleton = motion.skeleton.with_offsets(scale * motion.skeleton.offsets)
    return Motion(skeleton, translations, rotations, motion.frame_time_text)


def mirrored(motion: Motion) -> Motion:
    """The motion in a mirror across x = 0, joints keeping their names."""
    flip, turn = np.array([-1.0, 1, 1]), np.array([1.0, -1, -1, 1])
    skeleton = motion.skeleton.with_offsets(flip * motion.skeleton.offsets)
    return Motion(skeleton, flip * motion.translations, turn * motion.rotations, motion.frame_time_text)
