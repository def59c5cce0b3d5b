"""Feet and hips over resting feet: when feet rest, whether they slide, and whether they and the hips are in place.

Heights and lengths are compared after scaling by the ratio of leg lengths, and a foot is compared with how the target's
own foot stands on its sole, so that a foot of another build is not an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.body.legs import Leg
from distretarget.matching.matching import Matching
from distretarget.measure.flat_foot import FlatFoot, find_flat_foot
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


@dataclass(frozen=True, eq=False, kw_only=True)
class FootHeights:
    """The feet of a motion in numbers that are compared between bodies; of one without legs they have no columns.

    Attributes:
        sole: (frames, legs), the height of the sole [leg lengths].
        pitch: (frames, legs), that of the foot from its flat sole [degrees].
        flat_ankle: (frames, legs), the height of the ankle less that over a flat sole [leg lengths].
        hips: (frames, legs), the height of the middle between the hip joints over the ankle [leg lengths].
    """

    sole: Array
    pitch: Array
    flat_ankle: Array
    hips: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class SourceFeet:
    """The feet of a source, which those of results are measured against.

    Attributes:
        up: (3,), the unit vector up in source and results.
        soles: those of the target's legs.
        leg: the length of these [file units].
        stance, slide: as in `Feet`.
        heights: the source's.
    """

    up: Array
    soles: Sequence[FlatFoot]
    leg: float
    stance: Flags
    slide: Array
    heights: FootHeights

    def in_result(self, result: Motion) -> Feet:
        """The feet of a result against these."""
        ankle_rests, toe_rests = self.stance[:, ::2], self.stance[:, 1::2]
        legs = [sole.leg for sole in self.soles]
        source, own = self.heights, _heights(result, self.soles, self.leg, self.up)
        flat = ankle_rests & toe_rests & (np.abs(source.pitch) <= FLAT)
        return Feet(
            joints=_foot_joints(legs),
            stance=self.stance,
            slide_source=self.slide,
            slide=_slide(result, legs, self.leg, self.up),
            foot_height=_where(ankle_rests | toe_rests, 100 * np.abs(own.sole - source.sole)),
            foot_pitch=_where(ankle_rests & toe_rests, np.abs(own.pitch - source.pitch)),
            ankle_height=_where(flat, 100 * np.abs(own.flat_ankle - source.sole)),
            hips_height=_where(ankle_rests, 100 * np.abs(own.hips - source.hips)),
        )


def find_feet(source: Motion, matching: Matching, up: Array) -> SourceFeet:
    """The feet of a source, for measuring those of results; `up`, (3,), points up in source and results."""
    legs, target_legs = matching.legs or ((), ())
    length, target_length = matching.leg_lengths
    rest = _stance(source, legs, length, up)
    soles = _soles(matching.source, legs, source.positions, rest, up)
    return SourceFeet(
        up=up,
        soles=_soles_of_target(matching.target, target_legs, target_length),
        leg=target_length,
        stance=rest,
        slide=_slide(source, legs, length, up),
        heights=_heights(source, soles, length, up),
    )


def _soles_of_target(body: Body, legs: Sequence[Leg], length: float) -> list[FlatFoot]:
    """The soles of the target's legs, which are of this length [file units]."""
    up = body.up_vector
    if body.motion is None:
        no_frames = np.zeros((0, len(body.skeleton), 3))
        return _soles(body, legs, no_frames, np.zeros((0, 2 * len(legs)), bool), up)
    return _soles(body, legs, body.motion.positions, _stance(body.motion, legs, length, up), up)


def _soles(body: Body, legs: Sequence[Leg], positions: Array, rest: Flags, up: Array) -> list[FlatFoot]:
    """The soles of legs; `positions`, (frames, joints, 3), are of their body, and `rest`, (frames, foot joints), is
    whether the foot joints rest there.
    """
    flat = rest[:, ::2] & rest[:, 1::2]
    return [find_flat_foot(body, leg, positions[flat[:, k]], up) for k, leg in enumerate(legs)]


def _heights(motion: Motion, soles: Sequence[FlatFoot], length: float, up: Array) -> FootHeights:
    """The heights and pitches of feet in a motion; legs are of this length, `up`, (3,), is the unit vector up."""
    positions = motion.positions
    ankles = [positions[:, sole.leg.ankle] for sole in soles]
    hips = [positions[:, [sole.leg.hip for sole in soles]].mean(axis=1) - ankle for ankle in ankles]
    flat_ankles = [ankle @ up - sole.flat_height for ankle, sole in zip(ankles, soles, strict=True)]

    def columns(values: list[Array]) -> Array:
        return np.reshape(values, (len(soles), len(motion))).T

    return FootHeights(
        sole=columns([sole.lowest(positions, up) for sole in soles]) / length,
        pitch=columns([sole.pitch(positions, up) - sole.flat_pitch for sole in soles]),
        flat_ankle=columns(flat_ankles) / length,
        hips=columns([over @ up for over in hips]) / length,
    )


def _stance(motion: Motion, legs: Sequence[Leg], length: float, up: Array) -> Flags:
    """(frames, foot joints), whether each foot joint rests: it is slow, and near its lowest heights."""
    paths = _foot_paths(motion, legs, length)
    heights = paths @ up
    low = heights - np.percentile(heights, LOWEST, axis=0) < LOW
    return np.asarray(low & (speeds_along(paths, motion.frame_time) < SLOW))


def _slide(motion: Motion, legs: Sequence[Leg], length: float, up: Array) -> Array:
    """(frames, foot joints), the horizontal speed of the foot joints [leg lengths / s]."""
    return speeds_along(level(_foot_paths(motion, legs, length), up), motion.frame_time)


def _foot_paths(motion: Motion, legs: Sequence[Leg], length: float) -> Array:
    """(frames, foot joints, 3), where the foot joints of legs of this length are [leg lengths]."""
    return motion.positions[:, _foot_joints(legs)] / length


def _foot_joints(legs: Sequence[Leg]) -> NDArray[np.intp]:
    """Ankle and toe of the one leg, then of the other."""
    return np.array([joint for leg in legs for joint in (leg.ankle, leg.toe)], np.intp)


def _where(measured: Flags, values: Array) -> Array:
    """(frames, legs), the values where they are measured, nan elsewhere."""
    return np.where(measured, values, np.nan)
