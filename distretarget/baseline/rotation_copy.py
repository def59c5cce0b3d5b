"""The rotation copy: the source's rotations on the target's bones, and the scale of the root's path.

It is the baseline, and the start of all solving.
"""

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


@dataclass(frozen=True)
class RootScale:
    """The scale from the source's world to the target's.

    Performers of different sizes in one world share the scale along the floor, so that they meet; each has its own
    scale upwards, so that each stands on the floor.

    Attributes:
        level, height: target units per source unit along the floor, and upwards.
    """

    level: float
    height: float

    @classmethod
    def even(cls, scale: float) -> RootScale:
        """The same scale in all directions."""
        return cls(scale, scale)

    def places(self, places: Array, up: Array) -> Array:
        """Return places of the source's world, (..., 3), in the target's; `up` is the unit vector up."""
        if self.level == self.height:
            return np.asarray(self.level * places)
        return np.asarray(self.level * places + (self.height - self.level) * (places @ up)[..., None] * up)


def find_root_scale(matching: Matching) -> float:
    """Return the scale of the root's path, target units per source unit: the ratio of leg lengths, which keeps stride
    and height in proportion to the body; without legs the ratio of the longest paths.
    """
    if matching.legs:
        from_length, to_length = matching.leg_lengths
    else:
        shared = np.flatnonzero(matching.drivers >= 0)
        drivers = matching.drivers[shared]
        from_length = matching.source.skeleton.path_lengths[np.ix_(drivers, drivers)].max()
        to_length = matching.target.skeleton.path_lengths[np.ix_(shared, shared)].max()
    return float(to_length / from_length) if from_length > 0 else 1.0


def root_path(baseline: Motion, matching: Matching, scale: RootScale) -> Array:
    """Return the root's path, (frames, 3) [target file units], that puts the middle of the hip joints, from which the
    legs hang, on the scaled path of the source's. `baseline` is the rotation copy; without legs its path is kept.
    """
    if matching.legs is None:
        return np.ascontiguousarray(baseline.root_positions)
    source_hips, hips = (
        motion.positions[:, [leg.hip for leg in legs]].mean(axis=1)
        for motion, legs in zip((matching.source_motion, baseline), matching.legs, strict=True)
    )
    return np.ascontiguousarray(scale.places(source_hips, matching.source.up_vector) - hips + baseline.root_positions)


SINK = 0.1  # how much lower than in the source hips may be in a stride [leg lengths]
MOST_FRAMES = 95.0  # strides are within reach in this share of the resting feet's frames [%]


def longest_strides(matching: Matching) -> float:
    """Return how many times as long, against the legs, the strides may be along the floor; infinite without legs.

    A foot that rests at the distance d along the floor from its hip joint, which is h above it, can be s d away where
    (s d)^2 + (h - sink)^2 is the square of the leg's length.
    """
    if matching.legs is None:
        return float("inf")
    motion, up, leg_length = matching.source_motion, matching.source.up_vector, matching.leg_lengths[0]
    factors = []
    for leg in matching.legs[0]:
        rests = feet_at_rest(motion, leg, up, leg_length).any(axis=1)
        way = motion.positions[rests, leg.hip] - motion.positions[rests, leg.ankle]
        reach = np.sqrt(np.maximum(leg_length**2 - (way @ up - SINK * leg_length) ** 2, 0.0))
        factors.append(reach / np.maximum(lengths(level(way, up)), 1e-9 * leg_length))
    known = np.concatenate(factors)
    return float(np.percentile(known, 100.0 - MOST_FRAMES)) if len(known) else float("inf")


def followed_scale(heights: Sequence[float], longest: Sequence[float]) -> float:
    """Return the scale along the floor that all performers of a world share: the mean of their `heights` scales, or the
    largest smaller one that the legs of all can reach; `longest` are their `longest_strides`.
    """
    if len(heights) == 1:
        return heights[0]
    followed = [height * most for height, most in zip(heights, longest, strict=True)]
    return min(float(np.mean(heights)), *followed)


def rotation_copy(matching: Matching, scale: RootScale) -> Motion:
    """Return the motion with the world rotations R_src(t) A, where A is the alignment of the rest poses.

    Joints with two rotation sources blend both; joints without one follow their parents. The joint `matching.pelvis`
    takes the scaled path of its driver.
    """
    source, skeleton, up = matching.source_motion, matching.target.skeleton, matching.source.up_vector
    sources, alignment, blend = _with_followers(matching)
    between = np.flatnonzero(blend > 0)
    of_all, of_first, of_second = (
        (np.ascontiguousarray(sources[joints, k]), np.ascontiguousarray(alignment[joints, k]))
        for joints, k in ((slice(None), 0), (between, 0), (between, 1))
    )

    def pose(block: slice, world: Array) -> Array:
        turned = source.world_rotations_in(block)
        world[:] = rotation_products(turned, *of_all)
        if len(between):
            first, second = (Rotation.from_quat(rotation_products(turned, *ends)) for ends in (of_first, of_second))
            steps = (first.inv() * second).as_rotvec() * blend[between, None]
            world[:, between] = (first * Rotation.from_rotvec(steps)).as_quat()
        path = scale.places(source.positions[block, matching.drivers[matching.pelvis]], up)
        for joint in skeleton.line(matching.pelvis)[:-1]:
            parent = Rotation.from_quat(world[:, skeleton.parents[joint]])
            path = path - parent.apply(np.array(skeleton.offsets[joint]))
        return path

    return motion_of_world(skeleton, len(source), source.frame_time_text, pose)


def _with_followers(matching: Matching) -> tuple[NDArray[np.intp], Array, Array]:
    """The rotation sources of target joints, (joints, 2), with their alignment, (joints, 2, 4), and blend, (joints,);
    joints without a source have what their parents have.
    """
    sources, alignment, blend = np.array(matching.rotation_sources), rest_alignment(matching), np.array(matching.blend)
    for joint, parent in enumerate(matching.target.skeleton.parents):
        if joint and sources[joint, 0] < 0:
            sources[joint], alignment[joint], blend[joint] = sources[parent], alignment[parent], blend[parent]
    return sources, alignment, blend
