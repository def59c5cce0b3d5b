"""Joints that are no part of the body: twist joints, cloth, hair, a sword in the hand, and handles of an engine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np
import rig_bodies

from distretarget.body.anatomy import SIDES
from distretarget.skeleton import Skeleton
from zoo.conventions import Naming
from zoo.tree import places, roles, with_chain

Helper = Literal["twist", "sleeves", "skirt", "hair", "sword", "ik"]

TWISTED = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot"}
PANELS = 8  # of the skirt

# The joints of these roles, by the names of the handles' joints in `rig_bodies.UNREAL`.
HANDLED = {"foot_l": "leftFoot", "foot_r": "rightFoot", "hand_l": "leftHand", "hand_r": "rightHand"}


def twist(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """A joint in the middle of each long bone, which can take a share of its twist."""
    for side in SIDES:
        for part, end in TWISTED.items():
            joints = roles(skeleton)
            middle = 0.5 * skeleton.offsets[joints[side + end]]
            name = naming.of_part(side, f"{part}_Twist")
            skeleton = with_chain(skeleton, joints[side + part], {name: middle}, end=None)
    return skeleton


def sleeves(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """Two joints that hang from each forearm."""
    for side in SIDES:
        forearm = roles(skeleton)[f"{side}LowerArm"]
        down = (0.0, -0.4 * skeleton.lengths[forearm], 0.0)
        names = [naming.of_part(side, f"Sleeve{number}") for number in (1, 2)]
        skeleton = with_chain(skeleton, forearm, dict.fromkeys(names, down), end=down)
    return skeleton


def skirt(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """Chains of two joints that hang from the hips all around."""
    joints = roles(skeleton)
    thigh = skeleton.lengths[joints["leftLowerLeg"]]
    for panel in range(PANELS):
        angle = 2 * np.pi * panel / PANELS
        around = np.array([np.sin(angle), 0.0, np.cos(angle)])
        upper, lower = f"Skirt{panel}_1", f"Skirt{panel}_2"
        down = thigh * (0.1 * around + (0.0, -0.5, 0.0))
        skeleton = with_chain(skeleton, joints["hips"], {upper: 0.35 * thigh * around, lower: down}, end=down)
    return skeleton


def hair(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """A plait of three joints from the back of the head downwards."""
    head = roles(skeleton)["head"]
    size = skeleton.lengths[skeleton.children[head][0]]
    offsets = {"Hair1": (0.0, 0.6 * size, -0.5 * size), "Hair2": (0.0, -0.6 * size, -0.2 * size)}
    down = (0.0, -0.6 * size, 0.0)
    return with_chain(skeleton, head, {**offsets, "Hair3": down}, end=down)


def sword(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """A sword in the right hand that points forward."""
    joints = roles(skeleton)
    forearm = skeleton.lengths[joints["rightHand"]]
    grip = 0.3 * skeleton.offsets[joints["rightHand"]]
    return with_chain(skeleton, joints["rightHand"], {"Sword": grip}, end=(0.0, 0.0, 3.0 * forearm))


def ik(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """Handles of an engine below the root, at the places of hands and feet."""
    joints, points = roles(skeleton), places(skeleton)
    numbers, spots = {"root": 0}, {"root": points[0]}
    for name, parent, place in rig_bodies.UNREAL.handles:
        spots[name] = points[joints[HANDLED[place]]] if place in HANDLED else spots[place]
        numbers[name] = len(skeleton)
        skeleton = with_chain(skeleton, numbers[parent], {name: spots[name] - spots[parent]}, end=None)
    return skeleton


HELPERS: Mapping[Helper, Callable[[Skeleton, Naming], Skeleton]] = {
    "twist": twist,
    "sleeves": sleeves,
    "skirt": skirt,
    "hair": hair,
    "sword": sword,
    "ik": ik,
}
