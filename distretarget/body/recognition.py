"""Which joint of a skeleton plays which role: by the file's humanoid, by names, by shape, or by names and shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import ARM, LEG, SIDES, Anatomy
from distretarget.body.named_anatomy import by_names, with_named_fingers
from distretarget.body.shape import by_shape
from distretarget.skeleton import Skeleton

LIMBS = tuple(tuple(side + part for part in limb) for side in SIDES for limb in (ARM, LEG))
LONG_BONES = ("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")


def find_anatomy(skeleton: Skeleton, positions: NDArray[np.float64] | None = None) -> Anatomy | None:
    """Return the anatomy of a skeleton; None where no human body is recognised.

    Where names show the body but not all its arms and legs, its shape shows the others, if it agrees on the rest.
    `positions`, (frames, joints, 3), are those of a motion, as in `by_shape`.
    """
    named = by_names(skeleton)
    if named and (named.method == "humanoid" or all(_is_known(named, limb) for limb in LIMBS)):
        return named
    shaped = by_shape(skeleton, positions)
    if not named:
        return with_named_fingers(skeleton, shaped) if shaped else None
    if not shaped:
        return named
    same = next((each for each in (shaped, shaped.mirrored) if _agree(named, each)), None)
    return _completed(named, same) if same else named


def _is_known(anatomy: Anatomy, limb: tuple[str, ...]) -> bool:
    """Whether a limb has its two long bones."""
    return all(role in anatomy.roles for role in limb if role.endswith(LONG_BONES))


def _agree(named: Anatomy, shaped: Anatomy) -> bool:
    """Whether both have the same joints in all limbs that the names show."""
    known = [limb for limb in LIMBS if _is_known(named, limb)]
    shared = [role for limb in known for role in limb if role in named.roles and role in shaped.roles]
    return bool(shared) and sum(named.roles[role] == shaped.roles[role] for role in shared) > len(shared) / 2


def _completed(named: Anatomy, shaped: Anatomy) -> Anatomy:
    """The anatomy by names with the limbs of the other that it lacks."""
    lost = [role for limb in LIMBS if not _is_known(named, limb) for role in limb]
    kept = {role: joint for role, joint in named.roles.items() if role not in lost}
    taken = {*kept.values(), *named.spine, *named.neck}
    new = {role: shaped.roles[role] for role in lost if role in shaped.roles and shaped.roles[role] not in taken}
    return replace(named, roles=kept | new, method="shape") if new else named
