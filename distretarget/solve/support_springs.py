"""The springs that hold joints at rest on the world, and lead them to their places and away from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.solve.articulation import Articulation
from distretarget.solve.springs import Springs
from distretarget.solve.supports import Supports

Array = NDArray[np.float64]

LEAST_WEIGHT = 1e-6  # a joint of less weight is free
FIRM = 2  # so many joints of a region are held with full stiffness; more share it


def support_springs(supports: Supports, body: Articulation, bones: Array, unit: float, stiffness: float) -> Springs:
    """The springs of resting joints; their arrays have the frames in front.

    A joint of weight s is drawn the share s of the way to its place, whatever the `stiffness` k at its place: with M,
    the compliance of the body at the joint, its spring is A = (m (1 - s) / s M + n I / k)^-1. Joints of one region that
    rest together, such as the fingers of a hand, share what one of them would have: n is half their number, but at
    least 1; m is their number, and n for foot joints. A stiffness of 0 leaves the joints free.

    `bones`, (frames, joints, 3), are those of the copy, and `unit` is the body unit [file units].
    """
    weights, joints = supports.weights, supports.joints
    A = np.zeros((*weights.shape, 3, 3))
    for support, joint in enumerate(joints if stiffness > 0.0 else ()):
        s = weights[:, support, None, None]
        together = (weights[:, supports.regions == supports.regions[support]] > LEAST_WEIGHT).sum(axis=1)[:, None, None]
        n = np.maximum(together / FIRM, 1.0)
        m = n if support < supports.feet else together
        A[:, support] = np.where(s < 1.0, 0.0, stiffness / n) * np.eye(3)
        setting_in = np.flatnonzero((weights[:, support] > LEAST_WEIGHT) & (weights[:, support] < 1.0))
        s, m, n = s[setting_in], m[setting_in], n[setting_in]
        M = compliance(body, bones[setting_in], int(joint))
        A[setting_in, support] = np.linalg.inv(m * (1.0 - s) / s * M + n * np.eye(3) / stiffness)
    return Springs(joints, np.full(len(joints), -1), supports.places / unit, A)


def compliance(body: Articulation, bones: Array, joint: int) -> Array:
    """M, (frames, 3, 3): how far a joint moves under a force, held by the stiffness of the parts and of the root alone.

    A part of stiffness h, with the lever arm a on the joint, adds [a]^T [a] / h = (|a|^2 I - a a^T) / h.
    """
    arms: dict[int, Array] = {}
    while joint > 0:
        part = int(body.parts[body.parents[joint]])
        arms[part] = arms.get(part, 0.0) + bones[:, joint]
        joint = int(body.parents[joint])
    M = np.broadcast_to(np.eye(3) / body.stiffness[-1], (len(bones), 3, 3)).copy()
    for part, arm in arms.items():
        square = (arm * arm).sum(axis=1)[:, None, None] * np.eye(3)
        M += (square - arm[:, :, None] * arm[:, None, :]) / body.stiffness[part]
    return M
