"""The rotation copy: the source's rotations on the target's bones. It is the baseline and the start of all solving."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rest_pose import rest_alignment
from distretarget.baseline.root import RootScale
from distretarget.matching.matching import Matching
from distretarget.motion import Motion, motion_of_world
from distretarget.numerics.kinematics import rotation_products

Array = NDArray[np.float64]


def rotation_copy(matching: Matching, scale: RootScale) -> Motion:
    """Return the motion with the world rotations R_src(t) A, where A is the alignment of the rest poses.

    Joints with two rotation sources blend both; joints without one follow their parents. The pelvis joint (`pelvis` of
    the matching) takes the path of its driver, scaled.
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
