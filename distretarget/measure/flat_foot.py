"""The soles of a body: which joints they consist of, and how the foot stands when its sole is flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.body.axes import axis_vector
from distretarget.body.body import Body
from distretarget.body.legs import Leg
from distretarget.numerics.vectors import lengths

Array = NDArray[np.float64]

STEEPEST = 60.0  # a foot that points farther up or down than this in the rest pose is not flat there [degrees]


@dataclass(frozen=True, eq=False)
class FlatFoot:
    """The sole of a foot.

    Attributes:
        leg: the leg.
        points: (points,), the ankle and what hangs on it: toes, heel, End Sites. Only the ankle where there is no foot.
        flat_pitch: the elevation of the bone from ankle to toe while the sole is flat [degrees]; nan if unknown.
        flat_height: the height of the ankle over the lowest of the points while the sole is flat [file units]; nan if
            unknown.
    """

    leg: Leg
    points: NDArray[np.intp]
    flat_pitch: float = np.nan
    flat_height: float = np.nan

    def pitch(self, positions: Array, up: Array) -> Array:
        """(...), the elevation of the bone from ankle to toe [degrees]; nan where there is none. `positions`,
        (..., joints, 3), are those of the body, `up`, (3,), is the unit vector up.
        """
        bone = positions[..., self.leg.toe, :] - positions[..., self.leg.ankle, :]
        length = lengths(bone)
        sine = np.divide(bone @ up, length, out=np.full_like(length, np.nan), where=length > 0)
        return np.asarray(np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))))

    def lowest(self, positions: Array, up: Array) -> Array:
        """(...), the height of the lowest of the points [file units]; arguments as in `pitch`."""
        return np.asarray((positions[..., self.points, :] @ up).min(axis=-1))

    def ankle_height(self, positions: Array, up: Array) -> Array:
        """(...), the height of the ankle over the lowest of the points [file units]; arguments as in `pitch`."""
        return np.asarray(positions[..., self.leg.ankle, :] @ up - self.lowest(positions, up))


def find_flat_foot(body: Body, leg: Leg, resting: Array, up: Array) -> FlatFoot:
    """Return the sole of a leg.

    It is flat in the rest pose, if a person can stand in that and the foot does not point steeply down or up there;
    else it is as in the median of the postures `resting`, (frames, joints, 3), in which the foot rests. `up`, (3,), is
    the unit vector up in these.
    """
    below = [joint for joint in body.skeleton.subtree(leg.ankle) if body.regions.of_joint[joint] >= 0]
    sole = FlatFoot(leg, np.array(below if leg.toe != leg.ankle else [leg.ankle], np.intp))
    if leg.toe == leg.ankle:
        return sole
    if body.up_at_rest:
        rest, rest_up = body.skeleton.rest_positions, axis_vector(body.up_at_rest)
        pitch = float(sole.pitch(rest, rest_up))
        if abs(pitch) <= STEEPEST:
            return FlatFoot(leg, sole.points, pitch, float(sole.ankle_height(rest, rest_up)))
    if not len(resting):
        return sole
    pitch = float(np.median(sole.pitch(resting, up)))
    return FlatFoot(leg, sole.points, pitch, float(np.median(sole.ankle_height(resting, up))))
