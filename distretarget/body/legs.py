"""The two legs of a body, found by its anatomy or, without one, by the tree of its joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import SIDES, Anatomy
from distretarget.skeleton import Skeleton

LIKENESS = 0.15  # largest difference between the bone lengths of two like limbs [sum of the lengths of both]
SHORTEST_LIMB = 0.4  # least length of a limb [lengths of the longest pair of like limbs; for arms, of a leg]
JOINT_BEND = np.radians(30)  # the rest pose bends by more than this at most hip joints and ankles [rad]
SHORTEST_FOOT = 0.3  # the foot's first bone reaches at least this far [length from the ankle to the end of the toes]
LOWEST_HIP = 0.3  # the hip joint is above this place [length of the leg's chain, from its top]
HIGHEST_ANKLE = 0.6  # the ankle is below this place [length of the leg's chain, from its top]


@dataclass(frozen=True)
class Leg:
    """The joints of a leg.

    Attributes:
        hip: the upper end of the thigh.
        ankle: the lower end of the shin.
        toe: the end of the foot's first bone; the ankle where there is no foot.
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
    """Return the two legs of a body, left before right where sides are known; None where it has none.

    They are found by the anatomy, and by the tree of joints where there is no anatomy.
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
    """Return the ankle, and the joint towards which the foot points from there: the toes, else what reaches
    farthest from the ankle; None without either. Toes right below the ankle are passed over for what follows.
    """
    foot = anatomy.roles.get(f"{side}Foot")
    if foot is None:
        return None
    toes = anatomy.roles.get(f"{side}Toes")
    chains = [_longest_chain(skeleton, end) for end in (skeleton.children[foot] if toes is None else [toes])]
    chain = max(chains, key=lambda joints: skeleton.path_lengths[foot, joints[-1]], default=[])
    if not chain or not skeleton.path_lengths[foot, chain[-1]] > 0:
        return None
    reach = skeleton.path_lengths[foot, chain]
    return foot, chain[int(np.argmax(reach >= SHORTEST_FOOT * reach[-1]))]


def tree_legs(skeleton: Skeleton) -> Legs | None:
    """Return the two legs that the tree and its bone lengths show, whatever the names; None where they show none.

    Of all pairs of like limbs, the legs are the pair that branches off nearest to the root, and of several that branch
    off there, the longest. A limb is the longest chain below a child of the joint where the pair branches off. Pairs
    much shorter than the longest one (eyes, toes) are left out.
    """
    pairs = [pair for joint in range(len(skeleton)) for pair in _like_limbs(skeleton, joint)]
    if not pairs:
        return None
    longest = max(_length(skeleton, pair[0]) for pair in pairs)
    limbs = [pair for pair in pairs if _length(skeleton, pair[0]) >= SHORTEST_LIMB * longest]
    from_root = skeleton.path_lengths[0]
    a, b = min(limbs, key=lambda pair: (from_root[skeleton.parents[pair[0][0]]], -_length(skeleton, pair[0])))
    return _leg(skeleton, a), _leg(skeleton, b)


def _like_limbs(skeleton: Skeleton, joint: int) -> list[tuple[list[int], list[int]]]:
    """The pairs of chains below a joint that have about equal bone lengths."""
    chains = [_longest_chain(skeleton, child) for child in skeleton.children[joint]]
    chains = [chain for chain in chains if leg_length(skeleton, (_leg(skeleton, chain),)) > 0]
    return [(a, b) for a, b in combinations(chains, 2) if alike(skeleton.lengths[a], skeleton.lengths[b])]


def alike(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Return whether the bone lengths of two chains, (bones,) each, are about equal."""
    return len(a) == len(b) and bool(2 * np.abs(a - b).sum() <= LIKENESS * (a + b).sum())


def _longest_chain(skeleton: Skeleton, top: int) -> list[int]:
    """The joints from `top` down to the leaf that is farthest from it along the bones."""
    leaf = max(skeleton.subtree(top), key=lambda joint: skeleton.path_lengths[top, joint])
    chain = [leaf]
    while chain[-1] != top:
        chain.append(int(skeleton.parents[chain[-1]]))
    return chain[::-1]


def _length(skeleton: Skeleton, chain: list[int]) -> float:
    return float(skeleton.lengths[chain].sum())


def _leg(skeleton: Skeleton, chain: list[int]) -> Leg:
    """The leg in a chain of joints: from the bend at the hip to the bend at the ankle.

    Where the rest pose does not bend there, it is from the start of the first long bone to the end of the last one.
    """
    lengths = skeleton.lengths[chain]
    along = np.cumsum(lengths) / max(lengths.sum(), 1e-300)
    long = np.flatnonzero(2 * lengths[1:] >= lengths[1:].max(initial=0.0)) + 1
    if not len(long):
        return Leg(chain[0], chain[-1], chain[-1])
    bent = [k for k in range(1, len(chain) - 1) if _bends(skeleton, chain, k)]
    first = max([k for k in bent if along[k] < LOWEST_HIP], default=long[0] - 1)
    last = min([k for k in bent if along[k] > HIGHEST_ANKLE], default=long[-1])
    return Leg(chain[first], chain[last], chain[min(last + 1, len(chain) - 1)])


def _bends(skeleton: Skeleton, chain: list[int], k: int) -> bool:
    """Whether the rest pose bends at joint k of a chain."""
    a, b = skeleton.offsets[chain[k]], skeleton.offsets[chain[k + 1]]
    return bool(a @ b < np.cos(JOINT_BEND) * np.linalg.norm(a) * np.linalg.norm(b))


def pelvis_joint(skeleton: Skeleton, legs: Legs) -> int:
    """Return the joint where the legs branch off."""
    a, b = (set(skeleton.line(leg.hip)) for leg in legs)
    return max(a & b)


def leg_length(skeleton: Skeleton, legs: Sequence[Leg]) -> float:
    """Return the length of thigh and shin, the mean of the legs [file units]."""
    return float(np.mean([skeleton.path_lengths[leg.hip, leg.ankle] for leg in legs]))
