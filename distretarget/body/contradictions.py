"""Where the names of joints contradict the body, the body is right: toes lie ahead of the ankle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from distretarget.body.anatomy import SIDES, Anatomy
from distretarget.body.axes import Directions, direction
from distretarget.body.reference_pose import stands_at_rest
from distretarget.numerics.vectors import Array
from distretarget.skeleton import Skeleton

ALONG = np.cos(np.radians(25))  # a joint below the ankle lies along the shin within this angle, ...
AHEAD = np.cos(np.radians(45))  # ... and the foot points ahead of it from this angle on [cosine]
BENT_LESS = 75.0  # percentile of the cosines of a motion's frames that counts: with the ankle bent rather little [%]


def as_body_shows(skeleton: Skeleton, anatomy: Anatomy, positions: Array | None) -> Anatomy:
    """Return an anatomy without the roles that the body contradicts in its rest pose, if a person can stand in it, else
    in a motion, `positions` (frames, joints, 3); the same anatomy where neither is known.
    """
    places = skeleton.rest_positions[None]
    if not stands_at_rest(Directions(anatomy, places[0])):
        if positions is None:
            return anatomy
        places = positions
    return _with_toes_ahead(skeleton, anatomy, places)


def _with_toes_ahead(skeleton: Skeleton, anatomy: Anatomy, places: Array) -> Anatomy:
    """The anatomy with the toes farther down the foot where they lie along the shin, straight below the ankle, and the
    foot goes on ahead from there: some rigs have a joint in the heel or the middle of the foot.
    """
    roles = dict(anatomy.roles)
    for side in SIDES:
        knee, ankle = (anatomy.roles.get(side + part) for part in ("LowerLeg", "Foot"))
        if knee is None or ankle is None:
            continue
        shin = direction(places, knee, ankle)

        def along(bone: tuple[int, int], shin: Array = shin) -> float:
            return float(np.percentile((direction(places, *bone) * shin).sum(axis=1), BENT_LESS))

        below = roles.get(f"{side}Toes", _only_child(skeleton, ankle))
        while below is not None and along((ankle, below)) > ALONG:
            onward = _only_child(skeleton, below)
            if onward is None or along((below, onward)) > AHEAD:
                break
            roles[f"{side}Toes"] = below = onward
    return anatomy if roles == anatomy.roles else replace(anatomy, roles=roles)


def _only_child(skeleton: Skeleton, joint: int) -> int | None:
    """The child of a joint that has one; else None."""
    children = skeleton.children[joint]
    return children[0] if len(children) == 1 else None
