"""The regions of a body that touch each other: hands, forearms, head, trunk and so on, and the joints of each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import FINGERS, SIDES, Anatomy
from distretarget.skeleton import Skeleton

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
TRUNK = ("trunk", "hips")  # the regions that limbs branch off
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
