"""The anatomy of a skeleton: by the file's humanoid, by names, by shape, or by names and shape."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import product

from distretarget.body.anatomy import ARM, FINGERS, LEG, SIDES, Anatomy, trunk_roles
from distretarget.body.conventions import NamedTree
from distretarget.body.named_anatomy import by_tree, with_named_fingers
from distretarget.body.shape import by_shape
from distretarget.numerics.vectors import Array
from distretarget.skeleton import Skeleton

LIMBS = tuple(tuple(side + part for part in limb) for limb in (ARM, LEG) for side in SIDES)
LONG_BONES = ("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")
# VRM's names of bones, from the trunk outwards; those of fingers follow a side and the finger's name.
SPINE = ("spine", "chest", "upperChest")
FINGER = ("Proximal", "Intermediate", "Distal")
THUMB = ("Metacarpal", "Proximal", "Distal")


def find_anatomy(skeleton: Skeleton, positions: Array | None = None) -> Anatomy | None:
    """Return the anatomy of a skeleton; None where no human body is recognised.

    Names come first. Arms and legs that they lack are taken from the shape, if it agrees on the others; `positions`,
    (frames, joints, 3), of a motion help there. If the shape shows no body, limbs may be single bones.
    """
    named = by_names(skeleton)
    if named and (named.method == "humanoid" or all(_is_known(named.roles, limb) for limb in LIMBS)):
        return named
    shaped = by_shape(skeleton, positions)
    if not shaped:
        return by_tree(NamedTree.of(skeleton), single=True) or named
    if not named:
        return with_named_fingers(skeleton, shaped)
    agreeing = next((each for each in (shaped, shaped.mirrored) if _agree(named, each)), None)
    return _completed(named, agreeing) if agreeing else named


def by_names(skeleton: Skeleton) -> Anatomy | None:
    """Return the anatomy that the file's `humanoid` states, or else names and tree; None if these show too little."""
    return by_humanoid(skeleton) if skeleton.humanoid else by_tree(NamedTree.of(skeleton))


def _is_known(roles: Mapping[str, int], limb: Iterable[str]) -> bool:
    """Whether a limb has its two long bones."""
    return all(role in roles for role in limb if role.endswith(LONG_BONES))


def _agree(named: Anatomy, shaped: Anatomy) -> bool:
    """Whether both have the same joints in most roles of the limbs that the names show."""
    known = {role for limb in LIMBS if _is_known(named.roles, limb) for role in limb}
    shared = known & named.roles.keys() & shaped.roles.keys()
    return 2 * sum(named.roles[role] == shaped.roles[role] for role in shared) > len(shared)


def _completed(named: Anatomy, shaped: Anatomy) -> Anatomy:
    """The anatomy by names, with limbs that it lacks taken from the one by shape."""
    missing = [role for limb in LIMBS if not _is_known(named.roles, limb) for role in limb]
    kept = {role: joint for role, joint in named.roles.items() if role not in missing}
    taken = {*kept.values(), *named.spine, *named.neck}
    new = {role: shaped.roles[role] for role in missing if role in shaped.roles and shaped.roles[role] not in taken}
    return replace(named, roles=kept | new, method="shape") if new else named


def by_humanoid(skeleton: Skeleton) -> Anatomy | None:
    """Return the anatomy that the skeleton's `humanoid` states; None unless it states the hips, and the two long bones
    of both arms or of both legs. Bones that do not hang from the bone above them in a body get no role, nor do eyes
    and jaw.
    """
    joints = dict(skeleton.humanoid)
    if "hips" not in joints:
        return None
    hips = joints["hips"]
    spine = tuple(_chain(skeleton, joints, hips, SPINE).values())
    upper = _chain(skeleton, joints, [hips, *spine][-1], ("neck", "head"))
    neck = (upper["neck"],) if "neck" in upper else ()
    roles = trunk_roles(hips, spine, neck, upper.get("head"))
    for limb in LIMBS:
        roles |= _chain(skeleton, joints, hips, limb)
    for side, finger in product([side for side in SIDES if f"{side}Hand" in roles], FINGERS):
        names = [f"{side}{finger}{bone}" for bone in (THUMB if finger == "Thumb" else FINGER)]
        chain = _chain(skeleton, joints, roles[f"{side}Hand"], names)
        roles |= {f"{side}{finger}{names.index(name) + 1}": joint for name, joint in chain.items()}
    if not any(all(_is_known(roles, limb) for limb in pair) for pair in (LIMBS[:2], LIMBS[2:])):
        return None
    return Anatomy(roles=roles, spine=spine, neck=neck, convention="", method="humanoid")


def _chain(skeleton: Skeleton, joints: Mapping[str, int], above: int, bones: Iterable[str]) -> dict[str, int]:
    """The joints of `bones`, by bone, each below the one before, the first below `above`; others are left out."""
    found: dict[str, int] = {}
    for bone in bones:
        joint = joints.get(bone)
        if joint is not None and above in skeleton.to_root(joint)[1:]:
            found[bone] = above = joint
    return found
