"""The legs and arms of a tree of joints, by bone lengths.

Nothing here looks at names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from distretarget.body.legs import LIMB, Leg, alike, tree_legs
from distretarget.skeleton import Skeleton

FORK = 0.5  # a chain ends where another at least this part as long leaves it: fingers, toes, the face
LONG = 0.5  # the forearm is at least this part of the longest bone of an arm
FOREARM = 0.9  # of the upper arm's length; real bodies have 0.55 to 1.2
ARM_LENGTH = 0.6  # of the leg's length, from shoulder to wrist; real bodies have 0.53 to 0.67
TWIST = 0.05  # what a joint within the upper arm or the forearm adds to the logarithms of these ratios,
BENT = 0.3  # what one adds at which the rest pose bends,
BARE = 0.3  # what an arm adds that leaves no joint of its chain to the collar bone,
UNLIKE = 1.2  # and their sum from which a limb is no arm
ARM_JOINTS = 3  # at least: shoulder, elbow, wrist
STRAIGHT = np.radians(10)  # bones of one thigh meet at a smaller angle
SHIN = 0.1  # of the leg's length; a shorter bone above the ankle is part of the foot


@dataclass(frozen=True)
class Limb:
    """The joints of an arm or a leg.

    Attributes:
        collar: the joints between trunk and upper arm, from the trunk on; none for a leg.
        upper: where upper arm or thigh begins.
        lower: where forearm or shin begins.
        end: where it ends.
        length: from `upper` to `end` [file units].
    """

    collar: tuple[int, ...]
    upper: int
    lower: int
    end: int
    length: float


Pair = tuple[Limb, Limb]


def find_limbs(skeleton: Skeleton) -> tuple[Pair, Pair] | None:
    """The two legs and the two arms; None where there are no such pairs."""
    legs = tree_legs(skeleton)
    if legs is None:
        return None
    a, b = (_leg(skeleton, leg, other) for leg, other in (legs, legs[::-1]))
    arms = _find_arms(skeleton, (a, b)) if a and b else None
    return ((a, b), arms) if a and b and arms else None


def like_chains(skeleton: Skeleton, tops: Sequence[int]) -> list[tuple[list[int], list[int]]]:
    """The pairs among the chains below some joints whose bones have about equal lengths, one by one.

    A chain may go on longer than its like, as an arm does that holds a sword; what it has more is left out.
    """
    chains = [chain for top in tops if (chain := _chain(skeleton, top))]
    pairs = [
        (a[: len(b)], b[: len(a)])
        for a, b in combinations(chains, 2)
        if len(a) == len(b) or min(len(a), len(b)) >= ARM_JOINTS
    ]
    return [(a, b) for a, b in pairs if alike(skeleton.lengths[a], skeleton.lengths[b])]


def forks(skeleton: Skeleton, joint: int) -> bool:
    """Whether two chains of about equal length leave a joint."""
    *_, second, longest = sorted([0.0, 0.0, *(_reach(skeleton, child) for child in skeleton.children[joint])])
    return second > 0 and second >= FORK * longest


def _leg(skeleton: Skeleton, leg: Leg, other: Leg) -> Limb | None:
    """The leg with its knee, the joint nearest to its middle; None for a leg of one bone."""
    hip = _hip(skeleton, leg, other)
    up = skeleton.line(leg.ankle)
    joints = up[up.index(hip) :: -1]
    from_hip = skeleton.path_lengths[hip]
    while len(joints) > 3 and (
        skeleton.end_sites[joints[-1]] or skeleton.lengths[joints[-1]] < SHIN * from_hip[joints[-1]]
    ):
        joints.pop()
    if len(joints) < 3:
        return None
    length = float(from_hip[joints[-1]])
    knee = min(joints[1:-1], key=lambda joint: abs(2 * from_hip[joint] - length))
    return Limb((), hip, knee, joints[-1], length)


def _hip(skeleton: Skeleton, leg: Leg, other: Leg) -> int:
    """Where the thigh begins: above twist joints, at the first bend upwards, where the rest pose has one."""
    trunk = skeleton.line(other.hip)
    for joint in skeleton.line(leg.hip):
        if joint in trunk or not skeleton.lengths[joint]:
            break
        if _bends(skeleton, joint, leg.ankle):
            return joint
    return leg.hip


def _bends(skeleton: Skeleton, joint: int, below: int) -> bool:
    """Whether the rest pose bends at a joint, on the way to one below it."""
    bone, on = skeleton.offsets[joint], skeleton.rest_positions[below] - skeleton.rest_positions[joint]
    return bool(bone @ on < np.cos(STRAIGHT) * np.linalg.norm(bone) * np.linalg.norm(on))


def _find_arms(skeleton: Skeleton, legs: Pair) -> Pair | None:
    """Of the pairs of like limbs that part above the legs, the one most like human arms in its proportions."""
    leg = (legs[0].length + legs[1].length) / 2
    barred = {j for hip in legs for j in (*skeleton.line(hip.upper), *skeleton.subtree(hip.upper))}
    joints = [joint for joint in range(len(skeleton)) if joint not in barred]
    pairs = [pair for joint in joints for pair in like_chains(skeleton, skeleton.children[joint])]
    long = [(a, b) for a, b in pairs if len(a) >= ARM_JOINTS and skeleton.lengths[a].sum() >= LIMB * leg]
    unlike, parts, a, b = min(((*_best_arm(skeleton, a, leg), a, b) for a, b in long), default=(np.inf, (), [], []))
    return (_arm(skeleton, a, *parts), _arm(skeleton, b, *parts)) if unlike < UNLIKE else None


def _best_arm(skeleton: Skeleton, chain: list[int], leg: float) -> tuple[float, tuple[int, ...]]:
    """How unlike a human arm a chain is at best, and where in it shoulder, elbow and wrist are then."""
    along = skeleton.path_lengths[chain[0], chain]
    bones = np.diff(along)
    last_long = int(np.flatnonzero(bones >= LONG * bones.max())[-1]) + 1
    wrist = len(chain) - 1 if forks(skeleton, chain[-1]) else max(last_long, ARM_JOINTS - 1)
    inner = np.array([BENT if _bends(skeleton, a, b) else TWIST for a, b in pairwise(chain)])
    best = (np.inf, (0, 1, wrist))
    for upper, lower in combinations(range(wrist), 2):
        unlike = _unlikeness(along[[upper, lower, wrist]], leg) + inner[upper + 1 : wrist].sum() - inner[lower]
        bare = BARE if upper == 0 and wrist >= ARM_JOINTS else 0.0
        best = min(best, (unlike + bare, (upper, lower, wrist)))
    return best


def _unlikeness(along: NDArray[np.float64], leg: float) -> float:
    """Of an arm whose shoulder, elbow and wrist are so far along it to a human one, from 0 on."""
    upper, fore = np.diff(along)
    if min(upper, fore) <= 0:
        return np.inf
    return float(abs(np.log(fore / (FOREARM * upper))) + abs(np.log((upper + fore) / (ARM_LENGTH * leg))))


def _arm(skeleton: Skeleton, chain: list[int], upper: int, lower: int, end: int) -> Limb:
    length = float(skeleton.path_lengths[chain[upper], chain[end]])
    return Limb(tuple(chain[:upper]), chain[upper], chain[lower], chain[end], length)


def _chain(skeleton: Skeleton, top: int) -> list[int]:
    """The joints from `top` down the longest way, as far as it does not fork; End Sites are left out."""
    chain: list[int] = []
    below: int | None = top
    while below is not None and not skeleton.end_sites[below]:
        chain.append(below)
        children = () if forks(skeleton, below) else skeleton.children[below]
        below = max(children, key=lambda child: _reach(skeleton, child), default=None)
    return chain


def _reach(skeleton: Skeleton, joint: int) -> float:
    """How far the leaves below a joint are from its parent, along the bones."""
    return float(skeleton.lengths[joint] + skeleton.path_lengths[joint, skeleton.subtree(joint)].max())
