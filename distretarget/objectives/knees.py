"""Straightens knees that the source bends a little backwards, as straight legs in motion capture often are.

Where a foot rests nearer to the hips than in the rotation copy, its knee bends more than the copied one. It would bend
farther backwards, and snap to the front when the copied knee does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from distretarget.body.axes import perpendicular
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import angles_between, lengths, normalised
from distretarget.objectives.clip import Clip
from distretarget.objectives.supports import Supports
from distretarget.skin.limbs import Limb, bent

BACKWARDS = np.radians(10)  # knees bent backwards by up to this are straightened; from twice this on they stay [rad]
NEARER = 0.01  # knees are straightened in full where the foot comes nearer to the hips by this or more [shins]


def with_straight_knees(clip: Clip, feet: Supports, limbs: Sequence[Limb]) -> Clip:
    """Return the clip with knees of its rotation copy straightened that bend a little backwards, away from where the
    foot points, while the foot rests nearer to the hips than in the copy. `feet` are the supports of feet, `limbs`
    those of the target; the clip's root path has to be final.
    """
    legs, moved = {limb.end: number for number, limb in enumerate(limbs)}, np.zeros((len(clip), len(limbs), 2, 3))
    for support, pair in zip(range(0, feet.feet, 2), clip.legs, strict=False):
        number = legs.get(pair.target.ankle)
        if number is None:
            continue
        hip, knee, ankle, toe = (clip.copy.positions[:, each] for each in (*limbs[number].joints, pair.target.toe))
        thigh, shin = knee - hip, ankle - knee
        leg, place = ankle - hip, feet.places[:, support] - (clip.root - clip.copy.root_positions)
        axis = normalised(leg)
        forward = normalised(perpendicular(toe - ankle, axis))
        back = np.maximum(-(perpendicular(thigh, axis) * forward).sum(axis=1), 0.0)
        nearer = (lengths(leg) - lengths(place - hip)) / (NEARER * lengths(shin))
        firm = feet.weights[:, support] * np.clip(nearer, 0.0, 1.0)
        firm *= 1.0 - smoothstep(angles_between(thigh, shin) / BACKWARDS - 1.0)
        moved[:, number, 0] = (firm * back)[:, None] * forward
    return replace(clip, copy=bent(clip.copy, limbs, moved)) if moved.any() else clip
