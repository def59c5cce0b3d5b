"""The springs that hold resting feet, and lead them to their places and away from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.solve.articulation import Articulation
from distretarget.solve.springs import Springs
from distretarget.solve.stance import Stance

Array = NDArray[np.float64]

LEAST_WEIGHT = 1e-6  # a foot of less weight is free


def foot_springs(stance: Stance, body: Articulation, bones: Array, unit: float, stiffness: float) -> Springs:
    """The springs of resting feet; their arrays have the frames in front.

    A foot of weight s is drawn the share s of the way to its place, whatever the `stiffness` at its place: with M, the
    compliance of the body at the foot, its spring is A = ((1 - s) / s M + I / stiffness)^-1. A stiffness of 0 leaves
    the feet free.

    `bones`, (frames, joints, 3), are those of the copy, and `unit` is the body unit [file units].
    """
    A = np.zeros((*stance.weights.shape, 3, 3))
    for foot, joint in enumerate(stance.joints if stiffness > 0.0 else ()):
        frames = np.flatnonzero(stance.weights[:, foot] > LEAST_WEIGHT)
        s = stance.weights[frames, foot, None, None]
        A[frames, foot] = np.linalg.inv(
            (1.0 - s) / s * compliance(body, bones[frames], int(joint)) + np.eye(3) / stiffness
        )
    return Springs(stance.joints, np.full(len(stance.joints), -1), stance.places / unit, A)


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
