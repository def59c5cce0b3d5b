"""Where limbs can touch a body: pairs of segments that are one place to be touched, and their gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.skin.capsules import SEGMENTS

IS_HARD = np.array(["hand" in name or "forearm" in name for name in SEGMENTS])  # these give way to nothing
APART = 0.03  # parts that are farther apart than this, 5 cm on an adult, do not touch [body units]


@dataclass(frozen=True, eq=False)
class Spots:
    """Where limbs can touch: segments of limbs, and the places that they touch. What is meant for a pair of segments is
    meant for all pairs of its spot, of which the nearest touches.
    """

    limbs: Numbers  # (spots,), the segment of the limb
    places: Numbers  # (spots,), the place
    of_pair: Numbers  # (pairs,), the spot of each pair of segments

    @classmethod
    def of(cls, limbs: Numbers, places: Numbers) -> Spots:
        """Return the spots of pairs, (pairs,), of segments of limbs and places."""
        both, of_pair = np.unique(np.stack([limbs, places]), axis=1, return_inverse=True)
        return cls(both[0], both[1], of_pair.ravel())

    def with_own(self, pairs: Numbers) -> Spots:
        """Return the spots with one more, of these pairs, (n,), which no longer belong to another."""
        of_pair, first = self.of_pair.copy(), self.of_pair[pairs[0]]
        of_pair[pairs] = len(self.limbs)
        return Spots(np.append(self.limbs, self.limbs[first]), np.append(self.places, self.places[first]), of_pair)

    @property
    def are_hard(self) -> Flags:
        """(spots,), whether the limb of each gives way to nothing."""
        return IS_HARD[self.limbs % len(SEGMENTS)]

    def least(self, gaps: Array) -> Array:
        """(frames, spots), the least of the gaps of each spot's pairs, (frames, pairs)."""
        least = np.full((len(gaps), len(self.limbs)), np.inf)
        for pair, spot in enumerate(self.of_pair):
            np.minimum(least[:, spot], gaps[:, pair], out=least[:, spot])
        return least


def of_pairs(gaps: Array, pairs: Numbers, wanted: Numbers) -> Array:
    """(frames, wanted pairs), the gaps of pairs, (frames, pairs); `APART` for those that are not there."""
    columns = {pair: column for column, pair in enumerate(map(tuple, pairs.tolist()))}
    found = np.array([columns.get(pair, -1) for pair in map(tuple, wanted.tolist())], np.intp)
    return np.take(np.pad(gaps, ((0, 0), (0, 1)), constant_values=APART), found, axis=1)
