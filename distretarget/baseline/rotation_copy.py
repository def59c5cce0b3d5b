"""The rotation copy: the source's rotations on the target's bones, with a scaled root path; solving starts from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rest_pose import rest_alignment
from distretarget.body.resting import feet_at_rest
from distretarget.matching.matching import Matching
from distretarget.motion import Motion, motion_of_world
from distretarget.numerics.kinematics import rotation_products
from distretarget.numerics.vectors import lengths, level

Array = NDArray[np.float64]

SINK = 0.1  # how much lower than in the source hips may be in a stride [leg lengths]
MOST_FRAMES = 95.0  # share of the frames of resting feet in which strides must be within reach [%]


@dataclass(frozen=True)
class RootScale:
    """The scale from positions in the source's world to positions in the target's. Performers who share a world share
    the scale along the floor, so that they meet, but not the scale upwards, so that each stands on the floor.
    """

    level: float  # along the floor [target units per source unit]
    height: float  # upwards [target units per source unit]

    @classmethod
    def even(cls, scale: float) -> RootScale:
        """Return the same scale in all directions."""
        return cls(scale, scale)

    def places(self, places: Array, up: Array) -> Array:
        """Return positions in the source's world, (..., 3), scaled to the target's; `up` is the unit vector up."""
        return np.asarray(self.level * places + (self.height - self.level) * (places @ up)[..., None] * up)


def find_root_scale(matching: Matching) -> float:
    """Return how many target units the root travels per source unit: the ratio of leg lengths, which keeps strides and
    heights in proportion to the body, or without legs the ratio of the longest paths.
    """
    if matching.legs:
        from_length, to_length = matching.leg_lengths
    else:
        shared = np.flatnonzero(matching.drivers >= 0)
        from_length = matching.source.skeleton.longest_path_among(matching.drivers[shared])
        to_length = matching.target.skeleton.longest_path_among(shared)
    return float(to_length / from_length) if from_length > 0 else 1.0


def root_path(baseline: Motion, matching: Matching, scale: RootScale) -> Array:
    """Return the root's path, (frames, 3) [target file units], that moves the midpoint of the hip joints along the
    source's scaled path; without legs, the root's path in the rotation copy `baseline`.
    """
    if matching.legs is None:
        return np.ascontiguousarray(baseline.root_positions)
    source_hips, hips = (
        motion.positions[:, [leg.hip for leg in legs]].mean(axis=1)
        for motion, legs in zip((matching.source_motion, baseline), matching.legs, strict=True)
    )
    return np.ascontiguousarray(scale.places(source_hips, matching.source.up_vector) - hips + baseline.root_positions)


def longest_strides(matching: Matching) -> float:
    """Return the largest factor of the strides, relative to leg length, that the legs can reach; infinite without legs,
    and where feet that rest are farther below their hip joints than legs are long, which shows no strides.
    A foot that rests at the distance d along the floor from its hip joint, at the height h below it, reaches s d with
    (s d)^2 + (h - sink)^2 = (leg length)^2.
    """
    if matching.legs is None:
        return float("inf")
    motion, up, leg_length = matching.source_motion, matching.source.up_vector, matching.leg_lengths[0]
    factors = []
    for leg in matching.legs[0]:
        rests = feet_at_rest(motion, leg, up, leg_length).any(axis=1)
        to_hip = motion.positions[rests, leg.hip] - motion.positions[rests, leg.ankle]
        reach = np.sqrt(np.maximum(leg_length**2 - (to_hip @ up - SINK * leg_length) ** 2, 0.0))
        factors.append(reach / np.maximum(lengths(level(to_hip, up)), 1e-9 * leg_length))
    known = np.concatenate(factors)
    return float(np.percentile(known, 100.0 - MOST_FRAMES) if known.any() else 0.0) or float("inf")


def followed_scale(heights: Sequence[float], longest: Sequence[float]) -> float:
    """Return the scale along the floor for all performers of a world: the mean of their scales upwards, `heights`, or
    less if the legs of one cannot reach that; `longest` has the `longest_strides` of each.
    """
    if len(heights) == 1:
        return heights[0]
    return float(min(np.mean(heights), *np.multiply(heights, longest)))


def rotation_copy(matching: Matching, scale: RootScale) -> Motion:
    """Return the motion with the world rotations R_src(t) A, where A is the alignment of the rest poses.

    Joints with two rotation sources blend both, joints without one follow their parents as in the reference pose, and
    the matching's `pelvis` takes the scaled path of its driver.
    """
    source, skeleton, up = matching.source_motion, matching.target.skeleton, matching.source.up_vector
    alignment = rest_alignment(matching).copy()
    sources, blend = matching.rotation_sources.copy(), matching.blend.copy()
    stance = Rotation.from_quat(matching.target.reference.rotations)
    for joint, parent in enumerate(skeleton.parents):
        if joint and sources[joint, 0] < 0:
            sources[joint], alignment[joint], blend[joint] = sources[parent], alignment[parent], blend[parent]
            if not matching.target.stands_at_rest:
                turn = stance[parent].inv() * stance[joint]
                alignment[joint] = (Rotation.from_quat(alignment[parent]) * turn).as_quat()
    between = np.flatnonzero(blend > 0)

    def aligned(turned: Array, joints: NDArray[np.intp], k: int) -> Array:
        return rotation_products(turned, sources[joints, k], alignment[joints, k])

    def pose(block: slice, world: Array) -> Array:
        turned = source.world_rotations_in(block)
        world[:] = aligned(turned, np.arange(len(skeleton)), 0)
        if len(between):
            first, second = (Rotation.from_quat(aligned(turned, between, k)) for k in (0, 1))
            steps = (first.inv() * second).as_rotvec() * blend[between, None]
            world[:, between] = (first * Rotation.from_rotvec(steps)).as_quat()
        path = scale.places(source.positions[block, matching.drivers[matching.pelvis]], up)
        for joint in skeleton.line(matching.pelvis)[:-1]:
            parent = Rotation.from_quat(world[:, skeleton.parents[joint]])
            path = path - parent.apply(np.array(skeleton.offsets[joint]))
        return path

    return motion_of_world(skeleton, len(source), source.frame_time_text, pose)
