"""Corrections of an anatomy whose joint names contradict the geometry of the body: arms or legs named for the other
side, and toes named below the ankle instead of ahead of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from distretarget.body.anatomy import LEG, SIDES, Anatomy, side_and_part
from distretarget.body.axes import Directions, direction
from distretarget.body.limbs import foot_bone
from distretarget.numerics.vectors import Array, cross, lengths, normalised
from distretarget.skeleton import Skeleton

ALONG = np.cos(np.radians(12))  # a joint within this angle of the shin is no ball of the foot [cosine] ...
AHEAD = np.cos(np.radians(45))  # ... if the next bone points ahead by more than this angle [cosine]
BENT_LESS = 75.0  # percentile of the cosines over the frames that counts, at which the ankle bends little [%]
OPPOSITE = -0.7  # arms and legs are named for opposite sides below this cosine of shoulder and hip line [cosine]
BENT = 0.05  # mean distance of a bent knee from the middle of hip and ankle is larger [distances of hip and ankle]


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


# ---- sides


def with_correct_sides(skeleton: Skeleton, anatomy: Anatomy, positions: Array) -> Anatomy:
    """Return an anatomy with left and right swapped in arms or legs, if names put these on opposite sides.

    The pair that contradicts the front of the body is swapped. Feet, or else knees, show the front in `positions`,
    (frames, joints, 3), of postures in most of which the body stands; if neither does, the arms are swapped.
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
    return replace(anatomy, roles=roles, swapped_sides=wrong)


def knee_bends(anatomy: Anatomy, positions: Array) -> Array:
    """Return the mean displacement of knees from the middle of hip and ankle, (frames, 3) [hip to ankle]; 0 if tiny."""
    legs = [anatomy.joints(*(side + part for part in LEG[:3])) for side in SIDES]
    if any(len(leg) < 3 for leg in legs):
        return np.zeros((len(positions), 3))
    x = [positions[:, leg] for leg in legs]
    ahead = np.mean([(each[:, 1] - 0.5 * (each[:, 0] + each[:, 2])) / _hip_to_ankle(each) for each in x], axis=0)
    return ahead if lengths(ahead).mean() > BENT else np.zeros_like(ahead)


def _hip_to_ankle(leg: Array) -> float:
    """The mean distance of hip and ankle; above 0."""
    return max(float(lengths(leg[:, 2] - leg[:, 0]).mean()), 1e-300)


def _front(skeleton: Skeleton, anatomy: Anatomy, positions: Array) -> Array:
    """(frames, 3), the direction of the feet, or else of the knees; not normalised."""
    feet = [foot_bone(skeleton, anatomy, side) for side in SIDES]
    if None in feet:
        return knee_bends(anatomy, positions)
    return np.asarray(sum(direction(positions, *foot) for foot in feet if foot))


def _cosine(one: Array, other: Array) -> float:
    """The mean cosine of the angle between vectors, (frames, 3) each."""
    return float((normalised(one) * normalised(other)).sum(axis=1).mean())
