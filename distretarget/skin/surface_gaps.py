"""How far points on a surface that moves with joints are from others on it. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import B1, B2, F1, F2, F4, I1, indices

RUN = 8  # points of a limb that are looked for together


class Bound(NamedTuple):
    """Vectors that are bound to joints: sums of R b + w x over joints with the rotations R and the places x."""

    first: I1  # (vectors + 1,), the first row of each in what follows; the last is their end
    joints: I1  # (rows,), the joints
    b: F2  # (rows, 4), b and w


class Points(NamedTuple):
    """Points on the outside of a surface, ordered by segment, and so that those of a run are neighbours."""

    places: Bound
    one: Bound  # an edge of the triangle of each ...
    other: Bound  # ... and another, such that their cross product leads out
    radii: F1  # (points,), of the piece of surface that each stands for
    shares: F2  # (points, 2), how far along its edges each is, 0 to 1
    are_large: B1  # (points,), whether its triangle is larger than that piece
    of_segment: I1  # (segments + 1,), the first point of each segment; the last is their end


class GapWorkspace(NamedTuple):
    """Scratch for one frame."""

    placed: F2  # (points, 3)
    near: I1  # (points,), those of a part that are near a limb ...
    at: F2  # (3, points), ... where they are ...
    squares: F1  # (points,), ... and how far off the middle of a run, squared
    nearer: I1  # (points,), those that are near a run
    are_placed: I1  # (segments,)
    vectors: F2  # (3, 3)
    ball: F1  # (4,), around points of a limb


@compiled(fastmath=True)
def write_gaps(
    points: Points, moved: F4, limbs: I1, parts: B2, wanted: B2, farthest: float, room: GapWorkspace, gaps: Out[F2]
) -> None:
    """Write the least height of the points of limbs over parts, (frames, pairs), where it is wanted and less than
    `farthest`. `moved`, (frames, joints, 3, 4), are rotations and places of joints; `limbs`, (pairs,), are segments,
    and `parts`, (pairs, segments), have several.
    """
    for frame in range(len(moved)):
        for segment in range(len(room.are_placed)):
            room.are_placed[segment] = 0
        for pair in range(len(limbs)):
            if wanted[frame, pair]:
                for segment in range(len(room.are_placed)):
                    if parts[pair, segment] or segment == limbs[pair]:
                        _place(points, moved[frame], segment, room)
                count = _find_near(points, limbs[pair], parts[pair], farthest, room)
                gaps[frame, pair] = _least_height(points, moved[frame], limbs[pair], count, farthest, room)


@inlined(fastmath=True)
def _write(bound, moved, row, to):  # type: ignore[no-untyped-def]
    """Write a bound vector."""
    for i in range(3):
        to[i] = 0.0
    for n in range(bound.first[row], bound.first[row + 1]):
        m, b = moved[bound.joints[n]], bound.b[n]
        for i in range(3):
            to[i] += m[i, 0] * b[0] + m[i, 1] * b[1] + m[i, 2] * b[2] + m[i, 3] * b[3]


@inlined(fastmath=True)
def _place(points, moved, segment, room):  # type: ignore[no-untyped-def]
    """Write the places of the points of a segment once in a frame."""
    if room.are_placed[segment] == 0:
        room.are_placed[segment] = 1
        for point in range(points.of_segment[segment], points.of_segment[segment + 1]):
            _write(points.places, moved, point, room.placed[point])


@inlined(fastmath=True)
def _enclose(room, first, end):  # type: ignore[no-untyped-def]
    """Write a ball around some points."""
    ball = room.ball
    for i in range(4):
        ball[i] = 0.0
    for point in range(first, end):
        for i in range(3):
            ball[i] += room.placed[point, i] / (end - first)
    for point in range(first, end):
        ball[3] = max(ball[3], _square(room.placed[point], ball))
    ball[3] = np.sqrt(ball[3])


@inlined(fastmath=True)
def _square(p, q):  # type: ignore[no-untyped-def]
    """The squared distance of two points."""
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2


@inlined(fastmath=True)
def _find_near(points, limb, part, farthest, room):  # type: ignore[no-untyped-def]
    """Write the points of a part that may be near a limb; return how many there are."""
    count = 0
    _enclose(room, points.of_segment[limb], points.of_segment[limb + 1])
    reach = (room.ball[3] + farthest) ** 2
    for segment in range(len(part)):
        if part[segment]:
            for point in range(points.of_segment[segment], points.of_segment[segment + 1]):
                p = room.placed[point]
                if _square(p, room.ball) < reach:
                    room.near[count] = point
                    room.at[0, count], room.at[1, count], room.at[2, count] = p[0], p[1], p[2]
                    count += 1
    return count


@inlined(fastmath=True)
def _find_nearer(count, farthest, room):  # type: ignore[no-untyped-def]
    """Write those of the near points that may be the nearest of a point of a run; return how many there are."""
    x, y, z, radius = room.ball
    least, nearer = np.inf, 0
    for n in indices(0, count):
        room.squares[n] = (room.at[0, n] - x) ** 2 + (room.at[1, n] - y) ** 2 + (room.at[2, n] - z) ** 2
        least = min(least, room.squares[n])
    reach = (radius + min(farthest, np.sqrt(least) + radius)) ** 2
    for n in range(count):
        if room.squares[n] <= reach:
            room.nearer[nearer], nearer = room.near[n], nearer + 1
    return nearer


@inlined(fastmath=True)
def _least_height(points, moved, limb, count, farthest, room):  # type: ignore[no-untyped-def]
    """The least height of the points of a limb over those that were found, or `farthest`."""
    least, limit = farthest, points.of_segment[limb + 1]
    for first in range(points.of_segment[limb], limit, RUN):
        end = min(first + RUN, limit)
        _enclose(room, first, end)
        nearer = _find_nearer(count, farthest, room)
        for point in range(first, end):
            p, nearest, best = room.placed[point], -1, farthest * farthest
            for n in range(nearer):
                square = _square(p, room.placed[room.nearer[n]])
                if square < best:
                    best, nearest = square, room.nearer[n]
            if nearest >= 0:
                least = min(least, _height(points, moved, point, nearest, best, room))
    return least


@inlined(fastmath=True)
def _height(points, moved, point, nearest, square, room):  # type: ignore[no-untyped-def]
    """How far off the surface a point is, negative beneath, by the nearest point of that: off its triangle's plane
    within its piece of the surface, and off that piece's edge beyond. Of a triangle that is larger than the piece, the
    triangle is the piece.
    """
    a, b, c = room.vectors
    p, q, radius = room.placed[point], room.placed[nearest], points.radii[nearest]
    _write(points.one, moved, nearest, a)
    _write(points.other, moved, nearest, b)
    c[0], c[1], c[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    size = np.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
    height = 0.0
    for i in range(3):
        height += (p[i] - q[i]) * c[i] / max(size, 1e-300)
    if points.are_large[nearest]:
        aside = _off_triangle(a, b, p, q, points.shares[nearest])
    else:
        aside = max(np.sqrt(max(square - height * height, 0.0)) - radius, 0.0)
    if height < 0.0 and aside <= radius:
        return height
    return np.sqrt(height * height + aside * aside)


@inlined(fastmath=True)
def _off_triangle(a, b, p, q, shares):  # type: ignore[no-untyped-def]
    """How far p is off a triangle within its plane: off its edges a and b, of which q is at these shares."""
    aa, ab, bb, along_a, along_b = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        aa, ab, bb = aa + a[i] * a[i], ab + a[i] * b[i], bb + b[i] * b[i]
        along_a, along_b = along_a + (p[i] - q[i]) * a[i], along_b + (p[i] - q[i]) * b[i]
    whole = max(aa * bb - ab * ab, 1e-300)
    u = shares[0] + (bb * along_a - ab * along_b) / whole
    v = shares[1] + (aa * along_b - ab * along_a) / whole
    if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
        return 0.0
    of_edges = _off_edge(u, v, 1.0, 0.0, aa, ab, bb), _off_edge(u, v, 0.0, 1.0, aa, ab, bb)
    return np.sqrt(min(of_edges[0], of_edges[1], _off_edge(u - 1.0, v, -1.0, 1.0, aa, ab, bb)))


@inlined(fastmath=True)
def _off_edge(u, v, x, y, aa, ab, bb):  # type: ignore[no-untyped-def]
    """The squared distance of u a + v b from the line from 0 to x a + y b, by the products of a and b."""
    along, square = aa * u * x + ab * (u * y + v * x) + bb * v * y, aa * x * x + 2.0 * ab * x * y + bb * y * y
    t = min(max(along / max(square, 1e-300), 0.0), 1.0)
    u, v = u - t * x, v - t * y
    return max(aa * u * u + 2.0 * ab * u * v + bb * v * v, 0.0)
