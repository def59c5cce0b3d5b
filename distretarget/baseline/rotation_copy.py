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
from distretarget.numerics.threads import over_blocks

Array = NDArray[np.float64]

ALL = slice(None)


def rotation_copy(matching: Matching, scale: RootScale) -> Motion:
    """Return the motion with the world rotations R_src(t) A, where A is the alignment of the rest poses.

    Joints with two rotation sources blend both; joints without one follow their parents. The pelvis joint (`pelvis` of
    the matching) takes the path of its driver, scaled.
    """
    source, skeleton, blend = matching.source_motion, matching.target.skeleton, matching.blend
    alignment, between = rest_alignment(matching), np.flatnonzero(blend > 0)
    world = np.empty((len(source), len(skeleton), 4))

    def turn(block: slice) -> None:
        turned, copied = source.world_rotations_in(block), world[block]
        copied[:] = _aligned(matching, turned, alignment, ALL, 0)
        if len(between):
            first, second = (Rotation.from_quat(_aligned(matching, turned, alignment, between, k)) for k in (0, 1))
            steps = (first.inv() * second).as_rotvec() * blend[between, None]
            copied[:, between] = (first * Rotation.from_rotvec(steps)).as_quat()
        for joint in range(1, len(skeleton)):
            if matching.rotation_sources[joint, 0] < 0:
                copied[:, joint] = copied[:, skeleton.parents[joint]]

    over_blocks(turn, *world.shape[:2])
    path = scale.places(source.positions[:, matching.drivers[matching.pelvis]], matching.source.up_vector)
    for joint in skeleton.line(matching.pelvis)[:-1]:
        path = path - Rotation.from_quat(world[:, skeleton.parents[joint]]).apply(np.array(skeleton.offsets[joint]))
    return motion_of_world(skeleton, path, world, source.frame_time_text)


def _aligned(matching: Matching, turned: Array, alignment: Array, joints: slice | NDArray[np.intp], k: int) -> Array:
    """(frames, joints, 4), the world rotations of target joints by their first (k = 0) or second (k = 1) source, whose
    own are `turned`, (frames, source joints, 4); no turn where there is none.
    """
    sources = np.ascontiguousarray(matching.rotation_sources[joints, k])
    return rotation_products(turned, sources, np.ascontiguousarray(alignment[joints, k]))
