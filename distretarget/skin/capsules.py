"""Tapered capsules: balls of changing radius along lines that move with the joints of a body."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from distretarget.motion import Motion
from distretarget.numerics.compiled import compiled, read_only
from distretarget.numerics.kinematics import turned
from distretarget.numerics.parallel import over_blocks
from distretarget.skeleton import HALF_TURN

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
IS_ARM = np.array(["arm" in name or "hand" in name for name in SEGMENTS])  # (segments,)

# Segments that are one place to be touched: what is meant for one of them is meant for all.
PLACES = (
    ("head", "neck"),
    ("chest", "belly", "pelvis", "left thigh", "right thigh"),
    ("left shin", "right shin", "left foot", "right foot"),
    ("left hand", "left forearm", "left upper arm"),
    ("right hand", "right forearm", "right upper arm"),
)
# (segments + 1,), the number of the place that each segment belongs to; -1 for the last, which is none
PLACE = np.array([next(k for k, names in enumerate(PLACES) if name in names) for name in SEGMENTS] + [-1])


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

    def turned_round(self) -> Capsules:
        """Return the capsules turned half round about Y, as `Skeleton.turned_round` is."""
        return replace(self, ends=self.ends * HALF_TURN)

    def scaled(self, factor: float) -> Capsules:
        """Return the capsules of a body that is larger by a factor."""
        return replace(self, ends=factor * self.ends, radii=factor * self.radii)

    def posed(self, motion: Motion) -> Array:
        """Return the ends of the axes in each frame of a motion, (frames, capsules, 2, 3) [file units]."""
        posed = np.empty((len(motion), *self.ends.shape))

        def pose(block: slice) -> None:
            world = motion.world_rotations_in(block)
            _write_posed(world, read_only(motion.positions[block]), self.joints, read_only(self.ends), posed[block])

        over_blocks(pose, len(motion), len(motion.skeleton))
        return posed


@compiled()
def _write_posed(world, positions, joints, ends, posed):  # type: ignore[no-untyped-def]
    for frame in range(len(world)):
        for capsule in range(len(joints)):
            q, x = world[frame, joints[capsule]], positions[frame, joints[capsule]]
            for end in range(2):
                v = ends[capsule, end]
                a, b, c = turned(q[0], q[1], q[2], q[3], v[0], v[1], v[2])
                posed[frame, capsule, end, 0] = x[0] + a
                posed[frame, capsule, end, 1] = x[1] + b
                posed[frame, capsule, end, 2] = x[2] + c


def no_capsules() -> Capsules:
    """Return the surface of a body without thickness."""
    none = np.zeros(0, np.intp)
    return Capsules(none, np.zeros((0, 2, 3)), np.zeros((0, 2)), none)
