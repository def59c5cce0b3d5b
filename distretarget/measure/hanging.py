"""Arms that hang: what comes near the body then is no contact."""

from __future__ import annotations

import numpy as np

from distretarget.body.body import Body
from distretarget.body.limbs import Arm
from distretarget.numerics.vectors import Array, Flags, Numbers, angles_between, cross, lengths, normalised

HANGS = np.radians(60)  # an arm hangs while the angles of shoulder and elbow add up to no more than this [rad]
ASIDE = np.radians(45)  # ... and its hand is farther than this round the trunk from straight before or behind it [rad]


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


def hangs(body: Body, positions: Array, arm: Arm) -> Flags:
    """(frames,), whether an arm of a body hangs beside it, along gravity or, where hip joints are known, along the
    trunk. `positions`, (frames, joints, 3), are those of the body.
    """
    shoulder, elbow, wrist = (positions[:, joint] for joint in (arm.shoulder, arm.elbow, arm.wrist))
    off, hips = angles_between(elbow - shoulder, np.broadcast_to(-body.up_vector, elbow.shape)), _hips(body)
    if hips:
        off = np.minimum(off, angles_between(elbow - shoulder, positions[:, hips].mean(axis=1) - shoulder))
    hanging = off + angles_between(elbow - shoulder, wrist - elbow) <= HANGS
    if hips and len(body.arms) == 2:
        hanging &= beside(body, positions, [*body.skeleton.subtree(arm.wrist)])
    return np.asarray(hanging)


def beside(body: Body, positions: Array, joints: list[int]) -> Flags:
    """(frames,), whether the middle of joints is beside the trunk, and not in front of it or behind it; `positions` as
    for `hangs`, of a body with hips and two arms.
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
