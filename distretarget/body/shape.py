"""The anatomy of a skeleton, recognised by its tree, bone lengths and postures; names play no part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import SIDES, Anatomy, spine_roles
from distretarget.body.axes import FOLDED, STRETCHED
from distretarget.body.limbs import Limb, LimbPair, find_limbs, forks, like_chains
from distretarget.numerics.vectors import cross, lengths, normalised
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

LONGEST_NECK = 0.17  # a longer bone above the spine belongs to the head [leg lengths]
NECK_RISE = 0.3  # a neck bone rises by at least this, a jaw by less [lengths of the bone]
COLLAR_TO_HEAD = 0.25  # collar bones that branch off nearer to the head than this do so from the neck [leg lengths]
CLEAR_FRONT = 0.3  # a direction shows which way is front if its mean cosine with it is larger than this [cosine]
SLIGHT = 0.05  # directions shorter than this on average show nothing [leg lengths]


def by_shape(skeleton: Skeleton, positions: Array | None = None) -> Anatomy | None:
    """Return the anatomy that tree, bone lengths and posture show; None where they show no human body.

    The posture is the rest pose if a person can stand in it, else those of a motion: `positions`, (frames, joints, 3).
    The feet show which side is left; else the knees, which bend forwards; else the direction in which the body walks.
    Where none of them does, left is the side that comes first in the file.
    """
    limbs = find_limbs(skeleton)
    if limbs is None:
        return None
    legs, arms = limbs
    moving = np.empty((0, len(skeleton), 3)) if positions is None else positions
    posture = _posture(skeleton, legs, arms, moving)
    trunk = None if posture is None else _trunk(skeleton, legs, arms, _heights(skeleton, legs, posture))
    if posture is None or trunk is None:
        return None
    roles = {"hips": trunk.hips, **spine_roles(trunk.spine), "head": trunk.head}
    if trunk.neck:
        roles["neck"] = trunk.neck[0]
    for side, leg, arm in zip(SIDES, *_sided(skeleton, legs, arms, posture, moving), strict=True):
        roles |= {f"{side}UpperLeg": leg.upper, f"{side}LowerLeg": leg.lower, f"{side}Foot": leg.end}
        roles |= {f"{side}UpperArm": arm.upper, f"{side}LowerArm": arm.lower, f"{side}Hand": arm.end}
        roles |= {f"{side}Toes": joint for joint in _toes(skeleton, leg)}
        roles |= {f"{side}Shoulder": joint for joint in _collar(skeleton, arms, arm, posture)}
    if any(skeleton.end_sites[joint] for joint in roles.values()):
        return None
    return Anatomy(roles=roles, spine=trunk.spine, neck=trunk.neck, convention="", method="shape")


@dataclass(frozen=True)
class _TrunkShape:
    hips: int
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    head: int


def _trunk(skeleton: Skeleton, legs: LimbPair, arms: LimbPair, heights: Array) -> _TrunkShape | None:
    """The trunk, from the joint where legs and spine part up to the head; None without spine or head.

    The head's branch leaves the spine at or below the joint where the arms do, and is not one of a pair of like chains.
    """
    taken = {(*arm.collar, arm.upper)[0] for arm in arms}
    up = skeleton.line(int(skeleton.parents[min(taken)]))
    both_legs = set(skeleton.line(legs[0].upper)) & set(skeleton.line(legs[1].upper))
    hips = next(joint for joint in up if joint in both_legs)
    for k, joint in enumerate(up[: up.index(hips)]):
        free = [child for child in skeleton.children[joint] if child not in taken and not skeleton.end_sites[child]]
        paired = {chain[0] for pair in like_chains(skeleton, free) for chain in pair}
        branches = [child for child in free if child not in paired]
        if branches:
            first = max(branches, key=lambda child: heights[skeleton.subtree(child)].max())
            *neck, head = _neck(skeleton, first, heights, legs[0].length)
            spine = up[k : up.index(hips)][::-1]
            if not neck and len(spine) > 1 and skeleton.lengths[head] < COLLAR_TO_HEAD * legs[0].length:
                neck = [spine.pop()]
            return _TrunkShape(hips, tuple(spine), tuple(neck), head)
        taken = {joint}
    return None


def _neck(skeleton: Skeleton, first: int, heights: Array, leg: float) -> list[int]:
    """The joints from the first of the neck up to the head.

    The head is where the branch ends or forks into a face, or where the next bone does not rise, or is longer than a
    neck bone and than its own End Sites.
    """
    neck = [first]
    while True:
        above = [child for child in skeleton.children[neck[-1]] if not skeleton.end_sites[child]]
        if len(above) != 1:
            return neck
        length = skeleton.lengths[above[0]]
        ends = [skeleton.lengths[end] for end in skeleton.children[above[0]] if skeleton.end_sites[end]]
        rise = heights[above[0]] - heights[neck[-1]]
        if length > max(LONGEST_NECK * leg, *ends, 0.0) or rise < NECK_RISE * length:
            return neck
        neck += above


def _collar(skeleton: Skeleton, arms: LimbPair, arm: Limb, posture: Array) -> list[int]:
    """The joint at the inner end of an arm's collar bone: the only candidate, or the last one that is less than halfway
    from the body's middle to the shoulder.
    """
    if len(arm.collar) < 2:
        return list(arm.collar)
    x = posture if len(posture) else skeleton.rest_positions[None]
    a, b = ([*arm.collar, arm.upper] for arm in arms)
    apart = lengths(x[:, a] - x[:, b]).mean(axis=0)
    return [joint for joint, width in zip(arm.collar, apart, strict=False) if 2 * width < apart[-1]][-1:]


def _toes(skeleton: Skeleton, leg: Limb) -> list[int]:
    """The joint of a foot's toes; empty where each toe has its own joint."""
    below = [] if forks(skeleton, leg.end) else list(skeleton.children[leg.end])
    longest = max(below, key=lambda joint: skeleton.path_lengths[leg.end, skeleton.subtree(joint)].max(), default=0)
    return [longest] if below and not skeleton.end_sites[longest] else []


def _posture(skeleton: Skeleton, legs: LimbPair, arms: LimbPair, moving: Array) -> Array | None:
    """(frames, joints, 3), the rest pose or the motion in which the body stands; no frames where neither shows it; None
    where they show a body on all fours.
    """
    rest = skeleton.rest_positions[None]
    at_rest = float(_stretch(rest, legs, arms)[0])
    if at_rest > STRETCHED:
        return rest
    if len(moving):
        return moving if np.percentile(_stretch(moving, legs, arms), 99) > STRETCHED else None
    return moving if at_rest < FOLDED else None


def _stretch(x: Array, legs: LimbPair, arms: LimbPair) -> Array:
    """(frames,), the angle between trunk and legs [degrees]: 180 for a person who stands."""
    trunk = _middle(x, [arm.upper for arm in arms]) - _middle(x, [leg.upper for leg in legs])
    cosine = -(normalised(trunk) * _up(x, legs)).sum(axis=-1)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _heights(skeleton: Skeleton, legs: LimbPair, posture: Array) -> Array:
    """(joints,), the mean heights of the joints; without a posture their path lengths from the hip [file units]."""
    if not len(posture):
        return np.asarray(skeleton.path_lengths[legs[0].upper])
    return np.asarray((posture * _up(posture, legs)[:, None]).sum(axis=-1).mean(axis=0))


def _sided(
    skeleton: Skeleton, legs: LimbPair, arms: LimbPair, posture: Array, moving: Array
) -> tuple[LimbPair, LimbPair]:
    """Legs and arms, left before right."""
    across, apart = (posture[:, a.upper] - posture[:, b.upper] for a, b in (legs, arms))
    if (across * apart).sum() < 0:
        arms = arms[::-1]
    for x, forward in (
        *((x, _feet(skeleton, legs, x)) for x in (posture, moving)),
        *((x, _knees(legs, x)) for x in (posture, moving)),
        (moving, _travel(legs, moving)),
    ):
        cosine = _agreement(forward, legs, x)
        if abs(cosine) > CLEAR_FRONT:
            return (legs, arms) if cosine > 0 else (legs[::-1], arms[::-1])
    return legs, arms


def _feet(skeleton: Skeleton, legs: LimbPair, x: Array) -> Array:
    """(frames, 3), the direction of the feet: from the ankles to the joints below, without the part along the shins."""
    feet = [_middle(x, skeleton.subtree(leg.end)) - x[:, leg.end] for leg in legs]
    shins = [normalised(x[:, leg.lower] - x[:, leg.end]) for leg in legs]
    return np.asarray(sum(_across(foot, shin) for foot, shin in zip(feet, shins, strict=True)))


def _knees(legs: LimbPair, x: Array) -> Array:
    """(frames, 3), the direction of the knees, from the middle between hip and ankle of each leg."""
    return np.asarray(sum(x[:, leg.lower] - _middle(x, [leg.upper, leg.end]) for leg in legs))


def _travel(legs: LimbPair, x: Array) -> Array:
    """(frames, 3), the movement of the hips in each frame, times the number of frames."""
    hips = _middle(x, [leg.upper for leg in legs])
    return len(x) * np.diff(hips, axis=0, prepend=hips[:1])


def _agreement(forward: Array, legs: LimbPair, x: Array) -> float:
    """The mean cosine, -1 to 1, between directions (frames, 3) and the front of a body whose first leg is the left one;
    0 where the directions are too short to show anything.
    """
    up = _up(x, legs)
    front = normalised(cross(x[:, legs[0].upper] - x[:, legs[1].upper], up))
    level = lengths(_across(forward, up)).sum()
    slight = SLIGHT * legs[0].length * len(x)
    return float((forward * front).sum() / level) if level > slight else 0.0


def _up(x: Array, legs: LimbPair) -> Array:
    """(frames, 3), unit vectors up the legs, from the middle of the ankles to the middle of the hip joints."""
    return normalised(_middle(x, [leg.upper for leg in legs]) - _middle(x, [leg.end for leg in legs]))


def _middle(x: Array, joints: list[int]) -> Array:
    return np.asarray(x[:, joints].mean(axis=1))


def _across(vectors: Array, axes: Array) -> Array:
    """The parts of vectors that are at right angles to unit vectors."""
    return np.asarray(vectors - (vectors * axes).sum(axis=-1, keepdims=True) * axes)
