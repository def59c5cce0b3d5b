"""Which joint of a skeleton plays which part of a human body, as tree, bone lengths and posture tell.

Nothing here looks at names.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import SIDES, Anatomy, spine_roles
from distretarget.body.axes import FOLDED, STRETCHED
from distretarget.body.limbs import Limb, Pair, find_limbs, forks, like_chains
from distretarget.numerics.rotations import normalised
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

NECK_BONE = 0.17  # of the leg's length, at most; a longer bone up there is the head's
RISE = 0.3  # of a neck bone's length, at least; the jaw's is less
NECK = 0.25  # of the leg's length; collar bones that leave so near to the head leave from the neck
CLEAR = 0.3  # mean cosine from which a direction tells front from back
SLIGHT = 0.05  # of the leg's length; both feet or knees together point nowhere by less


def by_shape(skeleton: Skeleton, positions: Array | None = None) -> Anatomy | None:
    """The anatomy that tree, bone lengths and posture tell; None where this is no human body.

    The posture is the rest pose where a person can stand so, else that of a motion: `positions`, (frames, joints, 3).
    Feet tell which side is left, else knees, which bend forwards, else the way the body goes. Where nothing tells,
    left is the side that comes first in the file.
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
    return Anatomy(roles, trunk.spine, trunk.neck, "", "shape")


@dataclass(frozen=True)
class _Trunk:
    hips: int
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    head: int


def _trunk(skeleton: Skeleton, legs: Pair, arms: Pair, heights: Array) -> _Trunk | None:
    """From where legs and spine part up to the head; None without spine or head.

    The head's branch leaves the spine where the arms do or below, and no other branch there is like it.
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
            if not neck and len(spine) > 1 and skeleton.lengths[head] < NECK * legs[0].length:
                neck = [spine.pop()]
            return _Trunk(hips, tuple(spine), tuple(neck), head)
        taken = {joint}
    return None


def _neck(skeleton: Skeleton, first: int, heights: Array, leg: float) -> list[int]:
    """The joints from the neck's first up to the head: where the branch ends, forks into a face, or goes on with a bone
    that does not rise, or that is longer than a neck's and than what ends it.
    """
    neck = [first]
    while True:
        above = [child for child in skeleton.children[neck[-1]] if not skeleton.end_sites[child]]
        if len(above) != 1:
            return neck
        length = skeleton.lengths[above[0]]
        ends = [skeleton.lengths[end] for end in skeleton.children[above[0]] if skeleton.end_sites[end]]
        if length > max(NECK_BONE * leg, *ends, 0.0) or heights[above[0]] - heights[neck[-1]] < RISE * length:
            return neck
        neck += above


def _collar(skeleton: Skeleton, arms: Pair, arm: Limb, posture: Array) -> list[int]:
    """The joint from which an arm's collar bone goes: the only one, or the last that is nearer to the body's middle
    than halfway to the shoulder.
    """
    if len(arm.collar) < 2:
        return list(arm.collar)
    x = posture if len(posture) else skeleton.rest_positions[None]
    a, b = ([*arm.collar, arm.upper] for arm in arms)
    apart = np.linalg.norm(x[:, a] - x[:, b], axis=2).mean(axis=0)
    return [joint for joint, width in zip(arm.collar, apart, strict=False) if 2 * width < apart[-1]][-1:]


def _toes(skeleton: Skeleton, leg: Limb) -> list[int]:
    """The joint of a foot's toes; none where each toe has its own."""
    below = [] if forks(skeleton, leg.end) else list(skeleton.children[leg.end])
    longest = max(below, key=lambda joint: skeleton.path_lengths[leg.end, skeleton.subtree(joint)].max(), default=0)
    return [longest] if below and not skeleton.end_sites[longest] else []


def _posture(skeleton: Skeleton, legs: Pair, arms: Pair, moving: Array) -> Array | None:
    """(frames, joints, 3), the rest pose or a motion in which the body stands, no frame where neither tells; None where
    they tell that it goes on all fours.
    """
    rest = skeleton.rest_positions[None]
    at_rest = float(_stretch(rest, legs, arms)[0])
    if at_rest > STRETCHED:
        return rest
    if len(moving):
        return moving if np.percentile(_stretch(moving, legs, arms), 99) > STRETCHED else None
    return moving if at_rest < FOLDED else None


def _stretch(x: Array, legs: Pair, arms: Pair) -> Array:
    """(frames,), the angle between trunk and legs [degrees]: 180 for a person who stands."""
    trunk = _middle(x, [arm.upper for arm in arms]) - _middle(x, [leg.upper for leg in legs])
    cosine = -(normalised(trunk) * _up(x, legs)).sum(axis=-1)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _heights(skeleton: Skeleton, legs: Pair, posture: Array) -> Array:
    """(joints,), how high joints are on average, by path lengths from the hip where there is no posture."""
    if not len(posture):
        return np.asarray(skeleton.path_lengths[legs[0].upper])
    return np.asarray((posture * _up(posture, legs)[:, None]).sum(axis=-1).mean(axis=0))


def _sided(skeleton: Skeleton, legs: Pair, arms: Pair, posture: Array, moving: Array) -> tuple[Pair, Pair]:
    """Legs and arms, left before right."""
    across, apart = (posture[:, a.upper] - posture[:, b.upper] for a, b in (legs, arms))
    if (across * apart).sum() < 0:
        arms = arms[::-1]
    for x, forward in (
        *((x, _feet(skeleton, legs, x)) for x in (posture, moving)),
        *((x, _knees(legs, x)) for x in (posture, moving)),
        (moving, _course(legs, moving)),
    ):
        cosine = _agreement(forward, legs, x)
        if abs(cosine) > CLEAR:
            return (legs, arms) if cosine > 0 else (legs[::-1], arms[::-1])
    return legs, arms


def _feet(skeleton: Skeleton, legs: Pair, x: Array) -> Array:
    """(frames, 3), from the ankles to what is below them, across the shins: a foot that goes on along the shin points
    nowhere.
    """
    feet = [_middle(x, skeleton.subtree(leg.end)) - x[:, leg.end] for leg in legs]
    shins = [normalised(x[:, leg.lower] - x[:, leg.end]) for leg in legs]
    return np.asarray(sum(_across(foot, shin) for foot, shin in zip(feet, shins, strict=True)))


def _knees(legs: Pair, x: Array) -> Array:
    """(frames, 3), from between hips and ankles to the knees."""
    return np.asarray(sum(x[:, leg.lower] - _middle(x, [leg.upper, leg.end]) for leg in legs))


def _course(legs: Pair, x: Array) -> Array:
    """(frames, 3), by how much the hips move, times the number of frames."""
    hips = _middle(x, [leg.upper for leg in legs])
    return len(x) * np.diff(hips, axis=0, prepend=hips[:1])


def _agreement(forward: Array, legs: Pair, x: Array) -> float:
    """The mean cosine, -1 to 1, between directions (frames, 3) and the front of a body whose first leg is the left one;
    0 where they are slight.
    """
    up = _up(x, legs)
    front = normalised(np.cross(x[:, legs[0].upper] - x[:, legs[1].upper], up))
    level = np.linalg.norm(_across(forward, up), axis=-1).sum()
    slight = SLIGHT * legs[0].length * len(x)
    return float((forward * front).sum() / level) if level > slight else 0.0


def _up(x: Array, legs: Pair) -> Array:
    """(frames, 3), unit vectors from between the ankles to between the hips."""
    return normalised(_middle(x, [leg.upper for leg in legs]) - _middle(x, [leg.end for leg in legs]))


def _middle(x: Array, joints: list[int]) -> Array:
    return np.asarray(x[:, joints].mean(axis=1))


def _across(vectors: Array, axes: Array) -> Array:
    """What of vectors is at right angles to unit vectors."""
    return np.asarray(vectors - (vectors * axes).sum(axis=-1, keepdims=True) * axes)
