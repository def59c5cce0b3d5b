"""Foot lock: when feet rest on the floor, and where they belong on the target."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.legs import Leg
from distretarget.body.resting import feet_at_rest
from distretarget.body.soles import Sole
from distretarget.ik.springs import no_springs
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.kinematics import heights_of
from distretarget.numerics.parallel import mapper_for
from distretarget.numerics.time_series import Shots, by_shot, over_runs, widened
from distretarget.numerics.vectors import level
from distretarget.objectives.floor import no_floor
from distretarget.objectives.settings import ContactSettings
from distretarget.objectives.supports import RESTS, Supports, no_supports

Array = NDArray[np.float64]

ROLL = 0.05  # the height by which heel and toe differ while the sole rolls from one to the other [leg lengths]


def find_stance(
    matching: Matching, copy: Motion, scale: RootScale, shots: Shots, settings: ContactSettings
) -> Supports:
    """The feet at rest in the source, and where they belong on the target.

    A foot rests while it is slow and low. It is held as in the rotation copy, sole to the floor as in the source. Its
    sole is as high as the source's, scaled; its ankle is, on average over the frames of each rest, where the
    source's ankle is in the plane, scaled; and it does not slide against the source's toe. `shots`, (frames,),
    are those of the clip; what happens in one says nothing of the others.
    """
    source, legs = matching.source_motion, matching.legs
    if legs is None:
        return no_supports(len(source))
    up, length = matching.source.up_vector, matching.leg_lengths[0]
    blend = partial(widened, frames=settings.support_blend / source.frame_time)
    limits: dict[str, Any] = {"speed": settings.rest_speed, "height": settings.rest_height, "shots": shots}
    rounding = ROLL * length

    def foot(driver: Leg, leg: Leg, soles: tuple[Sole, Sole]) -> tuple[Array, list[Array]]:
        """How much ankle and toe rest, (frames, 2), and where they belong."""
        weights = by_shot(blend, shots, feet_at_rest(source, driver, up, length, **limits).astype(np.float64))
        feet = (
            _Foot.of(source, driver, soles[0], up, rounding),
            _Foot.of(copy, leg, soles[1], up, scale.height * rounding),
        )
        return weights, _places(*feet, scale, up, weights.max(axis=1), shots)

    side_by_side = mapper_for(*copy.positions.shape[:2])
    weights, places = zip(*side_by_side(foot, *legs, matching.soles), strict=True)
    at = np.array([joint for leg in legs[1] for joint in (leg.ankle, leg.toe)])
    return Supports(
        joints=at,
        regions=matching.regions.of_joint[at],
        feet=len(at),
        weights=np.concatenate(weights, axis=1),
        places=np.stack([*places[0], *places[1]], axis=1),
        floor=no_floor(len(source)),
        touching=no_springs(len(source)),
    )


def hips_rise(matching: Matching, stance: Supports, scale: RootScale, shots: Shots) -> Array:
    """Return how much higher the hips belong than the source's, scaled, because the ankles do, (frames,) [target
    file units]: the median over the frames of a shot in which an ankle rests, or without any what the soles show.
    """
    source = matching.source_motion
    if matching.legs is None:
        return np.zeros(len(source))
    ankles = [leg.ankle for leg in matching.legs[0]]
    places, weights = stance.places[:, ::2], stance.weights[:, ::2]
    up = matching.source.up_vector
    higher = (places - scale.places(source.positions[:, ankles], up)) @ up
    usual = np.mean([target.ankle - scale.height * source.ankle for source, target in matching.soles])
    return by_shot(partial(_median, usual=float(usual)), shots, higher, weights)


def _median(values: Array, weights: Array, usual: float) -> Array:
    """(frames,), the median of values (frames, n) where a foot rests; the usual value where none does."""
    resting = values[weights >= RESTS]
    return np.full(len(values), np.median(resting) if len(resting) else usual)


@dataclass(frozen=True, eq=False)
class _Foot:
    """A foot over the frames of a motion.

    Attributes:
        toe: (frames, 3), its places [file units].
        bone: (frames, 3), from toe to ankle [file units].
        below: (frames,), how far the lowest point of the sole is below the toe, as of a sole that rolls smoothly from
            heel to toe [file units].
    """

    toe: Array
    bone: Array
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
    """Where ankle and toe belong, (frames, 3) each [target file units], as `find_stance` says.

    `weights`, (frames,), are 1 while the foot rests, blended to 0; `shots`, (frames,), are those of the clip.
    """
    longer = level(scale.height * source.bone - copy.bone, up)
    toe = scale.places(source.toe, up) + by_shot(over_runs, shots, longer, weights)
    toe += (copy.below - scale.height * source.below)[:, None] * up
    return [toe + copy.bone, toe]
