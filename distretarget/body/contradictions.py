"""Where the names of joints contradict the body, the body is right: arms and legs are on the sides where they are, and
toes lie ahead of the ankle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from distretarget.body.anatomy import SIDES, Anatomy
from distretarget.body.axes import direction
from distretarget.body.sides import on_own_sides
from distretarget.numerics.vectors import Array
from distretarget.skeleton import Skeleton

ALONG = np.cos(np.radians(12))  # a joint below the ankle lies along the shin within this angle, as no ball does, ...
AHEAD = np.cos(np.radians(45))  # ... and the foot points ahead of it from this angle on [cosine]
BENT_LESS = 75.0  # percentile of the cosines of a motion's frames that counts: with the ankle bent rather little [%]


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
    """The joint with which a foot goes on ahead, if that named for the toes, or the first one, lies along the shin,
    straight below the ankle: some rigs have a joint in the heel or the middle of the foot. Else None.
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
