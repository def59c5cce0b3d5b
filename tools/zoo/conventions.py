"""Bodies of adults in a T-pose with the joint names of six conventions: Y up, facing +Z, hips as the root, no fingers
and no helpers [cm].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, get_args

import make_rigs
import numpy as np

from distretarget.body.anatomy import SIDES
from distretarget.skeleton import Skeleton
from zoo.tree import bare, roles, with_end, without

Convention = Literal["mixamo", "xsens", "lafan1", "unreal", "cmu", "bandai"]

HAND = 17.5  # from the wrist to the End Site of a hand [cm]
HELPERS = ("ik_", "twist")  # in the names of joints of the Unreal rig that are no part of the body

# The names of joints of the LAFAN1 rig in two more conventions.
CMU = {
    "Spine": "LowerBack",
    "Spine1": "Spine",
    "Spine2": "Spine1",
    "LeftToe": "LeftToeBase",
    "RightToe": "RightToeBase",
}
BANDAI_LIMBS = {
    "Shoulder": "Shoulder",
    "Arm": "UpperArm",
    "ForeArm": "LowerArm",
    "Hand": "Hand",
    "UpLeg": "UpperLeg",
    "Leg": "LowerLeg",
    "Foot": "Foot",
    "Toe": "Toes",
}
BANDAI = {"Spine2": "Chest"} | {
    f"{side}{lafan1}": f"{bandai}_{side[0]}" for side in ("Left", "Right") for lafan1, bandai in BANDAI_LIMBS.items()
}
RENAMED: Mapping[str, Mapping[str, str]] = {"cmu": CMU, "bandai": BANDAI}


@dataclass(frozen=True, kw_only=True)
class Naming:
    """How a convention names the joints of limbs and fingers.

    Attributes:
        part: pattern of the name of a joint of a limb, with {Part} or {part}.
        finger: pattern of the name of a joint of a finger, with {Finger} or {finger}, and {number}.
        palm: the same for the bone in the palm.
        root: the name of a joint above the hips.
    """

    part: str = "{Left}{Part}"
    finger: str = "{Left}Hand{Finger}{number}"
    palm: str = "{Left}InHand{Finger}"
    root: str = "Reference"

    def of_part(self, side: str, part: str) -> str:
        """The name of a joint of a limb; `part` is its name without a side, such as "Heel"."""
        return _named(self.part, side, Part=part, part=part.lower())

    def of_finger(self, side: str, finger: str, number: int) -> str:
        """The name of a joint of a finger; number 0 is the bone in the palm."""
        pattern = self.finger if number else self.palm
        return _named(pattern, side, Finger=finger, finger=finger.lower(), number=number)


def _named(pattern: str, side: str, **words: str | int) -> str:
    return pattern.format(Left=side.capitalize(), L=side[0].upper(), l=side[0], **words)


NAMING: Mapping[Convention, Naming] = dict.fromkeys(get_args(Convention), Naming()) | {
    "mixamo": Naming(
        part="mixamorig:{Left}{Part}",
        finger="mixamorig:{Left}Hand{Finger}{number}",
        palm="mixamorig:{Left}InHand{Finger}",
    ),
    "unreal": Naming(part="{part}_{l}", finger="{finger}_0{number}_{l}", palm="{finger}_metacarpal_{l}", root="root"),
    "bandai": Naming(part="{Part}_{L}", finger="{Finger}{number}_{L}", palm="InHand{Finger}_{L}", root="joint_Root"),
}


def adult(convention: Convention) -> Skeleton:
    """The body of an adult with the names and the rotation channels of a convention."""
    match convention:
        case "cmu" | "bandai":
            body = _renamed(make_rigs.rig("lafan1", "T"), RENAMED[convention])
        case "unreal":
            body = _on_hips(_y_up(make_rigs.rig("unreal", "T")))
        case _:
            body = make_rigs.rig(convention, "T")
    for side in SIDES:
        body = _without_fingers(body, side)
    return body


def _renamed(skeleton: Skeleton, names: Mapping[str, str]) -> Skeleton:
    """The skeleton with other names, End Sites named after their parents."""
    new = {name: names.get(name, name) for name in skeleton.names}
    ends = {f"{name}_End": f"{other}_End" for name, other in new.items()}
    return replace(skeleton, names=tuple(ends.get(name, new[name]) for name in skeleton.names))


def _y_up(skeleton: Skeleton) -> Skeleton:
    return replace(skeleton, offsets=skeleton.offsets[:, [0, 2, 1]] * (1, 1, -1), up="Y")


def _on_hips(skeleton: Skeleton) -> Skeleton:
    """The Unreal rig without its helpers and its root, whose channels and place the pelvis gets."""
    helpers = [joint for joint, name in enumerate(skeleton.names) if any(word in name for word in HELPERS)]
    body = without(skeleton, helpers)
    offsets = np.array(body.offsets[1:])
    offsets[0] += body.offsets[0]
    return Skeleton(
        names=body.names[1:],
        parents=body.parents[1:] - 1,
        offsets=offsets,
        channels=(body.channels[0], *body.channels[2:]),
        end_sites=body.end_sites[1:],
        units=body.units,
        up=body.up,
    )


def _without_fingers(skeleton: Skeleton, side: str) -> Skeleton:
    """The skeleton with an End Site at the fingertips below the hand, and nothing else."""
    body = bare(skeleton, roles(skeleton)[f"{side}Hand"])
    return with_end(body, roles(body)[f"{side}Hand"], (HAND if side == "left" else -HAND, 0.0, 0.0))
