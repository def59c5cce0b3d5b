"""Where the parts of a body are in its reference pose: frames in which the skins of two bodies can be compared.

How far along, to the side and up a point of a part is counts along limbs in lengths of the bone, in a hand in lengths
of the palm, and else in the size of the body, which is the length of a leg and of the trunk together: long arms are no
thicker.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import FINGERS, SIDES
from distretarget.body.axes import axes_of
from distretarget.body.body import Body
from distretarget.body.segments import FINGER_GROUPS, Segments, find_segments
from distretarget.numerics.vectors import level, normalised

Array = NDArray[np.float64]

LIMBS = {  # the joints at the ends of the bone of each part
    "upper arm": ("UpperArm", "LowerArm"),
    "forearm": ("LowerArm", "Hand"),
    "thigh": ("UpperLeg", "LowerLeg"),
    "shin": ("LowerLeg", "Foot"),
}
HAND = dict(zip(("fingers", "little fingers", "thumb"), FINGER_GROUPS, strict=True))  # parts of a hand, and fingers
LEG = 0.638  # the leg of an average adult [sizes]
PALM = 0.078  # that adult's palm, from the wrist to the knuckles [sizes]
HEAD = 0.155  # how far the top of that adult's head is above its joint [sizes]
PELVIS = 0.3  # the lowest joint of the spine takes over from the hips no lower than this [lengths of the trunk]
KNUCKLES = 3  # with fewer fingers, the hand's joints do not show how large it is
PALMS = 0.6, 1.7  # the least and the longest palm [of the average one]
HEADS = 1.0, 2.5  # the least and the largest head [of the average one]
ALONG = 0.9  # a bone that points forward more than this is turned about by what is up [cosine]


@dataclass(frozen=True, eq=False)
class Frame:
    """Where a part of a body is in the body's reference pose.

    Attributes:
        origin: (3,) [file units].
        axes: (3, 3), unit vectors along it, to its side and up as columns.
        length: what counts as 1 along it [file units].
        breadth: what counts as 1 across it, and for radii [file units].
        carriers: the joints that carry it, and how far along it each takes over; the first from the start.
    """

    origin: Array
    axes: Array
    length: float
    breadth: float
    carriers: Sequence[tuple[int, float]]

    @property
    def scales(self) -> Array:
        """(3,), what counts as 1 along its axes [file units]."""
        return np.array([self.length, self.breadth, self.breadth])

    def carrier(self, along: float) -> int:
        """Return the joint that carries what is so far along it."""
        return next(joint for joint, start in reversed(self.carriers) if along >= start or start == -np.inf)


def frames(body: Body, head: float = 1.0) -> Iterator[tuple[str, Frame]]:
    """Yield the frame of each part that a body with an anatomy has, such as "trunk" and "left palm". A head of which
    bones do not show that it is larger than the average one is `head` times as large.
    """
    size = _Size.of(body)
    if size is None:
        return
    segments = find_segments(body)
    yield "trunk", size.trunk
    yield from _head(body, size, head)
    for side in SIDES:
        for part, (upper, lower) in LIMBS.items():
            if (start := size.roles.get(side + upper)) is not None:
                end = size.roles.get(side + lower, body.skeleton.farthest.item(start))
                along = size.positions[end] - size.positions[start]
                if along.any():
                    axes = size.across(along, side)
                    yield (
                        f"{side} {part}",
                        Frame(size.positions[start], axes, _norm(along), size.size, [(start, -np.inf)]),
                    )
        yield from _hand(size, side, segments, body)
        yield from _foot(size, side, body)


@dataclass(frozen=True, eq=False)
class _Size:
    """A body in its reference pose, and its size, that of leg and trunk [file units]."""

    roles: Mapping[str, int]
    positions: Array
    axes: Array
    size: float
    trunk: Frame

    @classmethod
    def of(cls, body: Body) -> _Size | None:
        """Return those of a body; None for one without extent."""
        assert body.anatomy is not None
        roles, x, axes = body.anatomy.roles, body.reference.positions, body.reference.axes
        spine = (roles["hips"], *body.anatomy.spine)
        tops = _both(roles, "UpperArm") or [joint for joint in (*body.anatomy.neck, roles.get("head")) if joint][:1]
        low = x[_both(roles, "UpperLeg") or [roles["hips"]]].mean(axis=0)
        along = x[tops or [spine[-1]]].mean(axis=0) - low
        leg, trunk = body.leg_length, _norm(along)
        size = leg + trunk if leg and trunk else leg / LEG + trunk / (1.0 - LEG)
        if not size:
            return None
        trunk = trunk or (1.0 - LEG) * size
        left, up, forward = axes_of(axes[:, 0], normalised(along) if along.any() else axes[:, 1]).T
        shares = np.maximum.accumulate([PELVIS, *((x[list(spine[1:])] - low) @ up / trunk)])
        shares[0] = -np.inf
        frame = Frame(low, np.stack([up, left, forward], axis=1), trunk, size, list(zip(spine, shares, strict=True)))
        return cls(roles, x, axes, size, frame)

    def across(self, along: Array, side: str, wide: Array | None = None) -> Array:
        """The axes of a part of a limb: along it, to its side, and forwards; or along it, along `wide`, and up from
        these.
        """
        along = normalised(along)
        sign = 1.0 if side == "left" else -1.0
        if wide is not None:
            wide = normalised(level(wide, along))
            return np.stack([along, wide, sign * np.cross(along, wide)], axis=1)
        forward = self.axes[:, 2] if abs(along @ self.axes[:, 2]) < ALONG else self.axes[:, 1]
        high = normalised(level(forward, along))
        return np.stack([along, sign * np.cross(high, along), high], axis=1)


def proportions(body: Body) -> tuple[float, float] | None:
    """Return the length of a body's legs and how far the top of its head is over its shoulders [sizes]; None where
    bones do not show both.
    """
    size = _Size.of(body) if body.anatomy else None
    shoulders = _both(size.roles, "UpperArm") if size else []
    if size is None or not shoulders or not body.legs or not (reach := _head_reach(body, size)):
        return None
    neck = size.positions[size.roles["head"]] - size.positions[shoulders].mean(axis=0)
    return body.leg_length / size.size, reach + float(neck @ size.axes[:, 1]) / size.size


def _head_reach(body: Body, size: _Size) -> float:
    """How far the top of the head is over its joint [sizes]; 0 where neither an End Site nor a joint named for it, such
    as "HeadTop_End", shows it.
    """
    skeleton, head = body.skeleton, size.roles.get("head")
    if head is None:
        return 0.0
    names, below = skeleton.names, skeleton.children[head]
    ends = [joint for joint in below if skeleton.end_sites[joint] or names[joint].startswith(names[head])]
    up = (size.positions[ends] - size.positions[head]) @ size.axes[:, 1]
    return float(up.max(initial=0.0)) / size.size


def _head(body: Body, size: _Size, usual: float) -> Iterator[tuple[str, Frame]]:
    """Neck and head. A head that reaches farther than the average one is as large as that; else `usual` times."""
    head, neck = size.roles.get("head"), size.roles.get("neck")
    left, up, forward = size.axes.T
    axes = np.stack([up, left, forward], axis=1)
    if head is not None:
        own = float(np.clip(_head_reach(body, size) / HEAD, *HEADS))
        scale = size.size * (own if own > HEADS[0] else usual)
        yield "head", Frame(size.positions[head], axes, scale, scale, [(head, -np.inf)])
    if head is not None and neck is not None:
        along = size.positions[head] - size.positions[neck]
        if along.any():
            axes = axes_of(left, normalised(along))[:, [1, 0, 2]]
            yield "neck", Frame(size.positions[neck], axes, _norm(along), size.size, [(neck, -np.inf)])


def _hand(size: _Size, side: str, segments: Segments, body: Body) -> Iterator[tuple[str, Frame]]:
    """The parts of a hand; its fingers hang on the wrist where it has no joints for them."""
    hand = size.roles.get(f"{side}Hand")
    if hand is None:
        return
    x = size.positions
    known = [size.roles[name] for finger in FINGERS[1:] if (name := f"{side}{finger}1") in size.roles]
    average = PALM * size.size
    is_known = len(known) >= KNUCKLES
    tip = x[known].mean(axis=0) if is_known else x[body.skeleton.farthest[hand]]
    along = tip - x[hand]
    if not along.any():
        along = x[hand] - x[size.roles[f"{side}LowerArm"]]
    palm = float(np.clip(_norm(along), PALMS[0] * average, PALMS[1] * average)) if is_known else average
    wide = x[known[0]] - x[known[-1]] if is_known else size.axes[:, 2]
    if not level(wide, normalised(along)).any():
        wide = size.across(along, side)[:, 2]
    axes = size.across(along, side, wide)
    yield f"{side} palm", Frame(x[hand], axes, palm, palm, [(hand, -np.inf)])
    for part, fingers in HAND.items():
        joints = [
            size.roles[name] for finger in fingers for n in (1, 2) if (name := f"{side}{finger}{n}") in size.roles
        ]
        carrier = segments.carriers.item(joints[0]) if joints else hand
        yield f"{side} {part}", Frame(x[hand], axes, palm, palm, [(carrier, -np.inf)])


def _foot(size: _Size, side: str, body: Body) -> Iterator[tuple[str, Frame]]:
    """Foot and toes."""
    foot = size.roles.get(f"{side}Foot")
    if foot is None:
        return
    up, forward = size.axes[:, 1], size.axes[:, 2]
    toes = size.roles.get(f"{side}Toes", foot)
    toe = body.legs[SIDES.index(side)].toe if body.legs else toes
    along = level(size.positions[toe] - size.positions[foot], up)
    along = along if along @ forward > 0.0 else forward
    axes = np.stack([normalised(along), normalised(np.cross(up, along)), up], axis=1)
    axes[:, 1] *= 1.0 if side == "left" else -1.0
    for part, joint in (("foot", foot), ("toes", toes)):
        yield f"{side} {part}", Frame(size.positions[foot], axes, size.size, size.size, [(joint, -np.inf)])


def _both(roles: Mapping[str, int], part: str) -> list[int]:
    """The joints of a part on both sides; none where one of them is missing."""
    found = [roles[side + part] for side in SIDES if side + part in roles]
    return found if len(found) == len(SIDES) else []


def _norm(vector: Array) -> float:
    return float(np.linalg.norm(vector))
