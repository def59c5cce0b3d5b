"""The anatomy of a body: which joint plays which role, and which regions of the body can touch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Literal

import numpy as np

from distretarget.numerics.vectors import Flags, Numbers
from distretarget.skeleton import Skeleton

Side = Literal["left", "right"]
SIDES = ("left", "right")
FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
KNUCKLES = tuple(f"{finger}1" for finger in FINGERS)
ARM = ("Shoulder", "UpperArm", "LowerArm", "Hand")
LEG = ("UpperLeg", "LowerLeg", "Foot", "Toes")
# The roles of the top, the middle and the end of each limb, arms before legs.
LIMBS = tuple(tuple(side + part for part in parts) for parts in (ARM[1:], LEG[:3]) for side in SIDES)

# The parts of each region, the most important regions first. The joint at the top of the thigh is at the hips.
REGION_PARTS = {
    "hand": ("Hand", *(f"{finger}{number}" for finger in FINGERS for number in range(4))),
    "head": ("head", "neck"),
    "forearm": ("LowerArm",),
    "upper arm": ("UpperArm",),
    "trunk": ("Shoulder", "upperChest", "chest", "spine"),
    "hips": ("hips", "UpperLeg"),
    "shin": ("LowerLeg",),
    "foot": ("Foot", "Toes"),
}
REGION_OF_PART = {part: region for region, parts in REGION_PARTS.items() for part in parts}
TRUNK_REGIONS = ("trunk", "hips")  # the regions that limbs branch off
WITHOUT_SIDE = ("head", *TRUNK_REGIONS)
EXTREMITIES = {"Hand": "LowerArm", "Foot": "LowerLeg"}  # a hand is no longer than its forearm, a foot than its shin


@dataclass(frozen=True, kw_only=True)
class Anatomy:
    """Which joint of a skeleton plays which role.

    Attributes:
        roles: the joint of each role. Roles are those of the VRM humanoid 1.0 ("hips", "leftUpperArm", ...; "Shoulder"
            is the collar bone). Fingers have "leftIndex1" to "leftIndex3" from the knuckle to the tip, and
            "leftIndex0" for the bone in the palm.
        spine: the joints above the hips up to the one where arms and neck branch off, lowest first.
        neck: the joints above the spine and below the head, lowest first.
        convention: the naming convention of the joints, such as "Mixamo"; empty where none is recognised.
        method: whether the roles were recognised by the joints' names or by the shape of the skeleton, or are stated by
            the humanoid in the file.
        swapped_sides: the limbs whose names say the other side: "arms", "legs", or both as "sides"; empty for none.
    """

    roles: Mapping[str, int]
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    convention: str
    method: Literal["names", "shape", "humanoid"]
    swapped_sides: str = ""

    def __hash__(self) -> int:
        return hash((frozenset(self.roles.items()), self.spine, self.neck))

    def joints(self, *roles: str) -> list[int]:
        """Return the joints of some roles, without roles that the body lacks."""
        return [self.roles[role] for role in roles if role in self.roles]

    def pair(self, part: str) -> list[int]:
        """Return the left and the right joint of a part; empty unless the body has both."""
        joints = self.joints(*(side + part for side in SIDES))
        return joints if len(joints) == len(SIDES) else []

    @property
    def knuckles(self) -> frozenset[int]:
        """The joints at the base of the fingers."""
        return frozenset(joint for role, joint in self.roles.items() if role.endswith(KNUCKLES))

    @property
    def mirrored(self) -> Anatomy:
        """The same anatomy with left and right exchanged."""
        return replace(self, roles={opposite(role): joint for role, joint in self.roles.items()})


def side_and_part(role: str) -> tuple[str, str]:
    """Return the side of a role, empty for a part of the trunk, and the role without it."""
    side = next((side for side in SIDES if role.startswith(side)), "")
    return side, role.removeprefix(side)


def opposite(role: str) -> str:
    """Return the role on the other side; the role itself for a part of the trunk."""
    side, part = side_and_part(role)
    return SIDES[side == "left"] + part if side else role


def trunk_roles(hips: int, spine: Sequence[int], neck: Sequence[int], head: int | None) -> dict[str, int]:
    """Return the joints of the roles in a trunk; spine and neck are given lowest first. A spine of one joint is
    "chest", of two "spine" and "chest"; of a longer one the middle joint (of two the lower) is "chest", and the highest
    "upperChest".
    """
    roles = {"hips": hips}
    if len(spine) < 3:
        roles |= zip(("chest", "spine"), reversed(spine), strict=False)
    else:
        roles |= {"spine": spine[0], "chest": spine[(len(spine) - 1) // 2], "upperChest": spine[-1]}
    roles |= {"neck": neck[0]} if neck else {}
    return roles if head is None else roles | {"head": head}


@dataclass(frozen=True, eq=False)
class Regions:
    """The regions of a body."""

    names: tuple[str, ...]  # such as "left hand", most important first; without anatomy the first joint of each limb
    of_joint: Numbers  # (joints,), the region of each; -1 above the hips, for handles, props, hair and cloth
    neighbours: Flags  # (regions, regions), whether two regions are the same or share a bone, and so always touch

    def inside(self, *regions: str) -> Flags:
        """Return whether each joint lies in one of the regions, named without a side, (joints,)."""
        wanted = [name.removeprefix("left ").removeprefix("right ") in regions for name in self.names]
        return np.array([*wanted, False], bool)[self.of_joint]

    def with_joints(self, skeleton: Skeleton, joints: Iterable[int]) -> Regions:
        """Return the regions with more joints, each in the region of its nearest ancestor that has one."""
        of_joint = np.array(self.of_joint)
        for joint in joints:
            of_joint[joint] = next((of_joint[above] for above in skeleton.to_root(joint) if of_joint[above] >= 0), -1)
        return replace(self, of_joint=of_joint)


def find_regions(skeleton: Skeleton, anatomy: Anatomy | None, above_hips: tuple[int, ...]) -> Regions:
    """Return the regions of a body; the joints `above_hips` are in none."""
    labels = _limbs(skeleton) if anatomy is None else _by_anatomy(skeleton, anatomy)
    for joint in above_hips:
        labels.pop(joint, None)
    order = {f"{side}{region}": place for place, region in enumerate(REGION_PARTS) for side in ("", "left ", "right ")}
    names = sorted(set(labels.values()), key=lambda name: (order.get(name, len(order)), name))
    numbers = {name: number for number, name in enumerate(names)}
    of_joint = np.array([numbers.get(labels.get(joint, ""), -1) for joint in range(len(skeleton))], np.intp)
    neighbours = np.eye(len(names), dtype=bool)
    joints = [joint for joint in labels if skeleton.parents[joint] in labels]
    a, b = of_joint[joints], of_joint[skeleton.parents[joints]]
    neighbours[a, b] = neighbours[b, a] = True
    return Regions(tuple(names), of_joint, neighbours)


def _by_anatomy(skeleton: Skeleton, anatomy: Anatomy) -> dict[int, str]:
    """The region of each joint with a role, of the joints between them, and of the ends of hands, feet and head."""
    labels = dict.fromkeys(anatomy.spine, "trunk") | dict.fromkeys(anatomy.neck, "head")
    for role, joint in anatomy.roles.items():
        side, part = side_and_part(role)
        region = REGION_OF_PART[part]
        labels[joint] = region if region in WITHOUT_SIDE else f"{side} {region}"
    for joint in sorted(labels):
        for between in takewhile(lambda above: above not in labels, skeleton.to_root(joint)[1:]):
            labels[between] = labels[joint]
    for joint, region in list(labels.items()):
        labels.update({child: region for child in skeleton.children[joint] if skeleton.end_sites[child]})
    for side in SIDES:
        for part, bone in EXTREMITIES.items():
            joint, above = (anatomy.roles.get(side + role, -1) for role in (part, bone))
            if min(joint, above) >= 0:
                reach, longest = skeleton.paths_from(joint)[skeleton.farthest], skeleton.paths_from(above)[joint]
                near = [below for below in skeleton.subtree(joint) if reach[below] <= longest]
                labels = dict.fromkeys(near, labels[joint]) | labels
    return labels


def _limbs(skeleton: Skeleton) -> dict[int, str]:
    """The limb of each joint, named by its first joint. A limb begins below each joint with several children."""
    labels: dict[int, str] = {}
    for joint, parent in enumerate(skeleton.parents.tolist()):
        only_child = parent >= 0 and len(skeleton.children[parent]) == 1
        labels[joint] = labels[parent] if only_child else skeleton.keys[joint]
    return labels
