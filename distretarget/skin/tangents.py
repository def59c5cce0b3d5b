"""What displaced limbs have to keep, as tangents: linear functions of displacements that are to be 0 or more.

The gap between a ball and a capsule that stays is convex in where the ball is, so it is nowhere less than its tangent:
where that is 0 or more the ball is outside, on the side on which it was. Tangents push limbs until all are 0 or more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import inlined
from distretarget.numerics.vectors import B1, F1, F2, F3, I1, I2, Array, clear
from distretarget.skin.balls import NEVER, Balls, Placed, find_meetings, gap_of, place
from distretarget.skin.capsules import LEAST

MARGIN = 0.005  # gaps that are larger, also without displacements, have no tangent [body units]
GIVES = 0.18  # compliance of a push, so that limbs without room to leave a body are not pushed on and on
LEAST_SHARE = 0.5  # balls that move by a smaller share of a displacement stay where they are


class Displaced(NamedTuple):
    """What moves with the joints that can be displaced: the middle of each limb, such as an elbow, and its end."""

    limbs: I1  # (capsules,), the limb that each capsule belongs to; -1 for none
    shares: F3  # (capsules, 2, 2), how much of the displacements of middle and end its own two ends move by
    mutual: B1  # (pairs,), whether both segments of a pair give way, or that of the balls alone


class Tangents(NamedTuple):
    """Functions of displacements: a value, plus the sum of shares of displacements along a normal."""

    limbs: I2  # (tangents, 2), which are displaced
    shares: F2  # (tangents, 4), of the middle and the end of the two limbs
    moves: F2  # (tangents, 4), how far a push of 1 displaces them
    normals: F2  # (tangents, 3)
    values: F1  # (tangents,), without displacements
    firmness: F1  # (tangents,), the push that a value of -1 asks for
    gives: F1  # (tangents,), by how much each push of 1 gives way
    least: F1  # (tangents,), the least push: 0 for what only pushes
    pushes: F1  # (tangents,)


def tangents_for(balls: Balls, limbs: int) -> Tangents:
    """Return room for the tangents of a frame of a body with so many limbs."""
    most = int((balls.spare < NEVER).sum()) + 2 * limbs
    of_four = (np.zeros((most, width)) for width in (4, 4, 3))
    return Tangents(np.zeros((most, 2), np.intp), *of_four, *np.zeros((5, most)))


@inlined(fastmath=True)
def place_displaced(balls: Balls, displaced: Displaced, posed: Array, d: Array, ends: Array, placed: Placed) -> None:
    """Write where balls and capsules are with limbs displaced by d, (limbs, 2, 3); `posed`, (capsules, 2, 3), are the
    ends of axes without, and `ends` become those with it.
    """
    for capsule in range(len(posed)):
        by = d[displaced.limbs[capsule]]
        for end in range(2):
            s = displaced.shares[capsule, end]
            for i in range(3):
                ends[capsule, end, i] = posed[capsule, end, i] + s[0] * by[0, i] + s[1] * by[1, i]
    place(balls, ends, placed)


@inlined(fastmath=True)
def find_gaps(balls, displaced, placed, free, d, soft, rows):  # type: ignore[no-untyped-def]
    """Write the tangents of the gaps of a frame at displacements d, (limbs, 2, 3); return how many there are."""
    count = 0
    for pair in range(len(balls.pairs)):
        both, far = displaced.mutual[pair], MARGIN - soft[pair]
        for meeting in range(find_meetings(balls, pair, far + _way(balls, displaced, pair, d), placed)):
            ball, capsule = placed.meetings[meeting, 0], placed.meetings[meeting, 1]
            gap, t, x, y, z = gap_of(balls, ball, capsule, placed)
            if _is_movable(balls, displaced, ball, capsule, t, both, free, rows, count):
                _write(rows, count, x, y, z, gap + soft[pair], GIVES, 0.0, d)
                if min(gap + soft[pair], rows.values[count]) < MARGIN:
                    count += 1
    return count


@inlined(fastmath=True)
def _way(balls, displaced, pair, d):  # type: ignore[no-untyped-def]
    """How far, at most, displacements d change the distance of two segments."""
    ball, capsule = balls.of_ball[balls.pairs[pair, 0]], balls.of_capsule[balls.pairs[pair, 1]]
    return _farthest(d[displaced.limbs[balls.carriers[ball]]]) + _farthest(d[displaced.limbs[capsule]])


@inlined(fastmath=True)
def _farthest(by):  # type: ignore[no-untyped-def]
    """The larger of the displacements of a limb's middle and end, (2, 3)."""
    square = 0.0
    for joint in range(2):
        square = max(square, by[joint, 0] ** 2 + by[joint, 1] ** 2 + by[joint, 2] ** 2)
    return np.sqrt(square)


@inlined(fastmath=True)
def find_lengths(limbs, free, d, rows, count):  # type: ignore[no-untyped-def]
    """Write the tangent of each bone's change of length at displacements d, after `count` others, and return the new
    count. `limbs`, (limbs, 3, 3), are where top, middle and end were.
    """
    for limb in range(len(limbs)):
        x, y, z = 0.0, 0.0, 0.0
        for bone in range(2):
            a, b, by = limbs[limb, bone], limbs[limb, bone + 1], d[limb]
            x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            old = np.sqrt(x * x + y * y + z * z)
            x, y, z = x + by[bone, 0], y + by[bone, 1], z + by[bone, 2]
            if bone == 1:
                x, y, z = x - by[0, 0], y - by[0, 1], z - by[0, 2]
            new = np.sqrt(x * x + y * y + z * z)
            s, m = rows.shares[count], rows.moves[count]
            clear(s)
            clear(m)
            s[bone], s[0] = 1.0, 1.0 - 2.0 * bone
            m[0], m[1] = s[0] * free[limb, 0], s[1] * free[limb, 1]
            squares = m[0] * s[0] + m[1] * s[1]
            if min(old, new) < LEAST or squares <= 0.0:
                continue
            rows.limbs[count, 0], rows.limbs[count, 1] = limb, len(free) - 1
            rows.firmness[count] = 1.0 / squares
            _write(rows, count, x / new, y / new, z / new, new - old, 0.0, -NEVER, d)
            count += 1
    return count


@inlined(fastmath=True)
def _is_movable(balls, displaced, ball, capsule, t, both, free, rows, row):  # type: ignore[no-untyped-def]
    """Write the limbs of a ball and of the point t of a capsule, and how they move; return whether they can."""
    carrier, at = balls.carriers[ball], balls.places[ball]
    rows.limbs[row, 0], rows.limbs[row, 1] = displaced.limbs[carrier], displaced.limbs[capsule]
    of_ball, of_capsule, squares = displaced.shares[carrier], displaced.shares[capsule], 0.0
    for k in range(2):
        s = (1.0 - at) * of_ball[0, k] + at * of_ball[1, k]
        u = (t - 1.0) * of_capsule[0, k] - t * of_capsule[1, k]
        rows.shares[row, k], rows.shares[row, 2 + k] = s, u
        rows.moves[row, k] = s * free[rows.limbs[row, 0], k]
        rows.moves[row, 2 + k] = u * free[rows.limbs[row, 1], k] if both else 0.0
        squares += rows.moves[row, k] * s + rows.moves[row, 2 + k] * u
    rows.firmness[row] = 1.0 / max(squares, LEAST)
    return squares >= LEAST_SHARE * LEAST_SHARE


@inlined(fastmath=True)
def _write(rows, row, x, y, z, value, gives, least, d):  # type: ignore[no-untyped-def]
    """Write a normal, and the value without displacements from the one at displacements d; a push gives way by `gives`
    times what it displaces.
    """
    n, s, a, b = rows.normals[row], rows.shares[row], d[rows.limbs[row, 0]], d[rows.limbs[row, 1]]
    n[0], n[1], n[2] = x, y, z
    for i in range(3):
        value -= n[i] * (s[0] * a[0, i] + s[1] * a[1, i] + s[2] * b[0, i] + s[3] * b[1, i])
    rows.values[row], rows.least[row], rows.pushes[row] = value, least, 0.0
    rows.gives[row] = gives / rows.firmness[row]
    rows.firmness[row] /= 1.0 + gives


@inlined(fastmath=True)
def push(rows, row, d):  # type: ignore[no-untyped-def]
    """Displace the limbs of a tangent by what it lacks; return the change of its push."""
    a, b = d[rows.limbs[row, 0]], d[rows.limbs[row, 1]]
    s, m, n = rows.shares[row], rows.moves[row], rows.normals[row]
    value, before = rows.values[row] + rows.gives[row] * rows.pushes[row], rows.pushes[row]
    for i in range(3):
        value += n[i] * (s[0] * a[0, i] + s[1] * a[1, i] + s[2] * b[0, i] + s[3] * b[1, i])
    rows.pushes[row] = max(before - rows.firmness[row] * value, rows.least[row])
    by = rows.pushes[row] - before
    if by != 0.0:
        for i in range(3):
            a[0, i] += by * m[0] * n[i]
            a[1, i] += by * m[1] * n[i]
            b[0, i] += by * m[2] * n[i]
            b[1, i] += by * m[3] * n[i]
    return abs(by)
