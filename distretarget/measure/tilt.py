"""How far the world of a clip is tilted: gravity shows it, since nobody stands straight over soles that lean."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.axes import Directions
from distretarget.body.body import Body
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Flags, lengths, normalised

STRAIGHT = 0.9  # a leg that stands is at least this long [leg lengths]
AGREE = np.radians(15)  # trunk and legs of a straight body are within this angle of up from its soles [rad]
LIES = np.radians(60)  # a body that leans farther than this lies [rad]
LEAST = 10  # fewer frames in which a foot stands show nothing


def world_tilt(motion: Motion, body: Body, still: Flags) -> float:
    """Return how far the world of a motion is tilted [degrees]: the least of what soles, legs and trunk lean on average
    while a foot stands under a straight leg, if they lean to the same side; else 0. On a slope only the soles lean, and
    of a person who bows only the trunk does. Feet are taken to stand flat in the rest pose; nothing is known of a body
    that does not stand in it.

    `still`, (frames, 2), says whether each foot stays where it is.
    """
    if body.legs is None or body.anatomy is None or not body.stands_at_rest:
        return 0.0
    trunk = Directions(body.anatomy, motion.positions).trunk
    ups: list[list[Array]] = [[], [], []]
    for leg, stays in zip(body.legs, still.T, strict=True):
        up_the_leg = motion.positions[:, leg.hip] - motion.positions[:, leg.ankle]
        on = stays & (lengths(up_the_leg) > STRAIGHT * body.leg_length)
        if on.any():
            normals = Rotation.from_quat(motion.world_rotations_of(leg.ankle)[on]).apply(body.rest.axes[:, 1])
            for each, found in zip(ups, (normals, up_the_leg[on], trunk[on]), strict=True):
                each.append(found)
    if sum(map(len, ups[0])) < LEAST:
        return 0.0
    means = normalised(np.stack([np.concatenate(each).mean(axis=0) for each in ups]))
    apart = np.arccos(np.clip(means[1:] @ means[0], -1.0, 1.0))
    leans = np.arccos(np.clip(means @ body.up_vector, -1.0, 1.0))
    return float(np.degrees(leans.min())) if apart.max() < AGREE and leans.max() < LIES else 0.0
