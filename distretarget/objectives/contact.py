"""The contact objective: what is near stays as near, everything else keeps the rotation copy's rotations.

Per frame it minimises, over the rotations of a body of exact bones and the displacement of its root,

    1/2 sum over near pairs     w r^T (k I + (1 - k) e e^T) r,    r = x_u - x_v - delta_uv
  + 1/2 sum over parts          h_p |v_p|^2
  + 1/2 sum over resting joints r^T A_f r,                        r = x_f - place_f
  + 1/2 sum over joints below   k_j depth_j^2                     the height they keep above (`floor`)
  + 1/2                         root_stiffness |root - its path|^2

A pair is drawn to a vector, not only to a distance, so that nothing changes sides: delta = d_copy + f (tau2 / tau1
d_source - d_copy). At f = 1 it has the length tau2 D of Eq. (1) and the direction e of the source. The activation f
grows smoothly from 0 to 1 as the pair comes near, beginning a little ahead of time, and the weight w grows with it
(`contact_pairs`). The stiffness A_f, a matrix, draws a joint that comes to rest or lets go a share of the way to its
place (`support_springs`). Where nothing is near and nothing rests, the result has the rotation copy's rotations. Apart
from the places of resting joints, a frame depends on the frames around it only.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.body.legs import pelvis_joint
from distretarget.ik.articulation import Articulation, Scratch
from distretarget.ik.pose_solver import Clip, Workspace, compile_pose_solver
from distretarget.ik.poses import Mapper, PoseProblem, Poses, Progress, ignore_progress, solve_in_chunks
from distretarget.ik.rigid_parts import subtree_lengths
from distretarget.ik.spg import Effort
from distretarget.ik.springs import (
    NEGLIGIBLE,
    Springs,
    is_negligible,
    joined,
    no_springs,
    room_for,
    spring_energy,
)
from distretarget.numerics.compiled import inlined, is_to_be_compiled, read_only
from distretarget.numerics.parallel import blocks_of
from distretarget.objectives.contact_pairs import (
    NearPairs,
    activation_window,
    candidate_pairs,
    near_pairs,
    write_pair_spring,
)
from distretarget.objectives.discontinuities import smooth_jumps, smooth_landings
from distretarget.objectives.floor import Floor, add_floor, floor_energy, no_floor
from distretarget.objectives.settings import ContactSettings
from distretarget.objectives.supports import Supports, support_springs

Array = NDArray[np.float64]


def part_stiffness(problem: PoseProblem, settings: ContactSettings) -> Array:
    """h: (parts + 1,), the stiffness of each part's rotation; last, that of the root's path.

    It grows with the length of a part's bones and, far more, with the share of the body that the part carries, so that
    arms give way before the spine does. Bones that carry no point of the distance problem do not count as carried. Feet
    are stiffer by `foot_factor`, and parts that only the floor moves softer by `loose_factor`. Parts above the pelvis
    have the `fixed_stiffness`.
    """
    skeleton, legs, parts = problem.skeleton, problem.legs, problem.parts
    carried = subtree_lengths(skeleton, problem.distances.targets)
    longest = np.zeros(parts.max() + 1)
    bones = np.zeros_like(longest)
    np.add.at(bones, parts[skeleton.parents[1:]], skeleton.lengths[1:] / problem.unit)
    share = np.divide(carried, carried[0], out=np.zeros_like(carried), where=carried[0] > 0)
    np.maximum.at(longest, parts[skeleton.parents[1:]], share[skeleton.parents[1:]])
    stiffness = settings.base_stiffness * (bones + settings.added_length) * (1.0 + settings.trunk_factor * longest)
    feet = {joint for leg in legs or () for joint in (leg.ankle, leg.toe) if skeleton.children[joint]}
    stiffness[parts[sorted(feet)]] *= settings.foot_factor
    stiffness[problem.loose_parts] *= settings.loose_factor
    if legs:
        pelvis = pelvis_joint(skeleton, legs)
        above = [joint for joint in skeleton.line(pelvis) if parts[joint] != parts[pelvis]]
        stiffness[parts[above]] = settings.fixed_stiffness
    return np.append(stiffness, settings.root_stiffness)


def solve_contact(
    problem: PoseProblem,
    supports: Supports,
    settings: ContactSettings,
    *,
    mapper: Mapper = map,
    progress: Progress = ignore_progress,
) -> Poses:
    """Minimise the contact objective in every frame of a clip in which joints rest as `supports` says.

    The clip is solved in chunks, by `mapper`; `progress` is called with numbers of solved frames (`chunks`).
    """
    margin = activation_window(settings.lead / problem.frame_time)
    solve = partial(_solve_frames, settings=settings)
    poses = solve_in_chunks(solve, problem, supports, margin=margin, mapper=mapper, progress=progress)
    smooth_jumps(poses.v, problem.frame_time, settings)
    smooth_landings(poses.v, problem.loose_parts, problem.frame_time, settings)
    return poses


def _solve_frames(problem: PoseProblem, supports: Supports, frames: slice, settings: ContactSettings) -> Poses:
    """Solve some frames of a clip."""
    distances, unit = problem.distances, problem.unit
    stiffness = part_stiffness(problem, settings)
    body = Articulation.of(problem.skeleton, problem.parts, stiffness)
    pairs = candidate_pairs(distances, problem.regions, problem.legs, unit, settings.least_path)
    # One layout of arrays, for which the solver is compiled once.
    source, copy = np.take(problem.source, distances.sources, axis=1), np.take(problem.copy, distances.targets, axis=1)
    bones, root = problem.bones, np.ascontiguousarray(problem.root / unit)
    copy /= unit
    bones /= unit
    lead = settings.lead / problem.frame_time
    count = frames.stop - frames.start
    v = np.zeros((count, len(stiffness), 3))
    log = np.zeros((4, count))
    work = Workspace.of(body)
    for solved in blocks_of(count):
        block = slice(frames.start + solved.start, frames.start + solved.stop)
        standing = supports.standing[block]
        near = near_pairs(pairs, distances, source, copy, standing, block=block, lead=lead, settings=settings)
        held = support_springs(supports[block], body, bones[block], unit, settings.support_stiffness)
        springs = joined(held, supports.touching.of_frames(block))
        floor = supports.floor.of_frames(block)
        room = room_for(len(near.a) + len(springs.a) + len(floor.joints))
        clip, given = Clip(bones[block], root[block]), Given(near, springs, floor, room)
        _solve(body, clip, given, settings.tolerance, v, solved.start, log, work)
    v[:, -1] *= unit
    return Poses(v, Effort.from_log(log))


class Given(NamedTuple):
    """What acts on the body in a block of frames.

    Attributes:
        near, springs, floor: in all frames of the block.
        room: for the springs of one frame.
    """

    near: NearPairs
    springs: Springs
    floor: Floor
    room: Springs


class Terms(NamedTuple):
    """What acts on the body in one frame.

    Attributes:
        springs: with room for a spring of each joint of the floor behind those that act.
        acting: how many of them act, the first ones.
        floor: of the frame.
    """

    springs: Springs
    acting: int
    floor: Floor


@inlined(fastmath=True)
def _energy(scratch: Scratch, terms: Terms) -> float:
    return spring_energy(scratch, terms.springs, terms.acting) + floor_energy(scratch, terms.floor)


@inlined(fastmath=True)
def _like_springs(scratch: Scratch, terms: Terms) -> tuple[Springs, int]:
    return terms.springs, add_floor(scratch, terms.floor, terms.springs, terms.acting)


@inlined()
def _terms_of(given: Given, frame: int, start: Array) -> Terms:  # noqa: ARG001
    floor = given.floor
    of_frame = Floor(floor.joints, floor.heights[frame], floor.stiffness[frame], floor.up)
    return Terms(given.room, _write_springs(given.near, given.springs, frame, given.room), of_frame)


@inlined()
def _write_springs(near: NearPairs, springs: Springs, frame: int, room: Springs) -> int:
    """Write the springs that act in a frame to `room`; return how many they are."""
    count = 0
    for pair in range(len(near.a)):
        if near.w[frame, pair] >= NEGLIGIBLE:
            write_pair_spring(near, frame, pair, room.rest[count], room.A[count])
            room.a[count], room.b[count] = near.a[pair], near.b[pair]
            count += 1
    for s in range(len(springs.a)):
        if not is_negligible(springs.A[frame], s):
            room.a[count], room.b[count] = springs.a[s], springs.b[s]
            for i in range(3):
                room.rest[count, i] = springs.rest[frame, s, i]
                for j in range(3):
                    room.A[count, i, j] = springs.A[frame, s, i, j]
            count += 1
    return count


_solve = compile_pose_solver(_terms_of, _energy, _like_springs)


def solver_lacks_code() -> bool:
    """Return whether the solver is still to be compiled."""
    return is_to_be_compiled(_solve)


def compile_solver() -> None:
    """Compile the solver, or load its code: let it solve a body of two joints in no frames."""
    body = Articulation(read_only(np.array([-1, 0])), np.zeros(2, np.intp), np.zeros(2), np.zeros((2, 2), np.intp))
    none, lengths, points, weights = np.zeros(0, np.intp), np.zeros(0), np.zeros((0, 0, 3)), np.zeros((0, 0))
    near = NearPairs(none, none, none, none, lengths, points, points, weights, weights, 0.0)
    clip, given = Clip(np.zeros((0, 2, 3)), np.zeros((0, 3))), Given(near, no_springs(0), no_floor(0), room_for(0))
    _solve(body, clip, given, 0.0, np.zeros((0, 2, 3)), 0, np.zeros((4, 0)), Workspace.of(body))
