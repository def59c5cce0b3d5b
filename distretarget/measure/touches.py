"""Arms that hang and hands that pass by touch nothing."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.body.limbs import Arm
from distretarget.motion import Motion
from distretarget.numerics.time_series import lasting, spans_of
from distretarget.numerics.vectors import Array, Flags, Numbers, angles_between, cross, lengths, normalised

SPEED_SPAN = 0.1  # speeds are those between so long before and after a frame, in which a hand that claps comes back [s]
PASSES_BY = 50.0  # what is faster than this, on average while it touches, passes by [% of the height/s]


def speeds(motion: Motion, frames: Numbers, joints: Numbers, on: Numbers) -> Array:
    """Return how fast joints move as seen from the joints that they are `on`, (n,), in some frames, each (n,)
    [file units/s].
    """
    reach = max(round(SPEED_SPAN / motion.frame_time), 1)
    ends = np.maximum(frames - reach, 0), np.minimum(frames + reach, len(motion) - 1)
    before, after = (_seen_from(motion, at, joints, on) for at in ends)
    return np.asarray(lengths(after - before) / (np.maximum(ends[1] - ends[0], 1) * motion.frame_time))


def passing(speed: Array, rows: Numbers, of: Numbers, height: float) -> Flags:
    """Return whether touches pass by, (n,), by their `speed`, (n,) [file units/s]; each is of a row of frames and of
    something, (n,) each, such as a limb and a place, and lasts while that has touches in consecutive rows.
    """
    passes = np.zeros(len(speed), bool)
    for one in np.unique(of):
        own = np.flatnonzero(of == one)
        touched = np.zeros(rows[own].max() + 1, bool)
        touched[rows[own]] = True
        for first, end in spans_of(touched):
            span = own[(rows[own] >= first) & (rows[own] < end)]
            passes[span] = speed[span].mean() > PASSES_BY / 100.0 * height
    return passes


def _seen_from(motion: Motion, frames: Numbers, joints: Numbers, on: Numbers) -> Array:
    """(n, 3), where joints are in the axes of others."""
    result = np.zeros((len(frames), 3))
    for joint in np.unique(on).tolist():
        own = np.flatnonzero(on == joint)
        at = frames[own]
        off = motion.positions[at, joints[own]] - motion.positions[at, joint]
        result[own] = Rotation.from_quat(motion.world_rotations_of(joint)[at]).apply(off, inverse=True)
    return result


HANGS = np.radians(60)  # an arm hangs while the angles of shoulder and elbow add up to no more than this [rad]
ASIDE = np.radians(45)  # what is farther than this round the trunk from straight before or behind it is beside it [rad]
LASTS = 1.0  # hands of arms that hang are in front of the trunk for less than this while they swing [s]


def hanging_gaps(body: Body, u: Numbers, v: Numbers) -> Array:
    """How far joints u and v, (pairs,) each, are apart while the body stands and its arms hang, (pairs,) [file units];
    infinite where it is not known which joints are its arms.
    """
    if not body.anatomy:
        return np.full(len(u), np.inf)
    places, down = np.array(body.reference.positions), -body.reference.axes[:, 1]
    for arm in body.arms:
        along = body.skeleton.paths_from(arm.shoulder)
        for joint in body.skeleton.subtree(arm.shoulder):
            places[joint] = places[arm.shoulder] + along[joint] * down
    return np.asarray(lengths(places[u] - places[v]))


def hanging_parts(body: Body, motion: Motion, arm: Arm) -> tuple[Flags, Flags]:
    """Return whether a hand hangs beside the body, or swings past it, and whether the forearm of its arm is beside the
    trunk, where it is as well while the elbow is bent, (frames,) each.
    """
    positions, low = motion.positions, _hangs(body, motion.positions, arm)
    if not _hips(body) or len(body.arms) < 2:
        return low, low
    parts = [*body.skeleton.subtree(arm.wrist)], [arm.elbow, arm.wrist]
    apart = [~_beside(body, positions, joints) for joints in parts]
    of_hand, of_forearm = (lasting(flags.astype(float), LASTS / motion.frame_time) > 0.0 for flags in apart)
    return low & ~of_hand, ~np.where(low, of_forearm, apart[1])


def _hangs(body: Body, positions: Array, arm: Arm) -> Flags:
    """(frames,), whether an arm of a body hangs, along gravity or, where hip joints are known, along the trunk.
    `positions`, (frames, joints, 3), are those of the body.
    """
    shoulder, elbow, wrist = (positions[:, joint] for joint in (arm.shoulder, arm.elbow, arm.wrist))
    off, hips = angles_between(elbow - shoulder, np.broadcast_to(-body.up_vector, elbow.shape)), _hips(body)
    if hips:
        off = np.minimum(off, angles_between(elbow - shoulder, positions[:, hips].mean(axis=1) - shoulder))
    return np.asarray(off + angles_between(elbow - shoulder, wrist - elbow) <= HANGS)


def _beside(body: Body, positions: Array, joints: list[int]) -> Flags:
    """(frames,), whether the middle of joints is beside the trunk, and not in front of it or behind it; `positions` as
    for `_hangs`, of a body with hips and two arms.
    """
    left, right = (positions[:, each.shoulder] for each in body.arms)
    pelvis = positions[:, _hips(body)].mean(axis=1)
    off = positions[:, joints].mean(axis=1) - pelvis
    trunk = normalised(0.5 * (left + right) - pelvis)
    across = normalised(left - right)
    forwards = cross(across, trunk)
    aside, forward = (np.abs((off * axis).sum(axis=1)) for axis in (across, forwards))
    return np.asarray(aside >= np.tan(ASIDE) * forward)


def _hips(body: Body) -> list[int]:
    return [leg.hip for leg in body.legs or ()]
