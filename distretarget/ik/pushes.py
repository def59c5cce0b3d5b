"""Pushes: springs between two points of a body along one direction. The points need not be joints; each is fixed to the
part that a joint carries. Compiled.

The length of a push is n . (P - Q), for points P and Q. A small rotation dw of a part moves P by dw x l, where l is the
sum of the part's bones on the line from the root to P. So the length changes by the sum over parts of dw . (l x n), and
the curvature is a matrix of rank one: k times the outer product of these torques. Above the joint where the lines of P
and Q meet, their bones are the same and cancel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.ik.articulation import Articulation, Scratch, to_rotation_vector
from distretarget.numerics.compiled import inlined
from distretarget.numerics.loops import clear

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


class Pushes(NamedTuple):
    """Pushes between points P and Q."""

    a: Numbers  # (pushes,), the joint whose part carries P
    b: Numbers  # (pushes,), the joint whose part carries Q
    at_a: Array  # (pushes, 3), from joint a to P
    at_b: Array  # (pushes, 3), from joint b to Q
    direction: Array  # (pushes, 3), n, the unit vector from Q to P
    k: Array  # (pushes,), the stiffness; 0 for one that only makes its parts move


def room_for_pushes(count: int) -> Pushes:
    """Uninitialised arrays for `count` pushes of one frame."""
    a, b = np.zeros((2, count), np.intp)
    at_a, at_b, direction = np.zeros((3, count, 3))
    return Pushes(a, b, at_a, at_b, direction, np.zeros(count))


@inlined(fastmath=True)
def add_force(scratch: Scratch, body: Articulation, joint: int, at: Array, n: Array, force: float) -> None:
    """Add the gradient `force` n with respect to a point to `scratch`; `at`, (3,), is the point less the joint."""
    torque, gradient = scratch.torque[body.parts[joint]], scratch.gradient[joint]
    torque[0] += force * (at[1] * n[2] - at[2] * n[1])
    torque[1] += force * (at[2] * n[0] - at[0] * n[2])
    torque[2] += force * (at[0] * n[1] - at[1] * n[0])
    for i in range(3):
        gradient[i] += force * n[i]


@inlined(fastmath=True)
def mark_ends(pushes: Pushes, count: int, body: Articulation, ends: Numbers) -> None:
    """Count the ends of the first `count` pushes below each joint, as `springs.write_way` does for springs."""
    for s in range(count):
        a, b = pushes.a[s], pushes.b[s]
        ends[a] += 1
        ends[b] += 1
        ends[body.meets[a, b]] -= 2


@inlined(fastmath=True)
def mark_carriers(pushes: Pushes, count: int, parts: Numbers, place: Numbers) -> None:
    """Set the `place` of the parts that carry the points of the first `count` pushes to 0."""
    for s in range(count):
        place[parts[pushes.a[s]]] = 0
        place[parts[pushes.b[s]]] = 0


@inlined(fastmath=True)
def add_pushes(
    v: Array, body: Articulation, scratch: Scratch, pushes: Pushes, count: int, place: Numbers, row: Array, H: Array
) -> None:
    """Add the curvature of the first `count` pushes to the upper triangle of H, at the `place` of each part; `row`,
    (parts + 1, 3), is scratch.
    """
    for s in range(count):
        if pushes.k[s] == 0.0:
            continue
        clear(row)
        meets = body.meets[pushes.a[s], pushes.b[s]]
        _add_line(pushes.a[s], meets, 1.0, pushes.at_a[s], pushes.direction[s], body, scratch, row)
        _add_line(pushes.b[s], meets, -1.0, pushes.at_b[s], pushes.direction[s], body, scratch, row)
        for part in range(len(row) - 1):
            if row[part, 0] != 0.0 or row[part, 1] != 0.0 or row[part, 2] != 0.0:
                to_rotation_vector(v[part], scratch.series[part], row[part])
        _add_outer(pushes.k[s], row, place, H)


@inlined(fastmath=True)
def _add_line(joint, top, sign, at, n, body, scratch, row):  # type: ignore[no-untyped-def]
    """Add the torques on the parts from a joint up to `top`, per unit of force along n on a point beside the joint."""
    _add_torque(sign, at, n, row[body.parts[joint]])
    while joint > top:
        parent = body.parents[joint]
        _add_torque(sign, scratch.bones[joint], n, row[body.parts[parent]])
        joint = parent


@inlined(fastmath=True)
def _add_torque(sign: float, arm: Array, n: Array, torque: Array) -> None:
    torque[0] += sign * (arm[1] * n[2] - arm[2] * n[1])
    torque[1] += sign * (arm[2] * n[0] - arm[0] * n[2])
    torque[2] += sign * (arm[0] * n[1] - arm[1] * n[0])


@inlined(fastmath=True)
def _add_outer(k: float, row: Array, place: Numbers, H: Array) -> None:
    """Add k times the outer product of `row` to the upper triangle of H."""
    for p in range(len(row) - 1):
        m = place[p]
        if m < 0 or (row[p, 0] == 0.0 and row[p, 1] == 0.0 and row[p, 2] == 0.0):
            continue
        for q in range(len(row) - 1):
            n = place[q]
            if n < m or (row[q, 0] == 0.0 and row[q, 1] == 0.0 and row[q, 2] == 0.0):
                continue
            for i in range(3):
                for j in range(3):
                    H[3 * m + i, 3 * n + j] += k * row[p, i] * row[q, j]
