"""The frames in which joints rest on the world: on the floor, or on anything else that stands still."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from distretarget.body.legs import Leg
from distretarget.motion import Motion
from distretarget.numerics.kinematics import speeds_along
from distretarget.numerics.shots import Shots, by_shot

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

REST_SPEED = 0.35  # a joint that rests on the floor is slower than this [leg lengths / s]
REST_HEIGHT = 0.1  # a joint that rests on the floor is no higher than this above the lowest joint [leg lengths]
STILL_SPEED = 0.1  # a joint that stands still is slower than this [leg lengths / s] ...
STILL_TIME = 0.3  # ... for at least this long [s],
TIMES_AS_FAR = 5.0  # while the joint where its limb begins goes this many times as far from its mean place ...
FARTHER = 0.02  # ... and this much farther [leg lengths]


def feet_at_rest(
    motion: Motion,
    leg: Leg,
    up: Array,
    length: float,
    *,
    speed: float = REST_SPEED,
    height: float = REST_HEIGHT,
    shots: Shots | None = None,
) -> Flags:
    """Return whether ankle and toe of a leg rest, (frames, 2): each while it is slow and the foot is low, or while it
    stands still, as on a step.

    `up`, (3,), is the unit vector up; `length` is that of the leg [file units]; `speed` and `height` are the limits,
    in leg lengths per second and leg lengths. Only frames of the same shot decide; without `shots`, (frames,), the
    motion is one.
    """
    shots = np.zeros(len(motion), np.intp) if shots is None else shots
    joints = np.array([leg.ankle, leg.toe])
    below = [leg.ankle, leg.toe, *motion.skeleton.children[leg.toe]]
    low = low_joints(motion, below, up, height * length).any(axis=1, keepdims=True)
    still = still_joints(motion, joints, np.array([leg.hip, leg.hip]), length, shots)
    return (slow_joints(motion, joints, speed * length, shots) & low) | still


def slow_joints(motion: Motion, joints: NDArray[np.intp], speed: float, shots: Shots) -> Flags:
    """Return whether each of the joints is slower than `speed` [file units / s], (frames, len(joints))."""
    speeds = partial(speeds_along, frame_time=motion.frame_time)
    return np.asarray(by_shot(speeds, shots, motion.positions[:, joints]) < speed)


def low_joints(motion: Motion, joints: NDArray[np.intp] | list[int], up: Array, height: float) -> Flags:
    """Return whether each of the joints is less than `height` [file units] above the lowest one of the frame,
    (frames, len(joints)).
    """
    heights = motion.positions @ up
    return np.asarray(heights[:, joints] - heights.min(axis=1, keepdims=True) < height)


def still_joints(
    motion: Motion, joints: NDArray[np.intp], bases: NDArray[np.intp], length: float, shots: Shots
) -> Flags:
    """Return whether each of the joints stands still in the world while its limb moves, (frames, len(joints)).

    Nothing but something to hold on to keeps the end of a limb in its place while the joint where the limb begins, in
    `bases`, moves. `length` is that of a leg [file units].
    """
    slow = slow_joints(motion, joints, STILL_SPEED * length, shots)
    least = max(STILL_TIME / motion.frame_time, 2.0)
    columns = [
        by_shot(partial(_holding, length=length, least=least), shots, slow[:, k], *positions)
        for k, positions in enumerate(zip(_paths(motion, joints), _paths(motion, bases), strict=True))
    ]
    return np.stack(columns, axis=1) if columns else slow


def _holding(slow: Flags, path: Array, base_path: Array, length: float, least: float) -> Flags:
    """(frames,), the frames of those runs of slow frames, at least so many, in which a joint keeps its place while the
    base of its limb moves.
    """
    runs, count = label(slow)
    holding = np.zeros(len(slow), bool)
    for run in range(1, count + 1):
        frames = np.flatnonzero(runs == run)
        moves = _reach(base_path[frames]) > TIMES_AS_FAR * _reach(path[frames]) + FARTHER * length
        holding[frames] = len(frames) >= least and moves
    return holding


def _paths(motion: Motion, joints: NDArray[np.intp]) -> Array:
    """(len(joints), frames, 3), where each of the joints is."""
    return motion.positions[:, joints].swapaxes(0, 1)


def _reach(places: Array) -> float:
    """How far places (frames, 3) are at most from their mean."""
    return float(np.linalg.norm(places - places.mean(axis=0), axis=-1).max())
