"""Frames in which joints rest: on the floor, or on anything else that stands still."""

from __future__ import annotations

import numpy as np

from distretarget.body.limbs import Leg
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import find_holding, heights_of, lowest_heights, write_speeds
from distretarget.numerics.time_series import Shots, slices_of, smoothstep, spans_of
from distretarget.numerics.vectors import Array, Flags, Numbers

REST_SPEED = 0.35  # a joint that rests on the floor is slower than this [leg lengths / s]
REST_HEIGHT = 0.1  # a foot that rests on the floor is at most this far above the body's lowest joint [leg lengths]
SPAN = 1 / 30  # speeds are means over this time before and after a frame [s]
FADE = 1.4  # the rest weight of a foot is 1 up to these limits and 0 from this many times them on
# A joint that stands still is slower than `STILL_SPEED` for at least `STILL_TIME`, while the base of its limb moves
# `TIMES_AS_FAR` times as far from its mean position, and `FARTHER` more.
STILL_SPEED = 0.1  # [leg lengths / s]
STILL_TIME = 0.3  # [s]
TIMES_AS_FAR = 5.0
FARTHER = 0.02  # [leg lengths]


def feet_at_rest(motion: Motion, leg: Leg, up: Array, length: float) -> Flags:
    """Return whether ankle and toe of a leg rest, (frames, 2), in a motion of one shot; otherwise as `feet_resting`."""
    return np.asarray(feet_resting(motion, leg, up, length) == 1.0)


def feet_resting(motion: Motion, leg: Leg, up: Array, length: float, shots: Shots | None = None) -> Array:
    """Return the rest weights of ankle and toe of a leg, (frames, 2), 0 to 1: 1 if they are slow and the foot is near
    the height of the body's lowest joint (joints above the leg excluded), or if they stand still, as on a step.
    Weights fade to 0 at `FADE` times the limits of speed and height. `up`, (3,), is the unit vector up; `length` the
    leg's [file units]; `shots`, (frames,), are judged separately; by default there is one.
    """
    shots = np.zeros(len(motion), np.intp) if shots is None else shots
    joints = np.array([leg.ankle, leg.toe])
    below = [leg.ankle, leg.toe, *motion.skeleton.children[leg.toe]]
    outside = {*motion.skeleton.to_root(leg.hip)[1:]}
    of_body = np.array([joint for joint in range(len(motion.skeleton)) if joint not in outside])
    speeds = joint_speeds(motion, joints, shots)
    heights = heights_of(motion.positions, below, up).min(axis=1)
    slow = speeds.min(axis=1) < FADE * REST_SPEED * length
    low = _low(heights, heights - lowest_heights(motion.positions, up, of_body), slow, length, shots)
    still = still_joints(motion, joints, np.array([leg.hip, leg.hip]), speeds, length, shots)
    return np.asarray(np.where(still, 1.0, _within(speeds, REST_SPEED * length) * low[:, None]))


def _low(heights: Array, above: Array, slow: Flags, length: float, shots: Shots) -> Array:
    """(frames,), the weight, 0 to 1, with which a foot counts as low, from its `heights` and its heights `above` the
    body's lowest joint, (frames,) each. While it stays `slow`, it is low near the height at which it has the weight 1,
    even if a hand reaches below it.
    """
    low = _within(above, REST_HEIGHT * length)
    for shot in slices_of(shots):
        for first, end in spans_of(slow[shot]) + shot.start:
            stays = slice(first, end)
            if (low[stays] == 1.0).any():
                floor = heights[stays][low[stays] == 1.0].min()
                low[stays] = np.maximum(low[stays], _within(heights[stays] - floor, REST_HEIGHT * length))
    return low


def _within(values: Array, limit: float) -> Array:
    """1 up to a limit, 0 from `FADE` times the limit on, a smoothstep in between."""
    return smoothstep((FADE - values / limit) / (FADE - 1.0))


def joint_speeds(motion: Motion, joints: Numbers, shots: Shots) -> Array:
    """Return the speeds of joints, (frames, joints) [file units / s], each shot on its own: the mean velocity over
    `SPAN` before and after a frame, so that noise and the frame rate hardly matter.
    """
    reach = max(round(SPAN / motion.frame_time), 1)
    edges = np.array([0, *(shot.stop for shot in slices_of(shots))])
    speeds = np.empty((len(motion), len(joints)))
    write_speeds(motion.positions, joints, edges, reach, motion.frame_time, speeds)
    return speeds


def still_joints(motion: Motion, joints: Numbers, bases: Numbers, speeds: Array, length: float, shots: Shots) -> Flags:
    """Return whether joints stand still in the world while the joint at the base of their limb, in `bases`, moves,
    (frames, joints), as of hands that hold on to something. `speeds` are those of `joint_speeds`; `length` is that of a
    leg [file units].
    """
    slow = speeds < STILL_SPEED * length
    holding = np.zeros_like(slow)
    least = max(STILL_TIME / motion.frame_time, 2.0)
    farther = FARTHER * length
    find_holding(slow, motion.positions, joints, bases, TIMES_AS_FAR, farther, least, shots, holding)
    return holding
