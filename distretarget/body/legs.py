"""The two legs of a body: by the parts of its anatomy, or by the tree of its joints alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import SIDES, Anatomy
from distretarget.skeleton import Skeleton

LIKENESS = 0.15  # the bone lengths of two like limbs differ by at most this part of their sum
LIMB = 0.4  # a leg is at least this part of the longest pair of like limbs
BEND = np.radians(30)  # hip and thigh, shin and foot of most rest poses meet at a larger angle [rad]
HIP, KNEE = 0.3, 0.6  # the hip joint lies above the one, the ankle below the other [part of the chain's length]


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

    @property
    def joints(self) -> tuple[int, int, int]:
        """Hip, ankle and toe."""
        return self.hip, self.ankle, self.toe


Legs = tuple[Leg, Leg]


def find_legs(skeleton: Skeleton, anatomy: Anatomy | None) -> Legs | None:
    """The two legs of a body, left before right where sides are known; None where it has none.

    The anatomy decides where there is one, else the tree.
    """
    return tree_legs(skeleton) if anatomy is None else _legs_of_anatomy(skeleton, anatomy)


def _legs_of_anatomy(skeleton: Skeleton, anatomy: Anatomy) -> Legs | None:
    ends = {side + part for side in SIDES for part in ("UpperLeg", "Foot")}
    if not ends <= anatomy.roles.keys():
        return None
    left, right = (_leg_of_anatomy(skeleton, anatomy, side) for side in SIDES)
    return left, right


def _leg_of_anatomy(skeleton: Skeleton, anatomy: Anatomy, side: str) -> Leg:
    ankle = anatomy.roles[f"{side}Foot"]
    foot = foot_bone(skeleton, anatomy, side)
    return Leg(anatomy.roles[f"{side}UpperLeg"], ankle, foot[1] if foot else ankle)


def foot_bone(skeleton: Skeleton, anatomy: Anatomy, side: str) -> tuple[int, int] | None:
    """The joints from which to which a foot points: the ankle, and the toes or what ends the foot; None without."""
    foot = anatomy.roles.get(f"{side}Foot")
    if foot is None:
        return None
    ends = [anatomy.roles.get(f"{side}Toes", -1), *skeleton.children[foot]]
    long = [end for end in ends if end >= 0 and skeleton.path_lengths[foot, end] > 0]
    return (foot, long[0]) if long else None


def tree_legs(skeleton: Skeleton) -> Legs | None:
    """The two legs as the tree and its bone lengths show them; None where they show none. Names play no part.

    Of all pairs of like limbs the legs part nearest to the root. A limb is the longest chain below a child of the joint
    where the pair parts. Of pairs that part at the same place the longest counts, and pairs much shorter than the
    longest (eyes, toes) do not.
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


def pelvis_joint(skeleton: Skeleton, legs: Legs) -> int:
    """The joint from which the legs part."""
    a, b = (set(skeleton.line(leg.hip)) for leg in legs)
    return max(a & b)


def leg_length(skeleton: Skeleton, legs: Sequence[Leg]) -> float:
    """Thigh and shin, the mean of the legs [file units]."""
    return float(np.mean([skeleton.path_lengths[leg.hip, leg.ankle] for leg in legs]))
