"""Where the names of joints contradict the body, the body is right: arms and legs are on the sides where they are, and
toes lie ahead of the ankle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from distretarget.body.anatomy import LEG, SIDES, Anatomy, side_and_part
from distretarget.body.axes import Directions, direction
from distretarget.body.limbs import foot_bone
from distretarget.numerics.vectors import Array, cross, lengths, normalised
from distretarget.skeleton import Skeleton

ALONG = np.cos(np.radians(12))  # within this angle a joint lies along the shin, as no ball of a foot does, ...
AHEAD = np.cos(np.radians(45))  # ... and the foot points ahead of it from this angle on [cosine]
BENT_LESS = 75.0  # percentile of the cosines of a motion's frames that counts: with the ankle bent rather little [%]
OPPOSITE = -0.7  # arms and legs are named for opposite sides if shoulders and hip joints are so far apart [cosine]
BENT = 0.05  # knees are bent if they are on average farther than this from between hip and ankle [lengths of that]


def as_body_shows(skeleton: Skeleton, anatomy: Anatomy, positions: Array) -> Anatomy:
    """Return an anatomy without the roles that the body contradicts in postures in which it stands on the whole,
    `positions` (..., joints, 3).
    """
    places = positions.reshape(-1, len(skeleton), 3)
    anatomy = on_own_sides(skeleton, anatomy, places)
    toes = {f"{side}Toes": _toes_farther_down(skeleton, anatomy, side, places) for side in SIDES}
    found = {role: joint for role, joint in toes.items() if joint is not None}
    return replace(anatomy, roles={**anatomy.roles, **found}) if found else anatomy


def _toes_farther_down(skeleton: Skeleton, anatomy: Anatomy, side: str, places: Array) -> int | None:
    """The joint from which the foot points ahead, if the joint named for the toes, or else the first below the ankle,
    lies straight below the ankle, along the shin: some rigs have a joint in the heel or the middle of the foot. None
    for other rigs.
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
    """The cosine of the angle between a bone and the shin, (frames, 3)."""
    return float(np.percentile((direction(places, upper, lower) * shin).sum(axis=1), BENT_LESS))


def _only_child(skeleton: Skeleton, joint: int) -> int | None:
    """The child of a joint that has one; else None."""
    children = skeleton.children[joint]
    return children[0] if len(children) == 1 else None


# ---- sides


def on_own_sides(skeleton: Skeleton, anatomy: Anatomy, positions: Array) -> Anatomy:
    """Return an anatomy with left and right exchanged in arms or legs, where names put these on opposite sides: in
    those whose names contradict the front of the body, which feet or else knees show in postures in which it stands on
    the whole, `positions` (frames, joints, 3); in the arms if neither does.
    """
    shown = Directions(anatomy, positions)
    shoulders, hips = (shown.across(part) for part in ("UpperArm", "UpperLeg"))
    if shoulders is None or hips is None or _cosine(shoulders, hips) > OPPOSITE:
        return anatomy
    left = cross(shown.trunk, _front(skeleton, anatomy, positions))
    wrong = "legs" if (hips * left).sum() < 0.0 else "arms"
    other = dict(zip(SIDES, SIDES[::-1], strict=True))
    roles = {}
    for role, joint in anatomy.roles.items():
        side, part = side_and_part(role)
        of_limb = side and (part in LEG) == (wrong == "legs")
        roles[other[side] + part if of_limb else role] = joint
    return replace(anatomy, roles=roles, exchanged=wrong)


def knees_ahead(anatomy: Anatomy, positions: Array) -> Array:
    """Return where knees bend to, the mean of both in units of the leg, (frames, 3); 0 where they hardly do."""
    legs = [anatomy.joints(*(side + part for part in LEG[:3])) for side in SIDES]
    if any(len(leg) < 3 for leg in legs):
        return np.zeros((len(positions), 3))
    x = [positions[:, leg] for leg in legs]
    ahead = np.mean([(each[:, 1] - 0.5 * (each[:, 0] + each[:, 2])) / _size(each) for each in x], axis=0)
    return ahead if lengths(ahead).mean() > BENT else np.zeros_like(ahead)


def _size(leg: Array) -> float:
    """The mean distance of hip and ankle; above 0."""
    return max(float(lengths(leg[:, 2] - leg[:, 0]).mean()), 1e-300)


def _front(skeleton: Skeleton, anatomy: Anatomy, positions: Array) -> Array:
    """(frames, 3), where the feet point, or else the knees."""
    feet = [foot_bone(skeleton, anatomy, side) for side in SIDES]
    if None in feet:
        return knees_ahead(anatomy, positions)
    return np.asarray(sum(direction(positions, *foot) for foot in feet if foot))


def _cosine(one: Array, other: Array) -> float:
    """The mean cosine of the angle between vectors, (frames, 3) each."""
    return float((normalised(one) * normalised(other)).sum(axis=1).mean())
