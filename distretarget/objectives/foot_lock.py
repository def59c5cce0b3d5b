"""Foot lock: when feet rest on the floor, and where the target's feet are locked.

A foot rests while it is slow and low. It keeps its rotation of the rotation copy, and its sole meets the floor as the
source's does:

    toe = scale source toe + mean over the rest (scale source foot - copied foot), along the floor
        + (how far the copied sole is below the toe - scale the source's) up
    ankle = toe + copied foot

So the sole has the source's height, scaled; the ankle has, on average over each rest, the source's place along the
floor; and the foot does not skate relative to the source's toe.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.legs import Leg
from distretarget.body.resting import feet_at_rest
from distretarget.body.soles import Sole
from distretarget.ik.springs import no_springs
from distretarget.motion import Motion
from distretarget.numerics.kinematics import heights_of
from distretarget.numerics.parallel import mapper_for
from distretarget.numerics.time_series import Shots, by_shot, over_runs, widened
from distretarget.numerics.vectors import level
from distretarget.objectives.clip import Clip, LegPair
from distretarget.objectives.floor import no_floor
from distretarget.objectives.supports import BLEND, RESTS, Supports, no_supports

Array = NDArray[np.float64]

ROLL = 0.05  # height over which the lowest point of the sole rolls from heel to toe [leg lengths]


def find_foot_lock(clip: Clip) -> Supports:
    """Return the feet at rest in the source, and where they belong on the target."""
    if not clip.legs:
        return no_supports(len(clip))
    length, rounding = clip.leg_lengths[0], ROLL * clip.leg_lengths[0]
    blend = partial(widened, frames=BLEND / clip.frame_time)

    def foot(pair: LegPair) -> tuple[Array, list[Array]]:
        """The weights of ankle and toe, (frames, 2), and their places."""
        rests = feet_at_rest(clip.source, pair.source, clip.up, length, shots=clip.shots)
        weights = by_shot(blend, clip.shots, rests.astype(np.float64))
        source = _Foot.of(clip.source, pair.source, pair.source_sole, clip.up, rounding)
        copy = _Foot.of(clip.copy, pair.target, pair.target_sole, clip.up, clip.scale.height * rounding)
        return weights, _places(source, copy, clip.scale, clip.up, weights.max(axis=1), clip.shots)

    side_by_side = mapper_for(len(clip), len(clip.skeleton))
    weights, places = zip(*side_by_side(foot, clip.legs), strict=True)
    joints = np.array([joint for pair in clip.legs for joint in (pair.target.ankle, pair.target.toe)])
    return Supports(
        joints=joints,
        regions=clip.regions.of_joint[joints],
        feet=len(joints),
        weights=np.concatenate(weights, axis=1),
        places=np.stack([*places[0], *places[1]], axis=1),
        floor=no_floor(len(clip)),
        scene_springs=no_springs(len(clip)),
    )


def hips_rise(clip: Clip, feet: Supports) -> Array:
    """Return how far to raise the hips above the source's height, scaled, because the target's ankles are higher,
    (frames,) [target file units]: the median over the resting frames of a shot, or the difference of the soles' ankle
    heights in a shot without any.
    """
    if not clip.legs:
        return np.zeros(len(clip))
    ankles = [pair.source.ankle for pair in clip.legs]
    places, weights = feet.places[:, ::2], feet.weights[:, ::2]
    higher = (places - clip.scale.places(clip.source.positions[:, ankles], clip.up)) @ clip.up
    usual = np.mean([pair.target_sole.ankle - clip.scale.height * pair.source_sole.ankle for pair in clip.legs])

    def median(values: Array, weights: Array) -> Array:
        resting = values[weights >= RESTS]
        return np.full(len(values), np.median(resting) if len(resting) else usual)

    return by_shot(median, clip.shots, higher, weights)


@dataclass(frozen=True, eq=False)
class _Foot:
    """A foot over the frames of a motion."""

    toe: Array  # (frames, 3), its places [file units]
    bone: Array  # (frames, 3), from toe to ankle [file units]
    # (frames,), how far the lowest point of the sole is below the toe; it rolls smoothly from heel to toe [file units]
    below: Array

    @classmethod
    def of(cls, motion: Motion, leg: Leg, sole: Sole, up: Array, rounding: float) -> _Foot:
        """The foot of a leg in a motion."""
        positions = motion.positions
        toe = positions[:, leg.toe]
        bone = positions[:, leg.ankle] - toe
        normal = Rotation.from_quat(motion.world_rotations_of(leg.ankle)).apply(sole.normal) @ up
        under = np.outer(normal, sole.heights) - (heights_of(positions, sole.joints, up) - (toe @ up)[:, None])
        heel, others = under[:, 0], under[:, 1:]
        front = others.max(axis=1) if others.shape[1] else heel
        return cls(toe, bone, (heel + front + np.hypot(heel - front, rounding)) / 2.0)


def _places(source: _Foot, copy: _Foot, scale: RootScale, up: Array, weights: Array, shots: Shots) -> list[Array]:
    """The places of ankle and toe, (frames, 3) each [target file units]; `weights`, (frames,), are 1 at rest."""
    longer = level(scale.height * source.bone - copy.bone, up)
    toe = scale.places(source.toe, up) + by_shot(over_runs, shots, longer, weights)
    toe += (copy.below - scale.height * source.below)[:, None] * up
    return [toe + copy.bone, toe]
