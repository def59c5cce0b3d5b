"""The anatomy of a skeleton whose file says which joint is which bone of a humanoid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from distretarget.body.anatomy import ARM, FINGERS, LEG, SIDES, Anatomy, trunk_roles
from distretarget.skeleton import Skeleton

# Bones in VRM's words, from the trunk outwards; those of limbs and fingers follow a side, and a side and a finger.
SPINE = ("spine", "chest", "upperChest")
FINGER = ("Proximal", "Intermediate", "Distal")
THUMB = ("Metacarpal", "Proximal", "Distal")
LONG_BONES = (ARM[1:3], LEG[:2])


def by_humanoid(skeleton: Skeleton) -> Anatomy | None:
    """Return the anatomy that the skeleton's `humanoid` states; None where it states too little.

    It must state the hips, and the two long bones of both arms or of both legs. Bones that do not hang from the bone
    that they belong to have no role, nor have eyes and jaw.
    """
    joints = dict(skeleton.humanoid)
    if "hips" not in joints:
        return None
    hips = joints["hips"]
    spine = tuple(_chain(skeleton, joints, hips, SPINE).values())
    upper = _chain(skeleton, joints, [hips, *spine][-1], ("neck", "head"))
    neck = tuple(upper[bone] for bone in upper if bone == "neck")
    roles = trunk_roles(hips, spine, neck, upper.get("head"))
    for side in SIDES:
        for limb in (ARM, LEG):
            roles |= _chain(skeleton, joints, hips, [side + part for part in limb])
        if f"{side}Hand" in roles:
            for finger in FINGERS:
                names = [f"{side}{finger}{bone}" for bone in (THUMB if finger == "Thumb" else FINGER)]
                chain = _chain(skeleton, joints, roles[f"{side}Hand"], names)
                roles |= {f"{side}{finger}{names.index(name) + 1}": joint for name, joint in chain.items()}
    if not any(all(side + part in roles for side in SIDES for part in bones) for bones in LONG_BONES):
        return None
    return Anatomy(roles=roles, spine=spine, neck=neck, convention="", method="humanoid")


def _chain(skeleton: Skeleton, joints: Mapping[str, int], above: int, bones: Iterable[str]) -> dict[str, int]:
    """The joints of those of the bones that hang below the joint `above` and below each other, by bone."""
    found: dict[str, int] = {}
    for bone in bones:
        joint = joints.get(bone)
        if joint is not None and above in skeleton.line(joint)[1:]:
            found[bone] = above = joint
    return found
