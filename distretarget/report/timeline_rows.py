"""The rows of a player's timeline: contacts, supports, and skin that sinks in, with how far each is off in a frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.measure.contacts import CONTACT_DISTANCE
from distretarget.measure.diff import Diff
from distretarget.measure.figures import BY_KEY
from distretarget.numerics.time_series import spans_of
from distretarget.report.actors import packed

Array = NDArray[np.float64]
Kind = Literal["contact", "support", "skin"]
Point = tuple[int, int]
"""An actor of the page, and one of its joints."""

FAR = CONTACT_DISTANCE / 3  # a contact whose D is farther off than this is not kept well
SEEN = 0.3  # skin that is less deep inside than this is not shown [limits]
CODES = 254  # steps of how far something is off
LIMB_ROLES = {"hand": "Hand", "forearm": "LowerArm"}
# The kinds of the tracks that have a row for each part, and what is said of a part.
TRACKS: dict[str, tuple[Kind, str]] = {
    "skin_depth": ("skin", "{} inside"),
    "skin_gap": ("contact", "{} touching"),
    "foot_height": ("support", "{} on floor"),
    "support_height": ("support", "{} on floor"),
}


@dataclass(frozen=True, eq=False)
class Row:
    """Something that holds in some frames.

    Attributes:
        name: what it is, such as "left hand - right hip".
        kind: chooses its mark.
        values: (frames,), how far it is off, nan where it does not hold.
        limit: the value up to which nobody minds.
        unit: of these values.
        points: the joints between which its mark is, for each side of the page.
    """

    name: str
    kind: Kind
    values: Array
    limit: float
    unit: str
    points: Sequence[Sequence[Point]]

    @property
    def spans(self) -> list[list[int]]:
        """The first frame and the end of each time in which it holds."""
        return [[int(first), int(end)] for first, end in spans_of(np.isfinite(self.values))]

    @property
    def data(self) -> dict[str, Any]:
        """The row for the page: each frame is 0, or 1 and how far off it is, in `CODES` steps up to `top`."""
        top = max(3.0 * self.limit, float(np.nanmax(self.values)))
        codes = np.where(np.isfinite(self.values), 1 + np.rint(CODES * self.values / top), 0)
        frames = int(np.isfinite(self.values).sum())
        return {
            "name": self.name,
            "kind": self.kind,
            "unit": self.unit,
            "limit": self.limit,
            "top": top,
            "account": f"{frames} frames, at most {np.nanmax(self.values):.3g} {self.unit} off",
            "codes": packed(codes, "<u1"),
            "points": self.points,
        }


def rows_of(diff: Diff, actors: Sequence[int], prefix: str = "") -> list[Row]:
    """Return the rows of a diff, their names after a prefix; `actors` are the numbers of A and of all others, which
    have the joints of B.
    """
    rows = [*_contacts(diff, actors), *_tracks(diff, actors)]
    return [replace(row, name=prefix + row.name) for row in rows]


def _points(diff: Diff, joints: Sequence[int], actors: Sequence[int]) -> list[list[Point]]:
    first, *others = actors
    drivers = [int(diff.matching.drivers[joint]) for joint in joints]
    of_a = [(first, driver) for driver in drivers] if min(drivers) >= 0 else []
    return [of_a, *([(actor, joint) for joint in joints] for actor in others)]


def _contacts(diff: Diff, actors: Sequence[int]) -> Iterator[Row]:
    """A row for each two regions that touch in A."""
    contacts = diff.comparison.contacts
    for touch in contacts.touches:
        on = contacts.regions == contacts.candidates.names.index(touch.name)
        values = np.full(len(diff), np.nan)
        values[contacts.frame[on]] = contacts.error[on]
        yield Row(touch.name, "contact", values, FAR, "D", _points(diff, (touch.u, touch.v), actors))


def _tracks(diff: Diff, actors: Sequence[int]) -> Iterator[Row]:
    """A row for each part of what is measured of feet, other supports and skin."""
    anatomy, keys = diff.matching.target.anatomy, diff.b.skeleton.keys
    for key, (kind, text) in TRACKS.items():
        track, limit = diff.comparison.tracks[key], BY_KEY[key].limit
        assert limit is not None
        for column, part in enumerate(track.parts):
            values = np.full(len(diff), np.nan)
            if track.values.ndim == 2 and len(track.values):
                on = track.weights[:, column] > 0
                if kind == "skin":
                    on &= track.values[:, column] > SEEN * limit.margin
                values[: len(on)][on] = track.values[on, column]
            side, _, limb = part.partition(" ")
            joint = keys.index(part) if part in keys else None
            if joint is None and anatomy and limb in LIMB_ROLES:
                joint = anatomy.roles.get(side + LIMB_ROLES[limb])
            if joint is not None and np.isfinite(values).any():
                points = _points(diff, (joint,), actors)
                regions = diff.matching.regions
                name = part if limb in LIMB_ROLES else regions.names[regions.of_joint[joint]]
                yield Row(text.format(name), kind, values, limit.margin, BY_KEY[key].symbol, points)
