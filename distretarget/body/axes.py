"""Directions of a body in its postures, such as up the trunk and to the left, and the axes of a file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from distretarget.body.anatomy import LEG, SIDES, Anatomy
from distretarget.numerics.vectors import Array, cross, lengths, level, normalised
from distretarget.skeleton import AXES

STRETCHED = 125.0  # least angle between trunk and legs of an upright body, rarely reached on four legs [degrees]
FOLDED = 45.0  # with a smaller angle between trunk and legs, a rest pose does not show how the body stands [degrees]
SQUARE = np.cos(np.radians(25))  # a direction within this angle of an axis of the file is snapped to it [cosine]
AHEAD = np.cos(np.radians(10))  # so is left within this angle: a body that faces an axis is symmetric about it [cosine]
# A posture leans as a whole if its legs, side by side but for `STRIDE`, lean by more than `LEAN`, and its trunk at
# least `ALONG` times as much to the same side; it is turned if hip joints and shoulders are turned the same way by more
# than `TURNED`. In 40 rigs that stand upright legs lean by up to 3 degrees, or 6 while the trunk does not, and stride
# by up to 2; hip joints are not turned, and shoulders by up to 4 degrees.
STRIDE = 6.0  # [degrees]
LEAN = np.sin(np.radians(4.5))  # [sine]
TURNED = np.sin(np.radians(1.5))  # [sine]
ALONG = 0.15
PARALLEL = 1e-6  # directions are parallel if the angle between them is smaller than this [rad]


def axis_vector(axis: str) -> Array:
    """Return the unit vector, (3,), of one of `AXES`."""
    vector = np.zeros(3)
    vector["XYZ".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return vector


def nearest_axis(direction: Array) -> tuple[str, float]:
    """Return which of `AXES` is nearest to a direction (3,), and the direction's component along it."""
    signed = np.concatenate([direction, -direction])
    return AXES[int(np.argmax(signed))], float(signed.max())


def direction(positions: Array, start: int, end: int) -> Array:
    """Return the unit vectors, (..., 3), from one joint to another; `positions` is (..., joints, 3)."""
    return normalised(positions[..., end, :] - positions[..., start, :])


def perpendicular(vectors: Array, axes: Array) -> Array:
    """Return the components of vectors perpendicular to unit vectors, all (..., 3)."""
    return np.asarray(vectors - (vectors * axes).sum(axis=-1, keepdims=True) * axes)


def axes_of(left: Array, up: Array) -> Array:
    """Return rotation matrices, (..., 3, 3), with the columns left, up and forward, from unit vectors (..., 3), up made
    perpendicular to left. Where the two are parallel or one is zero, up is kept (Y if it is zero), and left is
    arbitrary.
    """
    lost = lengths(cross(left, up)) < PARALLEL
    if lost.any():
        up = np.where(up.any(axis=-1, keepdims=True), up, axis_vector("Y"))
        arbitrary = perpendicular(np.eye(3)[np.abs(up).argmin(axis=-1)], up)
        left = np.where(lost[..., None], normalised(arbitrary), left)
    up = normalised(perpendicular(up, left))
    return np.stack([left, up, cross(left, up)], axis=-1)


@dataclass(frozen=True, eq=False)
class Directions:
    """Directions of a body in one posture or many; zero vectors where the body lacks the joints they need."""

    anatomy: Anatomy  # the joint of each role
    positions: Array  # (..., joints, 3), the positions of the joints

    @cached_property
    def trunk(self) -> Array:
        """(..., 3), unit vectors from the hip joints up to the shoulders, without arms to the top of the spine."""
        return self._between(self._base, self._top)

    @cached_property
    def legs(self) -> Array:
        """(..., 3), unit vectors from the hip joints down to the ankles, without feet to the knees."""
        return self._between(self._base, self.anatomy.pair("Foot") or self.anatomy.pair("LowerLeg"))

    @cached_property
    def up(self) -> Array:
        """(..., 3), the mean of up the trunk and up the legs; one of them where the body lacks the other."""
        directions = [direction for direction in (self.trunk, -self.legs) if direction.any()]
        return np.asarray(np.mean(directions, axis=0)) if directions else np.zeros_like(self.trunk)

    @property
    def vertical(self) -> Array:
        """(3,), the unit vector up of a posture in which the body stands: `up`, or an axis of the file near to it,
        unless the posture leans as a whole.
        """
        return self._snapped_up(normalised(self.up))

    @cached_property
    def left(self) -> Array:
        """(..., 3), unit vectors from right to left across hip joints and shoulders together."""
        across = (self.across(part) for part in ("UpperLeg", "UpperArm"))
        return normalised(sum((width for width in across if width is not None), np.zeros_like(self.trunk)))

    @cached_property
    def axes(self) -> Array:
        """(..., 3, 3), rotation matrices whose columns are the body's left, up and forward."""
        return axes_of(self.left, self.trunk if self.trunk.any() else self.up)

    @property
    def standing_axes(self) -> Array:
        """(3, 3), the `axes` of a posture in which the body stands, with up and left snapped to near axes of the file,
        unless the posture leans, or is turned, as a whole.
        """
        snapped = upright if self._is_turned else squared
        return snapped(self.axes, self._snapped_up(self.axes[:, 1]))

    def _snapped_up(self, up: Array) -> Array:
        """A direction up snapped to a near axis of the file, or to that which leans with the posture."""
        lean = self._lean
        return normalised(axis_vector(nearest_axis(up)[0]) + lean) if lean.any() else _snapped(up)

    @property
    def stride(self) -> float:
        """The angle between the legs of a posture, seen from the side [degrees]; 0 without legs."""
        legs = [self.bone(f"{side}UpperLeg", f"{side}Foot") for side in SIDES]
        if legs[0] is None or legs[1] is None:
            return 0.0
        across, along = cross(legs[0], legs[1]) @ self.left, level(legs[0], self.left) @ legs[1]
        return float(np.degrees(abs(np.arctan2(across, along))))

    @cached_property
    def _lean(self) -> Array:
        """(3,), how far a posture leans as a whole: horizontal, its length is the tangent of the angle; mostly zero."""
        up = axis_vector(nearest_axis(self.up)[0])
        aside = normalised(level(self.left, up))
        ways = np.stack([aside, cross(aside, up)])
        of_legs, of_trunk = ways @ -self.legs, ways @ self.trunk
        lean = np.where(of_legs * of_trunk > ALONG * of_legs**2, of_legs, 0.0)
        if self.stride > STRIDE or np.linalg.norm(lean) <= LEAN:
            return np.zeros(3)
        return np.asarray(lean @ ways / abs(self.legs @ up))

    @property
    def _is_turned(self) -> bool:
        """Whether a posture is turned as a whole to the left or right of an axis of the file."""
        ahead = cross(_snapped(self.left, AHEAD), self.vertical)
        widths = [width for part in ("UpperLeg", "UpperArm") if (width := self.across(part)) is not None]
        turns = np.array([normalised(width) @ ahead for width in widths])
        return len(turns) > 1 and bool(abs(turns).min() > TURNED and abs(turns.sum()) == abs(turns).sum())

    @cached_property
    def stretch(self) -> Array:
        """(...), the angle between trunk and legs [degrees]: 180 for a person who stands."""
        cosine = (self.trunk * self.legs).sum(axis=-1)
        return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))

    @property
    def is_whole(self) -> bool:
        """Whether the body has a trunk, and both thighs and shins."""
        return bool(self._top and all(map(self.anatomy.pair, LEG[:2])))

    def bone(self, upper: str, lower: str) -> Array | None:
        """(..., 3), unit vectors from the joint of one role to that of another; None where the body lacks either."""
        ends = self.anatomy.joints(upper, lower)
        return direction(self.positions, *ends) if len(ends) == 2 else None

    def across(self, part: str) -> Array | None:
        """(..., 3), from the right joint of a part to the left one; None where the body lacks either."""
        pair = self.anatomy.pair(part)
        return self.positions[..., pair[0], :] - self.positions[..., pair[1], :] if pair else None

    @property
    def _top(self) -> list[int]:
        """The upper end of the trunk: the shoulders, else the topmost joint of spine and neck."""
        return self.anatomy.pair("UpperArm") or [*self.anatomy.spine, *self.anatomy.neck][-1:]

    @property
    def _base(self) -> list[int]:
        """The lower end of the trunk: the hip joints, else the hips."""
        return self.anatomy.pair("UpperLeg") or self.anatomy.joints("hips")

    def _between(self, start: list[int], end: list[int]) -> Array:
        """(..., 3), unit vectors between the centres of two lists of joints; zero where either list is empty."""
        x = self.positions
        if not start or not end:
            return np.zeros((*x.shape[:-2], 3))
        return normalised(x[..., end, :].mean(axis=-2) - x[..., start, :].mean(axis=-2))


def upright(axes: Array, up: Array | None = None) -> Array:
    """Return a body's axes, (3, 3) with columns left, up and forward, with another `up`, (3,), by default its own
    snapped to a near axis of the file.
    """
    up = _snapped(axes[:, 1]) if up is None else up
    return axes_of(normalised(level(axes[:, 0], up)), up)


def squared(axes: Array, up: Array | None = None) -> Array:
    """Return a body's axes as `upright` does, with left snapped to a near axis of the file as well."""
    left, up, _ = upright(axes, up).T
    return axes_of(normalised(level(_snapped(left, AHEAD), up)), up)


def _snapped(direction: Array, least: float = SQUARE) -> Array:
    """The axis of the file, (3,), whose cosine with a direction is larger than this; else the direction itself."""
    nearest, cosine = nearest_axis(direction)
    return axis_vector(nearest) if cosine > least else direction
