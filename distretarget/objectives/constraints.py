"""User constraints: the entries of a contact list applied to a clip, with their joints, frames and weights, checked."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import NamedTuple, get_args

import numpy as np

from distretarget.body.body import Body
from distretarget.body.skin_anchors import AnchoredSkin, SkinPoint
from distretarget.contact_entries import Contact, ContactList, Distance, DroppedContact, Entry, Ground, Look, Plant
from distretarget.errors import closest, counted, quoted
from distretarget.motion import Motion
from distretarget.numerics.time_series import by_shot, widened
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, normalised
from distretarget.objectives.clip import Clip
from distretarget.objectives.supports import BLEND as FOOT_BLEND

NO_OTHERS: Mapping[str, Carrier] = {}
TURNED = ("head", "hand", "foot")  # parts whose direction a user can set
ADULT = 170.0  # the body unit of an adult, twice the leg's length [cm]
UNITS = (100.0, 1.0, 0.1, 2.54 / 0.45)  # units that files use: m, cm, mm, and that of the CMU data base [cm]


def _away(place: Array) -> tuple[Array, Array]:
    """`Carrier.nearest` of a joint without a surface: the joint itself, and the direction from it to a place, (3,)."""
    return np.zeros(3), normalised(place[None])[0]


@dataclass(frozen=True, eq=False, kw_only=True)
class Carrier:
    """What a planted part rests on and moves with: a joint of the body itself or of another performer, or a prop."""

    motion: Motion | None = None  # in the target's world; None for the body itself
    joint: int = 0
    is_whole: bool = False  # whether an entry names it as a whole, like a prop, and not by a joint
    radii: tuple[float, ...] = (0.0,)  # of the skin about its joints [target file units]
    # maps a place, (3,), to the nearest place on its surface and the surface's normal there; places are in the axes of
    # the joint, relative to it [target file units]
    nearest: Callable[[Array], tuple[Array, Array]] = _away


class Anchors(NamedTuple):
    """The two points of a contact, each on the skin of its part."""

    one: SkinPoint
    other: SkinPoint
    gap_offset: float = 0.0  # their distance while the gap between the two skins is 0 [body units]


@dataclass(frozen=True, eq=False)
class Constraint:
    """An entry of a contact list that changes the result, on a clip."""

    entry: Entry
    joints: tuple[Numbers, ...]  # the target's joints of each part
    frames: Flags  # (frames,), where it holds
    weight: Array  # (frames,), blend weight: its firmness in these frames, blended to 0 around them
    lead: int  # the number of frames over which the weight rises before these frames, and falls after them
    carrier: Carrier | None  # what a part is planted on
    pair: tuple[int, int] | None  # the joints whose offset it sets; None for drops, directions and parts on the world
    anchors: Anchors | None = None  # the points of a contact, if the entry has them

    @property
    def drops(self) -> bool:
        """Whether it only drops a contact."""
        return isinstance(self.entry, Contact) and not self.entry.keep


@dataclass(frozen=True, eq=False)
class Constraints:
    """The entries of a contact list that change the result, on a clip."""

    clip: Clip
    every: tuple[Constraint, ...]

    def __iter__(self) -> Iterator[Constraint]:
        return iter(self.every)

    def __len__(self) -> int:
        return len(self.every)

    @classmethod
    def of(
        cls,
        contacts: ContactList,
        clip: Clip,
        skin: AnchoredSkin,
        blend: float,
        others: Mapping[str, Carrier] = NO_OTHERS,
    ) -> Constraints:
        """Return the constraints of a contact list on a clip whose target has a `skin`. Their weights rise and fall
        over twice `blend` [s]. `others` are the performers and props that parts may rest on, by name.

        Raises:
            ContactsError: an entry names a joint, part or prop that does not exist, goes beyond the clip, contradicts
                another, or sets a distance that the bones do not allow.
        """
        found = []
        for entry in contacts:
            joints = tuple(_joints_of(contacts, clip, entry, n, name) for n, name in enumerate(entry.names))
            on = frames_of(contacts, clip, entry)
            _check_parts(contacts, clip, entry, joints)
            carrier = _carrier_of(contacts, clip, entry, joints[0], others)
            if entry.has_effect:
                if isinstance(entry, Contact) and entry.keep:
                    joints = tuple(_without_neck(skin.body, part) for part in joints)
                is_foot = isinstance(entry, Plant) and clip.regions.inside("foot")[joints[0]].any()
                lead = int(2.0 * (FOOT_BLEND if is_foot else blend) / clip.frame_time)
                firmness = entry.firmness if isinstance(entry, Contact) else 1.0
                weight = by_shot(partial(_eased, frames=lead), clip.shots, on)
                anchors = _anchors_of(contacts, entry, joints, skin)
                carried = anchors and (anchors.one.joint, anchors.other.joint)
                pair = carried or _pair_of(clip, entry, joints, on, carrier)
                found.append(Constraint(entry, joints, on, firmness * weight, lead, carrier, pair, anchors))
        for one, other in combinations(found, 2):
            _check_agree(contacts, one, other)
        return cls(clip, tuple(found))

    @property
    def drops(self) -> Constraints:
        """The constraints that only drop a contact."""
        return replace(self, every=tuple(constraint for constraint in self if constraint.drops))

    @property
    def made(self) -> Constraints:
        """All constraints but drops."""
        return replace(self, every=tuple(constraint for constraint in self if not constraint.drops))

    @property
    def dropped(self) -> tuple[DroppedContact, ...]:
        """The found contacts that are dropped: those of drops, and those between the parts of user contacts."""
        among = [constraint for constraint in self if isinstance(constraint.entry, Contact)]
        spans = (constraint.frames if constraint.drops else constraint.weight > 0.0 for constraint in among)
        return tuple(DroppedContact(constraint.joints, on) for constraint, on in zip(among, spans, strict=True))

    @property
    def on(self) -> Flags:
        """(frames,), where any constraint holds."""
        return np.asarray(np.any([np.zeros(len(self.clip), bool), *(constraint.frames for constraint in self)], axis=0))

    @property
    def rest_on_body(self) -> bool:
        """Whether any constraint plants a part on another of the same body."""
        return any(isinstance(constraint.entry, Plant) and constraint.pair for constraint in self)

    @property
    def share(self) -> Array:
        """(frames,), the blend weight of the solution with all constraints against the one without, 0 to 1."""
        return np.asarray(np.max([np.zeros(len(self.clip)), *(constraint.weight for constraint in self)], axis=0))

    def firmness(self, constraint: Constraint) -> Array:
        """(frames,), the weight of a constraint in the solution with all: its blend weight divided by `share`."""
        return np.divide(constraint.weight, self.share, out=np.zeros(len(self.clip)), where=constraint.weight > 0.0)

    @property
    def all_firmness(self) -> list[Array]:
        """The `firmness` of each constraint."""
        return [self.firmness(constraint) for constraint in self]

    def length(self, cm: float) -> float:
        """Return a length [cm] in body units."""
        return cm / centimetres(self.clip.unit) / self.clip.unit


def _without_neck(body: Body, part: Numbers) -> Numbers:
    """The joints of a part; of the head without the neck's, as contacts are with the head alone."""
    head = body.anatomy.roles.get("head") if body.anatomy else None
    return part if head is None or head not in part else np.intersect1d(part, [*body.skeleton.subtree(head)])


def _pair_of(
    clip: Clip, entry: Entry, joints: Sequence[Numbers], on: Flags, carrier: Carrier | None
) -> tuple[int, int] | None:
    """`Constraint.pair`; of a contact the two driven joints that are nearest to each other in the copy, on average."""
    if isinstance(entry, Distance):
        return int(joints[0][0]), int(joints[1][0])
    if isinstance(entry, Plant) and carrier is not None and carrier.motion is None:
        return int(joints[0][0]), carrier.joint
    if not isinstance(entry, Contact) or not entry.keep:
        return None
    driven = clip.drivers >= 0
    a, b = (part[driven[part]] if driven[part].any() else part for part in joints)
    x = clip.copy.positions[on]
    apart = lengths(x[:, a, None] - x[:, None, b]).mean(axis=0)
    i, j = np.unravel_index(apart.argmin(), apart.shape)
    return int(a[i]), int(b[j])


def _anchors_of(contacts: ContactList, entry: Entry, joints: Sequence[Numbers], skin: AnchoredSkin) -> Anchors | None:
    """`Constraint.anchors`."""
    if not isinstance(entry, Contact) or entry.anchors is None:
        return None
    points = [skin.point(int(part[0]), anchor) for part, anchor in zip(joints, entry.anchors, strict=True)]
    for number, point in enumerate(points):
        if point is None:
            what = f"{entry.between[number]!r} has no axis to be anchored on; leave anchors out"
            raise contacts.fault(entry, f"anchors[{number}]", what)
    one, other = filter(None, points)
    return Anchors(one, other)


def _eased(on: Flags, frames: int) -> Array:
    """(frames,), 1 where `on`, 0 farther than `frames` from there, and smooth in between."""
    weight = widened(on[:, None].astype(float), (frames - 1) // 2)[:, 0]
    return np.where(on, 1.0, np.minimum(weight, 1.0))


def _carrier_of(
    contacts: ContactList, clip: Clip, entry: Entry, part: Numbers, others: Mapping[str, Carrier]
) -> Carrier | None:
    """The joint or prop that a part is planted on; None for the floor or a place, and for other entries."""
    if not isinstance(entry, Plant) or not isinstance(entry.on, str) or entry.on in get_args(Ground):
        return None
    name, _, joint = (each.strip() for each in entry.on.partition(":"))
    other = others.get(entry.on if entry.on in others else name)
    if other and other.is_whole:
        return other
    if other and other.motion:
        keys = other.motion.skeleton.keys
        if joint in keys:
            return replace(other, joint=keys.index(joint))
        raise contacts.fault(entry, "on", f"performer {name} has no joint {joint!r}; {closest(joint, keys)}")
    own = _find_joints(clip, entry.on, regions=True)
    if own is None:
        props = (name for name, each in others.items() if each.is_whole)
        names = (*get_args(Ground), *props, *clip.regions.names, *clip.skeleton.keys)
        raise contacts.fault(entry, "on", f"no joint or prop {entry.on!r}; {closest(entry.on, names)}")
    if clip.regions.of_joint[own[0]] == clip.regions.of_joint[part[0]]:
        raise contacts.fault(entry, "on", f"{quoted((*entry.parts, entry.on))} are the same part of the body")
    return Carrier(joint=int(own[0]))


def _joints_of(contacts: ContactList, clip: Clip, entry: Entry, number: int, name: str) -> Numbers:
    """The target's joints of a part that an entry names."""
    regions = not isinstance(entry, Distance)
    joints = _find_joints(clip, name, regions=regions)
    if joints is None:
        what, available = ("part or joint", clip.regions.names) if regions else ("joint", ())
        key = entry.key + (f"[{number}]" if len(entry.names) > 1 else "")
        near = closest(name, (*available, *clip.skeleton.keys))
        raise contacts.fault(entry, key, f"no {what} {name!r}; {near}")
    return joints


def _find_joints(clip: Clip, name: str, *, regions: bool) -> Numbers | None:
    """The target's joints of a region, or its joint of this name, or the one that such a joint of the source drives."""
    if regions and name in clip.regions.names:
        return np.flatnonzero(clip.regions.of_joint == clip.regions.names.index(name))
    if name in clip.skeleton.keys:
        return np.array([clip.skeleton.keys.index(name)])
    sources = clip.source.skeleton.keys
    driven = np.flatnonzero(clip.drivers == sources.index(name)) if name in sources else np.zeros(0, np.intp)
    return driven[:1] if len(driven) else None


def frames_of(contacts: ContactList, clip: Clip, entry: Entry) -> Flags:
    """Return a mask of the frames in which an entry holds, (frames,); a ContactsError if they go beyond the clip."""
    last = len(clip) - 1
    span = entry.frames or (0, last)
    if entry.seconds is not None:
        first, end = (round(time / clip.frame_time) for time in entry.seconds)
        if end > last + 1:
            lasts = f"the clip, which lasts {len(clip) * clip.frame_time:g} s"
            raise contacts.fault(entry, "seconds", f"{entry.seconds[1]:g} s is beyond {lasts}")
        span = min(first, last), min(end, last)
    elif span[1] > last:
        has = f"the clip, which has {counted(len(clip), 'frame')}, 0 to {last}"
        raise contacts.fault(entry, "frames", f"frame {span[1]:g} is beyond {has}")
    numbers = np.arange(len(clip))
    return (numbers >= span[0]) & (numbers <= span[1])


def _check_parts(contacts: ContactList, clip: Clip, entry: Entry, joints: tuple[Numbers, ...]) -> None:
    """Check that the parts of an entry differ, are no neighbours, can be turned, or can have its distance."""
    key = entry.key
    if len(joints) > 1 and set(joints[0].tolist()) & set(joints[1].tolist()):
        raise contacts.fault(entry, key, f"{quoted(entry.names)} are the same part of the body")
    if isinstance(entry, Contact):
        one, other = (clip.regions.of_joint[each[0]] for each in joints)
        if min(one, other) >= 0 and clip.regions.neighbours[one, other]:
            raise contacts.fault(entry, key, f"{quoted(entry.between)} are neighbours, which always touch")
    if isinstance(entry, Look) and not clip.regions.inside(*TURNED)[joints[0]].all():
        raise contacts.fault(entry, key, f"{entry.look!r} carries other parts; expected the head, a hand or a foot")
    if isinstance(entry, Distance):
        least, most = _distance_limits(clip, int(joints[0][0]), int(joints[1][0]))
        cm = centimetres(clip.unit)
        if not least * cm - 1e-6 <= entry.value <= most * cm + 1e-6:
            what = f"{entry.value:g} cm apart; their bones allow {least * cm:.1f} to {most * cm:.1f}"
            raise contacts.fault(entry, "value", f"no posture has {quoted(entry.distance)} {what}")


def _distance_limits(clip: Clip, a: int, b: int) -> tuple[float, float]:
    """The least and the largest distance of two joints that bones of these lengths allow [file units]."""
    skeleton = clip.skeleton
    one, other = skeleton.to_root(a), skeleton.to_root(b)
    bones = np.array([skeleton.lengths[joint] for joint in {*one} ^ {*other}])
    most = float(bones.sum())
    return max(2.0 * float(bones.max(initial=0.0)) - most, 0.0), most


def _check_agree(contacts: ContactList, one: Constraint, other: Constraint) -> None:
    """Check that no two entries of a kind set different values for the same parts in the same frames."""
    a, b = one.entry, other.entry
    both = np.flatnonzero(one.frames & other.frames)
    if type(a) is not type(b) or a.parts != b.parts or not len(both):
        return
    if replace(a, frames=b.frames, seconds=b.seconds, **{b.key: getattr(b, b.key)}) == b:
        return
    where = f"frame {both[0]}" if len(both) == 1 else f"frames {both[0]} to {both[-1]}"
    says = f"contradicts {contacts.place_of(a)}: both are about {quoted(b.names)} in {where}"
    raise contacts.fault(b, "", says)


def centimetres(unit: float) -> float:
    """Return how many centimetres a file's unit is: the one of `UNITS` in which a body with this body unit [file units]
    is nearest to an adult's size.
    """
    return min(UNITS, key=lambda each: abs(math.log(max(unit, 1e-9) * each / ADULT)))
