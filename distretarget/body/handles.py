"""The IK handles of a rig: joints that mark where hands and feet belong, and are not part of the body."""

from __future__ import annotations

import numpy as np

from distretarget.body.anatomy import Anatomy
from distretarget.body.joint_names import Side, stem_and_side, without_digits, words
from distretarget.body.regions import Regions
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

HANDLE_WORDS = frozenset(("ik", "vb"))  # the name of a handle has one of these words; "VB" marks Unreal's virtual bones
HANDLED_PARTS = ("Hand", "Foot", "Toes")  # the parts that have handles, by the ends of their roles

# Handles that are not named for a joint, with the name of the joint whose pose they have. Unreal's "ik_hand_gun", the
# grip of a weapon, is at the right hand.
NAMED_OTHERWISE: dict[tuple[str, Side | None], tuple[str, Side]] = {("handgun", None): ("hand", "right")}


def find_handles(skeleton: Skeleton, anatomy: Anatomy | None, regions: Regions) -> dict[int, int]:
    """Return the joint whose pose each handle copies, by handle: the hand, foot or toes with the same name.

    "ik_foot_l" is the handle of "foot_l", and "RightHandIK" of "RightHand". Only joints that move and turn freely and
    carry no part of the body are handles.
    """
    roles = anatomy.roles if anatomy else {}
    parts = {_meaning(skeleton.names[joint]): joint for role, joint in roles.items() if role.endswith(HANDLED_PARTS)}
    handles = {}
    for joint in filter(lambda joint: _is_marked(skeleton.names[joint]), skeleton.joints):
        meaning = _meaning(skeleton.names[joint])
        part = parts.get(NAMED_OTHERWISE.get(meaning, meaning))
        carries = np.any(regions.of_joint[skeleton.subtree(joint)] >= 0)
        if part is not None and moves_freely(skeleton, joint) and not carries:
            handles[joint] = part
    return handles


def moves_freely(skeleton: Skeleton, joint: int) -> bool:
    """Return whether a joint has all six channels."""
    return set(POSITION_CHANNELS) <= set(skeleton.channels[joint]) and len(skeleton.rotation_axes(joint)) == 3


def _is_marked(name: str) -> bool:
    return any(without_digits(word) in HANDLE_WORDS for word in words(name))


def _meaning(name: str) -> tuple[str, Side | None]:
    """The stem and side of a name without namespace and without the words of a handle."""
    own_words = words(name.rpartition(":")[2])
    return stem_and_side([word for word in own_words if without_digits(word) not in HANDLE_WORDS])
