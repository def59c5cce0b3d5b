"""The parts of a human body, and which joint of a skeleton plays which."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

SIDES = ("left", "right")
FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
TRUNK = ("hips", "spine", "chest", "upperChest", "neck", "head")
ARM = ("Shoulder", "UpperArm", "LowerArm", "Hand")
LEG = ("UpperLeg", "LowerLeg", "Foot", "Toes")


@dataclass(frozen=True)
class Anatomy:
    """Which joint of a skeleton plays which part.

    Attributes:
        roles: the joint of each role. Roles are those of the VRM humanoid 1.0 ("hips", "leftUpperArm", ...; "Shoulder"
            is the collar bone), and for fingers "leftIndex1" to "leftIndex3" from the knuckle on, "leftIndex0" for the
            bone in the palm.
        spine: the joints above the hips up to the one from which arms and neck leave, from below.
        neck: the joints from there up to below the head, from below.
        convention: whose names the joints have, as "Mixamo"; empty where no convention is recognised.
        method: what told the roles.
    """

    roles: Mapping[str, int]
    spine: tuple[int, ...]
    neck: tuple[int, ...]
    convention: str
    method: Literal["names", "shape"]

    @property
    def mirrored(self) -> Anatomy:
        """The same with left and right exchanged."""
        other = {"left": "right", "right": "left"}
        sides = {role: next((side for side in SIDES if role.startswith(side)), "") for role in self.roles}
        roles = {other.get(side, "") + role.removeprefix(side): self.roles[role] for role, side in sides.items()}
        return replace(self, roles=roles)


def spine_roles(spine: Sequence[int]) -> dict[str, int]:
    """The roles in a spine of any number of joints: "spine" below, "upperChest" on top, "chest" between, a little
    lower where there are two; of two joints the upper one, and a single one, is the chest.
    """
    if len(spine) < 3:
        return dict(zip(("chest", "spine"), reversed(spine), strict=False))
    return {"spine": spine[0], "chest": spine[(len(spine) - 1) // 2], "upperChest": spine[-1]}
