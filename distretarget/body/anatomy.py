"""The parts of a body: which joint plays which role, the regions that can touch, and IK handles."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.body.joint_names import Side, stem_and_side, without_digits, words
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

SIDES = ("left", "right")
FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
TRUNK = ("hips", "spine", "chest", "upperChest", "neck", "head")
ARM = ("Shoulder", "UpperArm", "LowerArm", "Hand")
LEG = ("UpperLeg", "LowerLeg", "Foot", "Toes")


@dataclass(frozen=True, kw_only=True)
class Anatomy:
    """Which joint of a skeleton plays which part.

    Attributes:
        roles: the joint of each role. Roles are those of the VRM humanoid 1.0 ("hips", "leftUpperArm", ...; "Shoulder"
            is the collar bone). Fingers have "leftIndex1" to "leftIndex3" from the knuckle to the tip, and
            "leftIndex0" for the bone in the palm.
        spine: the joints above the hips up to the one where arms and neck branch off, lowest first.
        neck: the joints above the spine and below the head, lowest first.
        convention: the naming convention of the joints, such as "Mixamo"; empty where none is recognised.
        method: whether the roles were recognised by the joints' names or by the shape of the skeleton.
    """

    roles: Mapping[str, int]
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    convention: str
    method: Literal["names", "shape"]

    @property
    def knuckles(self) -> frozenset[int]:
        """The joints that the fingers turn about."""
        names = {f"{side}{finger}1" for side in SIDES for finger in FINGERS}
        return frozenset(joint for role, joint in self.roles.items() if role in names)

    @property
    def mirrored(self) -> Anatomy:
        """The same anatomy with left and right exchanged."""
        other = {"left": "right", "right": "left"}
        sides = {role: next((side for side in SIDES if role.startswith(side)), "") for role in self.roles}
        roles = {other.get(side, "") + role.removeprefix(side): self.roles[role] for role, side in sides.items()}
        return replace(self, roles=roles)


def spine_roles(spine: Sequence[int]) -> dict[str, int]:
    """Return the role of each spine joint that has one; `spine` lists the joints from below.

    Three or more joints: the lowest is "spine", the highest "upperChest", the middle one (of two, the lower) "chest".
    Two joints: "spine" and "chest". One joint: "chest".
    """
    if len(spine) < 3:
        return dict(zip(("chest", "spine"), reversed(spine), strict=False))
    return {"spine": spine[0], "chest": spine[(len(spine) - 1) // 2], "upperChest": spine[-1]}


# The region of each role without its side; regions of limbs have a side. The upper end of the thigh is at the hips.
REGION_OF_PART = {
    "Hand": "hand",
    **{f"{finger}{number}": "hand" for finger in FINGERS for number in range(4)},
    "head": "head",
    "neck": "head",
    "LowerArm": "forearm",
    "UpperArm": "upper arm",
    "Shoulder": "trunk",
    "upperChest": "trunk",
    "chest": "trunk",
    "spine": "trunk",
    "hips": "hips",
    "UpperLeg": "hips",
    "LowerLeg": "shin",
    "Foot": "foot",
    "Toes": "foot",
}
WITH_SIDES = ("hand", "forearm", "upper arm", "shin", "foot")
TRUNK_REGIONS = ("trunk", "hips")  # the regions that limbs branch off
EXTREMITIES = {"Hand": "LowerArm", "Foot": "LowerLeg"}  # a hand is no longer than its forearm, a foot than its shin


@dataclass(frozen=True, eq=False)
class Regions:
    """The regions of a body.

    Attributes:
        names: of the regions, such as "left hand", those of most interest first; in a body without anatomy the name of
            the first joint of each limb.
        of_joint: (joints,), the region of each joint and End Site; -1 for what is not part of the body: joints above
            the hips, handles, props, hair and cloth.
        neighbours: (regions, regions), whether two regions are the same or joined by a bone; they always touch.
    """

    names: tuple[str, ...]
    of_joint: NDArray[np.intp]
    neighbours: NDArray[np.bool_]

    def with_joints(self, skeleton: Skeleton, joints: Iterable[int]) -> Regions:
        """The same regions, with joints that have none in that of the nearest joint above that has one."""
        of_joint = np.array(self.of_joint)
        for joint in joints:
            above = [int(of_joint[each]) for each in skeleton.line(joint) if of_joint[each] >= 0]
            of_joint[joint] = above[0] if above else -1
        return replace(self, of_joint=of_joint)


def find_regions(skeleton: Skeleton, anatomy: Anatomy | None, above_hips: tuple[int, ...]) -> Regions:
    """Return the regions of a body, of which the joints `above_hips` are not part."""
    labels = _limbs(skeleton) if anatomy is None else _by_anatomy(skeleton, anatomy)
    for joint in above_hips:
        labels.pop(joint, None)
    order = {name: place for place, name in enumerate(dict.fromkeys(REGION_OF_PART.values()))}
    names = sorted(set(labels.values()), key=lambda name: (order.get(_without_side(name), len(order)), name))
    numbers = {name: number for number, name in enumerate(names)}
    of_joint = np.array([numbers.get(labels.get(joint, ""), -1) for joint in range(len(skeleton))], np.intp)
    return Regions(tuple(names), of_joint, _neighbours(skeleton, of_joint, len(names)))


def _by_anatomy(skeleton: Skeleton, anatomy: Anatomy) -> dict[int, str]:
    """The region of each joint with a role, of joints between them, and of those that end hands, feet and head."""
    labels = dict.fromkeys(anatomy.spine, "trunk") | dict.fromkeys(anatomy.neck, "head")
    for role, joint in anatomy.roles.items():
        side = next((side for side in SIDES if role.startswith(side)), "")
        region = REGION_OF_PART.get(role.removeprefix(side))
        if region:
            labels[joint] = f"{side} {region}" if region in WITH_SIDES else region
    for joint in sorted(labels):
        between = int(skeleton.parents[joint])
        while between >= 0 and between not in labels:
            labels[between] = labels[joint]
            between = int(skeleton.parents[between])
    for joint, region in list(labels.items()):
        labels.update({child: region for child in skeleton.children[joint] if skeleton.end_sites[child]})
    for side in SIDES:
        for part, bone in EXTREMITIES.items():
            joint, above = (anatomy.roles.get(side + role, -1) for role in (part, bone))
            if min(joint, above) >= 0:
                reach, longest = skeleton.path_lengths[joint], skeleton.path_lengths[above, joint]
                near = [below for below in skeleton.subtree(joint) if reach[below] <= longest]
                labels.update({below: labels[joint] for below in near if below not in labels})
    return labels


def _limbs(skeleton: Skeleton) -> dict[int, str]:
    """For each joint the name of the first joint of its limb, which begins where several joints leave a joint."""
    labels: dict[int, str] = {}
    for joint, parent in enumerate(skeleton.parents.tolist()):
        alone = parent >= 0 and len(skeleton.children[parent]) == 1
        labels[joint] = labels[parent] if alone else skeleton.keys[joint]
    return labels


def _neighbours(skeleton: Skeleton, of_joint: NDArray[np.intp], regions: int) -> NDArray[np.bool_]:
    neighbours = np.eye(regions, dtype=bool)
    for joint, parent in enumerate(skeleton.parents.tolist()):
        if parent >= 0 and min(of_joint[joint], of_joint[parent]) >= 0:
            neighbours[of_joint[joint], of_joint[parent]] = neighbours[of_joint[parent], of_joint[joint]] = True
    return neighbours


def _without_side(name: str) -> str:
    side, _, rest = name.partition(" ")
    return rest if side in SIDES else name


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
