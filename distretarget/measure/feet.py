"""Feet and hips over resting feet: when feet rest, whether they slide, and whether they and the hips are in place.

Heights and lengths are compared after scaling by the ratio of leg lengths, and a foot is compared with how the target's
own foot stands on its sole, so that a foot of another build is no error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.body.legs import Leg, Legs, leg_length
from distretarget.matching.matching import Matching
from distretarget.measure.soles import Sole, find_sole
from distretarget.motion import Motion
from distretarget.numerics.kinematics import speeds_along
from distretarget.numerics.vectors import level

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SLOW = 0.35  # a resting foot joint is slower than this [leg lengths / s] ...
LOW = 0.06  # ... and within this [leg lengths] of its lowest heights,
LOWEST = 2.0  # which is this percentile of them [%]
FLAT = 5.0  # a foot within this of the pitch of its flat sole stands flat [degrees]


@dataclass(frozen=True, eq=False, kw_only=True)
class Feet:
    """The feet of a result against those of its source; without legs there are no columns.

    Attributes:
        joints: (foot joints,), the target's ankle and toe of the one leg, then of the other.
        stance: (frames, foot joints), whether each foot joint of the source rests.
        slide_source, slide: (frames, foot joints), horizontal speed of the foot joints [leg lengths / s].
        foot_height: (frames, legs), how far the height of the sole is off the scaled source's [% of leg length]; nan
            unless ankle or toe rests.
        foot_pitch: (frames, legs), how far the pitch of the foot from its flat sole is off that of the source's foot
            [degrees]; nan unless ankle and toe rest, or if a flat sole is not known.
        ankle_height: (frames, legs), how far the height of the ankle over the floor, the scaled source's, is off that
            of the target's own flat foot [% of leg length]; nan unless the source's foot rests flat.
        hips_height: (frames, legs), how far the height of the middle between the hip joints over the ankle is off the
            scaled source's [% of leg length]; nan unless the ankle rests, and only feet carry the body.
    """

    joints: NDArray[np.intp]
    stance: Flags
    slide_source: Array
    slide: Array
    foot_height: Array
    foot_pitch: Array
    ankle_height: Array
    hips_height: Array

    def standing_alone(self, others: Flags) -> Feet:
        """The same, without the height of the hips in the frames, (frames,), in which others carry the body as well."""
        return replace(self, hips_height=np.where(others[:, None], np.nan, self.hips_height))

    @property
    def rest(self) -> Flags:
        """(frames, legs), whether ankle or toe rests."""
        return np.asarray(self.stance[:, ::2] | self.stance[:, 1::2])


def measure_feet(source: Motion, result: Motion, matching: Matching, up: Array) -> Feet:
    """Measure the feet of a result against those of its source; `up`, (3,), points up in both."""
    if matching.legs is None:
        nothing = np.zeros((len(source), 0))
        return Feet(
            joints=np.zeros(0, np.intp),
            stance=nothing.astype(bool),
            slide_source=nothing,
            slide=nothing,
            foot_height=nothing,
            foot_pitch=nothing,
            ankle_height=nothing,
            hips_height=nothing,
        )
    stance = _stance(source, matching.legs[0], up)
    ankle_rests, toe_rests = stance[:, ::2], stance[:, 1::2]
    source_soles = _soles(matching.source, matching.legs[0], source, up)
    soles = _soles(matching.target, matching.legs[1], matching.target.motion, matching.target.up_vector)
    compared = _Compared(source, result, matching, up)
    legs = list(zip(source_soles, soles, strict=True))
    flat = np.stack([np.abs(a.pitch(source.positions, up) - a.flat_pitch) <= FLAT for a in source_soles], axis=1)
    return Feet(
        joints=np.array(_foot_joints(matching.legs[1]), np.intp),
        stance=stance,
        slide_source=_slide(source, matching.legs[0], up),
        slide=_slide(result, matching.legs[1], up),
        foot_height=_where(ankle_rests | toe_rests, [compared.sole_off(a, b) for a, b in legs]),
        foot_pitch=_where(ankle_rests & toe_rests, [compared.pitch_off(a, b) for a, b in legs]),
        ankle_height=_where(ankle_rests & toe_rests & flat, [compared.ankle_off(a, b) for a, b in legs]),
        hips_height=_where(ankle_rests, [compared.hips_off(a.leg, b.leg) for a, b in legs]),
    )


@dataclass(frozen=True, eq=False)
class _Compared:
    """A source and a result, of which heights are compared in the target's units.

    Attributes:
        source, result: the two motions.
        matching: the matching of their bodies, which have legs.
        up: (3,), the unit vector up in both.
    """

    source: Motion
    result: Motion
    matching: Matching
    up: Array

    def _off(self, source_height: Array, height: Array) -> Array:
        """(frames,), how far a height is off the scaled source's [% of leg length]."""
        source_leg, leg = self.matching.leg_lengths
        return np.asarray(100 * np.abs(height / leg - source_height / source_leg))

    def sole_off(self, a: Sole, b: Sole) -> Array:
        """(frames,), how far the height of a sole is off [% of leg length]."""
        return self._off(a.lowest(self.source.positions, self.up), b.lowest(self.result.positions, self.up))

    def pitch_off(self, a: Sole, b: Sole) -> Array:
        """(frames,), how far the pitch of a foot, from its flat sole, is off [degrees]."""
        pitches = (s.pitch(x.positions, self.up) - s.flat_pitch for s, x in ((a, self.source), (b, self.result)))
        source_pitch, pitch = pitches
        return np.asarray(np.abs(pitch - source_pitch))

    def ankle_off(self, a: Sole, b: Sole) -> Array:
        """(frames,), how far the ankle over the source's floor is off its height in the flat foot [% of leg length]."""
        height = self.result.positions[:, b.leg.ankle] @ self.up - b.flat_height
        return self._off(a.lowest(self.source.positions, self.up), height)

    def hips_off(self, a: Leg, b: Leg) -> Array:
        """(frames,), how far the hips over the ankle of a leg are off [% of leg length]."""
        pairs = zip((self.source, self.result), self.matching.legs or (), (a, b), strict=True)
        heights = (
            (motion.positions[:, [leg.hip for leg in legs]].mean(axis=1) - motion.positions[:, one.ankle]) @ self.up
            for motion, legs, one in pairs
        )
        return self._off(*heights)


def _soles(body: Body, legs: Legs, motion: Motion | None, up: Array) -> list[Sole]:
    """The soles of a body; `motion` is one of this body, in which `up`, (3,), points up."""
    if motion is None:
        return [find_sole(body, leg, np.zeros((0, len(body.skeleton), 3)), up) for leg in legs]
    rest = _stance(motion, legs, up)
    flat = (rest[:, 2 * k] & rest[:, 2 * k + 1] for k in range(len(legs)))
    return [find_sole(body, leg, motion.positions[frames], up) for leg, frames in zip(legs, flat, strict=True)]


def _stance(motion: Motion, legs: Legs, up: Array) -> Flags:
    """(frames, foot joints), whether each foot joint rests: it is slow, and near its lowest heights."""
    paths = _foot_paths(motion, legs)
    heights = paths @ up
    low = heights - np.percentile(heights, LOWEST, axis=0) < LOW
    return np.asarray(low & (speeds_along(paths, motion.frame_time) < SLOW))


def _slide(motion: Motion, legs: Legs, up: Array) -> Array:
    """(frames, foot joints), the horizontal speed of the foot joints [leg lengths / s]."""
    paths = _foot_paths(motion, legs)
    return speeds_along(level(paths, up), motion.frame_time)


def _foot_paths(motion: Motion, legs: Legs) -> Array:
    """(frames, foot joints, 3), where the foot joints are [leg lengths]."""
    return motion.positions[:, _foot_joints(legs)] / leg_length(motion.rigid_skeleton, legs)


def _foot_joints(legs: Legs) -> list[int]:
    """Ankle and toe of the one leg, then of the other."""
    return [joint for leg in legs for joint in (leg.ankle, leg.toe)]


def _where(measured: Flags, columns: list[Array]) -> Array:
    """(frames, legs), the columns of the legs where they are measured, nan elsewhere."""
    return np.where(measured, np.stack(columns, axis=1), np.nan)
