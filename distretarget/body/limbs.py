"""The arms and legs of a body, and how far arms are raised, or hands in front of the body, in each frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from distretarget.body.anatomy import SIDES, Anatomy, Regions
from distretarget.body.axes import perpendicular
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, Flags, Numbers, angles_between, lengths, normalised
from distretarget.skeleton import Skeleton
from distretarget.skin.limbs import Limb

LIKENESS = 0.15  # two limbs are alike if their bone lengths differ by less than this [sum of the lengths of both]
SHORTEST_LIMB = 0.4  # least length of a limb [lengths of the longest pair of like limbs; for arms, of a leg]
MOST_LIMBS = 32  # of all limbs below a joint, only so many, the longest, may be arms and legs
STRAIGHT = np.radians(10)  # the rest pose bends by less than this at joints inside a bone of the body [rad]
JOINT_BEND = np.radians(30)  # the rest pose bends by more than this at most hip joints and ankles [rad]
SHORTEST_FOOT = 0.3  # the foot's first bone reaches at least this far [distance from the ankle to the end of the toes]
LOWEST_HIP = 0.3  # the hip joint is above this height [length of the leg's chain, from its top]
HIGHEST_ANKLE = 0.6  # the ankle is below this height [length of the leg's chain, from its top]
LOW_ANKLE = 0.2  # an ankle that bends is no higher than this over the leg's end [height of the hip over it]
# An arm hangs while the angles of shoulder and elbow add up to less than the first angle; it is raised or bent from
# the second one on [rad].
RELAXED, RAISED = np.radians(60), np.radians(100)
# A hand is beside the trunk up to the first angle from the shoulder line, and in front of or behind the trunk from
# the second one on. Hands of people who walk come near their bodies at angles up to 35 degrees [rad].
BESIDE, BEFORE = np.radians(35), np.radians(55)


@dataclass(frozen=True)
class Leg:
    """The joints of a leg."""

    hip: int  # the upper end of the thigh
    ankle: int  # the lower end of the shin
    toe: int  # the end of the foot's first bone; the ankle where there is no foot

    @property
    def joints(self) -> tuple[int, int, int]:
        """Hip, ankle and toe."""
        return self.hip, self.ankle, self.toe

    def foot_bends(self, skeleton: Skeleton) -> bool:
        """Return whether a joint turns the foot between ankle and toe, such as a ForeFoot right below the ankle."""
        return self.toe != self.ankle and skeleton.parents[self.toe] != self.ankle


Legs = tuple[Leg, Leg]


def find_legs(skeleton: Skeleton, anatomy: Anatomy | None) -> Legs | None:
    """Return the legs of the anatomy, else of the tree (`tree_legs`), left first if sides are known; None without."""
    if anatomy is None:
        return tree_legs(skeleton)
    hips, ankles = anatomy.pair("UpperLeg"), anatomy.pair("Foot")
    if not hips or not ankles:
        return None
    feet = [foot_bone(skeleton, anatomy, side) for side in SIDES]
    left, right = (Leg(hip, *(foot or (ankle, ankle))) for hip, ankle, foot in zip(hips, ankles, feet, strict=True))
    return left, right


def foot_bone(skeleton: Skeleton, anatomy: Anatomy, side: str) -> tuple[int, int] | None:
    """Return the ankle and the joint to which the foot points from there: the toes, else the joint farthest from it;
    joints too near to the ankle are skipped. None where there is no foot.
    """
    foot = anatomy.roles.get(f"{side}Foot")
    if foot is None:
        return None
    toes = anatomy.roles.get(f"{side}Toes")
    from_foot = skeleton.paths_from(foot)
    chains = [_longest_chain(skeleton, end) for end in (skeleton.children[foot] if toes is None else [toes])]
    chain = max(chains, key=lambda joints: from_foot[joints[-1]], default=[])
    places = skeleton.rest_positions
    reach = lengths(places[chain] - places[foot])  # straight, not along the bones: some End Sites lead back
    if not reach.any():
        return None
    return foot, chain[int(np.argmax(reach >= SHORTEST_FOOT * reach[-1]))]


def tree_legs(skeleton: Skeleton) -> Legs | None:
    """Return the two legs by the tree and its bone lengths, without names; None if there are none.

    A limb is the longest chain below a child of a joint; two below the same joint, of about equal bone lengths, are a
    pair. The legs are the pair that branches off nearest to the root, and of several there the longest. Pairs much
    shorter than the longest one (eyes, toes) do not count.
    """
    pairs = [pair for tops in skeleton.children if len(tops) > 1 for pair in _longest_pair(skeleton, tops)]
    longest = max((length for length, _, _ in pairs), default=0.0)
    limbs = [pair for pair in pairs if pair[0] >= SHORTEST_LIMB * longest]
    from_root = skeleton.paths_from(0)
    legs = min(limbs, key=lambda pair: (from_root[skeleton.parents[pair[1][0]]], -pair[0]), default=None)
    return (_leg(skeleton, legs[1]), _leg(skeleton, legs[2])) if legs else None


def _longest_pair(skeleton: Skeleton, tops: Sequence[int]) -> list[tuple[float, list[int], list[int]]]:
    """The length of the longest pair of like limbs below the joints `tops`, and the pair; empty if none are alike."""
    long = longest_limbs(skeleton, tops)
    for a in sorted(long, key=lambda top: -limb_length(skeleton, top)):
        for b in long[long.index(a) + 1 :]:
            if limbs := _like_limbs(skeleton, a, b):
                return [(float(skeleton.lengths[limbs[0]].sum()), *limbs)]
    return []


def _like_limbs(skeleton: Skeleton, a: int, b: int) -> tuple[list[int], list[int]] | None:
    """The limbs below two joints; None unless their bones have about equal lengths, and some length."""
    sizes, depths = [limb_length(skeleton, top) for top in (a, b)], skeleton.depths
    near = 2 * abs(sizes[0] - sizes[1]) <= 1.001 * LIKENESS * sum(sizes)  # a cheap test before the bones are compared
    if not near or len({int(depths[skeleton.farthest[top]] - depths[top]) for top in (a, b)}) > 1:
        return None
    one, other = _longest_chain(skeleton, a), _longest_chain(skeleton, b)
    long = all(leg_length(skeleton, [_leg(skeleton, chain)]) > 0 for chain in (one, other))
    return (one, other) if long and are_alike(skeleton, one, other) else None


def limb_length(skeleton: Skeleton, top: int) -> float:
    """Return the distance from a joint's parent to the farthest leaf below the joint, along the bones [file units]."""
    return float(skeleton.lengths[top] + skeleton.reach[top])


def longest_limbs(skeleton: Skeleton, tops: Sequence[int]) -> list[int]:
    """Return the first joints of the longest limbs, of the joints `tops`, `MOST_LIMBS` at most, in their order."""
    long = sorted(tops, key=lambda top: -limb_length(skeleton, top))[:MOST_LIMBS]
    return [top for top in tops if top in long]


def are_alike(skeleton: Skeleton, a: Sequence[int], b: Sequence[int]) -> bool:
    """Return whether the bones of two chains of joints have about equal lengths."""
    one, other = skeleton.lengths[[*a]], skeleton.lengths[[*b]]
    return len(a) == len(b) and bool(2 * np.abs(one - other).sum() <= LIKENESS * (one + other).sum())


def is_bend(bone: Array, onward: Array, angle: float) -> bool:
    """Return whether the directions of two vectors, (3,) each, differ by more than an angle [rad]."""
    return bool(bone @ onward < np.cos(angle) * np.linalg.norm(bone) * np.linalg.norm(onward))


def _longest_chain(skeleton: Skeleton, top: int) -> list[int]:
    """The joints from `top` down to the leaf that is farthest from it along the bones."""
    line = skeleton.to_root(skeleton.farthest.item(top))
    return line[line.index(top) :: -1]


def _leg(skeleton: Skeleton, chain: list[int]) -> Leg:
    """The leg in a chain of joints: from the bend at the hip to the bend at the ankle, or its first to its last long
    bone. A high bend, such as an animal's hock, is no ankle.
    """
    lengths = skeleton.lengths[chain]
    along = np.cumsum(lengths) / max(lengths.sum(), 1e-300)
    long = np.flatnonzero(2 * lengths[1:] >= lengths[1:].max(initial=0.0)) + 1
    if not len(long):
        return Leg(chain[0], chain[-1], chain[-1])
    bones = skeleton.offsets[chain]
    bent = [k for k in range(1, len(chain) - 1) if is_bend(bones[k], bones[k + 1], JOINT_BEND)]
    first = max([k for k in bent if along[k] < LOWEST_HIP], default=long[0] - 1)
    while first and len(long) == 1 and not is_bend(bones[first], bones[first + 1], STRAIGHT):
        first -= 1  # the only long bone is the shin, and the thigh is in pieces, as above a twist joint
    places = skeleton.rest_positions[chain]
    over = (places[-1] - places) @ (places[-1] - places[first])
    last = min([k for k in bent if along[k] > HIGHEST_ANKLE], default=0)
    last = last + int(np.argmax(over[last:] <= LOW_ANKLE * over[first])) if last else long[-1]
    return Leg(chain[first], chain[last], chain[min(last + 1, len(chain) - 1)])


def passing_regions(regions: Regions, legs: Legs | None) -> Flags:
    """Return which regions pass each other in a stride, (regions, regions): both feet, and both shins."""
    passing = np.zeros((len(regions.names),) * 2, bool)
    if legs:
        shins = [regions.names.index(name) for side in SIDES if (name := f"{side} shin") in regions.names]
        for pair in (regions.of_joint[[leg.ankle for leg in legs]].tolist(), shins):
            if len(set(pair)) == len(SIDES) and min(pair) >= 0:
                passing[pair, pair[::-1]] = True
    return passing


def leg_length(skeleton: Skeleton, legs: Sequence[Leg]) -> float:
    """Return the length of thigh and shin, the mean of the legs [file units]."""
    return float(np.mean([skeleton.paths_from(leg.hip)[leg.ankle] for leg in legs]))


def hanging_distances(hanging: Array, u: Numbers, v: Numbers, tau: Array) -> Array:
    """Return D of joints u and v over path lengths `tau`, (pairs,) each, while arms hang, with joints at `hanging`."""
    return lengths(hanging[u] - hanging[v]) / tau


def arm_raise(positions: Array, arm: Limb, hips: list[int], up: Array) -> Array:
    """Return how far an arm is raised or bent in each frame, (frames,): 0 while it hangs, 1 from the angle `RAISED` on.

    The angle is that of the upper arm from straight down, by gravity or along the trunk, whichever is less, plus that
    of the elbow. `positions`, (frames, joints, 3), are the body's; `hips` its hip joints; `up` the unit vector up.
    """
    upper = positions[:, arm.middle] - positions[:, arm.top]
    lower = positions[:, arm.end] - positions[:, arm.middle]
    angle = angles_between(upper, np.broadcast_to(-up, upper.shape))
    if hips:
        trunk = positions[:, hips].mean(axis=1) - positions[:, arm.top]
        angle = np.minimum(angle, angles_between(upper, trunk))
    return smoothstep((angle + angles_between(upper, lower) - RELAXED) / (RAISED - RELAXED))


def in_front_or_behind(positions: Array, hand: list[int], shoulders: list[int], hips: list[int]) -> Array:
    """Return how far a hand is in front of the trunk, or behind it, in each frame, (frames,): 0 beside the trunk, 1
    from the angle `BEFORE` on. `positions` are (frames, joints, 3); `hand` has the joints of the hand.
    """
    left, right = (positions[:, joint] for joint in shoulders)
    pelvis = positions[:, hips].mean(axis=1)
    along = normalised(0.5 * (left + right) - pelvis)
    off = perpendicular(positions[:, hand].mean(axis=1) - pelvis, along)
    across = angles_between(off, perpendicular(left - right, along))
    return smoothstep((np.minimum(across, np.pi - across) - BESIDE) / (BEFORE - BESIDE))
