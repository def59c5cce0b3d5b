"""Fingers: none, three, five, and five with metacarpals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
import rig_bodies

from distretarget.body.anatomy import SIDES
from distretarget.skeleton import Skeleton
from zoo.conventions import Naming
from zoo.tree import bare, roles, with_chain

Fingers = Literal["none", "three", "five", "metacarpals"]

FOREARM = 26.6  # the forearm for which `rig_bodies.FINGERS` are written [cm]
METACARPAL = 0.3  # where the bone in the palm begins between wrist and knuckle [0 to 1]
KINDS: Mapping[Fingers, tuple[str, ...]] = {
    "none": (),
    "three": ("Thumb", "Index", "Ring"),
    "five": tuple(rig_bodies.FINGERS),
    "metacarpals": tuple(rig_bodies.FINGERS),
}


def with_fingers(skeleton: Skeleton, fingers: Fingers, naming: Naming) -> Skeleton:
    """The body, in T-pose and without fingers, with fingers on both hands."""
    if fingers == "none":
        return skeleton
    for side in SIDES:
        skeleton = bare(skeleton, roles(skeleton)[f"{side}Hand"])
        for finger in KINDS[fingers]:
            skeleton = _with_finger(skeleton, side, finger, naming, palm=fingers == "metacarpals" and finger != "Thumb")
    return skeleton


def _with_finger(skeleton: Skeleton, side: str, finger: str, naming: Naming, *, palm: bool) -> Skeleton:
    """The skeleton with a finger of three bones, and with a bone in the palm before them if `palm`."""
    hand = roles(skeleton)[f"{side}Hand"]
    size = skeleton.lengths[hand] / FOREARM * np.array([1.0 if side == "left" else -1.0, 1.0, 1.0])
    knuckle, direction, lengths = rig_bodies.FINGERS[finger]
    bones = size * np.multiply.outer(lengths, direction)
    first = size * np.array(knuckle)
    offsets = {naming.of_finger(side, finger, 0): METACARPAL * first} if palm else {}
    offsets[naming.of_finger(side, finger, 1)] = (1 - METACARPAL) * first if palm else first
    offsets |= {naming.of_finger(side, finger, number): bones[number - 2] for number in (2, 3)}
    return with_chain(skeleton, hand, offsets, end=bones[2])
