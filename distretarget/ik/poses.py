"""Poses of a clip: their motion, their fit to given points, and the chunks of frames in which they are solved.

A part is a joint together with the joints below it that have no rotation of their own. Clips are solved in overlapping
chunks of frames, serially or in parallel. Only the number of frames decides where a clip is split, so the result is
bit-identical for any number of workers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.ik.spg import Effort
from distretarget.motion import Motion, motion_of_world
from distretarget.numerics.euler import restrict
from distretarget.numerics.kinematics import turn_parts
from distretarget.numerics.rotations import best_rotation
from distretarget.numerics.vectors import Array, Numbers
from distretarget.skeleton import Skeleton

Mapper = Callable[..., Iterable[Any]]  # like `map` and an executor's: calls a function on items, results in order
Progress = Callable[[int], Any]

CHUNK_FRAMES = 1024  # about the length of a chunk [frames]
LEAD_IN = 32  # frames that are solved and discarded before a chunk, so that it continues the chunk before
LEAST_TURN = 2e-5  # [quaternion norm] smaller local rotations are rounding errors of files


def ignore_progress(_frames: int) -> None:
    """Show no progress."""


@dataclass(frozen=True, eq=False)
class Poses:
    """The solved poses of a clip."""

    # (frames, parts + 1, 3), the deviation of each part from the rotation copy [rad]; last, the displacement of the
    # root from its path [target file units]
    v: Array
    log: Array  # (4, frames), objective value, iterations, evaluations and reason to stop, see `spg.record`

    @property
    def effort(self) -> Effort:
        """The solver's effort on each frame."""
        return Effort.from_log(self.log)


@dataclass(frozen=True)
class Chunk:
    """Frames of a clip that are solved together."""

    frames: slice  # the frames whose poses are kept
    context: slice  # the frames that the solved ones depend on
    solve: slice  # the frames to solve, relative to `context`
    keep: slice  # the frames whose poses are kept, relative to `solve`


def chunks_of(frames: int, margin: int) -> list[Chunk]:
    """Return the chunks of a clip in which each frame depends on `margin` frames before and after it."""
    edges = np.linspace(0, frames, max(1, round(frames / CHUNK_FRAMES)) + 1).astype(int).tolist()
    chunks = []
    for first, end in pairwise(edges):
        start = max(first - LEAD_IN, 0)
        context = slice(max(start - margin, 0), min(end + margin, frames))
        solve = slice(start - context.start, end - context.start)
        chunks.append(Chunk(slice(first, end), context, solve, slice(first - start, end - start)))
    return chunks


def solve_in_chunks(
    solve: Callable[[Any, Any, slice], Poses], clip: Any, supports: Any, margin: int, mapper: Mapper, progress: Progress
) -> Poses:
    """Concatenate the chunks' results of `solve(clip, supports, frames)`. `mapper` calls `solve` on every chunk and
    returns results in order; `progress` is called with the number of frames of each.
    """
    chunks = chunks_of(len(clip), margin)
    slices = [[whole[chunk.context] for chunk in chunks] for whole in (clip, supports)]
    solved = zip(chunks, mapper(solve, *slices, [chunk.solve for chunk in chunks]), strict=True)
    v, log = np.empty(0), np.empty((4, len(clip)))
    for chunk, poses in solved:
        if not v.size:
            v = np.empty((len(clip), *poses.v.shape[1:]))
        v[chunk.frames], log[:, chunk.frames] = poses.v[chunk.keep], poses.log[:, chunk.keep]
        progress(chunk.frames.stop - chunk.frames.start)
    return Poses(v, log)


def part_of_joint(skeleton: Skeleton, roots: Numbers) -> Numbers:
    """(joints,), the number of the part that carries the bones below each joint, counted from the skeleton's root down;
    a leaf gets that of its parent. `roots`, (joints,), is the topmost joint of each joint's part.
    """
    carriers = np.array([joint if below else skeleton.parents[joint] for joint, below in enumerate(skeleton.children)])
    numbers: Numbers = np.unique(roots[np.maximum(carriers, 0)], return_inverse=True)[1]
    return numbers


def subtree_lengths(skeleton: Skeleton, carried: Numbers) -> Array:
    """(joints,), the summed length of each joint's own bone and of all bones below it that lead to one of the joints
    `carried` [file units]. So tails, props and helper joints do not count.
    """
    sums = np.zeros(len(skeleton))
    leading = [*skeleton.with_ancestors(carried)]
    sums[leading] = skeleton.lengths[leading]
    for joint in range(len(skeleton) - 1, 0, -1):
        sums[skeleton.parents[joint]] += sums[joint]
    return sums


def posed_motion(copy: Motion, v: Array, parts: Numbers, root_positions: Array) -> Motion:
    """The motion whose parts deviate from the rotation copy by `v`, (frames, parts + 1, 3) [rad].

    Leaves keep the world rotations of the copy, since they carry no bone, unless they never turn against their parents.
    `root_positions`, (frames, 3) [file units], are taken as they are; the root's displacement in `v` is not added.
    """
    leaves = np.array([joint for joint, below in enumerate(copy.skeleton.children) if not below])
    turns = np.abs(copy.rotations[:, leaves, :3]).max(axis=(0, 2), initial=0.0)
    turning = np.array(parts)
    turning[leaves[turns >= LEAST_TURN]] = -1

    def pose(block: slice, world: Array) -> Array:
        world[:] = copy.world_rotations_in(block)
        turn_parts(v[block, :-1], turning, world)
        return root_positions[block]

    return motion_of_world(copy.skeleton, len(copy), copy.frame_time_text, pose)


def fit_rotations(copy: Motion, points: Array, joints: Numbers, roots: Numbers) -> Motion:
    """Rotate the bones of the rotation copy towards points, from the root down.

    Each rigid part gets the rotation that brings its bones closest to the points at their ends: the least rotation for
    one bone, Kabsch's method for several. Twist, which points do not determine, stays that of the rotation copy. A
    joint without points below it keeps the copy's world rotation. Joints with fewer than three rotation channels rotate
    as far as these allow, and the joints below compensate.

    Of `points`, (frames, all joints, 3) [file units], only those of `joints` count; `roots`, (all joints,), is the
    topmost joint of the rigid part that each joint belongs to.
    """
    skeleton = copy.skeleton
    carried = _carried_points(skeleton, roots, set(joints.tolist()))
    positions = np.array(copy.positions)
    world = copy.world_rotations
    local = np.array(copy.rotations)
    deviations = np.tile([0.0, 0.0, 0.0, 1.0], (len(skeleton), len(copy), 1))
    for joint, root in enumerate(roots):
        above = world[:, skeleton.parents[joint]] if joint else np.array([[0.0, 0.0, 0.0, 1.0]])
        if joint:
            bone = Rotation.from_quat(above).apply(np.array(skeleton.offsets[joint]))  # scipy needs a writable array
            positions[:, joint] = positions[:, skeleton.parents[joint]] + bone
        if carried[joint]:
            bones = copy.positions[:, carried[joint]] - copy.positions[:, joint, None]
            deviations[joint] = best_rotation(bones, points[:, carried[joint]] - positions[:, joint, None])
        world[:, joint] = _product(deviations[root], world[:, joint])
        local[:, joint] = _product(above * [-1, -1, -1, 1], world[:, joint])
        axes = skeleton.rotation_axes(joint)
        if len(axes) < 3:
            local[:, joint] = restrict(local[:, joint], axes)
            world[:, joint] = _product(above, local[:, joint])
    return Motion(skeleton, copy.root_positions, local, copy.frame_time_text)


def _carried_points(skeleton: Skeleton, roots: Numbers, joints: set[int]) -> list[list[int]]:
    """For the root of each rigid part, those of `joints` at the ends of the part's bones and away from it."""
    carried: list[list[int]] = [[] for _ in roots]
    for joint in range(1, len(skeleton)):
        root = int(roots[skeleton.parents[joint]])
        if joint in joints and skeleton.paths_from(root)[joint] > 0:
            carried[root].append(joint)
    return carried


def _product(a: Array, b: Array) -> Array:
    return np.asarray((Rotation.from_quat(a) * Rotation.from_quat(b)).as_quat())
