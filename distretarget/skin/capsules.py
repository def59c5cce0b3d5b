"""Tapered capsules that move with joints, the gaps of balls to them, and the segments of a body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.parallel import over_blocks
from distretarget.numerics.quaternions import rotated
from distretarget.numerics.vectors import F3, F4, I1, Array, Flags, Numbers
from distretarget.skeleton import HALF_TURN

if TYPE_CHECKING:  # it needs scipy, which the build does without
    from distretarget.motion import Motion

LEAST = 1e-9  # a shorter axis is a point, and a smaller distance has no direction [any unit of length]
MOST_TAPER = 0.99  # of the radius per length of the axis; beyond, the larger ball holds the smaller
HOLDS = 1e9  # the last number of the axis of a capsule that is a point, if the radius at its end is the larger

# The parts of a body whose surfaces can touch.
LIMB_SEGMENTS = ("hand", "forearm", "upper arm", "thigh", "shin", "foot")
TRUNK_SEGMENTS = ("head", "neck", "chest", "belly", "pelvis")
SEGMENTS = (*(f"{side} {part}" for part in LIMB_SEGMENTS for side in ("left", "right")), *TRUNK_SEGMENTS)
IS_ARM = np.array(["arm" in name or "hand" in name for name in SEGMENTS])  # (segments,)

# Segments that count as one in contacts: a hand on the belly may touch chest, pelvis or thighs as well.
GROUPS = (
    ("head", "neck"),
    ("chest", "belly", "pelvis", "left thigh", "right thigh"),
    ("left shin", "right shin", "left foot", "right foot"),
    ("left hand", "left forearm", "left upper arm"),
    ("right hand", "right forearm", "right upper arm"),
)
# (segments + 1,), the index of the group that each segment belongs to; -1 for the last entry, which stands for none
GROUP = np.array([next(k for k, names in enumerate(GROUPS) if name in names) for name in SEGMENTS] + [-1])


@dataclass(frozen=True, eq=False)
class Capsules:
    """The surface of a body as tapered capsules."""

    joints: Numbers  # (capsules,), the joint that carries each
    ends: Array  # (capsules, 2, 3), the ends of its axis relative to the joint while no joint is turned [file units]
    radii: Array  # (capsules, 2), the radius at each end [file units]
    segments: Numbers  # (capsules,), the segment that each belongs to, an index of `SEGMENTS`

    def __len__(self) -> int:
        return len(self.joints)

    def __getitem__(self, chosen: Numbers | Flags) -> Capsules:
        return Capsules(self.joints[chosen], self.ends[chosen], self.radii[chosen], self.segments[chosen])

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
            world, places = motion.world_rotations_in(block), motion.positions[block]
            _write_posed(world, places, self.joints, self.ends, posed[block])

        over_blocks(pose, len(motion), len(motion.skeleton))
        return posed


@compiled()
def _write_posed(world: F3, positions: F3, joints: I1, ends: F3, posed: Out[F4]) -> None:
    for frame in range(len(world)):
        for capsule in range(len(joints)):
            q, x = world[frame, joints[capsule]], positions[frame, joints[capsule]]
            for end in range(2):
                v = ends[capsule, end]
                a, b, c = rotated(q[0], q[1], q[2], q[3], v[0], v[1], v[2])
                posed[frame, capsule, end, 0] = x[0] + a
                posed[frame, capsule, end, 1] = x[1] + b
                posed[frame, capsule, end, 2] = x[2] + c


def no_capsules() -> Capsules:
    """Return the surface of a body without thickness."""
    none = np.zeros(0, np.intp)
    return Capsules(none, np.zeros((0, 2, 3)), np.zeros((0, 2)), none)


@inlined(fastmath=True)
def write_axis(ends: Array, radii: Array, axis: Array) -> None:
    """Write the eight numbers of a tapered capsule for `gap_at`: one end of its axis, the vector to the other, and with
    the length L and the taper c = (r_1 - r_0) / L also 1 / L^2 and c / sqrt(1 - c^2) / L. `ends` are (2, 3), `radii`
    (2,).
    """
    square = 0.0
    for i in range(3):
        axis[i] = ends[0, i]
        axis[3 + i] = ends[1, i] - ends[0, i]
        square += axis[3 + i] ** 2
    axis[6] = 1.0 / square if square > LEAST * LEAST else 0.0
    taper = max(min((radii[1] - radii[0]) * np.sqrt(axis[6]), MOST_TAPER), -MOST_TAPER)
    axis[7] = taper * np.sqrt(axis[6] / (1.0 - taper * taper))
    if axis[6] == 0.0 and radii[1] > radii[0]:
        axis[7] = HOLDS


@inlined(fastmath=True)
def gap_at(p, radius, axis, radii):  # type: ignore[no-untyped-def]
    """The gap between a ball about p, (3,), and a tapered capsule, negative where they overlap; the fraction t along
    the axis at which the surface of the capsule is nearest; and the direction from there to p.

    With z along the axis of length L and h across it, the distance sqrt(h^2 + (z - L t)^2) - (1 - t) r_0 - t r_1 is
    least where L t = z + c h / sqrt(1 - c^2).
    """
    wx, wy, wz = p[0] - axis[0], p[1] - axis[1], p[2] - axis[2]
    along = (wx * axis[3] + wy * axis[4] + wz * axis[5]) * axis[6]
    across = max(wx * wx + wy * wy + wz * wz - along * along / max(axis[6], LEAST), 0.0)
    t = max(min(along + axis[7] * np.sqrt(across), 1.0), 0.0)
    x, y, z = wx - t * axis[3], wy - t * axis[4], wz - t * axis[5]
    distance = np.sqrt(x * x + y * y + z * z)
    inverse = 1.0 / max(distance, LEAST)
    return distance - radii[0] - t * (radii[1] - radii[0]) - radius, t, inverse * x, inverse * y, inverse * z


@inlined(fastmath=True)
def may_touch(ball: Array, axis: Array, radii: Array, far: float) -> bool:
    """Whether the gap of a ball, (4,), to a capsule with the larger radius all along is less than `far`."""
    x, y, z = ball[0] - axis[0], ball[1] - axis[1], ball[2] - axis[2]
    t = max(min((x * axis[3] + y * axis[4] + z * axis[5]) * axis[6], 1.0), 0.0)
    x, y, z = x - t * axis[3], y - t * axis[4], z - t * axis[5]
    return bool(x * x + y * y + z * z < max(max(radii[0], radii[1]) + ball[3] + far, 0.0) ** 2)
