"""What is asked for in the frames of a clip: contacts to drop, contacts to make, and directions to keep."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Drop:
    """A contact that does not count: between joints of the one part and joints of the other."""

    one: Flags  # (joints,), of the target
    other: Flags  # (joints,)
    frames: Flags  # (frames,)

    def of(self, a: NDArray[np.intp], b: NDArray[np.intp]) -> Flags:
        """(pairs,), whether joints a and b are one of each part."""
        return np.asarray((self.one[a] & self.other[b]) | (self.one[b] & self.other[a]))


@dataclass(frozen=True, eq=False)
class Touch:
    """Two parts whose skins are to be some gap apart."""

    one: Flags  # (joints,), of the target
    other: Flags  # (joints,)
    weight: Array  # (frames,), how far they are brought there, 0 to 1
    gap: float | None  # [body units]; None for the source's


@dataclass(frozen=True, eq=False)
class Asked:
    """What is asked for in a clip. Slicing selects frames."""

    drops: tuple[Drop, ...]
    touches: tuple[Touch, ...]

    def __getitem__(self, frames: slice) -> Asked:
        drops = (replace(drop, frames=drop.frames[frames]) for drop in self.drops)
        touches = (replace(touch, weight=touch.weight[frames]) for touch in self.touches)
        return Asked(tuple(drops), tuple(touches))

    def kept(self, a: NDArray[np.intp], b: NDArray[np.intp]) -> Array | None:
        """(frames, pairs), 0 where the contact of joints a and b is dropped, else 1; None if none is."""
        dropped = [(drop, of) for drop in self.drops if (of := drop.of(a, b)).any() and drop.frames.any()]
        if not dropped:
            return None
        kept = np.ones((len(dropped[0][0].frames), len(a)))
        for drop, of in dropped:
            kept[np.ix_(drop.frames, of)] = 0.0
        return kept
