"""Contacts that a user drops in the frames of a clip."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Joints = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Drop:
    """A contact that does not count: between joints of the one part and joints of the other."""

    parts: tuple[Joints, ...]  # the target's joints of both
    frames: Flags  # (frames,)

    def of(self, a: Joints, b: Joints) -> Flags:
        """(pairs,), whether joints a and b are one of each part."""
        one, other = self.parts
        ways = ((one, other), (other, one))
        return np.asarray(np.any([np.isin(a, first) & np.isin(b, second) for first, second in ways], axis=0))


@dataclass(frozen=True, eq=False)
class Dropped:
    """The contacts that are dropped in a clip. Slicing selects frames."""

    drops: tuple[Drop, ...]

    def __getitem__(self, frames: slice) -> Dropped:
        return Dropped(tuple(replace(drop, frames=drop.frames[frames]) for drop in self.drops))

    def kept(self, a: Joints, b: Joints) -> Array | None:
        """(frames, pairs), 0 where the contact of joints a and b is dropped, else 1; None if none is."""
        dropped = [(drop, of) for drop in self.drops if (of := drop.of(a, b)).any() and drop.frames.any()]
        if not dropped:
            return None
        kept = np.ones((len(dropped[0][0].frames), len(a)))
        for drop, of in dropped:
            kept[np.ix_(drop.frames, of)] = 0.0
        return kept
