"""How a body stands in a posture: which way its trunk, its feet and its left side point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import LEG, SIDES, Anatomy
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

UPRIGHT = 100.0  # degrees between trunk and legs of a rest pose that is a pose, at least
RAISED = np.cos(np.radians(30))  # and its arms are farther than this from the direction of the trunk
STRETCHED = 125.0  # degrees between trunk and legs, which people reach and animals on four legs rarely do
FOLDED = 45.0  # a rest pose with a smaller angle is no pose, and tells nothing
SQUARE = np.cos(np.radians(25))  # a body that stands so nearly along the file's axes stands along them
CLEAR = 0.3  # mean cosine from which feet tell left from right


def trunk(anatomy: Anatomy, x: Array) -> Array:
    """(..., 3), unit vectors from the hip joints up to the shoulders or the top of the spine, over positions
    x (..., joints, 3); zero for a body without.
    """
    return _ways(x, _base(anatomy), _upper(anatomy))


def leg_directions(anatomy: Anatomy, x: Array) -> Array:
    """(..., 3), unit vectors from the hip joints down to the ankles; zero for a body without."""
    feet = _joints(anatomy, "leftFoot", "rightFoot") or _joints(anatomy, "leftLowerLeg", "rightLowerLeg")
    return _ways(x, _base(anatomy), feet)


def upwards(anatomy: Anatomy, x: Array) -> Array:
    """(..., 3), the mean of the directions up the trunk and up the legs, or the one of them that the body has."""
    ways = [way for way in (trunk(anatomy, x), -leg_directions(anatomy, x)) if way.any()]
    return np.asarray(np.mean(ways, axis=0)) if ways else np.zeros((*x.shape[:-2], 3))


def leftwards(anatomy: Anatomy, x: Array) -> Array:
    """(..., 3), unit vectors from the joints named right to those named left: hip and shoulder joints together."""
    across = np.zeros((*x.shape[:-2], 3))
    for role in ("UpperLeg", "UpperArm"):
        pair = _joints(anatomy, *(side + role for side in SIDES))
        if len(pair) == 2:
            across += x[..., pair[0], :] - x[..., pair[1], :]
    return unit(across)


def body_axes(anatomy: Anatomy, x: Array) -> Array:
    """(..., 3, 3), the rotation matrix whose columns are the body's left, up and forward."""
    left = leftwards(anatomy, x)
    up = trunk(anatomy, x)
    up = up if up.any() else upwards(anatomy, x)
    up = unit(up - (up * left).sum(axis=-1, keepdims=True) * left)
    return np.stack([left, up, np.cross(left, up)], axis=-1)


def upright(axes: Array) -> Array:
    """Left, up and forward of a body, (3, 3), as columns, with up along an axis of the file, if it is nearly so."""
    up = _square(axes[:, 1])
    left = unit(axes[:, 0] - (axes[:, 0] @ up) * up)
    return np.stack([left, up, np.cross(left, up)], axis=-1)


def squared(axes: Array) -> Array:
    """The same with left along one too, if it is nearly so."""
    left, up, _ = upright(axes).T
    left = _square(left)
    left = unit(left - (left @ up) * up)
    return np.stack([left, up, np.cross(left, up)], axis=-1)


def _square(direction: Array) -> Array:
    """The axis of the file nearest to a direction, (3,), if it is near; else the direction."""
    nearest = np.argmax(np.abs(direction))
    axis = np.sign(direction[nearest]) * np.eye(3)[nearest]
    return axis if axis @ direction > SQUARE else direction


def is_pose(skeleton: Skeleton, anatomy: Anatomy) -> bool:
    """Whether the rest pose is one in which a person can stand: legs down, trunk up, arms not along it."""
    x = skeleton.rest_positions
    up = trunk(anatomy, x)
    hands = [_joints(anatomy, side + "UpperArm", side + "Hand") for side in SIDES]
    arms = [unit(x[arm[1]] - x[arm[0]]) for arm in hands if len(arm) == 2]
    stands = not _is_whole(anatomy) or _stretch(anatomy, x) > UPRIGHT
    return bool(stands and all(arm @ up < RAISED for arm in arms))


def sides_agree(skeleton: Skeleton, anatomy: Anatomy, positions: Array | None) -> bool | None:
    """Whether the joints called left are on the body's left, as its feet tell; None where they do not tell.

    By the rest pose where that is a pose, else by `positions`, (frames, joints, 3).
    """
    x = skeleton.rest_positions[None] if is_pose(skeleton, anatomy) else positions
    feet = [toe_bone(skeleton, anatomy, side) for side in SIDES]
    if x is None or None in feet:
        return None
    forward = sum(unit(x[:, foot[1]] - x[:, foot[0]]) for foot in feet if foot)
    cosine = float(np.mean((body_axes(anatomy, x)[..., 2] * forward).sum(axis=-1)) / 2)
    return cosine > 0 if abs(cosine) > CLEAR else None


def on_all_fours(skeleton: Skeleton, anatomy: Anatomy, positions: Array | None) -> bool:
    """Whether this seems to be no person: a rest pose whose trunk lies across the legs, or none at all, and trunk and
    legs that do not stretch in motion either; `positions`, (frames, joints, 3), if there is any.
    """
    if not _is_whole(anatomy):
        return False
    rest = float(_stretch(anatomy, skeleton.rest_positions))
    if rest > STRETCHED:
        return False
    if positions is None:
        return rest > FOLDED
    return bool(np.percentile(_stretch(anatomy, positions), 99) < STRETCHED)


def toe_bone(skeleton: Skeleton, anatomy: Anatomy, side: str) -> tuple[int, int] | None:
    """The joints from which to which a foot points: ankle and toes, or what ends the foot; None without."""
    foot = anatomy.roles.get(f"{side}Foot")
    if foot is None:
        return None
    ends = [anatomy.roles.get(f"{side}Toes", -1), *skeleton.children[foot]]
    long = [end for end in ends if end >= 0 and skeleton.path_lengths[foot, end] > 0]
    return (foot, long[0]) if long else None


def unit(vectors: Array) -> Array:
    """Vectors of length 1 in the same directions, (..., 3); zero stays zero."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0))


def _is_whole(anatomy: Anatomy) -> bool:
    """Whether it has a trunk, and both thighs and shins."""
    return bool(_upper(anatomy) and _joints(anatomy, *(side + part for side in SIDES for part in LEG[:2])))


def _upper(anatomy: Anatomy) -> list[int]:
    """The joints at the upper end of the trunk: the shoulders, or the top of the spine."""
    return _joints(anatomy, "leftUpperArm", "rightUpperArm") or [*anatomy.spine, *anatomy.neck][-1:]


def _base(anatomy: Anatomy) -> list[int]:
    return _joints(anatomy, "leftUpperLeg", "rightUpperLeg") or _joints(anatomy, "hips")


def _ways(x: Array, start: list[int], end: list[int]) -> Array:
    """(..., 3), unit vectors from the middle of some joints to that of others; zero where there are none."""
    if not start or not end:
        return np.zeros((*x.shape[:-2], 3))
    return unit(x[..., end, :].mean(axis=-2) - x[..., start, :].mean(axis=-2))


def _joints(anatomy: Anatomy, *roles: str) -> list[int]:
    """The joints of the roles, if it has them all."""
    joints = [anatomy.roles[role] for role in roles if role in anatomy.roles]
    return joints if len(joints) == len(roles) else []


def _stretch(anatomy: Anatomy, x: Array) -> Array:
    """(...), the angle between trunk and legs [degrees]: 180 for a person who stands."""
    cosine = (trunk(anatomy, x) * leg_directions(anatomy, x)).sum(axis=-1)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
