"""The contact objective: what is near stays as near, everything else keeps the rotation copy's rotations.

Per frame, over the rotations of a body of exact bones and the displacement of its root, it minimises

    1/2 sum over near pairs   w r^T (k I + (1 - k) e e^T) r,    r = x_u - x_v - delta_uv
  + 1/2 sum over parts        h_j |v_j|^2
  + 1/2 sum over stance feet  STAND s |x_f - place_f|^2
  + 1/2                       ROOT |root - its path|^2

The target of a pair is a vector, not only a distance, so that nothing changes sides:
delta = d_copy + f (tau2 / tau1 d_source - d_copy), which at f = 1 has the length tau2 D of Eq. (1) and the source's
direction e. f grows smoothly from 0 to 1 as the pair comes near, and a little ahead of it in time, and w with it
(`near`). Where nothing is near and no foot rests, this is the rotation copy; each frame depends on the frames around
it only.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from distretarget.body.legs import Legs, pelvis_joint
from distretarget.numerics.smoothing import averaged, widened
from distretarget.skeleton import Skeleton
from distretarget.solve.articulation import Body, subtree_lengths
from distretarget.solve.chunks import Mapper, Progress, solve_pieces
from distretarget.solve.contact_pairs import LEAD, near_pairs, pair_springs, sight
from distretarget.solve.poses import (
    Clip,
    Frame,
    Poses,
    Springs,
    continue_poses,
    needs_curvature,
    pose_solver,
    scratch_arrays,
    spring_energy,
)
from distretarget.solve.spg import Effort, Minimum, record
from distretarget.solve.stance import Stance

Array = NDArray[np.float64]

HOLD = 0.04  # how firmly parts keep to the copy's rotation
LEAST = 1.0  # [body units] a part's bones count as at least so long
TRUNK = 20.0  # how much firmer a part is held that carries the whole body, against one that carries nothing
FOOT = 5.0  # how much firmer the feet are
FIXED = 1e6  # how firmly what is above the pelvis is held: a root on the floor does not tip the body over
ROOT = 20.0  # how firmly the root keeps to its path
STAND = 5000.0  # how firmly a resting foot keeps its place
LEAP = np.radians(10)  # a part that deviates by so much more from one frame to the next [rad / (1/60 s)] leaps ...
SETTLE = 0.1  # [s] ... and is led over within so long before and after
TOLERANCE = 1e-6  # see `pose_solver`: no shaking, and no difference where a clip is cut
BLOCK = 256  # frames in memory at once


def holds(
    skeleton: Skeleton, legs: Legs | None, parts: NDArray[np.intp], points: NDArray[np.intp], unit: float
) -> Array:
    """(parts + 1,), how firmly each part is held to the copy's rotation, and the root to its path.

    In proportion to the length of its bones and, rising to `TRUNK`, to how much of the body it carries: arms give
    before the spine does. What carries none of the joints `points` does not count.
    """
    carried = subtree_lengths(skeleton, points)
    longest = np.zeros(parts.max() + 1)
    bones = np.zeros_like(longest)
    np.add.at(bones, parts[skeleton.parents[1:]], skeleton.lengths[1:] / unit)
    np.maximum.at(longest, parts[skeleton.parents[1:]], carried[skeleton.parents[1:]] / carried[0])
    firm = HOLD * (bones + LEAST) * (1.0 + TRUNK * longest)
    feet = {joint for leg in legs or () for joint in (leg.ankle, leg.toe) if skeleton.children[joint]}
    firm[parts[sorted(feet)]] *= FOOT
    if legs:
        pelvis = pelvis_joint(skeleton, legs)
        above = [joint for joint in skeleton.line(pelvis) if parts[joint] != parts[pelvis]]
        firm[parts[above]] = FIXED
    return np.append(firm, ROOT)


def _foot_springs(stance: Stance, unit: float) -> Springs:
    """The springs that keep resting feet in their places."""
    weights = STAND * stance.weights
    ground = np.full(len(stance.joints), -1)
    places = stance.places / unit
    return Springs(stance.joints, ground, places, np.zeros_like(places), weights, np.ones_like(weights))


def _joined(one: Springs, other: Springs) -> Springs:
    """Both, along the axis of springs."""
    lists = [np.concatenate([a, b], axis=min(np.ndim(a) - 1, 1)) for a, b in zip(one, other, strict=True)]
    return Springs(*lists)


def settled(v: Array, frame_time: float) -> Array:
    """Poses (frames, parts + 1, 3) in which no part leaps from one solution to another.

    Where a part leaps and stays, its deviation becomes a mean over the frames around (a raised cosine); a spike of one
    or two frames is no leap, and stays alone.
    """
    limit = LEAP * 60.0 * frame_time
    if not _leaps(v, limit).any():
        return v
    lasting = median_filter(v, (5, 1, 1), mode="nearest")
    leaps = _leaps(lasting, limit)
    reach = round(SETTLE / frame_time)
    share = widened(np.maximum(leaps, np.roll(leaps, 1, axis=0)), reach)[..., None]
    return np.asarray(v + share * (averaged(lasting, reach) - v))


def _leaps(v: Array, limit: float) -> Array:
    """(frames, parts + 1), 1 where a part's deviation changes by more than `limit` [rad] to the next frame, else 0."""
    leaps = np.zeros(v.shape[:2])
    leaps[:-1, :-1] = np.linalg.norm(np.diff(v[:, :-1], axis=0), axis=-1) > limit
    return leaps


@njit(cache=True)
def _same(work, springs):  # type: ignore[no-untyped-def] # noqa: ARG001
    return springs


_solve_pose = pose_solver(spring_energy, _same, TOLERANCE)


@njit(cache=True, error_model="numpy")
def _solve(body, bones, root, springs, v, first, figures):  # type: ignore[no-untyped-def]
    """Solve the frames from `first` on, each from the best of: the copy, the pose before, the two before continued."""
    work, U, scratch, starts = scratch_arrays(body)
    last = Minimum(0.0, 0, 0, 0)
    for t in range(len(bones)):
        at = first + t
        count = min(at, 2) + 1
        continue_poses(v, at, starts)
        frame = Frame(bones[t], root[t], U, scratch)
        now = Springs(springs.a, springs.b, springs.rest[t], springs.e[t], springs.w[t], springs.k[t])
        last = _solve_pose(starts, count, body, work, frame, now, needs_curvature(t, last), v[at])
        record(last, figures, at)


def solve_contact(clip: Clip, stance: Stance, mapper: Mapper = map, progress: Progress = lambda _frames: None) -> Poses:
    """Minimise the contact objective in every frame of a clip, whose feet at rest are `stance`.

    The clip is solved in pieces, by `mapper`; `progress` is called with numbers of frames as they are done (`pieces`).
    """
    poses = solve_pieces(_solve_frames, clip, stance, sight(LEAD / clip.frame_time), mapper, progress)
    return replace(poses, v=settled(poses.v, clip.frame_time))


def _solve_frames(clip: Clip, stance: Stance, frames: slice) -> Poses:
    """Solve some frames of a clip."""
    unit = clip.unit
    body = Body(
        clip.skeleton.parents, clip.parts, holds(clip.skeleton, clip.legs, clip.parts, clip.problem.targets, unit)
    )
    pairs = near_pairs(clip.problem, unit)
    points, copied = clip.source[:, clip.problem.sources], clip.copy[:, clip.problem.targets] / unit
    bones, root = clip.bones / unit, clip.root / unit
    count = frames.stop - frames.start
    v = np.zeros((count, len(body.holds), 3))
    figures = np.zeros((4, count))
    for first in range(0, count, BLOCK):
        block = slice(frames.start + first, min(frames.start + first + BLOCK, frames.stop))
        near = pair_springs(pairs, clip.problem, points, copied, block, LEAD / clip.frame_time)
        springs = _joined(near, _foot_springs(stance[block], unit))
        _solve(body, bones[block], root[block], springs, v, first, figures)
    v[:, -1] *= unit
    return Poses(v, Effort(*figures[1:].astype(np.int64)))
