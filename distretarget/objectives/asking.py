"""How the entries of a contact list apply to a clip: their joints and frames, and whether they suit it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from distretarget.contact_entries import Contact, ContactList, Distance, Entry, Look, Plant
from distretarget.errors import closest, counted, quoted
from distretarget.numerics.time_series import averaged, by_shot, largest, widened
from distretarget.objectives.asked import Asked, Drop, Touch
from distretarget.objectives.clip import Clip
from distretarget.objectives.supports import BLEND
from distretarget.objectives.units import centimetres

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Joints = NDArray[np.intp]

KEYS = {Contact: "between", Plant: "plant", Distance: "distance", Look: "look"}
TURNED = ("head", "hand", "foot")  # parts whose direction can be kept


@dataclass(frozen=True, eq=False)
class Wish:
    """An entry that changes something, on a clip."""

    entry: Entry
    joints: tuple[Joints, ...]  # the target's joints of each part
    frames: Flags  # (frames,)
    weight: Array  # (frames,), 1 in these frames, blended to 0
    apart: Array | None = None  # (frames, 3), between the joints of a contact, if it is known better [body units]

    @property
    def named(self) -> tuple[str, ...]:
        """The names of its parts, in the order of the file."""
        return tuple(_named(self.entry))


@dataclass(frozen=True, eq=False)
class Wishes:
    """The entries of a contact list that change something, on a clip."""

    clip: Clip
    blend: float  # frames; a wish sets in and lets go over twice this
    wishes: tuple[Wish, ...]

    @classmethod
    def of(cls, contacts: ContactList, clip: Clip, blend: float) -> Wishes:
        """Return the entries on a clip; a contact blends in over twice `blend` [s], and out over as much.

        Raises:
            ContactsError: an entry names what is not there, goes beyond the clip, contradicts another, or asks for a
                distance that the body cannot have.
        """
        frames, found = blend / clip.frame_time, []
        for entry in contacts:
            joints = tuple(_joints_of(contacts, clip, entry, n, name) for n, name in enumerate(_named(entry)))
            on = _frames_of(contacts, clip, entry)
            _check_parts(contacts, clip, entry, joints)
            if entry.acts:
                lead = BLEND / clip.frame_time if isinstance(entry, Plant) else frames
                weight = by_shot(partial(widened, frames=lead), clip.shots, on[:, None].astype(float))[:, 0]
                found.append(Wish(entry, joints, on, weight))
        for one, other in combinations(found, 2):
            _check_agree(contacts, one, other)
        return cls(clip, frames, tuple(found))

    @property
    def asked(self) -> Asked:
        """What the terms of the objective and the skin need to know."""
        drops, touches = [], []
        for wish in self.wishes:
            if isinstance(wish.entry, Contact):
                one, other = (self._among(joints) for joints in wish.joints)
                drops.append(Drop(one, other, wish.frames))
                if wish.entry.gap is not None:
                    gap = None if wish.entry.gap == "source" else self.length(float(wish.entry.gap))
                    touches.append(Touch(one, other, wish.entry.firmness * wish.weight, gap))
        return Asked(tuple(drops), tuple(touches))

    def length(self, cm: float) -> float:
        """Return a length [cm] in body units."""
        return cm / centimetres(self.clip.unit) / self.clip.unit

    @property
    def reach(self) -> Array:
        """(frames,), how far each frame may change, 0 to 1: 1 within three quarters of the time in which a contact sets
        in or lets go, 0 beyond that time.
        """
        on = np.any([wish.frames for wish in self.wishes], axis=0)[:, None].astype(float)
        fade = round(0.25 * self.blend)
        full = int(2.0 * self.blend) - fade

        def around(values: Array) -> Array:
            return averaged(largest(values, full), fade) if fade else largest(values, full)

        return np.asarray(np.clip(by_shot(around, self.clip.shots, on)[:, 0], 0.0, 1.0))

    def _among(self, joints: Joints) -> Flags:
        among = np.zeros(len(self.clip.skeleton), bool)
        among[joints] = True
        return among


def _named(entry: Entry) -> Sequence[str]:
    """The names of its parts, in the order of the file."""
    value = getattr(entry, KEYS[type(entry)])
    return (value,) if isinstance(value, str) else value


def _joints_of(contacts: ContactList, clip: Clip, entry: Entry, number: int, name: str) -> Joints:
    """The target's joints of a region; or the target's joint of this name, or that which the source's drives."""
    regions, keys, sources = clip.regions.names, clip.skeleton.keys, clip.source.skeleton.keys
    if name in regions and not isinstance(entry, Distance):
        return np.flatnonzero(clip.regions.of_joint == regions.index(name))
    if name in keys:
        return np.array([keys.index(name)])
    if name in sources:
        driven = np.flatnonzero(clip.drivers == sources.index(name))
        if len(driven):
            return driven[:1]
    what, available = ("part or joint", (*regions, *keys))
    if isinstance(entry, Distance):
        what, available = "joint", tuple(keys)
    key = KEYS[type(entry)] + (f"[{number}]" if len(_named(entry)) > 1 else "")
    raise contacts.fault(entry, key, f"no {what} {name!r}; {closest(name, available)}")


def _frames_of(contacts: ContactList, clip: Clip, entry: Entry) -> Flags:
    """(frames,), those in which an entry holds."""
    on, last = np.ones(len(clip), bool), len(clip) - 1
    span = entry.frames
    if entry.seconds is not None:
        first, end = (round(time / clip.frame_time) for time in entry.seconds)
        if end > last + 1:
            lasts = f"the clip, which lasts {len(clip) * clip.frame_time:g} s"
            raise contacts.fault(entry, "seconds", f"{entry.seconds[1]:g} s is beyond {lasts}")
        span = first, min(end, last)
    elif span is not None and span[1] > last:
        has = f"the clip, which has {counted(len(clip), 'frame')}, 0 to {last}"
        raise contacts.fault(entry, "frames", f"frame {span[1]:g} is beyond {has}")
    if span is not None:
        numbers = np.arange(len(clip))
        on = (numbers >= span[0]) & (numbers <= span[1])
    return on


def _check_parts(contacts: ContactList, clip: Clip, entry: Entry, joints: tuple[Joints, ...]) -> None:
    """Check that the parts of an entry suit it."""
    key = KEYS[type(entry)]
    if len(joints) > 1 and set(joints[0].tolist()) & set(joints[1].tolist()):
        raise contacts.fault(entry, key, f"{quoted(_named(entry))} are the same part of the body")
    if isinstance(entry, Contact):
        one, other = (clip.regions.of_joint[each[0]] for each in joints)
        if min(one, other) >= 0 and clip.regions.neighbours[one, other]:
            raise contacts.fault(entry, key, f"{quoted(entry.between)} are neighbours, which always touch")
    if isinstance(entry, Look) and not clip.regions.inside(*TURNED)[joints[0]].all():
        raise contacts.fault(entry, key, f"{entry.look!r} carries other parts; expected the head, a hand or a foot")
    if isinstance(entry, Distance):
        least, most = distance_limits(clip, int(joints[0][0]), int(joints[1][0]))
        cm = centimetres(clip.unit)
        if not least * cm - 1e-6 <= entry.value <= most * cm + 1e-6:
            what = f"{entry.value:g} cm apart; their bones allow {least * cm:.1f} to {most * cm:.1f}"
            raise contacts.fault(entry, "value", f"no posture has {quoted(entry.distance)} {what}")


def distance_limits(clip: Clip, a: int, b: int) -> tuple[float, float]:
    """Return the least and the largest distance of two joints that bones of these lengths allow [file units]."""
    skeleton = clip.skeleton
    one, other = skeleton.line(a), skeleton.line(b)
    bones = np.array([skeleton.lengths[joint] for joint in {*one} ^ {*other}])
    most = float(bones.sum())
    return max(2.0 * float(bones.max(initial=0.0)) - most, 0.0), most


def _check_agree(contacts: ContactList, one: Wish, other: Wish) -> None:
    """Check that two entries do not say different things of the same in the same frames."""
    a, b = one.entry, other.entry
    both = np.flatnonzero(one.frames & other.frames)
    if type(a) is not type(b) or a.parts != b.parts or not len(both):
        return
    if replace(a, frames=None, seconds=None) == replace(b, frames=None, seconds=None):
        return
    if {getattr(entry, KEYS[type(entry)]) for entry in (a, b)} and _says(a) == _says(b):
        return
    where = f"frame {both[0]}" if len(both) == 1 else f"frames {both[0]} to {both[-1]}"
    says = f"contradicts {contacts.place_of(a)}: both are about {quoted(_named(b))} in {where}"
    raise contacts.fault(b, "", says)


def _says(entry: Entry) -> dict[str, object]:
    """What an entry says of its parts."""
    left_out = ("frames", "seconds", "place", "found", KEYS[type(entry)])
    return {key: value for key, value in vars(entry).items() if key not in left_out}
