"""Arms that hang: what comes near the body then is no contact."""

from __future__ import annotations

import numpy as np

from distretarget.body.body import Body
from distretarget.body.limbs import Arm
from distretarget.numerics.vectors import Array, Flags, Numbers, angles_between, lengths

HANGS = np.radians(60)  # an arm hangs while the angles of shoulder and elbow add up to no more than this [rad]


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


def hangs(positions: Array, arm: Arm, hips: list[int], up: Array) -> Flags:
    """(frames,), whether an arm hangs, along gravity or, where hip joints are known, along the trunk.

    `positions`, (frames, joints, 3), are those of the body, `up`, (3,), is the unit vector up.
    """
    shoulder, elbow, wrist = (positions[:, joint] for joint in (arm.shoulder, arm.elbow, arm.wrist))
    off = angles_between(elbow - shoulder, np.broadcast_to(-up, elbow.shape))
    if hips:
        off = np.minimum(off, angles_between(elbow - shoulder, positions[:, hips].mean(axis=1) - shoulder))
    return np.asarray(off + angles_between(elbow - shoulder, wrist - elbow) <= HANGS)
