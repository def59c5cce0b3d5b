"""The rows of a player's timeline: contacts, supports, and skin that sinks in, with how far each is off in a frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.body.segments import find_segments
from distretarget.io.contacts_file import entry_to_json
from distretarget.measure.contacts import CONTACT_DISTANCE
from distretarget.measure.diff import Diff
from distretarget.measure.metrics import BY_KEY
from distretarget.measure.skin import TOUCHABLE
from distretarget.measure.skin_depths import LIMBS
from distretarget.numerics.time_series import spans_of
from distretarget.numerics.vectors import Array
from distretarget.pipeline.found_contacts import MarkedContact
from distretarget.report.actors import packed
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.fit import distances

Kind = Literal["contact", "support", "skin"]
Point = tuple[int, int]
"""An actor of the page, and one of its joints."""

FAR = CONTACT_DISTANCE / 3  # a contact whose D is farther off than this is not kept well
SEEN = 0.3  # skin that is less deep inside than this is not shown [limits]
TOUCHING, RESTING = " touching", " on floor"
CODES = 254  # steps of how far something is off
SPANS = 6  # times in which a row holds that are told
LIMB_ROLES = {"hand": "Hand", "forearm": "LowerArm"}
# The kinds of the tracks that have a row for each part, and what is said of a part.
TRACKS: dict[str, tuple[Kind, str]] = {
    "skin_depth": ("skin", "{} inside"),
    "skin_gap": ("contact", "{}" + TOUCHING),
    "foot_height": ("support", "{}" + RESTING),
    "support_height": ("support", "{}" + RESTING),
}


@dataclass(frozen=True, eq=False)
class Row:
    """Something that holds in some frames."""

    name: str  # what it is, such as "left hand - right hip"
    kind: Kind  # chooses its mark
    values: Array  # (frames,), how far it is off, nan where it does not hold
    limit: float  # the value up to which nobody minds
    unit: str  # of these values
    points: Sequence[Sequence[Point]]  # the joints between which its mark is, for each side of the page
    spots: NDArray[np.intp] | None = None  # (frames,), the joint at which its mark is instead, if that changes
    marked: Sequence[MarkedContact] = ()  # what of it was found, dropped or added, as a contact file says it

    @property
    def spans(self) -> list[list[int]]:
        """The first frame and the end of each time in which it holds."""
        return list(spans_of(np.isfinite(self.values)).tolist())

    @property
    def data(self) -> dict[str, Any]:
        """The row for the page: each frame is 0, or 1 and how far off it is, in `CODES` steps up to `top`."""
        most = float(np.nanmax(self.values, initial=0.0))
        top = max(3.0 * self.limit, most)
        codes = np.where(np.isfinite(self.values), 1 + np.rint(CODES * self.values / top), 0)
        spans = [f"{first}\u2013{end - 1}" for first, end in self.spans]
        told = ", ".join([*spans[:SPANS], *["\u2026"] * (len(spans) > SPANS)])
        account = f"frames {told}" if spans else "not measured"
        return {
            "name": self.name,
            "kind": self.kind,
            "unit": self.unit,
            "limit": self.limit,
            "top": top,
            "account": account + (f"; at most {most:.3g} {self.unit} off" if self.unit else ""),
            "codes": packed(codes, "<u1"),
            "points": self.points,
            "spots": "" if self.spots is None else packed(self.spots, "<u2"),
            "marked": [
                {"frames": each.entry.frames, "mark": each.mark, "json": entry_to_json(each.entry)}
                for each in self.marked
            ],
        }


def rows_of(
    diff: Diff, solid: Capsules | None, actors: Sequence[int], prefix: str = "", marked: Sequence[MarkedContact] = ()
) -> list[Row]:
    """Return the rows of a diff, their names after a prefix; `solid` is the surface of B, `actors` are the numbers of A
    and of all others, which have the joints of B; `marked` are the contacts that were found, dropped and added. Rows of
    those dropped and added come first.
    """
    contacts = [*_contacts(diff, actors)]
    told = {name for row in contacts for name in row.name.split(" - ")}
    rows = [*contacts, *(row for row in _tracks(diff, solid, actors) if row.name.removesuffix(TOUCHING) not in told)]
    rows = [*_with_marks(diff, rows, marked, actors)]
    rows.sort(key=lambda row: all(each.mark == "found" for each in row.marked))
    return [replace(row, name=prefix + row.name) for row in rows]


def _with_marks(
    diff: Diff, rows: Sequence[Row], marked: Sequence[MarkedContact], actors: Sequence[int]
) -> Iterator[Row]:
    """Rows with what of them was found, dropped and added; one more for each that has no row."""
    left: dict[frozenset[str], list[MarkedContact]] = {}
    for each in marked:
        left.setdefault(frozenset(each.entry.parts), []).append(each)
    for row in rows:
        own = left.pop(frozenset(row.name.removesuffix(RESTING).split(" - ")), []) if row.kind != "skin" else []
        values = np.array(row.values)
        for each in own:
            if each.mark == "dropped":
                values[_frames(each)] = np.nan
        yield replace(row, values=values, marked=own)
    for own in left.values():
        values, on = np.full(len(diff), np.nan), [each for each in own if each.mark == "added"]
        for each in on:
            values[_frames(each)] = 0.0
        joints = _nearest_joints(diff, own[0].entry.parts, _frames(on[0])) if on else ()
        kind: Kind = "contact" if len(own[0].entry.parts) > 1 else "support"
        name = " - ".join(own[0].entry.parts) + (RESTING if kind == "support" else "")
        yield Row(name, kind, values, 1.0, "", _points(diff, joints, actors), marked=own)


def _frames(marked: MarkedContact) -> slice:
    """The frames of a marked contact, which has them."""
    first, last = marked.entry.frames or (0, -1)
    return slice(int(first), int(last) + 1)


def _nearest_joints(diff: Diff, parts: Sequence[str], frames: slice) -> Sequence[int]:
    """The joints of B's parts, or joints called so, that are nearest to each other in some frames; none if unknown."""
    regions, keys = diff.matching.regions, diff.b.skeleton.keys
    joints = [
        np.flatnonzero(regions.of_joint == regions.names.index(part)) if part in regions.names else [keys.index(part)]
        for part in parts
        if part in regions.names or part in keys
    ]
    if len(joints) < len(parts):
        return ()
    if len(joints) == 1:
        return (int(joints[0][0]),)
    a, b = (diff.b.positions[frames][:, each] for each in joints)
    near = np.linalg.norm(a[:, :, None] - b[:, None], axis=3).mean(axis=0)
    one, other = np.unravel_index(near.argmin(), near.shape)
    return int(joints[0][one]), int(joints[1][other])


def _points(diff: Diff, joints: Sequence[int], actors: Sequence[int]) -> list[list[Point]]:
    first, *others = actors
    drivers = [int(diff.matching.drivers[joint]) for joint in joints]
    of_a = [(first, driver) for driver in drivers] if min(drivers, default=-1) >= 0 else []
    return [of_a, *([(actor, joint) for joint in joints] for actor in others)]


def _contacts(diff: Diff, actors: Sequence[int]) -> Iterator[Row]:
    """A row for each two regions that touch in A; where their skin is known, its gap judges, not the joints' D."""
    contacts, skin = diff.comparison.contacts, diff.comparison.tracks["skin_gap"]
    for touch in contacts.touches:
        on = contacts.regions == contacts.candidates.names.index(touch.name)
        values, points = np.full(len(diff), np.nan), _points(diff, (touch.u, touch.v), actors)
        limbs = [limb for limb, name in enumerate(skin.parts) if name in touch.name.split(" - ")]
        if limbs and skin.weights.any():
            gaps = np.where(skin.weights > 0, skin.values, 0.0)[:, limbs].max(axis=1)
            off, limit, unit = gaps[contacts.frame[on]], limit_of("skin_gap"), BY_KEY["skin_gap"].symbol
        else:
            off, limit, unit = contacts.error[on], FAR, "D"
        values[contacts.frame[on]] = off
        yield Row(touch.name, "contact", values, limit, unit, points)


def limit_of(key: str) -> float:
    """The value up to which nobody minds a metric."""
    limit = BY_KEY[key].limit
    assert limit is not None
    return limit.margin


def _tracks(diff: Diff, solid: Capsules | None, actors: Sequence[int]) -> Iterator[Row]:
    """A row for each part of what is measured of feet, other supports and skin."""
    anatomy, keys = diff.matching.target.anatomy, diff.b.skeleton.keys
    for key, (kind, text) in TRACKS.items():
        track, limit = diff.comparison.tracks[key], limit_of(key)
        for column, part in enumerate(track.parts):
            values = np.full(len(diff), np.nan)
            if track.values.ndim == 2 and len(track.values):
                on = track.weights[:, column] > 0
                if kind == "skin":
                    on &= track.values[:, column] > SEEN * limit
                values[: len(on)][on] = track.values[on, column]
            side, _, limb = part.partition(" ")
            joint = keys.index(part) if part in keys else None
            if joint is None and anatomy and limb in LIMB_ROLES:
                joint = anatomy.roles.get(side + LIMB_ROLES[limb])
            if joint is not None and np.isfinite(values).any():
                points = _points(diff, (joint,), actors)
                regions = diff.matching.regions
                name = part if limb in LIMB_ROLES else regions.names[regions.of_joint[joint]]
                row = Row(text.format(name), kind, values, limit, BY_KEY[key].symbol, points)
                yield replace(row, spots=_spots(diff, solid, part, values)) if kind == "skin" and solid else row


def _spots(diff: Diff, solid: Capsules, limb: str, values: Array) -> NDArray[np.intp]:
    """(frames,), the joint of a limb that is deepest in other parts of the body, where values are known; else 0."""
    joints = np.flatnonzero(find_segments(diff.matching.target).of_joint == SEGMENTS.index(limb))
    others = TOUCHABLE[LIMBS.index(limb), solid.segments]
    spots, frames = np.zeros(len(values), np.intp), np.flatnonzero(np.isfinite(values))
    if len(joints) and others.any():
        some = diff.b[frames]
        for frame, x, ends in zip(frames.tolist(), some.positions, solid.posed(some), strict=True):
            spots[frame] = joints[distances(x[joints], ends[others], solid.radii[others])[0].argmin()]
    return spots
