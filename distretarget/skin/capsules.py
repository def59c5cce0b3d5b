"""Tapered capsules: balls of changing radius along lines that move with the joints of a body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion

Array = NDArray[np.float64]

# The parts of a body whose surfaces can touch.
LIMB_SEGMENTS = ("hand", "forearm", "upper arm", "thigh", "shin", "foot")
SEGMENTS = (
    *(f"{side} {part}" for part in LIMB_SEGMENTS for side in ("left", "right")),
    "head",
    "neck",
    "chest",
    "belly",
    "pelvis",
)


@dataclass(frozen=True, eq=False)
class Capsules:
    """The surface of a body as tapered capsules.

    Attributes:
        joints: (capsules,), the joint that carries each.
        ends: (capsules, 2, 3), the ends of its axis relative to the joint while no joint is turned [file units].
        radii: (capsules, 2), the radius at each end [file units].
        segments: (capsules,), the part of the body that each belongs to, a number of `SEGMENTS`.
    """

    joints: NDArray[np.intp]
    ends: Array
    radii: Array
    segments: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.joints)

    def turned(self, motion: Motion) -> Array:
        """Return the ends of the axes relative to their joints in each frame, (frames, capsules, 2, 3)."""
        result = np.empty((len(motion), *self.ends.shape))
        for joint in np.unique(self.joints).tolist():
            on = np.flatnonzero(self.joints == joint)
            matrices = Rotation.from_quat(motion.world_rotations_of(joint)).as_matrix()
            result[:, on] = np.einsum("fij,cej->fcei", matrices, self.ends[on])
        return result

    def posed(self, motion: Motion) -> Array:
        """Return the ends of the axes in each frame of a motion, (frames, capsules, 2, 3) [file units]."""
        ends = self.turned(motion)
        ends += np.take(motion.positions, self.joints, axis=1)[:, :, None]
        return ends


def no_capsules() -> Capsules:
    """Return the surface of a body without thickness."""
    none = np.zeros(0, np.intp)
    return Capsules(none, np.zeros((0, 2, 3)), np.zeros((0, 2)), none)
