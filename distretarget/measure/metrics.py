"""Measure a motion against the motion it was made from, by code that shares nothing with the solvers.

A pair is two joints or End Sites that both bodies have, at different places on at least one of them; D is their
distance divided by the length of the bone path between them, |P| the number of joints on that path.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.legs import Leg
from distretarget.matching.matching import Matching
from distretarget.measure.figures import Track, Tracks
from distretarget.motion import Motion
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

NEAR = 0.15  # a contact pair has D below this in the source ...
FAR_ALONG = 5  # ... and at least so many joints on its path
SLOW = 0.35  # a foot in stance is slower than this [leg lengths / s] ...
LOW = 0.06  # ... and within this [leg lengths] of its lowest heights,
LOWEST = 2.0  # which is this percentile of them
PAIR_FRAMES = 256  # frames whose pairs are in memory at a time


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison:
    """What was measured of a result and its source, per frame; `figures` makes the figures of it.

    Attributes:
        distance_error: (frames,), mean |D_source - D_result| over all pairs.
        contact_error: (frames,), the sum of |D_source - D_result| over the contact pairs of the frame.
        contacts: (frames,), how many contact pairs there are.
        direction_error: (frames, bones), angle between corresponding bones [degrees].
        bone_error: (frames,), the largest relative error of the length of a bone of the body against the target.
        stance: (frames, feet), whether each foot joint (ankles and toes) of the source is in stance.
        slide_source, slide: (frames, feet), horizontal speed of the foot joints [leg lengths / s].
        foot_height_source, foot_height: (frames, feet), height over the origin [% of leg length].
        jerk_source, jerk: (frames - 3,), mean norm of the third difference of positions over joints
            [body sizes / s^3].
        turn: (frames - 1, joints), how much more each joint turns from one frame to the next than in the source
            [degrees].
    """

    distance_error: Array
    contact_error: Array
    contacts: NDArray[np.intp]
    direction_error: Array
    bone_error: Array
    stance: NDArray[np.bool_]
    slide_source: Array
    slide: Array
    foot_height_source: Array
    foot_height: Array
    jerk_source: Array
    jerk: Array
    turn: Array

    @property
    def tracks(self) -> Tracks:
        """What the figures of the result are taken from; its stress is known to whoever made the result."""
        return {
            "contact_error": Track(self.contact_error, self.contacts),
            "direction_error": Track(self.direction_error),
            "slide": Track(self.slide, self.stance),
            "foot_height": Track(self.foot_height, self.stance),
            "distance_error": Track(self.distance_error),
            "jerk": Track(self.jerk),
            "turn": Track(self.turn),
            "bone_error": Track(self.bone_error),
        }

    @property
    def source_tracks(self) -> Tracks:
        """What the figures of the source are taken from."""
        return {
            "slide": Track(self.slide_source, self.stance),
            "foot_height": Track(self.foot_height_source, self.stance),
            "jerk": Track(self.jerk_source),
        }


def compare(source: Motion, result: Motion, matching: Matching, up: Array) -> Comparison:
    """Measure a result against its source.

    `matching` is between their skeletons; the two have the same number of frames, and `up`, (3,), points up in both.
    """
    drivers = matching.drivers
    distance_error, contact_error, contacts = _distance_errors(source, result, matching)
    stance, slide_source, slide, foot_height_source, foot_height = _feet(source, result, matching, up)
    return Comparison(
        distance_error=distance_error,
        contact_error=contact_error,
        contacts=contacts,
        direction_error=_direction_error(source, result, drivers),
        bone_error=_bone_error(result, matching),
        stance=stance,
        slide_source=slide_source,
        slide=slide,
        foot_height_source=foot_height_source,
        foot_height=foot_height,
        jerk_source=_jerk(source, source.rigid_skeleton),
        jerk=_jerk(result, result.skeleton),
        turn=_turn(source, result, drivers),
    )


def normalised_distances(motion: Motion, joints: NDArray[np.intp]) -> Iterator[tuple[slice, Array]]:
    """D, (frames, pairs), block by block of frames, for the pairs u < v of the given joints; nan where the path
    between them has no length.
    """
    u, v = np.triu_indices(len(joints), 1)
    tau = motion.rigid_skeleton.path_lengths[joints[u], joints[v]]
    tau = np.where(tau > 0, tau, np.nan)
    for first in range(0, len(motion), PAIR_FRAMES):
        block = slice(first, min(first + PAIR_FRAMES, len(motion)))
        x = motion.positions[block][:, joints]
        yield block, np.linalg.norm(x[:, u] - x[:, v], axis=-1) / tau


def _distance_errors(source: Motion, result: Motion, matching: Matching) -> tuple[Array, Array, NDArray[np.intp]]:
    joints, drivers = points_of(matching), matching.drivers
    u, v = np.triu_indices(len(joints), 1)
    far = can_touch(matching, joints[u], joints[v])
    mean, contact, count = np.zeros(len(source)), np.zeros(len(source)), np.zeros(len(source), np.intp)
    blocks = zip(normalised_distances(source, drivers[joints]), normalised_distances(result, joints), strict=True)
    for (block, D_source), (_, D_result) in blocks:
        error = np.abs(D_source - D_result)
        known = np.isfinite(error)
        near = far & (D_source < NEAR) & known
        mean[block] = np.where(known, error, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
        contact[block] = np.where(near, error, 0.0).sum(axis=1)
        count[block] = near.sum(axis=1)
    return mean, contact, count


def can_touch(matching: Matching, u: NDArray[np.intp], v: NDArray[np.intp]) -> NDArray[np.bool_]:
    """(pairs,), whether joints u and v of the target can be in contact: far enough apart along the tree, and both part
    of the body, as a root on the floor is not.
    """
    apart = matching.target.skeleton.path_sizes[u, v] >= FAR_ALONG
    return np.asarray(apart & ~np.isin(u, matching.target.above_hips) & ~np.isin(v, matching.target.above_hips))


def points_of(matching: Matching) -> NDArray[np.intp]:
    """The joints of the target that stand for a place of their own on one of the bodies."""
    source, result, drivers = matching.source.skeleton, matching.target.skeleton, matching.drivers
    shared = np.flatnonzero(drivers >= 0)
    apart = (result.path_lengths > 0)[np.ix_(shared, shared)]
    apart |= (source.path_lengths > 0)[np.ix_(drivers[shared], drivers[shared])]
    first = np.array([np.flatnonzero(~row)[0] for row in apart])
    return np.asarray(shared[first == np.arange(len(shared))])


def _bones(skeleton: Skeleton, drivers: NDArray[np.intp], source: Skeleton) -> NDArray[np.intp]:
    """The lower joints of the bones that both bodies have, with a length on both."""
    lower = np.arange(1, len(skeleton))
    upper = skeleton.parents[1:]
    shared = (drivers[lower] >= 0) & (drivers[upper] >= 0) & (skeleton.lengths[1:] > 0)
    lower, upper = lower[shared], upper[shared]
    return lower[source.path_lengths[drivers[lower], drivers[upper]] > 0]


def _direction_error(source: Motion, result: Motion, drivers: NDArray[np.intp]) -> Array:
    lower = _bones(result.skeleton, drivers, source.rigid_skeleton)
    upper = result.skeleton.parents[lower]
    a = source.positions[:, drivers[lower]] - source.positions[:, drivers[upper]]
    b = result.positions[:, lower] - result.positions[:, upper]
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.degrees(np.arctan2(sine, np.einsum("fbi,fbi->fb", a, b))))


def _bone_error(result: Motion, matching: Matching) -> Array:
    of_body = matching.target.regions.of_joint >= 0
    lower = np.flatnonzero((result.skeleton.lengths > 0) & of_body & of_body[result.skeleton.parents])
    bones = result.positions[:, lower] - result.positions[:, result.skeleton.parents[lower]]
    lengths = result.skeleton.lengths[lower]
    return np.asarray(np.abs(np.linalg.norm(bones, axis=-1) / lengths - 1).max(axis=1, initial=0.0))


def _feet(
    source: Motion, result: Motion, matching: Matching, up: Array
) -> tuple[NDArray[np.bool_], Array, Array, Array, Array]:
    """Stance of the source's feet, their slide and the result's, their height and the result's, all (frames, feet)."""
    legs = matching.legs
    if legs is None:
        nothing = np.zeros((len(source), 0))
        return nothing.astype(bool), nothing, nothing, nothing, nothing
    source_paths, paths = (
        _foot_paths(motion, pair, length)
        for motion, pair, length in zip((source, result), legs, matching.leg_lengths, strict=True)
    )
    heights = source_paths @ up
    low = heights - np.percentile(heights, LOWEST, axis=0) < LOW
    stance = low & (_speeds(source_paths, source.frame_time) < SLOW)
    slide_source, slide = (_speeds(x - (x @ up)[..., None] * up, source.frame_time) for x in (source_paths, paths))
    return np.asarray(stance), slide_source, slide, np.asarray(100 * heights), np.asarray(100 * (paths @ up))


def _foot_paths(motion: Motion, legs: tuple[Leg, Leg], length: float) -> Array:
    """(frames, feet, 3), where the foot joints are [leg lengths]; `length` is the length of the legs [file units]."""
    feet = [joint for leg in legs for joint in (leg.ankle, leg.toe)]
    return motion.positions[:, feet] / length


def _speeds(paths: Array, frame_time: float) -> Array:
    """(frames, feet), the speed along paths (frames, feet, 3), by central differences."""
    if len(paths) < 2:
        return np.zeros(paths.shape[:2])
    return np.asarray(np.linalg.norm(np.gradient(paths, frame_time, axis=0), axis=-1))


def _jerk(motion: Motion, body: Skeleton) -> Array:
    """(frames - 3,), the mean norm of the third difference of positions over joints [body sizes / s^3]."""
    size = body.path_lengths.max() * motion.frame_time**3
    third = np.diff(motion.positions, 3, axis=0) / size
    return np.asarray(np.linalg.norm(third, axis=-1).mean(axis=1))


def _turn(source: Motion, result: Motion, drivers: NDArray[np.intp]) -> Array:
    joints = np.flatnonzero(drivers >= 0)
    source_steps, steps = _steps(source.world_rotations[:, drivers[joints]]), _steps(result.world_rotations[:, joints])
    return np.asarray(np.degrees(steps - source_steps))


def _steps(rotations: Array) -> Array:
    """(frames - 1, joints), the angle from each frame's rotation to the next [rad]."""
    if len(rotations) < 2:
        return np.zeros((0, rotations.shape[1]))
    return np.asarray((Rotation.from_quat(rotations[:-1]).inv() * Rotation.from_quat(rotations[1:])).magnitude())
