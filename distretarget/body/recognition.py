"""The anatomy of a skeleton: by the file's humanoid, by names, by shape, or by names and shape; corrected where names
contradict the geometry of the body: arms or legs named for the other side, and toes named below the ankle.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import product

import numpy as np

from distretarget.body.anatomy import ARM, FINGERS, LEG, SIDES, Anatomy, opposite, side_and_part, trunk_roles
from distretarget.body.axes import Directions, direction
from distretarget.body.conventions import NamedTree
from distretarget.body.limbs import foot_bone
from distretarget.body.named_anatomy import by_tree, with_named_fingers
from distretarget.body.shape import by_shape
from distretarget.numerics.vectors import Array, cross, lengths, normalised
from distretarget.skeleton import Skeleton

# The roles of whole limbs, with collar bones and toes.
WHOLE_LIMBS = tuple(tuple(side + part for part in limb) for limb in (ARM, LEG) for side in SIDES)
LONG_BONES = ("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")
# VRM's names of bones, from the trunk outwards; those of fingers follow a side and the finger's name.
SPINE = ("spine", "chest", "upperChest")
FINGER = ("Proximal", "Intermediate", "Distal")
THUMB = ("Metacarpal", "Proximal", "Distal")

ALONG = np.cos(np.radians(12))  # a joint within this angle of the shin is no ball of the foot [cosine] ...
AHEAD = np.cos(np.radians(45))  # ... if the next bone points ahead by more than this angle [cosine]
BENT_LESS = 75.0  # percentile of the cosines over the frames that counts, at which the ankle bends little [%]
OPPOSITE = -0.7  # arms and legs are named for opposite sides below this cosine of shoulder and hip line [cosine]
BENT = 0.05  # mean distance of a bent knee from the middle of hip and ankle is larger [distances of hip and ankle]


def find_anatomy(skeleton: Skeleton, positions: Array | None = None) -> Anatomy | None:
    """Return the anatomy of a skeleton; None where no human body is recognised.

    Names come first. Arms and legs that they lack are taken from the shape, if it agrees on the others; `positions`,
    (frames, joints, 3), of a motion help there. If the shape shows no body, limbs may be single bones.
    """
    named = by_names(skeleton)
    if named and (named.method == "humanoid" or all(_is_known(named.roles, limb) for limb in WHOLE_LIMBS)):
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
    known = {role for limb in WHOLE_LIMBS if _is_known(named.roles, limb) for role in limb}
    shared = known & named.roles.keys() & shaped.roles.keys()
    return 2 * sum(named.roles[role] == shaped.roles[role] for role in shared) > len(shared)


def _completed(named: Anatomy, shaped: Anatomy) -> Anatomy:
    """The anatomy by names, with limbs that it lacks taken from the one by shape."""
    missing = [role for limb in WHOLE_LIMBS if not _is_known(named.roles, limb) for role in limb]
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
    for limb in WHOLE_LIMBS:
        roles |= _chain(skeleton, joints, hips, limb)
    for side, finger in product([side for side in SIDES if f"{side}Hand" in roles], FINGERS):
        names = [f"{side}{finger}{bone}" for bone in (THUMB if finger == "Thumb" else FINGER)]
        chain = _chain(skeleton, joints, roles[f"{side}Hand"], names)
        roles |= {f"{side}{finger}{names.index(name) + 1}": joint for name, joint in chain.items()}
    if not any(all(_is_known(roles, limb) for limb in pair) for pair in (WHOLE_LIMBS[:2], WHOLE_LIMBS[2:])):
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


# ---- corrections


def corrected_anatomy(skeleton: Skeleton, anatomy: Anatomy, positions: Array) -> Anatomy:
    """Return an anatomy with wrong sides and toes corrected, from `positions`, (..., joints, 3), of postures in most of
    which the body stands.
    """
    places = positions.reshape(-1, len(skeleton), 3)
    anatomy = with_correct_sides(skeleton, anatomy, places)
    toes = {f"{side}Toes": _toes_farther_down(skeleton, anatomy, side, places) for side in SIDES}
    found = {role: joint for role, joint in toes.items() if joint is not None}
    return replace(anatomy, roles={**anatomy.roles, **found}) if found else anatomy


def _toes_farther_down(skeleton: Skeleton, anatomy: Anatomy, side: str, places: Array) -> int | None:
    """The joint at the end of the foot's first bone that points ahead, if the joint named for the toes, or else the
    only child of the ankle, continues the shin: some rigs have a joint in heel or middle of the foot. Else None.
    """
    knee, ankle = (anatomy.roles.get(side + part) for part in ("LowerLeg", "Foot"))
    if knee is None or ankle is None:
        return None
    shin, found = direction(places, knee, ankle), None
    below = anatomy.roles.get(f"{side}Toes", _only_child(skeleton, ankle))
    while below is not None and _along(places, shin, ankle, below) > ALONG:
        onward = _only_child(skeleton, below)
        if onward is None or _along(places, shin, below, onward) > AHEAD:
            break
        found = below = onward
    return found


def _along(places: Array, shin: Array, upper: int, lower: int) -> float:
    """The cosine between a bone and the directions of the shin, (frames, 3): a percentile over the frames."""
    return float(np.percentile((direction(places, upper, lower) * shin).sum(axis=1), BENT_LESS))


def _only_child(skeleton: Skeleton, joint: int) -> int | None:
    """The child of a joint that has a single one; else None."""
    children = skeleton.children[joint]
    return children[0] if len(children) == 1 else None


def with_correct_sides(skeleton: Skeleton, anatomy: Anatomy, positions: Array) -> Anatomy:
    """Return an anatomy with left and right swapped in arms or legs, if names put these on opposite sides.

    The pair that contradicts the front of the body is swapped. Feet, or else knees, show the front in `positions`,
    (frames, joints, 3), of postures in most of which the body stands; if neither does, the arms are swapped.
    """
    shown = Directions(anatomy, positions)
    shoulders, hips = (shown.across(part) for part in ("UpperArm", "UpperLeg"))
    if shoulders is None or hips is None or (normalised(shoulders) * normalised(hips)).sum(axis=1).mean() > OPPOSITE:
        return anatomy
    left = cross(shown.trunk, front_shown(skeleton, anatomy, positions))
    wrong = "legs" if (hips * left).sum() < 0.0 else "arms"
    roles = {}
    for role, joint in anatomy.roles.items():
        is_wrong = (side_and_part(role)[1] in LEG) == (wrong == "legs")
        roles[opposite(role) if is_wrong else role] = joint
    return replace(anatomy, roles=roles, swapped_sides=wrong)


def front_shown(skeleton: Skeleton, anatomy: Anatomy, positions: Array) -> Array:
    """Return the mean direction of both feet, (frames, 3); if one is missing, the mean displacement of both knees from
    the middle of hip and ankle [hip to ankle], or 0 if it is tiny.
    """
    feet = [foot_bone(skeleton, anatomy, side) for side in SIDES]
    if None not in feet:
        return np.asarray(sum(direction(positions, *foot) for foot in feet if foot)) / 2
    legs = [anatomy.joints(*(side + part for part in LEG[:3])) for side in SIDES]
    if any(len(leg) < 3 for leg in legs):
        return np.zeros((len(positions), 3))
    hips, knees, ankles = (positions[:, joints] for joints in zip(*legs, strict=True))  # (frames, legs, 3)
    hip_to_ankle = np.maximum(lengths(ankles - hips).mean(axis=0), 1e-300)
    ahead = ((knees - 0.5 * (hips + ankles)) / hip_to_ankle[:, None]).mean(axis=1)
    return ahead if lengths(ahead).mean() > BENT else np.zeros_like(ahead)
