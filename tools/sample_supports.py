"""Places where parts of the body rest, the paths between these places, and the table of supports they make."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike
from sample_tracks import FPS, Track, bump, columns, eased, held

from distretarget.motion import Motion

FLOOR, WORLD = "floor", "world"
CLEARANCE = 1e-6  # a time so near a frame counts as that frame [frames]


@dataclass(frozen=True)
class Support:
    """A joint or End Site that stands still from frame `first` to frame `last`, both included.

    Attributes:
        kind: `FLOOR`, or `WORLD` for a wall or a rung.
    """

    joint: str
    first: int
    last: int
    kind: str


@dataclass(frozen=True)
class Sample:
    """A clip and all its supports."""

    motion: Motion
    supports: tuple[Support, ...]


@dataclass(frozen=True)
class Rest:
    """A place in the world [cm], and the time for which a hand or a foot rests there [s]."""

    start: float
    end: float
    place: ArrayLike


def supports(t: Track, joints: Iterable[str], rests: Iterable[Rest], kind: str = FLOOR) -> list[Support]:
    """The supports of these joints, which rest together; without rests shorter than two frames of the clip."""
    table = []
    for joint, rest in product(joints, rests):
        first = int(np.ceil(max(rest.start, 0.0) * FPS - CLEARANCE))
        last = int(np.floor(min(rest.end, t[-1]) * FPS + CLEARANCE))
        if first < last:
            table.append(Support(joint, first, last, kind))
    return table


def stepped(t: Track, rests: Sequence[Rest], arc: ArrayLike) -> Track:
    """(frames, 3), a path that stays at each place and moves on to the next; `arc` takes it off the straight line."""
    keys = [time for rest in rests for time in (rest.start, rest.end)]
    places = np.repeat([rest.place for rest in rests], 2, axis=0)
    path = columns(*(eased(t, keys, values) for values in places.T))
    for before, after in pairwise(rests):
        path += bump(t, before.end, after.start)[:, None] * np.asarray(arc)
    return path


def reached(t: Track, free: Track, rests: Iterable[Rest], *, approach: float, leave: float) -> Track:
    """(frames, 3), a path that follows `free` but for the rests, to which it takes `approach` and from which `leave`
    [s].
    """
    return free + sum(
        resting(t, rest, approach=approach, leave=leave)[:, None] * (np.asarray(rest.place) - free) for rest in rests
    )


def resting(t: Track, rest: Rest, *, approach: float, leave: float) -> Track:
    """1 during the rest, 0 until `approach` before and from `leave` after [s]."""
    return held(t, rest.start - approach, rest.start, rest.end, rest.end + leave)
