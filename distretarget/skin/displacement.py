"""How far elbows, wrists and knees have to move so that the balls of limbs leave the capsules of other parts.

A ball on the upper arm moves by a share of the elbow's displacement, one on the forearm by shares of the elbow's and
the wrist's, and the hand by the wrist's; legs are alike. The displacements of a frame are the least that keep all gaps,
and the bones of limbs their lengths, as their tangents say; these are found at the displacements of the frame before,
so that a limb leaves a body on the side on which it entered, and again at those that they lead to. So a limb whose way
leads through a body slides round it; where it has slid away from a much shorter way out on the same side, it takes
that. The least displacements are found by projected Gauss-Seidel: each tangent in turn pushes by as much as it lacks
(K. Erleben, "Velocity-based shock propagation for multibody dynamics animation", ACM Transactions on Graphics 26
(2007), doi:10.1145/1243980.1243986).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import F2, F3, F4, Array, clear, copy_to
from distretarget.skin.balls import Balls, Placed, room_for
from distretarget.skin.tangents import (
    Displaced,
    Tangents,
    find_gaps,
    find_lengths,
    place_displaced,
    push,
    tangents_for,
)

TURNS = 2  # tangents of a frame are found so many times, the second time to do what is left
AFRESH = 4  # the same without those of the frame before
MUCH_SHORTER = 0.8  # the share of a way out from which a shorter one is taken
SWEEPS = 12  # over all tangents
SETTLED = 1e-3  # it ends where limbs move by less than this in sum [body units]
NOTHING = 1e-4  # displacements that add up to less are none [body units]


class PushWorkspace(NamedTuple):
    """Scratch for one frame."""

    placed: Placed
    rows: Tangents
    ends: F3  # (capsules, 2, 3)
    nowhere: F3  # (limbs, 2, 3), no displacements
    before: F3  # (limbs, 2, 3), those of the turn before
    kept: F3  # (limbs, 2, 3), those found from the frame before


class PushedFrames(NamedTuple):
    """Some frames of a body; what its fields are, `displacements` says."""

    posed: F4
    limbs: F4
    free: F3
    soft: F2


def displacements(
    balls: Balls, displaced: Displaced, posed: Array, limbs: Array, free: Array, soft: Array
) -> tuple[Array, Array]:
    """Return how far to displace joints in each frame so that the parts of a body come apart, (frames, limbs, 2, 3),
    as found in time forwards, and in time backwards.

    Args:
        balls: of the body, with its capsules.
        displaced: what moves with the displaced joints.
        posed: (frames, capsules, 2, 3), the ends of the capsules.
        limbs: (frames, limbs, 3, 3), the top, the middle and the end of each limb; its bones keep their lengths.
        free: (frames, limbs, 2), how far middle and end can move, 0 to 1.
        soft: (frames, pairs), how far segments may overlap, because flesh gives way.
    """
    count = limbs.shape[1]
    moved = displaced._replace(limbs=displaced.limbs % (count + 1))
    # The last limb is that of what no limb carries.
    from_none, forwards, backwards = np.zeros((3, len(posed), count + 1, 2, 3))
    free = np.concatenate([free, np.zeros((len(posed), 1, 2))], axis=1)
    room = PushWorkspace(
        room_for(balls), tangents_for(balls, count), np.zeros(posed.shape[1:]), *np.zeros((3, count + 1, 2, 3))
    )
    frames = PushedFrames(*map(np.ascontiguousarray, (posed, limbs, free, soft)))
    _write_from_none(balls, moved, frames, room, from_none)
    if from_none.any():
        _write_displacements(balls, moved, frames, from_none, 1, room, forwards)
        _write_displacements(balls, moved, frames, from_none, -1, room, backwards)
    return forwards[:, :count], backwards[:, :count]


@compiled(fastmath=True)
def _write_from_none(
    balls: Balls, displaced: Displaced, frames: PushedFrames, room: PushWorkspace, from_none: Out[F4]
) -> None:
    """Write what one turn finds from no displacements."""
    for frame in range(len(from_none)):
        _turn(balls, displaced, frames, frame, from_none[frame], True, room)


@compiled(fastmath=True)
def _write_displacements(
    balls: Balls,
    displaced: Displaced,
    frames: PushedFrames,
    from_none: F4,
    step: int,
    room: PushWorkspace,
    result: Out[F4],
) -> None:
    """Write the displacements in time forwards, if `step` is 1, or backwards, if it is -1."""
    nowhere, before, kept = room.nowhere, room.before, room.kept
    for n in range(len(result)):
        frame = n if step > 0 else len(result) - 1 - n
        d = result[frame]
        if n > 0:
            copy_to(d, result[frame - step])
        is_new = _way_between(d, nowhere) < NOTHING
        # From those of the frame before; then from none; then from the shorter of the two for each limb.
        for attempt in range(1 if is_new else 3):
            if attempt == 1:
                copy_to(kept, d)
            elif attempt == 2 and not _take_shorter(d, kept):
                break
            is_afresh = is_new or attempt == 1
            if is_afresh:
                clear(d)
            for turn in range(AFRESH if is_afresh else TURNS):
                copy_to(before, d)
                if is_afresh and turn == 0:
                    copy_to(d, from_none[frame])
                else:
                    _turn(balls, displaced, frames, frame, d, turn % TURNS == 0, room)
                if _way_between(before, d) < SETTLED or (attempt == 1 and not _any_shorter(d, kept)):
                    break
        for limb in range(len(d)):
            if _way_between(d[limb], nowhere[limb]) < NOTHING:
                clear(d[limb])


@inlined(fastmath=True)
def _turn(balls, displaced, frames, frame, d, begins, room):  # type: ignore[no-untyped-def]
    """Displace limbs by the least that keeps the tangents at displacements d, beginning with none if asked for."""
    place_displaced(balls, displaced, frames.posed[frame], d, room.ends, room.placed)
    count = find_gaps(balls, displaced, room.placed, frames.free[frame], d, frames.soft[frame], room.rows)
    if count > 0:
        count = find_lengths(frames.limbs[frame], frames.free[frame], d, room.rows, count)
    if begins:
        clear(d)
    _push_all(room.rows, count, d)


@inlined(fastmath=True)
def _take_shorter(d: Array, other: Array) -> bool:
    """Write the other displacements of each limb over d unless those are much shorter, and less than a right angle
    away, so that no limb changes sides through a body; return whether any are.
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
    """The same of one limb."""
    return bool(_dot(one, one) < MUCH_SHORTER**2 * _dot(other, other) and _dot(one, other) > 0.0)


@inlined(fastmath=True)
def _dot(a: Array, b: Array) -> float:
    total, flat_a, flat_b = 0.0, a.flat, b.flat
    for i in range(a.size):
        total += flat_a[i] * flat_b[i]
    return total


@inlined(fastmath=True)
def _push_all(rows, count, d):  # type: ignore[no-untyped-def]
    """Displace limbs by the least that keeps so many tangents."""
    for _ in range(SWEEPS):
        moved = 0.0
        for row in range(count - 1, -1, -1):
            moved += push(rows, row, d)
        if moved < SETTLED:
            break


@inlined(fastmath=True)
def _way_between(a: Array, b: Array) -> float:
    """The sum of the absolute differences of displacements."""
    size, flat_a, flat_b = 0.0, a.flat, b.flat
    for i in range(a.size):
        size += abs(flat_a[i] - flat_b[i])
    return size
