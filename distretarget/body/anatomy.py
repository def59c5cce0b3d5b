"""The parts of a human body, and which joint of a skeleton plays which part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

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
