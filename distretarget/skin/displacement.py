"""The least displacements of elbows, wrists and knees that bring the balls of limbs out of the capsules of other parts.

A ball on the upper arm moves by a share of the elbow's displacement, a ball on the forearm by shares of the elbow's and
the wrist's, and the hand by the wrist's; the same holds for legs. The displacements of a frame are the least that keep
all gaps open and the bones of limbs at their lengths, linearised (`tangents`) at the displacements of the frame before,
and once more at the solution. So a limb leaves a body on the side on which it entered, and a limb whose path leads
through a body slides round it; if it has slid away from a much shorter displacement on the same side, it takes that.
Solved backwards in time, it leaves the body on the side on which it comes out; a limb takes the cheaper of the two.
The solver is projected Gauss-Seidel (K. Erleben, "Velocity-based shock propagation for multibody dynamics animation",
ACM Transactions on Graphics 26 (2007), doi:10.1145/1243980.1243986).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import F2, F3, F4, Array, Flags, clear, copy_to
from distretarget.skin.balls import Balls, Placed, room_for
from distretarget.skin.tangents import (
    Displaced,
    Tangents,
    find_gaps,
    find_lengths,
    order_gaps,
    place_displaced,
    push,
    tangents_for,
)

PASSES = 2  # linearisations of a frame that continues the frame before; the second corrects the first
FRESH_PASSES = 4  # linearisations of a frame that begins without displacements
MUCH_SHORTER = 0.8  # displacements shorter than this share of the others are much shorter
SWEEPS = 12  # of Gauss-Seidel over all tangents, at most
SETTLED = 1e-3  # sweeps and passes end where the sum of changes is less than this [body units]
NOTHING = 1e-4  # displacements whose components sum to less than this are set to zero, and have no side [body units]
SAME = 0.005  # displacements that differ by less are on the same side [body units]


class PushWorkspace(NamedTuple):
    """Scratch for one frame."""

    placed: Placed
    rows: Tangents
    ends: F3  # (capsules, 2, 3)
    zero: F3  # (limbs, 2, 3), no displacements
    before: F3  # (limbs, 2, 3), displacements of the pass before
    continued: F3  # (limbs, 2, 3), displacements found from those of the frame before


class PushedFrames(NamedTuple):
    """Some frames of a body."""

    posed: F4  # (frames, capsules, 2, 3), the ends of the capsules
    limbs: F4  # (frames, limbs, 3, 3), the top, the middle and the end of each limb; its bones keep their lengths
    free: F3  # (frames, limbs, 2), how far middle and end can move, 0 to 1
    soft: F2  # (frames, pairs), how far segments may overlap


def least_displacements(balls: Balls, displaced: Displaced, *frames: Array, switch_cost: float) -> Array:
    """Return displacements of the middles and ends of limbs that bring the parts of a body apart in the frames of a
    shot, (frames, limbs, 2, 3), independently of the direction of time.

    Where the solutions of `displacements` differ, each frame takes the smaller one; a switch between them costs as much
    as `switch_cost` frames of their difference.
    """
    forwards, backwards = displacements(balls, displaced, *frames)
    taken = cheaper(forwards, backwards, switch_cost)
    return np.where(taken[:, None, None, None], backwards, forwards)


def cheaper(forwards: Array, backwards: Array, switch_cost: float) -> Flags:
    """Return a mask of the frames that take the displacements found backwards, (frames,): those of the cheapest
    sequence, by dynamic programming. The cost of a frame is the square of its displacements, that of a switch
    `switch_cost` times the square of the difference of the two solutions.
    """
    differ: Flags = np.asarray((np.abs(forwards - backwards) > SAME).any(axis=(1, 2, 3)))
    saved = np.where(differ, (forwards**2 - backwards**2).sum(axis=(1, 2, 3)), 0.0)
    switches = np.where(differ, switch_cost * ((forwards - backwards) ** 2).sum(axis=(1, 2, 3)), 0.0)
    gain = np.zeros(len(differ) + 1)  # cost saved up to the frame before by ending backwards rather than forwards
    for frame in np.flatnonzero(differ):
        gain[frame + 1] = np.clip(gain[frame], -switches[frame], switches[frame]) + saved[frame]
    taken = np.zeros(len(differ) + 1, bool)
    for frame in np.flatnonzero(differ)[::-1]:
        switch_after = switches[frame + 1] if frame + 1 < len(differ) else 0.0
        taken[frame] = gain[frame + 1] > (-switch_after if taken[frame + 1] else switch_after)
    return np.asarray(taken[:-1])


def displacements(
    balls: Balls, displaced: Displaced, posed: Array, limbs: Array, free: Array, soft: Array
) -> tuple[Array, Array]:
    """Return displacements of the middles and ends of limbs that bring the parts of a body apart, (frames, limbs, 2,
    3): found frame by frame forwards in time, and backwards in time. The arrays are those of `PushedFrames`.
    """
    count = limbs.shape[1]
    moved = displaced._replace(limbs=displaced.limbs % (count + 1))
    # The last limb stands for all that no limb carries.
    fresh, forwards, backwards = np.zeros((3, len(posed), count + 1, 2, 3))
    free = np.concatenate([free, np.zeros((len(posed), 1, 2))], axis=1)
    room = PushWorkspace(
        room_for(balls), tangents_for(balls, count), np.zeros(posed.shape[1:]), *np.zeros((3, count + 1, 2, 3))
    )
    frames = PushedFrames(*map(np.ascontiguousarray, (posed, limbs, free, soft)))
    _write_fresh(balls, moved, frames, room, fresh)
    if fresh.any():
        _write_displacements(balls, moved, frames, fresh, 1, room, forwards)
        _write_displacements(balls, moved, frames, fresh, -1, room, backwards)
    return forwards[:, :count], backwards[:, :count]


@compiled(fastmath=True)
def _write_fresh(balls: Balls, displaced: Displaced, frames: PushedFrames, room: PushWorkspace, fresh: Out[F4]) -> None:
    """Write the displacements of each frame after one pass that begins without displacements."""
    for frame in range(len(fresh)):
        _pass(balls, displaced, frames, frame, fresh[frame], True, room)


@compiled(fastmath=True)
def _write_displacements(
    balls: Balls,
    displaced: Displaced,
    frames: PushedFrames,
    fresh: F4,
    step: int,
    room: PushWorkspace,
    result: Out[F4],
) -> None:
    """Write the displacements, forwards in time with a `step` of 1, backwards with -1; `fresh` as by `_write_fresh`."""
    zero, before, continued = room.zero, room.before, room.continued
    for n in range(len(result)):
        frame = n if step > 0 else len(result) - 1 - n
        d = result[frame]
        if n > 0:
            copy_to(d, result[frame - step])
        is_new = _difference(d, zero) < NOTHING
        # From the displacements of the frame before; then from zero; then from the shorter of the two for each limb.
        for attempt in range(1 if is_new else 3):
            if attempt == 1:
                copy_to(continued, d)
            elif attempt == 2 and not _take_shorter(d, continued):
                break
            is_fresh = is_new or attempt == 1
            if is_fresh:
                clear(d)
            for n_pass in range(FRESH_PASSES if is_fresh else PASSES):
                copy_to(before, d)
                if is_fresh and n_pass == 0:
                    copy_to(d, fresh[frame])
                else:
                    _pass(balls, displaced, frames, frame, d, n_pass % PASSES == 0, room)
                if _difference(before, d) < SETTLED or (attempt == 1 and not _any_shorter(d, continued)):
                    break
        for limb in range(len(d)):
            if _difference(d[limb], zero[limb]) < NOTHING:
                clear(d[limb])


@inlined(fastmath=True)
def _pass(balls, displaced, frames, frame, d, from_zero, room):  # type: ignore[no-untyped-def]
    """Replace displacements d by the least that satisfy the tangents at d; Gauss-Seidel starts at d or `from_zero`."""
    place_displaced(balls, displaced, frames.posed[frame], d, room.ends, room.placed)
    count = find_gaps(balls, displaced, room.placed, frames.free[frame], d, frames.soft[frame], room.rows)
    if count > 0:
        order_gaps(room.rows, count)
        count = find_lengths(frames.limbs[frame], frames.free[frame], d, room.rows, count)
    if from_zero:
        clear(d)
    _push_all(room.rows, count, d)


@inlined(fastmath=True)
def _take_shorter(d: Array, other: Array) -> bool:
    """Replace the displacements d of each limb by the `other` ones, unless d is much shorter and less than a right
    angle away from them, so that no limb changes sides through a body; return whether any d remain.
    """
    any_shorter = False
    for limb in range(len(d)):
        if _is_shorter(d[limb], other[limb]):
            any_shorter = True
        else:
            copy_to(d[limb], other[limb])
    return any_shorter


@inlined(fastmath=True)
def _any_shorter(d: Array, other: Array) -> bool:
    """Whether the displacements of any limb are much shorter than others, and less than a right angle away."""
    for limb in range(len(d)):  # noqa: SIM110 - compiled
        if _is_shorter(d[limb], other[limb]):
            return True
    return False


@inlined(fastmath=True)
def _is_shorter(one: Array, other: Array) -> bool:
    """Whether the displacements `one` of a limb are much shorter than `other`, and less than a right angle away."""
    return bool(_dot(one, one) < MUCH_SHORTER**2 * _dot(other, other) and _dot(one, other) > NOTHING**2)


@inlined(fastmath=True)
def _dot(a: Array, b: Array) -> float:
    total, flat_a, flat_b = 0.0, a.flat, b.flat
    for i in range(a.size):
        total += flat_a[i] * flat_b[i]
    return total


@inlined(fastmath=True)
def _push_all(rows, count, d):  # type: ignore[no-untyped-def]
    """Solve the first `count` tangents by projected Gauss-Seidel, from displacements d."""
    for _ in range(SWEEPS):
        moved = 0.0
        for n in range(count - 1, -1, -1):
            moved += push(rows, rows.order[n], d)
        if moved < SETTLED:
            break


@inlined(fastmath=True)
def _difference(a: Array, b: Array) -> float:
    """The sum of the absolute differences of displacements."""
    size, flat_a, flat_b = 0.0, a.flat, b.flat
    for i in range(a.size):
        size += abs(flat_a[i] - flat_b[i])
    return size
