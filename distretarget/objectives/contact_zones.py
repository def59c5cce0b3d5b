"""Contact zones, where limbs can touch a body: segment pairs that count as one contact, and their gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.skin.capsules import SEGMENTS

IS_HARD = np.array(["hand" in name or "forearm" in name for name in SEGMENTS])  # these do not yield
APART = 0.03  # parts that are farther apart than this, 5 cm on an adult, do not touch [body units]


@dataclass(frozen=True, eq=False)
class ContactZones:
    """A zone is a segment of a limb and a group of segments that it can touch (`capsules.GROUPS`). All segment pairs of
    a zone make one contact, at the pair with the least gap.
    """

    limbs: Numbers  # (zones,), the segment of the limb
    groups: Numbers  # (zones,), the group that it can touch
    of_pair: Numbers  # (pairs,), the zone of each segment pair

    @classmethod
    def of(cls, limbs: Numbers, groups: Numbers) -> ContactZones:
        """Return the zones of segment pairs, given by the limb's segment and the other's group, (pairs,) each."""
        both, of_pair = np.unique(np.stack([limbs, groups]), axis=1, return_inverse=True)
        return cls(both[0], both[1], of_pair.ravel())

    def with_zone_of(self, pairs: Numbers) -> ContactZones:
        """Return the zones with a new one to which these pairs, (n,), move from their present zones."""
        of_pair, first = self.of_pair.copy(), self.of_pair[pairs[0]]
        of_pair[pairs] = len(self.limbs)
        limbs, groups = (np.append(each, each[first]) for each in (self.limbs, self.groups))
        return ContactZones(limbs, groups, of_pair)

    @property
    def are_hard(self) -> Flags:
        """(zones,), whether the limb of each is hard: a hand or a forearm."""
        return IS_HARD[self.limbs % len(SEGMENTS)]

    def least(self, gaps: Array) -> Array:
        """(frames, zones), the least gap of each zone, of the gaps of pairs, (frames, pairs)."""
        least = np.full((len(gaps), len(self.limbs)), np.inf)
        for pair, zone in enumerate(self.of_pair):
            np.minimum(least[:, zone], gaps[:, pair], out=least[:, zone])
        return least


def gaps_of_pairs(gaps: Array, pairs: Numbers, wanted: Numbers) -> Array:
    """(frames, wanted pairs), the gaps of wanted pairs, from those of pairs, (frames, pairs); `APART` if missing."""
    columns = {pair: column for column, pair in enumerate(map(tuple, pairs.tolist()))}
    found = np.array([columns.get(pair, -1) for pair in map(tuple, wanted.tolist())], np.intp)
    return np.take(np.pad(gaps, ((0, 0), (0, 1)), constant_values=APART), found, axis=1)
