"""The legs and arms of a tree of joints, found by bone lengths and the rest pose; names play no part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from distretarget.body.legs import SHORTEST_LIMB, Leg, alike, tree_legs
from distretarget.skeleton import Skeleton

FORK = 0.5  # a chain ends where a branch of this length leaves it: fingers, toes, face [lengths of the longest branch]
SHORTEST_FOREARM = 0.5  # the last bone of an arm with at least this length is the forearm [length of its longest bone]
FOREARM_RATIO = 0.9  # typical length of the forearm; real bodies have 0.55 to 1.2 [lengths of the upper arm]
ARM_RATIO = 0.6  # typical length from shoulder to wrist; real bodies have 0.53 to 0.67 [leg lengths]

# How unlike a human arm a limb is: the deviations of both ratios, as natural logarithms, plus these penalties.
TWIST_PENALTY = 0.05  # for a joint inside the upper arm or forearm
BEND_PENALTY = 0.3  # for a joint there at which the rest pose bends
NO_COLLAR_PENALTY = 0.3  # for an arm without a collar bone, if it has joints enough for one
UNLIKE = 1.2  # a limb with this sum or a larger one is not an arm

ARM_JOINTS = 3  # least number of joints of an arm: shoulder, elbow, wrist
STRAIGHT = np.radians(10)  # the rest pose bends by less than this at joints inside a bone of the body [rad]
SHORTEST_SHIN = 0.1  # a shorter bone above the end of the leg is part of the foot [leg lengths]


@dataclass(frozen=True, kw_only=True)
class Limb:
    """The joints of an arm or a leg.

    Attributes:
        collar: the joints between trunk and upper arm, from the trunk outwards; empty for a leg.
        upper: the upper end of the upper arm or thigh.
        lower: the elbow or knee.
        end: the wrist or ankle.
        length: length from `upper` to `end` [file units].
    """

    collar: tuple[int, ...]
    upper: int
    lower: int
    end: int
    length: float


LimbPair = tuple[Limb, Limb]


def find_limbs(skeleton: Skeleton) -> tuple[LimbPair, LimbPair] | None:
    """Return the two legs and the two arms; None unless the skeleton has both."""
    legs = tree_legs(skeleton)
    if legs is None:
        return None
    a, b = (_leg(skeleton, leg, other) for leg, other in (legs, legs[::-1]))
    arms = _find_arms(skeleton, (a, b)) if a and b else None
    return ((a, b), arms) if a and b and arms else None


def like_chains(skeleton: Skeleton, tops: Sequence[int]) -> list[tuple[list[int], list[int]]]:
    """Return the pairs of chains, each from one of the joints `tops` down, whose bones have about equal lengths.

    One chain of a pair may be longer, as an arm that holds a sword; the joints that only it has are left out.
    """
    chains = [chain for top in tops if (chain := _chain(skeleton, top))]
    pairs = [
        (a[: len(b)], b[: len(a)])
        for a, b in combinations(chains, 2)
        if len(a) == len(b) or min(len(a), len(b)) >= ARM_JOINTS
    ]
    return [(a, b) for a, b in pairs if alike(skeleton.lengths[a], skeleton.lengths[b])]


def forks(skeleton: Skeleton, joint: int) -> bool:
    """Return whether two branches of comparable length leave a joint."""
    *_, second, longest = sorted([0.0, 0.0, *(_reach(skeleton, child) for child in skeleton.children[joint])])
    return second > 0 and second >= FORK * longest


def _leg(skeleton: Skeleton, leg: Leg, other: Leg) -> Limb | None:
    """The leg with its knee, which is the joint nearest to the middle of the leg; None for a leg of one bone."""
    hip = _hip(skeleton, leg, other)
    up = skeleton.line(leg.ankle)
    joints = up[up.index(hip) :: -1]
    from_hip = skeleton.path_lengths[hip]
    while len(joints) > 3 and (
        skeleton.end_sites[joints[-1]] or skeleton.lengths[joints[-1]] < SHORTEST_SHIN * from_hip[joints[-1]]
    ):
        joints.pop()
    if len(joints) < 3:
        return None
    length = float(from_hip[joints[-1]])
    knee = min(joints[1:-1], key=lambda joint: abs(2 * from_hip[joint] - length))
    return Limb(collar=(), upper=hip, lower=knee, end=joints[-1], length=length)


def _hip(skeleton: Skeleton, leg: Leg, other: Leg) -> int:
    """The upper end of the thigh: from `leg.hip` up past twist joints, the first joint at which the rest pose bends."""
    trunk = skeleton.line(other.hip)
    for joint in skeleton.line(leg.hip):
        if joint in trunk or not skeleton.lengths[joint]:
            break
        if _bends(skeleton, joint, leg.ankle):
            return joint
    return leg.hip


def _bends(skeleton: Skeleton, joint: int, below: int) -> bool:
    """Whether the rest pose bends at a joint, between its own bone and the line to a joint below it."""
    bone, onward = skeleton.offsets[joint], skeleton.rest_positions[below] - skeleton.rest_positions[joint]
    return bool(bone @ onward < np.cos(STRAIGHT) * np.linalg.norm(bone) * np.linalg.norm(onward))


def _find_arms(skeleton: Skeleton, legs: LimbPair) -> LimbPair | None:
    """The pair of like limbs above the legs with the most arm-like proportions; None where no pair is arm-like."""
    leg = (legs[0].length + legs[1].length) / 2
    barred = {j for hip in legs for j in (*skeleton.line(hip.upper), *skeleton.subtree(hip.upper))}
    joints = [joint for joint in range(len(skeleton)) if joint not in barred]
    pairs = [pair for joint in joints for pair in like_chains(skeleton, skeleton.children[joint])]
    long = [(a, b) for a, b in pairs if len(a) >= ARM_JOINTS and skeleton.lengths[a].sum() >= SHORTEST_LIMB * leg]
    unlike, parts, a, b = min(((*_best_arm(skeleton, a, leg), a, b) for a, b in long), default=(np.inf, (), [], []))
    return (_arm(skeleton, a, *parts), _arm(skeleton, b, *parts)) if unlike < UNLIKE else None


def _best_arm(skeleton: Skeleton, chain: list[int], leg: float) -> tuple[float, tuple[int, ...]]:
    """The places of shoulder, elbow and wrist in a chain that make it most like a human arm, after how unlike it is."""
    along = skeleton.path_lengths[chain[0], chain]
    bones = np.diff(along)
    last_long = int(np.flatnonzero(bones >= SHORTEST_FOREARM * bones.max())[-1]) + 1
    wrist = len(chain) - 1 if forks(skeleton, chain[-1]) else max(last_long, ARM_JOINTS - 1)
    inner = np.array([BEND_PENALTY if _bends(skeleton, a, b) else TWIST_PENALTY for a, b in pairwise(chain)])
    best = (np.inf, (0, 1, wrist))
    for upper, lower in combinations(range(wrist), 2):
        unlike = _unlikeness(along[[upper, lower, wrist]], leg) + inner[upper + 1 : wrist].sum() - inner[lower]
        no_collar = NO_COLLAR_PENALTY if upper == 0 and wrist >= ARM_JOINTS else 0.0
        best = min(best, (unlike + no_collar, (upper, lower, wrist)))
    return best


def _unlikeness(along: NDArray[np.float64], leg: float) -> float:
    """How far the proportions of an arm are from human ones, 0 or more, on a body with legs of length `leg`.

    `along` has the distances of shoulder, elbow and wrist from the arm's first joint, along the bones [file units].
    """
    upper, fore = np.diff(along)
    if min(upper, fore) <= 0:
        return np.inf
    return float(abs(np.log(fore / (FOREARM_RATIO * upper))) + abs(np.log((upper + fore) / (ARM_RATIO * leg))))


def _arm(skeleton: Skeleton, chain: list[int], upper: int, lower: int, end: int) -> Limb:
    length = float(skeleton.path_lengths[chain[upper], chain[end]])
    return Limb(collar=tuple(chain[:upper]), upper=chain[upper], lower=chain[lower], end=chain[end], length=length)


def _chain(skeleton: Skeleton, top: int) -> list[int]:
    """The joints from `top` down the longest branch to where it forks or ends, without End Sites."""
    chain: list[int] = []
    below: int | None = top
    while below is not None and not skeleton.end_sites[below]:
        chain.append(below)
        children = () if forks(skeleton, below) else skeleton.children[below]
        below = max(children, key=lambda child: _reach(skeleton, child), default=None)
    return chain


def _reach(skeleton: Skeleton, joint: int) -> float:
    """The distance from a joint's parent to the farthest leaf below the joint, along the bones [file units]."""
    return float(skeleton.lengths[joint] + skeleton.path_lengths[joint, skeleton.subtree(joint)].max())
