"""Feet on the floor of a character's file: the height at which they stand flat there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from distretarget.baseline.rotation_copy import find_root_scale
from distretarget.body.resting import feet_at_rest, feet_resting
from distretarget.body.soles import floor_height, sole_height
from distretarget.matching.matching import Matching
from distretarget.matching.undersides import Undersides
from distretarget.numerics.joint_paths import heights_of

LOW = 0.2  # the lowest joints of feet on the floor are lower than this [leg lengths]


def on_own_soles(matching: Matching, scale: float | None = None, undersides: Undersides | None = None) -> Matching:
    """Return the matching with the source raised or lowered, so that the target's feet stand flat on the floor at
    height 0: on the soles of its mesh, or as high above it as in the bind pose, by the thickness of soles that no joint
    shows.

    Without a mesh only the file of a character says where the floor is below its rest pose
    (`Skeleton.floor_at_zero`). Where the source's feet are not near height 0 while they rest, or the target's are not
    at rest, nothing changes. `scale` is that of the root's path; the ratio of leg lengths if not given. `undersides`
    are the skins of both bodies; None if they are not known.
    """
    target, motion = matching.target, matching.source_motion
    source_leg, leg = matching.leg_lengths
    on_mesh = undersides is not None and undersides.feet_have_mesh
    if undersides is not None and on_mesh:
        own = undersides.soles[1]
    elif matching.legs is not None and target.skeleton.floor_at_zero and target.stands_at_rest:
        places = target.skeleton.rest_positions + target.skeleton.offsets[0]
        own = float(np.mean([(places[sole.joints] @ target.up_vector).min() for _, sole in matching.soles]))
    else:
        return matching
    found = _floor_of_source(matching, on_mesh)
    if abs(found) > LOW * source_leg or not (-LOW * leg if on_mesh else 0.0) <= own <= LOW * leg:
        return matching
    rise = own / (scale or find_root_scale(matching)) - found
    raised = replace(motion, root_positions=motion.root_positions + rise * target.up_vector)
    return replace(matching, source=matching.source.with_motion(raised, target.up))


def _floor_of_source(matching: Matching, on_mesh: bool) -> float:
    """The height of the source's floor [source file units]: the median of the lowest joints of its flat feet, or, if
    feet are to stand `on_mesh`, the floor under its soles; infinite where no foot rests.
    """
    motion, up, length = matching.source_motion, matching.target.up_vector, matching.leg_lengths[0]
    feet = [*zip(matching.legs[0] if matching.legs else (), [sole for sole, _ in matching.soles], strict=True)]
    if on_mesh:
        shots = matching.source.shots_of(motion)
        rests = [feet_resting(motion, leg, up, length, shots).max(axis=1) == 1.0 for leg, _ in feet]
        return floor_height(
            np.stack([sole_height(motion, sole, up) for _, sole in feet], axis=1), np.stack(rests, axis=1)
        )
    heights = []
    for leg, sole in feet:
        rests_flat = feet_at_rest(motion, leg, up, length).all(axis=1)
        heights.append(heights_of(motion.positions[rests_flat], sole.joints, up).min(axis=1))
    resting = np.concatenate(heights)
    return float(np.median(resting)) if len(resting) else np.inf
