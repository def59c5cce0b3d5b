"""The gaps between the parts of a scene that touch: regions of two bodies, or a region and a thing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.measure.across import touching_points
from distretarget.measure.diff import Diff
from distretarget.motion import Motion
from distretarget.numerics.vectors import lengths

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Gaps:
    """The gaps between two parts of a scene that touch in A, over all pairs of joints and frames in which they do.

    All are in leg lengths of A, the mean of both bodies; those of B are in the scale of A's world.

    Attributes:
        between: the numbers of the two; performers are counted before things.
        regions: the region of the body of each, such as "left hand"; empty for a thing.
        frames: in how many frames they touch.
        pairs: how many pairs of joints touch, counted in each frame.
        a, b: the mean gap.
        error: how far a gap in B is off that in A, on average.
        worst_frame: the frame in which a gap is furthest off ...
        joints: ... and the keys of the two joints of A between which it is.
    """

    between: tuple[int, int]
    regions: tuple[str, str]
    frames: int
    pairs: int
    a: float
    b: float
    error: float
    worst_frame: int
    joints: tuple[str, str]


@dataclass(frozen=True, eq=False, kw_only=True)
class Touchable:
    """The joints of a performer or a thing that may touch others.

    Attributes:
        a, b: (frames, joints, 3), where they are in A and in B [file units of each].
        leg: the length of a leg in A [file units]; 0 for a thing.
        regions: (joints,), the number of the region of the body that each is in ...
        names: ... and the names of these; a thing has one without a name.
        keys: of the joints in A.
    """

    a: Array
    b: Array
    leg: float
    regions: NDArray[np.intp]
    names: tuple[str, ...]
    keys: tuple[str, ...]

    @classmethod
    def of_body(cls, performer: Diff, frames: int) -> Touchable:
        """All driven joints of a performer's body."""
        matching = performer.matching
        joints = matching.body_joints
        drivers = matching.drivers[joints]
        return cls(
            a=performer.a.positions[:frames, drivers],
            b=performer.b.positions[:frames, joints],
            leg=matching.leg_lengths[0],
            regions=matching.regions.of_joint[joints],
            names=matching.regions.names,
            keys=tuple(performer.a.skeleton.keys[joint] for joint in drivers),
        )

    @classmethod
    def of_thing(cls, a: Motion, b: Motion) -> Touchable:
        """All joints of a thing."""
        regions = np.zeros(len(a.skeleton), np.intp)
        return cls(a=a.positions, b=b.positions, leg=0.0, regions=regions, names=("",), keys=a.skeleton.keys)


def gaps_between(between: tuple[int, int], one: Touchable, other: Touchable, scale: float) -> Iterator[Gaps]:
    """The gaps between the regions of two that touch in A; `scale` is in units of B per unit of A."""
    legs = [side.leg for side in (one, other) if side.leg]
    leg = sum(legs) / max(len(legs), 1)
    frame, u, v = (np.concatenate(found) for found in zip(*touching_points(one.a, other.a, leg), strict=True))
    a = lengths(one.a[frame, u] - other.a[frame, v]) / leg
    b = lengths(one.b[frame, u] - other.b[frame, v]) / (scale * leg)
    error = np.abs(b - a)
    kinds = one.regions[u] * len(other.names) + other.regions[v]
    for kind in np.unique(kinds).tolist():
        rows = np.flatnonzero(kinds == kind)
        worst = rows[error[rows].argmax()]
        yield Gaps(
            between=between,
            regions=(one.names[kind // len(other.names)], other.names[kind % len(other.names)]),
            frames=len(np.unique(frame[rows])),
            pairs=len(rows),
            a=float(a[rows].mean()),
            b=float(b[rows].mean()),
            error=float(error[rows].mean()),
            worst_frame=int(frame[worst]),
            joints=(one.keys[u[worst]], other.keys[v[worst]]),
        )
