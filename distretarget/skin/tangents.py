"""The constraints of displaced limbs, linearised: tangents, linear functions of displacements that have to be >= 0.

The gap between a ball and a fixed capsule is convex in the ball's position, so it is nowhere less than its tangent.
Where the tangent is >= 0 the ball is outside, and on the same side. Tangents push limbs until all are >= 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import inlined
from distretarget.numerics.vectors import B1, F1, F2, F3, I1, I2, Array, clear
from distretarget.skin.balls import NEVER, Balls, Placed, find_candidates, gap_of, place
from distretarget.skin.capsules import LEAST

MARGIN = 0.005  # gaps larger than this both with and without displacements have no tangent [body units]
COMPLIANCE = 0.18  # of the tangents of gaps, which bounds the pushes of limbs that have no room to leave a body
SHELL = (132, 57, 23, 10, 4, 1)  # the steps of Shell's sort (M. Ciura, 2001)
LEAST_SHARE = 0.49  # balls that move by a smaller share of a displacement are not pushed; at 0.5 are middles of parts


class Displaced(NamedTuple):
    """How capsules move with the middle and the end of each limb, such as elbow and wrist."""

    limbs: I1  # (capsules,), the limb that each capsule belongs to; -1 for none
    shares: F3  # (capsules, 2, 2), of the displacements of middle and end, for each end of the capsule's axis
    mutual: B1  # (pairs,), whether both segments of a pair are displaced, or only that of the balls


class Tangents(NamedTuple):
    """Linear functions of displacements: value + normal . (sum of shares times displacements), each with a push."""

    limbs: I2  # (tangents, 2), the two limbs that are displaced
    order: I1  # (tangents,), the tangents in the order in which they push, last first
    shares: F2  # (tangents, 4), of the displacements of middle and end of the two limbs
    moves: F2  # (tangents, 4), the displacements of these along the normal by a push of 1
    normals: F2  # (tangents, 3)
    values: F1  # (tangents,), without displacements
    effective_mass: F1  # (tangents,), the push that a value of -1 needs
    compliance: F1  # (tangents,), added to the value per push
    least: F1  # (tangents,), the least push: 0 for gaps, which only push
    pushes: F1  # (tangents,)


def tangents_for(balls: Balls, limbs: int) -> Tangents:
    """Return scratch for the tangents of a frame of a body with so many limbs."""
    most = int((balls.gap_offsets < NEVER).sum()) + 2 * limbs
    of_four = (np.zeros((most, width)) for width in (4, 4, 3))
    return Tangents(np.zeros((most, 2), np.intp), np.zeros(most, np.intp), *of_four, *np.zeros((5, most)))


@inlined(fastmath=True)
def place_displaced(balls: Balls, displaced: Displaced, posed: Array, d: Array, ends: Array, placed: Placed) -> None:
    """Pose the balls and capsules with limbs displaced by d, (limbs, 2, 3), and write the ends of axes to `ends`;
    `posed`, (capsules, 2, 3), are the ends without displacements.
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
    """Write the tangents of the gaps of a frame at displacements d, (limbs, 2, 3); return their number."""
    count = 0
    for pair in range(len(balls.pairs)):
        both, far = displaced.mutual[pair], MARGIN - soft[pair]
        for n in range(find_candidates(balls, pair, far + _most_change(balls, displaced, pair, d), placed)):
            ball, capsule = placed.candidates[n, 0], placed.candidates[n, 1]
            gap, t, x, y, z = gap_of(balls, ball, capsule, placed)
            if _is_movable(balls, displaced, ball, capsule, t, both, free, rows, count):
                _write(rows, count, x, y, z, gap + soft[pair], COMPLIANCE, 0.0, d)
                if min(gap + soft[pair], rows.values[count]) < MARGIN:
                    count += 1
    return count


@inlined(fastmath=True)
def order_gaps(rows: Tangents, count: int) -> None:
    """Order the tangents of gaps by their values, so that the deepest pushes first: a body and its mirror image are
    treated alike.
    """
    for row in range(count):
        rows.order[row] = row
    for step in SHELL:
        for n in range(step, count):
            row, at = rows.order[n], n
            while at >= step and _is_before(rows, rows.order[at - step], row):
                rows.order[at] = rows.order[at - step]
                at -= step
            rows.order[at] = row


@inlined(fastmath=True)
def _is_before(rows, one, other):  # type: ignore[no-untyped-def]
    """Whether a tangent pushes before another: of those with the same value, the one that was found last."""
    a, b = rows.values[one], rows.values[other]
    return a < b or (a == b and one > other)


@inlined(fastmath=True)
def _most_change(balls, displaced, pair, d):  # type: ignore[no-untyped-def]
    """A bound of the change of the gap of a segment pair by displacements d."""
    ball, capsule = balls.of_ball[balls.pairs[pair, 0]], balls.of_capsule[balls.pairs[pair, 1]]
    return _farthest(d[displaced.limbs[balls.carriers[ball]]]) + _farthest(d[displaced.limbs[capsule]])


@inlined(fastmath=True)
def _farthest(by):  # type: ignore[no-untyped-def]
    """The length of the larger displacement of a limb's middle and end, (2, 3)."""
    square = 0.0
    for joint in range(2):
        square = max(square, by[joint, 0] ** 2 + by[joint, 1] ** 2 + by[joint, 2] ** 2)
    return np.sqrt(square)


@inlined(fastmath=True)
def find_lengths(limbs, free, d, rows, count):  # type: ignore[no-untyped-def]
    """Append the tangent of each bone's change of length at displacements d to `count` others, and return the new
    count. `limbs`, (limbs, 3, 3), are top, middle and end without displacements.
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
            rows.effective_mass[count], rows.order[count] = 1.0 / squares, count
            _write(rows, count, x / new, y / new, z / new, new - old, 0.0, -NEVER, d)
            count += 1
    return count


@inlined(fastmath=True)
def _is_movable(balls, displaced, ball, capsule, t, both, free, rows, row):  # type: ignore[no-untyped-def]
    """Write limbs, shares and moves of a ball and of the point t of a capsule; return whether they can move enough."""
    carrier, at = balls.carriers[ball], balls.fractions[ball]
    rows.limbs[row, 0], rows.limbs[row, 1] = displaced.limbs[carrier], displaced.limbs[capsule]
    of_ball, of_capsule, squares = displaced.shares[carrier], displaced.shares[capsule], 0.0
    for k in range(2):
        s = (1.0 - at) * of_ball[0, k] + at * of_ball[1, k]
        u = (t - 1.0) * of_capsule[0, k] - t * of_capsule[1, k]
        rows.shares[row, k], rows.shares[row, 2 + k] = s, u
        rows.moves[row, k] = s * free[rows.limbs[row, 0], k]
        rows.moves[row, 2 + k] = u * free[rows.limbs[row, 1], k] if both else 0.0
        squares += rows.moves[row, k] * s + rows.moves[row, 2 + k] * u
    rows.effective_mass[row] = 1.0 / max(squares, LEAST)
    return squares >= LEAST_SHARE * LEAST_SHARE


@inlined(fastmath=True)
def _write(rows, row, x, y, z, value, compliance, least, d):  # type: ignore[no-untyped-def]
    """Write the other fields of a tangent, from its normal, its value at displacements d, its compliance relative to
    what a push of 1 changes, and its least push.
    """
    n, s, a, b = rows.normals[row], rows.shares[row], d[rows.limbs[row, 0]], d[rows.limbs[row, 1]]
    n[0], n[1], n[2] = x, y, z
    for i in range(3):
        value -= n[i] * (s[0] * a[0, i] + s[1] * a[1, i] + s[2] * b[0, i] + s[3] * b[1, i])
    rows.values[row], rows.least[row], rows.pushes[row] = value, least, 0.0
    rows.compliance[row] = compliance / rows.effective_mass[row]
    rows.effective_mass[row] /= 1.0 + compliance


@inlined(fastmath=True)
def push(rows, row, d):  # type: ignore[no-untyped-def]
    """Update the push of a tangent by its residual, and displace its limbs; return the change of the push."""
    a, b = d[rows.limbs[row, 0]], d[rows.limbs[row, 1]]
    s, m, n = rows.shares[row], rows.moves[row], rows.normals[row]
    value, before = rows.values[row] + rows.compliance[row] * rows.pushes[row], rows.pushes[row]
    for i in range(3):
        value += n[i] * (s[0] * a[0, i] + s[1] * a[1, i] + s[2] * b[0, i] + s[3] * b[1, i])
    rows.pushes[row] = max(before - rows.effective_mass[row] * value, rows.least[row])
    by = rows.pushes[row] - before
    if by != 0.0:
        for i in range(3):
            a[0, i] += by * m[0] * n[i]
            a[1, i] += by * m[1] * n[i]
            b[0, i] += by * m[2] * n[i]
            b[1, i] += by * m[3] * n[i]
    return abs(by)
