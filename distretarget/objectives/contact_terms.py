"""The terms of the contact objective in a frame: springs of contact pairs and of supports, and the floor. Compiled.

    1/2 w r^T (k I + (1 - k) e e^T) r,   r = x_u - x_v - delta,   delta = d_copy + f (d_scaled - d_copy)

is the energy of a contact pair, with d_copy the difference of its two points in the rotation copy, and d_scaled =
tau2 / tau1 d_source the source's difference, scaled; f is the activation, 0 to 1; w the stiffness; e the direction of
d_scaled; k w the stiffness perpendicular to e.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.ik.articulation import Articulation, Scratch
from distretarget.ik.pose_solver import CopiedBones, Workspace, pose_solver
from distretarget.ik.springs import (
    NEGLIGIBLE,
    FloorSprings,
    FrameSprings,
    Springs,
    add_floor,
    floor_energy,
    is_negligible,
    spring_energy,
)
from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import F1, F2, F3, I1, Array

LINEAR_RANGE = 0.05  # beyond this difference from the rotation copy a pair's force hardly grows [body units]
TOUCH = 0.005  # [D] added to D before the stiffness is divided by it, which keeps touching pairs finite
DIRECTION_RANGE = 0.08  # pairs closer than about this keep their direction as well as their distance [body units]


class NearPairs(NamedTuple):
    """The contact pairs of a block of frames; `write_pair_spring` makes their springs."""

    a: I1  # (pairs,), the target's joint at u
    b: I1  # (pairs,), the target's joint at v
    u: I1  # (pairs,), the first point
    v: I1  # (pairs,), the second point
    scaled: F3  # (frames, pairs, 3), d_scaled, the difference x_u - x_v that keeps the contact [body units]
    copied: F3  # (frames, pairs, 3), d_copy, the difference in the rotation copy [body units]
    f: F2  # (frames, pairs), activation
    w: F2  # (frames, pairs), stiffness


@compiled()
def write_stiffness(f: F2, D: F2, u: I1, v: I1, stiffness: float, reach: float, sums: Out[F1], w: Out[F2]) -> None:
    """Write w = stiffness f / sqrt((1 + F_u) (1 + F_v)) reach / (D + TOUCH); `sums`, (points,), is scratch."""
    for frame in range(len(f)):
        for point in range(len(sums)):
            sums[point] = 1.0
        for s in range(len(u)):
            sums[u[s]] += f[frame, s]
            sums[v[s]] += f[frame, s]
        for s in range(len(u)):
            w[frame, s] = 0.0
            if f[frame, s] > 0.0:
                shared = f[frame, s] / np.sqrt(sums[u[s]] * sums[v[s]])
                w[frame, s] = stiffness * shared * reach / (D[frame, s] + TOUCH)


@inlined()
def share_across(square):  # type: ignore[no-untyped-def]
    """k: a pair's stiffness perpendicular to its direction over that along it, from its squared length [body units], a
    number or an array; 1/2 at the length `DIRECTION_RANGE`.
    """
    return DIRECTION_RANGE**2 / (DIRECTION_RANGE**2 + square)


@inlined(fastmath=True)
def write_pair_spring(near: NearPairs, frame: int, pair: int, rest: Array, A: Array) -> None:
    """Write the spring of a pair in a frame: its rest vector d_copy + f (d_scaled - d_copy) to `rest`, (3,), and its
    stiffness, w along d_scaled and k w perpendicular to it (`share_across`), to `A`, (3, 3).

    With c the distance f |d_scaled - d_copy| of the rest vector from the copy, the stiffness is divided by
    (1 + (c / LINEAR_RANGE)^4)^(1/4), which bounds the force: contacts in reach are firm, others hardly bend the body.
    """
    d, f, w, change = near.scaled[frame, pair], near.f[frame, pair], near.w[frame, pair], 0.0
    for i in range(3):
        step = f * (d[i] - near.copied[frame, pair, i])
        rest[i] = near.copied[frame, pair, i] + step
        change += step * step
    change /= LINEAR_RANGE * LINEAR_RANGE
    w /= np.sqrt(np.sqrt(1.0 + change * change))
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    across = w * share_across(square)
    along = (w - across) / square if square > 0.0 else 0.0
    for i in range(3):
        for j in range(3):
            A[i, j] = along * d[i] * d[j]
        A[i, i] += across


class ContactFrames(NamedTuple):
    """The terms of a block of frames."""

    near: NearPairs  # contacts in all frames of the block
    springs: Springs  # of supports, scene contacts and user constraints in all frames of the block
    floor: FloorSprings  # the floor in all frames of the block
    room: FrameSprings  # scratch for the springs of one frame


class ContactTerms(NamedTuple):
    """The terms of one frame."""

    springs: FrameSprings  # of contacts and supports, then room for a spring per joint that the floor pushes up
    acting: int  # the number of springs in use
    floor: FloorSprings  # the floor in this frame


@inlined(fastmath=True)
def _energy(scratch: Scratch, terms: ContactTerms) -> float:
    return spring_energy(scratch, terms.springs, terms.acting) + floor_energy(scratch, terms.floor)


@inlined(fastmath=True)
def _like_springs(scratch: Scratch, terms: ContactTerms) -> tuple[FrameSprings, int]:
    return terms.springs, add_floor(scratch, terms.floor, terms.springs, terms.acting)


@inlined(fastmath=True)
def _terms_of(given: ContactFrames, frame: int, start: Array) -> ContactTerms:  # noqa: ARG001
    floor = given.floor
    of_frame = FloorSprings(floor.joints, floor.heights[frame], floor.stiffness[frame], floor.up)
    return ContactTerms(given.room, _write_springs(given.near, given.springs, frame, given.room), of_frame)


@inlined(fastmath=True)
def _write_springs(near: NearPairs, springs: Springs, frame: int, room: FrameSprings) -> int:
    """Write the springs that act in a frame to `room`; return their number."""
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


_solve_poses = pose_solver(_terms_of, _energy, _like_springs)


@compiled()
def solve_contact_frames(
    body: Articulation,
    copy: CopiedBones,
    given: ContactFrames,
    tolerance: float,
    v: Out[F3],
    first: int,
    log: Out[F2],
    work: Workspace,
) -> None:
    """Solve the frames of `copy`, see `pose_solver`."""
    _solve_poses(body, copy, given, tolerance, v, first, log, work)
