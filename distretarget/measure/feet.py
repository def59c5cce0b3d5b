"""Feet and hips: when feet rest, how far they slide then, and how far feet and hips are from where they should be.

Heights are compared in leg lengths of each body. A foot is compared with how the target's own foot stands on its flat
sole, so that a foot of another build is not an error. Where the target's feet have a mesh, its lowest vertices are
their soles, and belong at the mean height of the source's sole over a rest, on a level floor (`level_on_floor`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.body.limbs import Leg
from distretarget.body.soles import Sole, floor_height, level_on_floor
from distretarget.matching.matching import Matching
from distretarget.matching.undersides import Undersides
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import lowest_heights, speeds_along
from distretarget.numerics.kinematics import turned_by
from distretarget.numerics.time_series import over_runs
from distretarget.numerics.vectors import lengths, level

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SLOW = 0.35  # a resting foot joint is slower than this [leg lengths / s] ...
LOW = 0.06  # ... and within this [leg lengths] of its lowest heights,
LOWEST = 2.0  # which is this percentile of them [%]
FLAT = 5.0  # a foot within this of the pitch of its flat sole stands flat [degrees]
LEVEL = 0.5  # a sole stands on the floor, not on the tip or the back of the foot, if it is nearer to level [cosine]


@dataclass(frozen=True, eq=False)
class FlatFoot:
    """A foot, and how it stands on its flat sole."""

    leg: Leg
    points: NDArray[np.intp]  # (points,), the ankle and all joints below it; only the ankle if there is no toe
    flat_pitch: float = np.nan  # elevation of the bone from ankle to toe on the flat sole [degrees]; nan if unknown
    flat_height: float = np.nan  # of the ankle over the lowest point on the flat sole [file units]; nan if unknown
    normal: Array | None = None  # (3,), the unit vector up from the flat sole in the ankle's axes; None if unknown

    def sole_up(self, motion: Motion) -> Array:
        """(frames, 3), the unit vector up from the sole, in the world; nan if unknown."""
        if self.normal is None:
            return np.full((len(motion), 3), np.nan)
        return turned_by(motion.world_rotations_of(self.leg.ankle), self.normal)

    def pitch(self, positions: Array, up: Array) -> Array:
        """(...), the elevation of the bone from ankle to toe at positions (..., joints, 3) [degrees]; nan without a
        toe. `up`, (3,), is the unit vector up.
        """
        bone = positions[..., self.leg.toe, :] - positions[..., self.leg.ankle, :]
        length = lengths(bone)
        sine = np.divide(bone @ up, length, out=np.full_like(length, np.nan), where=length > 0)
        return np.asarray(np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))))

    def lowest(self, positions: Array, up: Array) -> Array:
        """(frames,), the height of the lowest of the points [file units]; as in `pitch`."""
        return lowest_heights(positions, up, self.points)


def find_flat_foot(body: Body, leg: Leg, sole: Sole) -> FlatFoot:
    """Find how the foot of a leg stands on its flat sole: as in the rest pose if a person can stand in that pose and
    the foot does not hang there, else as the motion shows.
    """
    foot, toe = FlatFoot(leg, sole.joints), np.flatnonzero(sole.joints == leg.toe)
    bone = np.linalg.norm(body.reference.positions[leg.toe] - body.reference.positions[leg.ankle])
    if not (len(toe) and bone and sole.known):
        return foot
    sine = (sole.heights[toe[0]] - sole.ankle) / bone
    pitch = float(np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))))
    return replace(foot, flat_pitch=pitch, flat_height=sole.ankle, normal=sole.normal)


@dataclass(frozen=True, eq=False, kw_only=True)
class Feet:
    """The feet of a result against those of its source. All arrays have no columns if the bodies have no legs.

    Errors are nan in frames in which nothing is to be measured.
    """

    joints: NDArray[np.intp]  # (foot joints,), the target's left ankle and toe, then the right ones
    stance: Flags  # (frames, foot joints), whether each foot joint of the source rests
    skate_source: Array  # (frames, foot joints), horizontal speed [leg lengths / s]
    skate: Array  # the same of the result
    foot_height: Array  # (frames, legs), of the sole while ankle or toe rests [% of leg length]
    foot_pitch: Array  # (frames, legs), from the flat sole, while ankle and toe rest and the sole is down [degrees]
    ankle_height: Array  # (frames, legs), over the source's floor, while the foot rests flat [% of leg length]
    hips_height: Array  # (frames, legs), over a resting ankle, while only feet carry the body [% of leg length]


@dataclass(frozen=True, eq=False, kw_only=True)
class _FootTracks:
    """The feet of one body over time."""

    skate: Array  # (frames, foot joints), horizontal speed [leg lengths / s]
    sole: Array  # (frames, legs), the height of the lowest joint of the foot or of the heel [leg lengths]
    level: Flags  # (frames, legs), whether the sole, not the tip or the back of the foot, faces the floor
    pitch: Array  # (frames, legs), of the foot from its flat sole [degrees]
    flat_ankle: Array  # (frames, legs), the height of the ankle less that over a flat sole [leg lengths]
    hips: Array  # (frames, legs), the height of the middle of the hip joints over the ankle [leg lengths]


@dataclass(frozen=True, eq=False, kw_only=True)
class SourceFeet:
    """The feet of a source, which those of results are measured against."""

    up: Array  # (3,), the unit vector up in source and results
    soles: Sequence[FlatFoot]  # the target's feet
    leg: float  # the length of the target's legs [file units]
    stance: Flags  # as in `Feet`
    tracks: _FootTracks  # of the source
    belongs: Array  # (frames, legs), the height at which the sole belongs [leg lengths]
    undersides: Undersides | None  # the skins of source and target; None if no mesh shows the target's feet

    def in_result(self, result: Motion, others_carry: Flags) -> Feet:
        """Measure the feet of a result; `others_carry`, (frames,), is whether other joints carry the body as well."""
        ankle_rests, toe_rests = self.stance[:, ::2], self.stance[:, 1::2]
        source, own = self.tracks, _foot_tracks(result, self.soles, self.leg, self.up)
        sole = own.sole if self.undersides is None else self._lowest_skin(result, self.undersides)
        on_sole = ankle_rests & toe_rests & source.level
        flat = on_sole & (np.abs(source.pitch) <= FLAT)
        alone = ankle_rests & ~others_carry[:, None]
        return Feet(
            joints=_foot_joints([sole.leg for sole in self.soles]),
            stance=self.stance,
            skate_source=source.skate,
            skate=own.skate,
            foot_height=np.where(ankle_rests | toe_rests, 100 * np.abs(sole - self.belongs), np.nan),
            foot_pitch=np.where(on_sole, np.abs(own.pitch - source.pitch), np.nan),
            ankle_height=np.where(flat, 100 * np.abs(own.flat_ankle - self.belongs), np.nan),
            hips_height=np.where(alone, 100 * np.abs(own.hips - source.hips), np.nan),
        )

    def _lowest_skin(self, result: Motion, undersides: Undersides) -> Array:
        """(frames, legs), the height of the lowest vertex of each foot, less that below a flat foot [leg lengths]."""
        lowest = [undersides.target.lowest_of_foot(result, sole.leg.ankle, self.up) for sole in self.soles]
        return (np.stack(lowest, axis=1) + undersides.soles[1]) / self.leg


def find_feet(source: Motion, matching: Matching, up: Array, undersides: Undersides | None = None) -> SourceFeet:
    """Measure the feet of a source; `up`, (3,), is the unit vector up in source and results, `undersides` are the skins
    of both bodies, if known.
    """
    on_mesh = undersides if undersides is not None and undersides.feet_have_mesh else None
    legs, target_legs = matching.legs or ((), ())
    soles = zip(*matching.soles, strict=True) if matching.soles else ((), ())
    source_feet, feet = (
        [find_flat_foot(body, leg, sole) for leg, sole in zip(own, of_body, strict=True)]
        for body, own, of_body in zip((matching.source, matching.target), (legs, target_legs), soles, strict=True)
    )
    length, target_length = matching.leg_lengths
    stance, tracks = _stance(source, legs, length, up), _foot_tracks(source, source_feet, length, up)
    return SourceFeet(
        up=up,
        soles=feet,
        leg=target_length,
        stance=stance,
        tracks=tracks,
        belongs=tracks.sole if on_mesh is None else _on_floor(tracks.sole, stance[:, ::2] | stance[:, 1::2]),
        undersides=on_mesh,
    )


def _on_floor(soles: Array, rests: Flags) -> Array:
    """(frames, legs), the heights at which soles belong that are at these heights in the source, (frames, legs), and
    rest or not.
    """
    if not rests.any():
        return soles
    means = [over_runs(sole[:, None], rest.astype(float))[:, 0] for sole, rest in zip(soles.T, rests.T, strict=True)]
    return level_on_floor(np.stack(means, axis=1), floor_height(soles, rests), rests, 1.0)


def _foot_tracks(motion: Motion, soles: Sequence[FlatFoot], length: float, up: Array) -> _FootTracks:
    """Follow the feet of a motion, on legs of this length [file units]."""
    positions, legs = motion.positions, [sole.leg for sole in soles]
    ankles = [positions[:, leg.ankle] for leg in legs]
    hips = [positions[:, [leg.hip for leg in legs]].mean(axis=1) - ankle for ankle in ankles]
    normals = [sole.sole_up(motion) for sole in soles]
    heels = [ankle - sole.flat_height * normal for ankle, sole, normal in zip(ankles, soles, normals, strict=True)]

    def columns(values: list[Array]) -> Array:
        return np.reshape(values, (len(soles), len(motion))).T

    return _FootTracks(
        skate=speeds_along(level(_foot_paths(motion, legs, length), up), motion.frame_time),
        sole=columns([np.fmin(sole.lowest(positions, up), heel @ up) for sole, heel in zip(soles, heels, strict=True)])
        / length,
        level=~(columns([normal @ up for normal in normals]) < LEVEL),
        pitch=columns([sole.pitch(positions, up) - sole.flat_pitch for sole in soles]),
        flat_ankle=columns([ankle @ up - sole.flat_height for ankle, sole in zip(ankles, soles, strict=True)]) / length,
        hips=columns([over @ up for over in hips]) / length,
    )


def _stance(motion: Motion, legs: Sequence[Leg], length: float, up: Array) -> Flags:
    """(frames, foot joints), whether each foot joint rests: it is slow, and near its lowest heights."""
    paths = _foot_paths(motion, legs, length)
    heights = paths @ up
    low = heights - np.percentile(heights, LOWEST, axis=0) < LOW
    return np.asarray(low & (speeds_along(paths, motion.frame_time) < SLOW))


def _foot_paths(motion: Motion, legs: Sequence[Leg], length: float) -> Array:
    """(frames, foot joints, 3), positions of the foot joints [leg lengths]."""
    return motion.positions[:, _foot_joints(legs)] / length


def _foot_joints(legs: Sequence[Leg]) -> NDArray[np.intp]:
    """Ankle and toe of each leg in turn."""
    return np.array([joint for leg in legs for joint in (leg.ankle, leg.toe)], np.intp)
