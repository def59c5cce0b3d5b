"""Feet on the floor of a character's file: the height at which they stand flat there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from distretarget.baseline.rotation_copy import find_root_scale
from distretarget.body.resting import feet_at_rest
from distretarget.matching.matching import Matching
from distretarget.numerics.kinematics import heights_of

LOW = 0.2  # the lowest joints of feet on the floor are lower than this [leg lengths]


def on_own_soles(matching: Matching, scale: float | None = None) -> Matching:
    """Return the matching with the source raised or lowered, so that the target's feet stand flat as high above the
    floor as in its bind pose: by the thickness of its soles, which no joint shows.

    Only the file of a character says where the floor is below its rest pose (`Skeleton.floor_at_zero`). Where the
    source's feet are not near height 0 while they rest, or the target's are not at rest, nothing changes. `scale` is
    that of the root's path; the ratio of leg lengths if not given.
    """
    target = matching.target
    if matching.legs is None or not target.skeleton.floor_at_zero or not target.stands_at_rest:
        return matching
    up, motion = target.up_vector, matching.source_motion
    places = target.skeleton.rest_positions + target.skeleton.offsets[0]
    own = float(np.mean([(places[sole.joints] @ up).min() for _, sole in matching.soles]))
    source_leg, leg = matching.leg_lengths
    heights = []
    for joints, (sole, _) in zip(matching.legs[0], matching.soles, strict=True):
        rests = feet_at_rest(motion, joints, up, source_leg).all(axis=1)
        heights.append(heights_of(motion.positions[rests], sole.joints, up).min(axis=1))
    resting = np.concatenate(heights)
    found = float(np.median(resting)) if len(resting) else np.inf
    if abs(found) > LOW * source_leg or not 0.0 <= own <= LOW * leg:
        return matching
    rise = own / (scale or find_root_scale(matching)) - found
    raised = replace(motion, root_positions=motion.root_positions + rise * up)
    return replace(matching, source=matching.source.with_motion(raised, target.up))
