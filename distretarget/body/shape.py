"""The anatomy of a skeleton, recognised by its tree, bone lengths and postures, without names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, pairwise, takewhile
from typing import NamedTuple

import numpy as np

from distretarget.body.anatomy import SIDES, Anatomy, trunk_roles
from distretarget.body.axes import FOLDED, STRETCHED, Directions, direction, perpendicular
from distretarget.body.limbs import (
    SHORTEST_LIMB,
    STRAIGHT,
    Leg,
    are_alike,
    is_bend,
    limb_length,
    longest_limbs,
    tree_legs,
)
from distretarget.numerics.vectors import Array, cross, lengths, normalised
from distretarget.skeleton import Skeleton

FORK = 0.5  # a chain ends where a branch of this length leaves it: fingers, toes, face [lengths of the longest branch]
MOST_FRAMES = 500  # up to so many frames of a motion, evenly spread, show which bones are in line
BENDING = 0.01  # bones bend in a motion if the angle between two changes by more than this [cosine]
RIGID = np.radians(1)  # two bones are in line in all frames if they never bend by more than this [rad]
SHORTEST_SHIN = 0.1  # a shorter bone above the end of the leg is part of the foot [leg lengths]
SHORTEST_FOREARM = 0.5  # the last bone of an arm with at least this length is the forearm [length of its longest bone]
FOREARM_RATIO = 0.9  # typical length of the forearm; real bodies have 0.55 to 1.2 [lengths of the upper arm]
ARM_RATIO = 0.6  # typical length from shoulder to wrist; real bodies have 0.53 to 0.67 [leg lengths]
MOST_JOINTS = 32  # of a chain that may be an arm; twists and collar bones included, real ones have up to about ten
ARM_JOINTS = 3  # least number of joints of an arm: shoulder, elbow, wrist

# How unlike a human arm a limb is: the deviations of both ratios, as natural logarithms, plus these penalties.
TWIST_PENALTY = 0.05  # for a joint inside the upper arm or forearm
BEND_PENALTY = 0.3  # for a joint there at which the rest pose bends
NO_COLLAR_PENALTY = 0.3  # for an arm without a collar bone, if it has joints enough for one
UNLIKE = 1.2  # a limb with at least this sum is not an arm

LONGEST_NECK = 0.17  # a longer bone above the spine belongs to the head [leg lengths]
NECK_RISE = 0.3  # a neck bone rises by at least this, a jaw by less [lengths of the bone]
COLLAR_TO_HEAD = 0.25  # collar bones that branch off nearer to the head than this do so from the neck [leg lengths]
CLEAR_FRONT = 0.3  # a direction shows the front if its mean cosine with the front or back is larger than this [cosine]
SLIGHT = 0.05  # vectors shorter than this on average show nothing [leg lengths]


class LimbChain(NamedTuple):
    """The joints of an arm or a leg."""

    collar: tuple[int, ...]  # the joints between trunk and upper arm, from the trunk outwards; empty for a leg
    upper: int  # the upper end of the upper arm or thigh
    lower: int  # the elbow or knee
    end: int  # the wrist or ankle
    length: float  # length from `upper` to `end` [file units]


LimbPair = tuple[LimbChain, LimbChain]


def by_shape(skeleton: Skeleton, positions: Array | None = None) -> Anatomy | None:
    """Return the anatomy that tree, bone lengths and posture show; None where they show no human body.

    The posture is the rest pose if a person can stand in it, else those of a motion: `positions`, (frames, joints, 3).
    The feet show which side is left; else the knees, which bend forwards; else the direction in which the body walks.
    If none of them does, left is the side that comes first in the file.
    """
    if positions is not None and len(positions):
        skeleton = _as_shown(skeleton, positions[:: -(-len(positions) // MOST_FRAMES)])
    return _by_shape(skeleton, positions)


def _as_shown(skeleton: Skeleton, positions: Array) -> Skeleton:
    """A skeleton in the most stretched frame of a motion, if two bones that are in line in all frames, while others
    bend, are not in the rest pose, which then shows no body; else as it is.
    """
    lower = np.flatnonzero(skeleton.parents > 0)
    middle = skeleton.parents[lower]
    places = np.concatenate([skeleton.rest_positions[None], positions])
    bones = places[:, lower] - places[:, middle], places[:, middle] - places[:, skeleton.parents[middle]]
    cosines = (normalised(bones[0]) * normalised(bones[1])).sum(axis=-1)
    in_line = (cosines[0] < np.cos(STRAIGHT)) & (cosines[1:] > np.cos(RIGID)).all(axis=0)
    if not in_line.any() or np.ptp(cosines[1:], axis=0).max() < BENDING:
        return skeleton
    stretched = positions[np.argmax(lengths(bones[0] + bones[1])[1:].sum(axis=1))]
    offsets = stretched - stretched[skeleton.parents]
    return skeleton.with_offsets(np.vstack([skeleton.offsets[:1], offsets[1:]]))


def _by_shape(skeleton: Skeleton, positions: Array | None) -> Anatomy | None:
    """The anatomy by `by_shape`, with bends of limbs as the rest pose shows them."""
    legs = _find_legs(skeleton)
    arms = _find_arms(skeleton, legs) if legs else None
    if legs is None or arms is None:
        return None
    limbs = Anatomy(roles=_roles(legs, arms), spine=(), neck=(), convention="", method="shape")
    moving = Directions(limbs, np.empty((0, len(skeleton), 3)) if positions is None else positions)
    standing = _standing(Directions(limbs, skeleton.rest_positions[None]), moving)
    trunk = _trunk(skeleton, legs, arms, _heights(skeleton, legs, standing)) if standing else None
    if standing is None or trunk is None:
        return None
    hips, spine, neck, head = trunk
    x = standing.positions
    across, apart = (x[:, a.upper] - x[:, b.upper] for a, b in (legs, arms))
    arms = arms[::-1] if (across * apart).sum() < 0 else arms
    if not _left_is_first(skeleton, legs, standing, moving):
        legs, arms = legs[::-1], arms[::-1]
    roles = trunk_roles(hips, spine, neck, head) | _roles(legs, arms)
    for side, leg, arm in zip(SIDES, legs, arms, strict=True):
        roles |= {f"{side}Toes": joint for joint in _onward(skeleton, leg.end)}  # none where each toe has its own
        roles |= {f"{side}Shoulder": joint for joint in _collar(skeleton, arms, arm, x)}
    if any(skeleton.end_sites[joint] for joint in roles.values()):
        return None
    return replace(limbs, roles=roles, spine=spine, neck=neck)


def _roles(legs: LimbPair, arms: LimbPair) -> dict[str, int]:
    """The joints of the roles of limbs, given left before right."""
    roles: dict[str, int] = {}
    for side, leg, arm in zip(SIDES, legs, arms, strict=True):
        roles |= {f"{side}UpperLeg": leg.upper, f"{side}LowerLeg": leg.lower, f"{side}Foot": leg.end}
        roles |= {f"{side}UpperArm": arm.upper, f"{side}LowerArm": arm.lower, f"{side}Hand": arm.end}
    return roles


# ---- limbs


def _find_legs(skeleton: Skeleton) -> LimbPair | None:
    """The legs that the tree shows, from the hip joints to the ankles."""
    if not (legs := tree_legs(skeleton)):
        return None
    a, b = (_limb_of_leg(skeleton, leg, other) for leg, other in (legs, legs[::-1]))
    return (a, b) if a and b else None


def _limb_of_leg(skeleton: Skeleton, leg: Leg, other: Leg) -> LimbChain | None:
    """A leg from its topmost bend, past twist joints, with the knee nearest to its middle; None for one bone."""
    thigh, trunk = skeleton.to_root(leg.hip), skeleton.to_root(other.hip)
    above = [*takewhile(lambda joint: joint not in trunk and skeleton.lengths[joint] > 0, thigh)]
    hip = next((joint for joint in above if _is_bent(skeleton, joint, leg.ankle)), leg.hip)
    up = skeleton.to_root(leg.ankle)
    joints = up[up.index(hip) :: -1]
    from_hip, ends = skeleton.paths_from(hip), skeleton.end_sites
    while len(joints) > 3 and (ends[joints[-1]] or skeleton.lengths[joints[-1]] < SHORTEST_SHIN * from_hip[joints[-1]]):
        joints.pop()
    if len(joints) < 3:
        return None
    knee = min(range(1, len(joints) - 1), key=lambda k: abs(2 * from_hip[joints[k]] - from_hip[joints[-1]]))
    return _limb(skeleton, joints, 0, knee, len(joints) - 1)


def _find_arms(skeleton: Skeleton, legs: LimbPair) -> LimbPair | None:
    """The pair of like limbs above the legs with the most arm-like proportions; None where no pair is arm-like."""
    leg = (legs[0].length + legs[1].length) / 2
    barred = {j for hip in legs for j in (*skeleton.to_root(hip.upper), *skeleton.subtree(hip.upper))}
    joints = [joint for joint in range(len(skeleton)) if joint not in barred]
    pairs = [pair for joint in joints for pair in _like_chains(skeleton, skeleton.children[joint], ARM_JOINTS)]
    long = [(a, b) for a, b in pairs if skeleton.lengths[a].sum() >= SHORTEST_LIMB * leg]
    best = min(((*_best_arm(skeleton, a, leg), a, b) for a, b in long), default=None)
    if best is None or best[0] >= UNLIKE:
        return None
    _, places, *chains = best
    a, b = (_limb(skeleton, chain, *places) for chain in chains)
    return a, b


def _limb(skeleton: Skeleton, chain: list[int], upper: int, lower: int, end: int) -> LimbChain:
    """The limb with its upper end, middle and lower end at these indices of a chain of joints."""
    length = float(skeleton.paths_from(chain[upper])[chain[end]])
    return LimbChain(tuple(chain[:upper]), chain[upper], chain[lower], chain[end], length)


def _is_bent(skeleton: Skeleton, joint: int, below: int) -> bool:
    """Whether the rest pose bends at a joint, between its own bone and the line to a joint below it."""
    x = skeleton.rest_positions
    return is_bend(skeleton.offsets[joint], x[below] - x[joint], STRAIGHT)


def _best_arm(skeleton: Skeleton, chain: list[int], leg: float) -> tuple[float, tuple[int, int, int]]:
    """How unlike a human arm a chain is, and the indices of shoulder, elbow and wrist in it for which it is least."""
    along = skeleton.paths_from(chain[0])[chain]
    bones = np.diff(along)
    last_long = int(np.flatnonzero(bones >= SHORTEST_FOREARM * bones.max())[-1]) + 1
    wrist = len(chain) - 1 if _forks(skeleton, chain[-1]) else max(last_long, ARM_JOINTS - 1)
    inner = np.array([BEND_PENALTY if _is_bent(skeleton, a, b) else TWIST_PENALTY for a, b in pairwise(chain)])
    best = (np.inf, (0, 1, wrist))
    for upper, lower in combinations(range(wrist), 2):
        unlike = _unlikeness(along[lower] - along[upper], along[wrist] - along[lower], leg)
        unlike += inner[upper + 1 : wrist].sum() - inner[lower]
        no_collar = NO_COLLAR_PENALTY if upper == 0 and wrist >= ARM_JOINTS else 0.0
        best = min(best, (unlike + no_collar, (upper, lower, wrist)))
    return best


def _unlikeness(upper: float, fore: float, leg: float) -> float:
    """How far an arm is from human proportions, by the lengths of upper arm, forearm and leg: 0 or more."""
    if min(upper, fore) <= 0:
        return np.inf
    return float(abs(np.log(fore / (FOREARM_RATIO * upper))) + abs(np.log((upper + fore) / (ARM_RATIO * leg))))


def _like_chains(skeleton: Skeleton, tops: Sequence[int], least: int = 1) -> list[tuple[list[int], list[int]]]:
    """The pairs of chains down from the joints `tops`, of at least `least` joints, with bones of about equal lengths.
    The longer chain of a pair, such as an arm that holds a sword, is cut to as many joints as the other.
    """
    inner = [top for top in tops if not skeleton.end_sites[top]]
    chains = [_chain(skeleton, top) for top in longest_limbs(skeleton, inner)] if len(inner) > 1 else []
    chains = [chain for chain in chains if len(chain) >= least]
    pairs = [(a, b) for a, b in combinations(chains, 2) if len(a) == len(b) or min(len(a), len(b)) >= ARM_JOINTS]
    equally_long = [(a[: len(b)], b[: len(a)]) for a, b in pairs]
    return [pair for pair in equally_long if are_alike(skeleton, *pair)]


def _chain(skeleton: Skeleton, top: int) -> list[int]:
    """The joints down the longest branch to where it forks or ends, `MOST_JOINTS` at most, without End Sites."""
    chain = [top]
    while len(chain) < MOST_JOINTS and (onward := _onward(skeleton, chain[-1])):
        chain += onward
    return chain


def _onward(skeleton: Skeleton, joint: int) -> list[int]:
    """The joint in which the longest branch below a joint begins; empty where it forks or ends in End Sites."""
    below = [] if _forks(skeleton, joint) else skeleton.children[joint]
    longest = max(below, key=partial(limb_length, skeleton), default=None)
    return [] if longest is None or skeleton.end_sites[longest] else [longest]


def _forks(skeleton: Skeleton, joint: int) -> bool:
    """Whether two branches of comparable length leave a joint."""
    *_, second, longest = sorted([0.0, 0.0, *(limb_length(skeleton, child) for child in skeleton.children[joint])])
    return second > 0 and second >= FORK * longest


def _collar(skeleton: Skeleton, arms: LimbPair, arm: LimbChain, posture: Array) -> list[int]:
    """The inner end of an arm's collar bone: the only candidate, or the outermost less than halfway to the shoulder."""
    if len(arm.collar) < 2:
        return list(arm.collar)
    x = posture if len(posture) else skeleton.rest_positions[None]
    a, b = ([*arm.collar, arm.upper] for arm in arms)
    apart = lengths(x[:, a] - x[:, b]).mean(axis=0)
    return [joint for joint, width in zip(arm.collar, apart, strict=False) if 2 * width < apart[-1]][-1:]


# ---- trunk


def _trunk(
    skeleton: Skeleton, legs: LimbPair, arms: LimbPair, heights: Array
) -> tuple[int, tuple[int, ...], tuple[int, ...], int] | None:
    """Hips, spine, neck and head; None without spine or head. The head's branch leaves the spine at or below the joint
    where the arms do, and is not one of a pair of like chains.
    """
    taken = {(*arm.collar, arm.upper)[0] for arm in arms}
    up = skeleton.to_root(int(skeleton.parents[min(taken)]))
    both_legs = skeleton.to_root(skeleton.common_ancestor(leg.upper for leg in legs))
    hips = next(joint for joint in up if joint in both_legs)
    for k, joint in enumerate(up[: up.index(hips)]):
        free = [child for child in skeleton.children[joint] if child not in taken and not skeleton.end_sites[child]]
        paired = {chain[0] for pair in _like_chains(skeleton, free) for chain in pair}
        branches = [child for child in free if child not in paired]
        if branches:
            first = max(branches, key=lambda child: heights[skeleton.subtree(child)].max())
            *neck, head = _neck(skeleton, first, heights, legs[0].length)
            spine = up[k : up.index(hips)][::-1]
            if not neck and len(spine) > 1 and skeleton.lengths[head] < COLLAR_TO_HEAD * legs[0].length:
                neck = [spine.pop()]
            return hips, tuple(spine), tuple(neck), head
        taken = {joint}
    return None


def _neck(skeleton: Skeleton, first: int, heights: Array, leg: float) -> list[int]:
    """The joints from the first of the neck up to the head, where the branch ends or forks into a face, or the next
    bone does not rise, or is longer than a neck bone and than its own End Sites.
    """
    neck = [first]
    while len(above := [child for child in skeleton.children[neck[-1]] if not skeleton.end_sites[child]]) == 1:
        length = skeleton.lengths[above[0]]
        ends = [skeleton.lengths[end] for end in skeleton.children[above[0]] if skeleton.end_sites[end]]
        rise = heights[above[0]] - heights[neck[-1]]
        if length > max(LONGEST_NECK * leg, *ends, 0.0) or rise < NECK_RISE * length:
            break
        neck += above
    return neck


# ---- postures; x are positions, (frames, joints, 3)


def _standing(rest: Directions, moving: Directions) -> Directions | None:
    """Rest pose or motion, whichever shows the body standing; no frames if neither does; None on all fours."""
    at_rest = float(rest.stretch[0])
    if at_rest > STRETCHED:
        return rest
    if len(moving.positions):
        return moving if np.percentile(moving.stretch, 99) > STRETCHED else None
    return moving if at_rest < FOLDED else None


def _heights(skeleton: Skeleton, legs: LimbPair, standing: Directions) -> Array:
    """(joints,), the mean heights of the joints; without a posture their path lengths from the hip [file units]."""
    if not len(standing.positions):
        return skeleton.paths_from(legs[0].upper)
    return np.asarray((standing.positions * -standing.legs[:, None]).sum(axis=-1).mean(axis=0))


def _left_is_first(skeleton: Skeleton, legs: LimbPair, standing: Directions, moving: Directions) -> bool:
    """Whether the first leg is the left one; true where nothing shows it."""
    feet = partial(_feet, skeleton)
    for postures, find in ((standing, feet), (moving, feet), (standing, _knees), (moving, _knees), (moving, _travel)):
        cosine = _agreement(find(legs, postures.positions), legs, postures)
        if abs(cosine) > CLEAR_FRONT:
            return cosine > 0
    return True


def _feet(skeleton: Skeleton, legs: LimbPair, x: Array) -> Array:
    """(frames, 3), the direction of the feet: from the ankles to the joints below, perpendicular to the shins."""
    feet = [_middle(x, skeleton.subtree(leg.end)) - x[:, leg.end] for leg in legs]
    shins = [direction(x, leg.end, leg.lower) for leg in legs]
    return np.asarray(sum(perpendicular(foot, shin) for foot, shin in zip(feet, shins, strict=True)))


def _knees(legs: LimbPair, x: Array) -> Array:
    """(frames, 3), the direction of the knees, from the middle between hip and ankle of each leg."""
    return np.asarray(sum(x[:, leg.lower] - _middle(x, [leg.upper, leg.end]) for leg in legs))


def _travel(legs: LimbPair, x: Array) -> Array:
    """(frames, 3), the movement of the hips in each frame, times the number of frames."""
    hips = _middle(x, [leg.upper for leg in legs])
    return len(x) * np.diff(hips, axis=0, prepend=hips[:1])


def _agreement(forward: Array, legs: LimbPair, postures: Directions) -> float:
    """The mean cosine of vectors (frames, 3) with the front if the first leg is the left one; 0 if too short."""
    x, up = postures.positions, -postures.legs
    front = normalised(cross(x[:, legs[0].upper] - x[:, legs[1].upper], up))
    total = lengths(perpendicular(forward, up)).sum()
    slight = SLIGHT * legs[0].length * len(x)
    return float((forward * front).sum() / total) if total > slight else 0.0


def _middle(x: Array, joints: list[int]) -> Array:
    """(frames, 3), the centre of some joints."""
    return np.asarray(x[:, joints].mean(axis=1))
