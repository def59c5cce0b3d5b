"""Feet of six shapes. Each function changes both feet of a body in T-pose; it stands on the floor only afterwards."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from distretarget.body.anatomy import SIDES
from distretarget.skeleton import Skeleton
from zoo.conventions import Naming
from zoo.tree import bare, places, roles, with_chain, with_end, with_offset

Foot = Literal["flat", "high ankle", "heel bone", "toes down", "no toe", "five toes"]

HIGH = np.radians(43)  # how far the foot bone of a high ankle points downwards [rad]
HEEL = -0.4  # the heel behind the ankle [lengths of the foot bone]
TOES = np.linspace(0.25, -0.25, 5)  # how far inwards, big toe first [lengths of the foot bone]
SOLE = 0.01  # height of the lowest joint of the feet over the floor [body heights]


def flat(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """The foot as it is: the ankle low over a flat sole."""
    return skeleton


def high_ankle(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """The foot bone steep and the toes flat, as in a shoe with a high heel."""
    for side in SIDES:
        toe = roles(skeleton)[f"{side}Toes"]
        skeleton = with_offset(skeleton, toe, skeleton.lengths[toe] * np.array([0.0, -np.sin(HIGH), np.cos(HIGH)]))
    return skeleton


def heel_bone(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """A joint at the heel, on the floor behind the ankle."""
    for side in SIDES:
        ankle, toe = _foot(skeleton, side)
        heel = (0.0, skeleton.offsets[toe, 1], HEEL * skeleton.lengths[toe])
        skeleton = with_chain(skeleton, ankle, {naming.of_part(side, "Heel"): heel}, end=None)
    return skeleton


def toes_down(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """Foot and toes in line with the shin, straight down."""
    offsets = np.array(skeleton.offsets)
    for side in SIDES:
        below = skeleton.subtree(_foot(skeleton, side)[0])[1:]
        offsets[below] = skeleton.lengths[below, None] * np.array([0.0, -1.0, 0.0])
    return skeleton.with_offsets(offsets)


def no_toe(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """The ankle the last joint, with an End Site at the place of the toe."""
    for side in SIDES:
        ankle, toe = _foot(skeleton, side)
        place = skeleton.offsets[toe]
        skeleton = with_end(bare(skeleton, ankle), roles(skeleton)[f"{side}Foot"], place)
    return skeleton


def five_toes(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """Five toes below the ball of the foot."""
    for side in SIDES:
        _, toe = _foot(skeleton, side)
        length, tip = skeleton.lengths[toe], skeleton.offsets[skeleton.children[toe][0]]
        inwards = -1.0 if side == "left" else 1.0
        skeleton = bare(skeleton, toe)
        for number, aside in enumerate(TOES, start=1):
            offset = tip * 0.2 + (inwards * aside * length, 0.0, 0.0)
            name = naming.of_part(side, f"ToePhalanx{number}")
            skeleton = with_chain(skeleton, roles(skeleton)[f"{side}Toes"], {name: offset}, end=0.8 * tip)
    return skeleton


def _foot(skeleton: Skeleton, side: str) -> tuple[int, int]:
    """Ankle and toe of a side."""
    joints = roles(skeleton)
    return joints[f"{side}Foot"], joints[f"{side}Toes"]


def standing(skeleton: Skeleton) -> Skeleton:
    """The body on the floor, by its root's OFFSET; the lowest joint of the feet just above the floor."""
    points = places(skeleton)
    height = np.ptp(points[:, 1])
    return with_offset(skeleton, 0, skeleton.offsets[0] + (0.0, SOLE * height - points[:, 1].min(), 0.0))


FEET: Mapping[Foot, Callable[[Skeleton, Naming], Skeleton]] = {
    "flat": flat,
    "high ankle": high_ankle,
    "heel bone": heel_bone,
    "toes down": toes_down,
    "no toe": no_toe,
    "five toes": five_toes,
}
