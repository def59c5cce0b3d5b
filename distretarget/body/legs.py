"""What a tree of joints says about the body: where its legs are, which way is up, how tall it stands.

Nothing here looks at names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from distretarget.skeleton import Skeleton

LIKENESS = 0.15  # the two legs differ by at most this part of their length, summed over the bones
LIMB = 0.4  # a leg is at least this part of the longest pair of limbs
BEND = np.radians(30)  # thigh and hip, foot and shin of most rest poses meet at a larger angle
HIP, KNEE = 0.3, 0.6  # of a leg's chain: the hip joint is above the one, the ankle below the other


@dataclass(frozen=True)
class Leg:
    """The joints of a leg.

    Attributes:
        hip: where the thigh begins.
        ankle: where the shin ends.
        toe: where the foot's first bone ends; the ankle where there is no foot.
    """

    hip: int
    ankle: int
    toe: int


@lru_cache(maxsize=16)
def find_legs(skeleton: Skeleton) -> tuple[Leg, Leg] | None:
    """The two legs: of the pairs of like limbs, those that part nearest to the root; None where there are none.

    A limb is the longest chain below a child of the joint where the pair parts. Of pairs that part at the same place
    the longest counts, and pairs much shorter than the longest (eyes, toes) do not.
    """
    pairs = [pair for joint in range(len(skeleton)) for pair in _like_limbs(skeleton, joint)]
    if not pairs:
        return None
    longest = max(_length(skeleton, pair[0]) for pair in pairs)
    limbs = [pair for pair in pairs if _length(skeleton, pair[0]) >= LIMB * longest]
    from_root = skeleton.path_lengths[0]
    a, b = min(limbs, key=lambda pair: (from_root[skeleton.parents[pair[0][0]]], -_length(skeleton, pair[0])))
    return _leg(skeleton, a), _leg(skeleton, b)


def _like_limbs(skeleton: Skeleton, joint: int) -> list[tuple[list[int], list[int]]]:
    chains = [_longest_chain(skeleton, child) for child in skeleton.children[joint]]
    chains = [chain for chain in chains if leg_length(skeleton, (_leg(skeleton, chain),)) > 0]
    return [(a, b) for a, b in combinations(chains, 2) if alike(skeleton.lengths[a], skeleton.lengths[b])]


def alike(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Whether the bones of two chains have about equal lengths, (bones,) each."""
    return len(a) == len(b) and bool(2 * np.abs(a - b).sum() <= LIKENESS * (a + b).sum())


def _longest_chain(skeleton: Skeleton, top: int) -> list[int]:
    """The joints from `top` down to the leaf farthest from it."""
    leaf = max(skeleton.subtree(top), key=lambda joint: skeleton.path_lengths[top, joint])
    chain = [leaf]
    while chain[-1] != top:
        chain.append(int(skeleton.parents[chain[-1]]))
    return chain[::-1]


def _length(skeleton: Skeleton, chain: list[int]) -> float:
    return float(skeleton.lengths[chain].sum())


def _leg(skeleton: Skeleton, chain: list[int]) -> Leg:
    """The leg in a chain: from the bend at the hip to the bend at the ankle.

    Where the rest pose does not bend there, from the start of the first long bone to the end of the last.
    """
    lengths = skeleton.lengths[chain]
    along = np.cumsum(lengths) / max(lengths.sum(), 1e-300)
    long = np.flatnonzero(2 * lengths[1:] >= lengths[1:].max(initial=0.0)) + 1
    if not len(long):
        return Leg(chain[0], chain[-1], chain[-1])
    bent = [k for k in range(1, len(chain) - 1) if _bends(skeleton, chain, k)]
    first = max([k for k in bent if along[k] < HIP], default=long[0] - 1)
    last = min([k for k in bent if along[k] > KNEE], default=long[-1])
    return Leg(chain[first], chain[last], chain[min(last + 1, len(chain) - 1)])


def _bends(skeleton: Skeleton, chain: list[int], k: int) -> bool:
    a, b = skeleton.offsets[chain[k]], skeleton.offsets[chain[k + 1]]
    return bool(a @ b < np.cos(BEND) * np.linalg.norm(a) * np.linalg.norm(b))


def parting(skeleton: Skeleton, legs: tuple[Leg, Leg]) -> int:
    """The joint from which the legs part."""
    a, b = (set(skeleton.line(leg.hip)) for leg in legs)
    return max(a & b)


def leg_length(skeleton: Skeleton, legs: Sequence[Leg]) -> float:
    """Thigh and shin, the mean of the legs [file units]."""
    return float(np.mean([skeleton.path_lengths[leg.hip, leg.ankle] for leg in legs]))


def body_unit(skeleton: Skeleton) -> float:
    """Twice the leg length, which is about the height of a person; without legs the largest path length
    [file units].
    """
    legs = find_legs(skeleton)
    return 2.0 * leg_length(skeleton, legs) if legs else float(skeleton.path_lengths.max())


def up_axis(positions: NDArray[np.float64], legs: tuple[Leg, Leg]) -> NDArray[np.float64]:
    """(3,), the signed axis that points most from ankles to hips, over positions (frames, joints, 3)."""
    hips = positions[:, [leg.hip for leg in legs]]
    ankles = positions[:, [leg.ankle for leg in legs]]
    legs_up = (hips - ankles).mean(axis=(0, 1))
    axis = int(np.argmax(np.abs(legs_up)))
    up = np.zeros(3)
    up[axis] = 1.0 if legs_up[axis] >= 0 else -1.0
    return up


def height(skeleton: Skeleton) -> float:
    """How tall the rest pose stands: its extent along the axis of its legs, without legs its largest extent
    [file units].
    """
    legs = find_legs(skeleton)
    rest = skeleton.rest_positions
    if legs is None:
        return float(np.ptp(rest, axis=0).max())
    return float(np.ptp(rest @ up_axis(rest[None], legs)))
