"""The parts of a body that have skin: segments, whose surfaces can touch, and part frames, to compare skins of bodies.

A part frame is the coordinate system of a part. Its unit is the bone's length along a limb, the palm's length in a
hand, and else the size of the body, the length of leg and trunk together: long arms are no thicker.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from distretarget.body.anatomy import FINGERS, SIDES, Anatomy, side_and_part
from distretarget.body.axes import axes_of
from distretarget.body.body import Body
from distretarget.body.limbs import Legs
from distretarget.numerics.vectors import Array, Numbers, level, normalised
from distretarget.rig import rig_cached
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS

SEGMENT_OF_PART = {"hips": "pelvis", "neck": "neck", "head": "head"}
SEGMENT_OF_PART |= {"UpperArm": "upper arm", "LowerArm": "forearm", "Hand": "hand"}
SEGMENT_OF_PART |= {"UpperLeg": "thigh", "LowerLeg": "shin", "Foot": "foot", "Toes": "foot"}
# Fingers of a group move together: the first knuckle of the group that the hand has carries all.
FINGER_GROUPS = (("Index", "Middle"), ("Ring", "Little"), ("Thumb",))
HELPER = 0.1  # branches that reach less far are muscles or twists, not hair [body units]
FACE = 0.14  # jaw, eyes and other joints of the face are nearer to the head's joint than this [body units] ...
BELOW_HEAD = 0.03  # ... and not so far below it [body units]

# The joints at the ends of the bone of each part of arm and leg.
LIMBS = {"upper arm": ("UpperArm", "LowerArm"), "forearm": ("LowerArm", "Hand")}
LIMBS |= {"thigh": ("UpperLeg", "LowerLeg"), "shin": ("LowerLeg", "Foot")}
HAND = dict(zip(("fingers", "little fingers", "thumb"), FINGER_GROUPS, strict=True))  # the fingers of parts of a hand
LEG = 0.638  # the leg of an average adult [sizes]
PALM = 0.078  # that adult's palm, from the wrist to the knuckles [sizes]
HEAD = 0.155  # height of the top of that adult's head above the head's joint [sizes]
PELVIS = 0.3  # below this height, skin of the trunk moves with the hips, not with the spine [lengths of the trunk]
FEWEST_FINGERS = 3  # with fewer fingers, the hand's joints do not show how large it is
PALMS = 0.6, 1.7  # bounds of the palm's length [average palms]
HEADS = 1.0, 2.5  # bounds of the head's size [average heads]
ALONG = 0.9  # the side axis of a bone that points more forward than this comes from up, not from forward [cosine]


@dataclass(frozen=True, eq=False)
class Segments:
    """The segments of a body; -1 for joints that are not part of it: above the hips, handles, props, hair and cloth."""

    of_joint: Numbers  # (joints,), the index in `SEGMENTS` of each joint's segment
    carriers: Numbers  # (joints,), the joint that carries the capsules of each joint's skin

    def joints(self, carrier: int) -> list[int]:
        """Return the joints of whose skin a joint carries the capsules."""
        return np.flatnonzero(self.carriers == carrier).tolist()


@rig_cached
def find_segments(body: Body) -> Segments:
    """Return the segments of a body; all -1 for a body without an anatomy."""
    skeleton, anatomy = body.skeleton, body.anatomy
    labels: dict[int, tuple[str, int]] = {} if anatomy is None else _main(skeleton, anatomy)
    on_the_way = skeleton.with_ancestors(labels)  # to joints with roles
    outside = {*body.above_hips, *(below for handle in body.handles for below in skeleton.subtree(handle))}
    for joint, parent in enumerate(skeleton.parents.tolist()):
        is_open = parent in labels and joint not in labels and joint not in outside
        if is_open and (joint in on_the_way or _belongs(body, joint, *labels[parent])):
            labels[joint] = labels[parent]
    of_joint, carriers = np.full(len(skeleton), -1), np.full(len(skeleton), -1)
    for joint, (segment, carrier) in labels.items():
        of_joint[joint], carriers[joint] = SEGMENTS.index(segment), carrier
    return Segments(of_joint, carriers)


def _main(skeleton: Skeleton, anatomy: Anatomy) -> dict[int, tuple[str, int]]:
    """The segment and the carrying joint of each joint with a role."""
    labels: dict[int, tuple[str, int]] = {}
    for role, joint in anatomy.roles.items():
        side, part = side_and_part(role)
        if part == "Shoulder":
            labels[joint] = "chest", anatomy.spine[-1] if anatomy.spine else joint
        elif part in SEGMENT_OF_PART:
            labels[joint] = f"{side} {SEGMENT_OF_PART[part]}".strip(), joint
    labels |= dict.fromkeys(anatomy.neck, ("neck", next(iter(anatomy.neck), -1)))
    labels |= _spine(skeleton, anatomy)
    for side, group in product(SIDES, FINGER_GROUPS):
        labels |= _fingers(anatomy, side, group)
    return labels


def _spine(skeleton: Skeleton, anatomy: Anatomy) -> dict[int, tuple[str, int]]:
    """The labels of the spine: bones in its lower half are the belly, all others and the highest are the chest."""
    if not anatomy.spine:
        return {}
    top = anatomy.neck[0] if anatomy.neck else anatomy.roles.get("head", anatomy.spine[-1])
    along = skeleton.paths_from(anatomy.roles["hips"])[[*anatomy.spine, top]]
    middles = 0.5 * (along[:-1] + along[1:])
    is_belly = middles < 0.5 * along[-1]
    is_belly[-1] = False
    return {joint: ("belly" if low else "chest", joint) for joint, low in zip(anatomy.spine, is_belly, strict=True)}


def _fingers(anatomy: Anatomy, side: str, group: Iterable[str]) -> dict[int, tuple[str, int]]:
    """The labels of a group of fingers; bones in the palm move with the wrist."""
    numbers = {f"{side}{finger}{number}": number for finger in group for number in range(4)}
    joints = {anatomy.roles[role]: number for role, number in numbers.items() if role in anatomy.roles}
    carrier = next((joint for joint, number in joints.items() if number > 0), -1)
    hand = anatomy.roles.get(f"{side}Hand", -1)
    return {joint: (f"{side} hand", carrier if number else hand) for joint, number in joints.items()}


def _belongs(body: Body, joint: int, segment: str, carrier: int) -> bool:
    """Whether a joint without roles in its subtree is part of the body, not of hair, cloth or a tail: an End Site, or
    a joint in a hand, a foot or the face, or with a short subtree. `segment` and `carrier` are those of its parent.
    """
    skeleton = body.skeleton
    if skeleton.end_sites[joint]:
        return True
    if segment == "head":
        away = skeleton.rest_positions[joint] - skeleton.rest_positions[carrier]
        up = body.rest.axes[:, 1]
        return bool(np.linalg.norm(away) < FACE * body.unit and away @ up > -BELOW_HEAD * body.unit)
    if segment.endswith(("hand", "foot")):
        return bool(body.regions.of_joint[joint] >= 0)
    return bool(skeleton.reach[joint] < HELPER * body.unit)


@dataclass(frozen=True, eq=False)
class PartFrame:
    """The coordinate system of a part of a body in the reference pose."""

    origin: Array  # (3,) [file units]
    axes: Array  # (3, 3), unit vectors along the part, to its side and up as columns
    length: float  # the unit along the part [file units]
    breadth: float  # the unit across the part, and of radii [file units]
    carriers: Sequence[tuple[int, float]]  # joints that move its skin, and the share of the length where each begins

    @property
    def scales(self) -> Array:
        """(3,), the units along the axes [file units]."""
        return np.array([self.length, self.breadth, self.breadth])

    def carrier(self, along: float) -> int:
        """Return the joint that carries the skin at `along`, a share of the length."""
        return next(joint for joint, start in reversed(self.carriers) if along >= start or start == -np.inf)


def part_frames(body: Body, head: float = 1.0) -> Iterator[tuple[str, PartFrame]]:
    """Yield name and frame of each part of a body with an anatomy, such as "trunk" and "left palm". The head is `head`
    times the average adult's, unless bones show that it is larger.
    """
    size = _Size.of(body)
    if size is None:
        return
    yield "trunk", size.trunk
    yield from _head(size, head)
    carriers = find_segments(body).carriers
    for side in SIDES:
        yield from _limbs(size, side)
        yield from _hand(size, side, carriers)
        yield from _foot(size, side)


def proportions(body: Body) -> tuple[float, float] | None:
    """Return the length of the legs, and the height of the top of the head over the shoulders [sizes]; None if bones do
    not show both.
    """
    size = _Size.of(body) if body.anatomy else None
    shoulders = size.anatomy.pair("UpperArm") if size else []
    if size is None or not shoulders or not body.legs or not (reach := _head_reach(size)):
        return None
    x, up = size.positions, size.axes[:, 1]
    neck = x[size.anatomy.roles["head"]] - x[shoulders].mean(axis=0)
    return body.leg_length / size.size, reach + float(neck @ up) / size.size


@dataclass(frozen=True, eq=False)
class _Size:
    """A body in its reference pose, and its size, the length of leg and trunk together [file units]."""

    skeleton: Skeleton
    anatomy: Anatomy
    legs: Legs | None
    positions: Array
    axes: Array
    size: float
    trunk: PartFrame

    @classmethod
    def of(cls, body: Body) -> _Size | None:
        """Return pose and size of a body with an anatomy; None for a body without extent."""
        anatomy, x, axes = body.anatomy, body.reference.positions, body.reference.axes
        assert anatomy is not None
        spine = (anatomy.roles["hips"], *anatomy.spine)
        tops = anatomy.pair("UpperArm") or [*anatomy.neck, *anatomy.joints("head")][:1] or [spine[-1]]
        low = x[anatomy.pair("UpperLeg") or [spine[0]]].mean(axis=0)
        along = x[tops].mean(axis=0) - low
        leg, trunk = body.leg_length, _norm(along)
        size = leg + trunk if leg and trunk else leg / LEG + trunk / (1.0 - LEG)
        if not size:
            return None
        trunk = trunk or (1.0 - LEG) * size
        left, up, forward = axes_of(axes[:, 0], normalised(along) if along.any() else axes[:, 1]).T
        shares = np.maximum.accumulate([PELVIS, *((x[list(spine[1:])] - low) @ up / trunk)])
        shares[0] = -np.inf
        columns = np.stack([up, left, forward], axis=1)
        frame = PartFrame(low, columns, trunk, size, list(zip(spine, shares, strict=True)))
        return cls(body.skeleton, anatomy, body.legs, x, axes, size, frame)

    def across(self, along: Array, side: str, wide: Array | None = None) -> Array:
        """The axes of a part as columns: along it, to the side and forwards; or along it, along `wide`, and up."""
        along = normalised(along)
        sign = 1.0 if side == "left" else -1.0
        if wide is not None:
            wide = normalised(level(wide, along))
            return np.stack([along, wide, sign * np.cross(along, wide)], axis=1)
        forward = self.axes[:, 2] if abs(along @ self.axes[:, 2]) < ALONG else self.axes[:, 1]
        high = normalised(level(forward, along))
        return np.stack([along, sign * np.cross(high, along), high], axis=1)


def _head_reach(size: _Size) -> float:
    """The height of the top of the head (End Sites, or "HeadTop_End") above its joint [sizes]; 0 if not shown."""
    skeleton, head = size.skeleton, size.anatomy.roles.get("head")
    if head is None:
        return 0.0
    names, below = skeleton.names, skeleton.children[head]
    ends = [joint for joint in below if skeleton.end_sites[joint] or names[joint].startswith(names[head])]
    up = (size.positions[ends] - size.positions[head]) @ size.axes[:, 1]
    return float(up.max(initial=0.0)) / size.size


def _head(size: _Size, usual: float) -> Iterator[tuple[str, PartFrame]]:
    """Head and neck. The head is as large as its joints show if that is above average, else `usual` times average."""
    x, (left, up, forward) = size.positions, size.axes.T
    for head in size.anatomy.joints("head"):
        own = float(np.clip(_head_reach(size) / HEAD, *HEADS))
        scale = size.size * (own if own > HEADS[0] else usual)
        yield "head", PartFrame(x[head], np.stack([up, left, forward], axis=1), scale, scale, [(head, -np.inf)])
        for neck in size.anatomy.joints("neck"):
            along = x[head] - x[neck]
            if along.any():
                axes = axes_of(left, normalised(along))[:, [1, 0, 2]]
                yield "neck", PartFrame(x[neck], axes, _norm(along), size.size, [(neck, -np.inf)])


def _limbs(size: _Size, side: str) -> Iterator[tuple[str, PartFrame]]:
    """The bones of arm and leg."""
    x, roles = size.positions, size.anatomy.roles
    for part, (upper, lower) in LIMBS.items():
        for start in size.anatomy.joints(side + upper):
            along = x[roles.get(side + lower, size.skeleton.farthest.item(start))] - x[start]
            if along.any():
                axes = size.across(along, side)
                yield f"{side} {part}", PartFrame(x[start], axes, _norm(along), size.size, [(start, -np.inf)])


def _hand(size: _Size, side: str, carriers: Numbers) -> Iterator[tuple[str, PartFrame]]:
    """The parts of a hand; the wrist carries fingers that have no joints."""
    x, anatomy = size.positions, size.anatomy
    hand, elbow = (anatomy.roles.get(side + part) for part in ("Hand", "LowerArm"))
    if hand is None or elbow is None:
        return
    known = anatomy.joints(*(f"{side}{finger}1" for finger in FINGERS[1:]))
    average = PALM * size.size
    is_known = len(known) >= FEWEST_FINGERS
    own = [joint for joint in size.skeleton.subtree(hand) if carriers[joint] >= 0]  # without what it holds
    farthest = max(own, key=size.skeleton.paths_from(hand).item)
    tip = x[known].mean(axis=0) if is_known else x[farthest]
    along = tip - x[hand]
    if not along.any():
        along = x[hand] - x[elbow]
    palm = float(np.clip(_norm(along), PALMS[0] * average, PALMS[1] * average)) if is_known else average
    wide = x[known[0]] - x[known[-1]] if is_known else size.axes[:, 2]
    if not level(wide, normalised(along)).any():
        wide = size.across(along, side)[:, 2]
    axes = size.across(along, side, wide)
    yield f"{side} palm", PartFrame(x[hand], axes, palm, palm, [(hand, -np.inf)])
    for part, fingers in HAND.items():
        joints = anatomy.joints(*(f"{side}{finger}{number}" for finger in fingers for number in (1, 2)))
        carrier = carriers.item(joints[0]) if joints else hand
        yield f"{side} {part}", PartFrame(x[hand], axes, palm, palm, [(carrier, -np.inf)])


def _foot(size: _Size, side: str) -> Iterator[tuple[str, PartFrame]]:
    """Foot and toes."""
    x, (_, up, forward) = size.positions, size.axes.T
    for foot in size.anatomy.joints(f"{side}Foot"):
        toes = size.anatomy.roles.get(f"{side}Toes", foot)
        toe = size.legs[SIDES.index(side)].toe if size.legs else toes
        along = level(x[toe] - x[foot], up)
        along = along if along @ forward > 0.0 else forward
        axes = np.stack([normalised(along), normalised(np.cross(up, along)), up], axis=1)
        axes[:, 1] *= 1.0 if side == "left" else -1.0
        for part, joint in (("foot", foot), ("toes", toes)):
            yield f"{side} {part}", PartFrame(x[foot], axes, size.size, size.size, [(joint, -np.inf)])


def _norm(vector: Array) -> float:
    return float(np.linalg.norm(vector))
