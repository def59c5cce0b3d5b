"""Placements after solving: the root on the floor and the IK handles of rigs for game engines, and the path of a root
without position channels, which joints below it take if they can.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.body import Body
from distretarget.errors import MotionError
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.kinematics import make_local
from distretarget.numerics.rotations import least
from distretarget.numerics.vectors import Array, Numbers, level
from distretarget.skeleton import POSITION_CHANNELS, Skeleton

RootFollows = Literal["pelvis", "source", "nothing"]
BELOW_HIPS = 0.25  # a root at least this far below the hips in the rest pose is on the floor [leg lengths]
IS_LEVEL = 0.02  # a source's root stays on the floor if its height changes by less [leg lengths]
MOVES = 0.01  # a source's root moves if it travels farther [leg lengths] or turns more [rad] than this
UPSIDE_DOWN = -0.5  # a body with a smaller cosine between its up axis and the world's has no heading


def path_carriers(skeleton: Skeleton, body: Numbers) -> list[int] | None:
    """Return the topmost joints that carry the path of a root without position channels; None if some have none."""
    if set(POSITION_CHANNELS) <= set(skeleton.channels[0]):
        return []
    moving = [set(POSITION_CHANNELS) <= set(channels) for channels in skeleton.channels]
    found = set()
    for joint in body.tolist():
        line = [each for each in skeleton.to_root(joint) if each and moving[each]]
        if not line:
            return None
        found.add(line[-1])
    return sorted(found)


def along_channels(motion: Motion, body: Numbers) -> Motion:
    """Return a motion whose root moves only along its channels; its `path_carriers` keep their positions."""
    skeleton, carriers = motion.skeleton, path_carriers(motion.skeleton, body)
    if carriers == []:
        return motion
    is_free = [channel in skeleton.channels[0] for channel in POSITION_CHANNELS]
    path = np.where(is_free, motion.root_positions, skeleton.offsets[0])
    if carriers is None:
        return replace(motion, root_positions=path)
    translations = motion.translations
    translations[:, 0] = path
    for joint in carriers:
        parent = int(skeleton.parents[joint])
        fixed = replace(motion, root_positions=path)
        back = Rotation.from_quat(motion.world_rotations_of(parent)).inv()
        places, above = motion.positions_of(np.array([joint])), fixed.positions_of(np.array([parent]))
        translations[:, joint] = back.apply(places[:, 0] - above[:, 0])
    return Motion.of_translations(skeleton, translations, motion.rotations, motion.frame_time_text)


@dataclass(frozen=True, eq=False)
class EngineRoot:
    """The joints of the target that are placed after solving, and how."""

    matching: Matching
    scale: RootScale  # scale of the root's path
    follows: RootFollows  # whether the root follows the target's pelvis, the source's root or nothing
    handles: Mapping[int, int]  # the joint that each IK handle copies, by handle; without handles that a map drives
    moving: tuple[int, ...]  # the joints to place (`_moving`)

    def placed(self, motion: Motion) -> Motion:
        """Return a motion of the target with root and handles placed; the body keeps its pose in the world."""
        if not self.moving:
            return motion
        skeleton, translations = motion.skeleton, motion.translations
        world, positions = motion.world_rotations, np.array(motion.positions)
        for joint in self.moving:
            parent = skeleton.parents[joint]
            if not joint:
                positions[:, 0], world[:, 0] = self._root(motion)
            elif joint in self.handles:
                positions[:, joint], world[:, joint] = (x[:, self.handles[joint]] for x in (positions, world))
            else:
                turn = Rotation.from_quat(world[:, parent])
                positions[:, joint] = positions[:, parent] + turn.apply(translations[:, joint])
                world[:, joint] = (turn * Rotation.from_quat(motion.rotations[:, joint])).as_quat()
        translations[:, 0] = positions[:, 0]
        for joint in range(1, len(skeleton)):
            parent = skeleton.parents[joint]
            if joint in self.handles or (parent in self.moving and joint not in self.moving):
                back = Rotation.from_quat(world[:, parent]).inv()
                translations[:, joint] = back.apply(positions[:, joint] - positions[:, parent])
        make_local(skeleton.parents, world)
        return Motion.of_translations(skeleton, translations, world, motion.frame_time_text)

    def _root(self, motion: Motion) -> tuple[Array, Array]:
        """The root's path, (frames, 3) [target file units], and its upright rotations, (frames, 4)."""
        source, body, up = self.matching.source, self.matching.target, self.matching.target.up_vector
        rest_axes = Rotation.from_matrix(body.reference.axes)
        raised = least(body.reference.axes[None, :, 1], up[None])
        path, heading = np.zeros((len(motion), 3)), np.zeros(len(motion))
        if self.follows == "pelvis":
            pelvis = body.pelvis_joint or 0
            path, axes = level(motion.positions[:, pelvis], up), _carried_axes(body, motion, pelvis)
        elif self.follows == "source":
            leader, joint = self.matching.source_motion, _leading_root(self.matching)
            path = self.scale.places(leader.positions[:, joint], source.up_vector)
            axes = _carried_axes(source, leader, joint)
        if self.follows != "nothing":
            heading = _heading(axes * rest_axes.inv() * raised.inv(), up)
        upright = raised * Rotation.from_quat(body.reference.rotations[0])
        return path, (Rotation.from_rotvec(heading[:, None] * up) * upright).as_quat()


def find_engine_root(matching: Matching, scale: RootScale, follows: RootFollows | None = None) -> EngineRoot:
    """Return which joints are placed after solving, and how. By default the root follows the source's root on the floor
    if that moves, else the pelvis. A MotionError if it `follows` a source's root that is not there.
    """
    body = matching.target
    handles = {handle: joint for handle, joint in body.handles.items() if matching.drivers[handle] < 0}
    moving = _moving(body, handles, _roots_on_floor(body))
    if 0 in moving and follows == "source" and not _roots_on_floor(matching.source):
        raise MotionError("the source has no root on the floor to follow; let the target's root follow the pelvis")
    found: RootFollows = "source" if _source_root_leads(matching) else "pelvis"
    return EngineRoot(matching, scale, follows or found, handles, moving)


def _moving(body: Body, handles: Collection[int], roots: Collection[int]) -> tuple[int, ...]:
    """The joints that move without the body: handles, a root on the floor, and what hangs from these outside it."""
    skeleton, regions = body.skeleton, body.regions.of_joint
    moving = {0} if 0 in roots and skeleton.moves_freely(0) else set()

    def stays(joint: int) -> bool:
        carries = bool((regions[skeleton.subtree(joint)] >= 0).any())
        return carries and joint not in roots and skeleton.moves_freely(joint)

    for joint in range(1, len(skeleton)):
        if joint in handles or (skeleton.parents[joint] in moving and not stays(joint)):
            moving.add(joint)
    if (regions[list(moving)] >= 0).any():
        return _moving(body, handles, ())
    return tuple(sorted(moving))


def _roots_on_floor(body: Body) -> list[int]:
    """The joints above the hips that are on the floor in the reference pose, from the root down."""
    if body.anatomy is None or body.legs is None or not body.above_hips:
        return []
    heights = body.reference.positions @ body.reference.axes[:, 1]
    limit = heights[body.pelvis_joint or 0] - BELOW_HIPS * body.leg_length
    return [joint for joint in reversed(body.above_hips) if heights[joint] < limit]


def _leading_root(matching: Matching) -> int:
    """The source's root on the floor: the one that drives the target's root, else the lowest in its tree."""
    roots, driver = _roots_on_floor(matching.source), matching.drivers.item(0)
    return driver if driver in roots else roots[-1]


def _source_root_leads(matching: Matching) -> bool:
    """Whether the source's root stays on the floor, and moves or drives the target's root."""
    source, roots = matching.source, _roots_on_floor(matching.source)
    if not roots:
        return False
    motion, root = matching.source_motion, _leading_root(matching)
    path = motion.positions[:, root] / source.leg_length
    turns = Rotation.from_quat(motion.world_rotations_of(root))
    moves = max(np.ptp(path, axis=0).max(), (turns[0].inv() * turns).magnitude().max()) > MOVES
    steady = np.ptp(path @ source.up_vector) < IS_LEVEL
    return bool(steady and (moves or matching.drivers[0] in roots))


def _carried_axes(body: Body, motion: Motion, joint: int) -> Rotation:
    """(frames,), the body's axes (columns left, up, forward) as they rotate with a joint."""
    reference, axes = Rotation.from_quat(body.reference.rotations[joint]), Rotation.from_matrix(body.reference.axes)
    return Rotation.from_quat(motion.world_rotations_of(joint)) * reference.inv() * axes


def _heading(turned: Rotation, up: Array) -> Array:
    """(frames,), the heading of rotations, unwrapped [rad]: the twist about `up`, interpolated while upside down."""
    quaternions = turned.as_quat()
    angles = 2 * np.arctan2(quaternions[:, :3] @ up, quaternions[:, 3])
    known = np.flatnonzero(turned.apply(up) @ up > UPSIDE_DOWN)
    return np.interp(np.arange(len(angles)), known, np.unwrap(angles[known])) if len(known) else np.zeros(len(angles))
