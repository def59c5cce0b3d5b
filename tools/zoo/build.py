"""Proportions: bodies of another build, by factors for the offsets of joints across, upward and forward."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

from distretarget.body.anatomy import SIDES
from distretarget.skeleton import Skeleton
from zoo.tree import resized, roles

Factor = float | tuple[float, float, float]
Build = Literal["child", "giant", "short arms", "short legs", "wide hips", "big head", "thin"]

# The factors of each build by role without side; "" is for the whole body, "crown" for the End Site of the head.
BUILDS: Mapping[Build, Mapping[str, Factor]] = {
    "child": {"": 0.55, "crown": 1.5, "LowerLeg": 0.85, "Foot": 0.85, "LowerArm": 0.9, "Hand": 0.9},
    "giant": {"": 3.0, "LowerLeg": 1.15, "Foot": 1.15, "crown": 0.8},
    "short arms": {"LowerArm": 0.65, "Hand": 0.65},
    "short legs": {"LowerLeg": 0.55, "Foot": 0.55},
    "wide hips": {"UpperLeg": (2.0, 1.0, 1.0)},
    "big head": {"crown": (1.0, 2.5, 1.0)},
    "thin": {"UpperLeg": (0.5, 1.0, 1.0), "Shoulder": (0.5, 1.0, 1.0), "UpperArm": (0.6, 1.0, 1.0)},
}


def with_build(skeleton: Skeleton, build: Build) -> Skeleton:
    """The skeleton with the proportions of one of `BUILDS`."""
    joints = roles(skeleton)
    for part, factor in BUILDS[build].items():
        match part:
            case "":
                resizing: Iterable[int] = range(len(skeleton))
            case "crown":
                resizing = skeleton.subtree(joints["head"])[1:]
            case _:
                resizing = [joints[side + part] for side in SIDES]
        skeleton = resized(skeleton, resizing, factor)
    return skeleton
