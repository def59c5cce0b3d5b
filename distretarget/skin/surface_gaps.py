"""Gaps between the parts of a surface that moves with joints, from points on it. Compiled.

Points are in runs of neighbours, each enclosed by a ball, and the nearest point is searched only in runs whose balls
are near enough. From one point to another, the height over a surface changes by no more than their distance, plus half
a radius at most where the nearest piece of the surface changes. So points that cannot be lower than the lowest one
found are skipped.

Parts are open where others begin, and skin folds, so a point behind the nearest piece of a surface may still be
outside. A point deeper than the radius of that piece counts as inside only if the winding number of the part is above
a half (Barill, Dickson, Schmidt, Levin and Jacobson, "Fast winding numbers for soups and clouds", 2018): points are
dipoles, and a far run is the sum of its dipoles, turned as joints turn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import B1, B2, F1, F2, F3, F4, I1

RUN = 8  # the most points of a run of neighbours
NOWHERE = 1e100  # a coordinate of no point
INSIDE = 0.5  # the least winding number of a point inside
FAR = 2.0  # a run farther away than this counts as one dipole [radii of its ball]


class Bound(NamedTuple):
    """Vectors that are bound to joints: sums of R b + w x over joints with the rotations R and the places x."""

    first: I1  # (vectors + 1,), the first row of each vector; the last entry is the number of rows
    joints: I1  # (rows,), the joints
    b: F2  # (rows, 4), b and w


class Runs(NamedTuple):
    """Runs of points that are neighbours, ordered by segment, and balls that enclose them in all poses."""

    first: I1  # (runs + 1,), the first point of each; the last entry is the number of points
    of_segment: I1  # (segments + 1,), the first run of each segment; the last entry is the number of runs
    middles: Bound  # the centres of the balls
    radii: F1  # (runs,), of the balls without the growth by `spread`
    dipoles: F2  # (rows of the middles, 3), the sums of normals at rest times areas, weighted with the row's joint
    # (rows of the middles,), the largest relative deviation of a joint's weights from their mean: a radius grows by
    # this share of the distance of the row's place from the centre
    spread: F1


class Points(NamedTuple):
    """Points on the outside of a surface, in runs. Each stands for a piece of the surface, a disc."""

    places: Bound
    first_edges: Bound  # two edges of the triangle of each point ...
    second_edges: Bound  # ... whose cross product leads out
    radii: F1  # (points,), of the piece of the surface
    shares: F2  # (points, 2), the point's coordinates along the two edges, 0 to 1
    are_large: B1  # (points,), whether the triangle is larger than the piece
    runs: Runs


class GapWorkspace(NamedTuple):
    """Scratch for one frame."""

    placed: F2  # (points, 3), places
    blocks: F3  # (runs, 3, RUN), these once more by runs, far away where a run has fewer points
    sides: F3  # (points, 3, 3), two edges and the normal of the triangle
    balls: F2  # (runs, 4), centre and radius
    have_balls: I1  # (segments,), whether the balls of a segment's runs are computed in this frame ...
    are_placed: I1  # (runs,), ... whether the places of a run's points are ...
    have_sides: I1  # (points,), ... whether the triangle of a point is ...
    have_dipoles: I1  # (runs,), ... and whether the dipole of a run is
    dipoles: F2  # (runs, 3)
    near: I1  # (runs,), the runs of a part that may be near a limb ...
    around: F2  # (4, runs), ... their balls ...
    beyond: F1  # (runs,), ... and a number that is above 0 for those that are not near a run of the limb
    nearer: I1  # (runs,), the runs of a part that may be near a run of the limb ...
    enclosing: F2  # (4, runs), ... and their balls
    chosen: I1  # (runs,), runs of such a list that pass a test
    lowest: I1  # (pairs,), the run that was lowest in the frame before, counted from the first of the limb
    deepest: I1  # (2,), the lowest point of a limb, and the point nearest to it
    ball: F1  # (4,), centre and radius of a ball round a limb

    @classmethod
    def of(cls, points: Points, pairs: int) -> GapWorkspace:
        """Return scratch for the gaps of so many pairs."""
        count, runs, segments = len(points.radii), len(points.runs.radii), len(points.runs.of_segment) - 1
        placed, sides, ball, balls, around, enclosing = (
            np.zeros(shape) for shape in ((count, 3), (count, 3, 3), 4, (runs, 4), (4, runs), (4, runs))
        )
        have_balls, have_sides, lowest, are_placed, near, nearer, have_dipoles, deepest = (
            np.zeros(size, np.intp) for size in (segments, count, pairs, runs, runs, runs, runs, 2)
        )
        known = balls, have_balls, are_placed, have_sides, have_dipoles, np.zeros((runs, 3))
        near_ones = near, around, np.zeros(runs), nearer, enclosing, np.zeros(runs, np.intp)
        return cls(placed, np.full((runs, 3, RUN), NOWHERE), sides, *known, *near_ones, lowest, deepest, ball)


@compiled(fastmath=True)
def write_gaps(
    points: Points, posed: F4, limbs: I1, parts: B2, wanted: B2, farthest: float, room: GapWorkspace, gaps: Out[F2]
) -> None:
    """Write the wanted gaps of limbs and parts, (frames, pairs): the least heights of a limb's points over a part, at
    most `farthest`. `posed`, (frames, joints, 3, 4), are rotations and positions of joints; `limbs`, (pairs,), are
    segments, and `parts`, (pairs, segments), masks of segments.
    """
    for frame in range(len(posed)):
        for known in (room.have_balls, room.are_placed, room.have_sides, room.have_dipoles):
            for n in range(len(known)):
                known[n] = 0
        for pair in range(len(limbs)):
            if wanted[frame, pair]:
                limb, part = limbs[pair], parts[pair]
                for segment in range(len(room.have_balls)):
                    if part[segment] or segment == limb:
                        _enclose(points.runs, posed[frame], segment, room)
                count = _find_near(points.runs, limb, part, farthest, room)
                gaps[frame, pair] = _gap(points, posed[frame], limb, part, pair, count, farthest, room)


@inlined(fastmath=True)
def _transformed(m, b):  # type: ignore[no-untyped-def]
    """R b + w x of a joint with the transform m, (3, 4)."""
    x = m[0, 0] * b[0] + m[0, 1] * b[1] + m[0, 2] * b[2] + m[0, 3] * b[3]
    y = m[1, 0] * b[0] + m[1, 1] * b[1] + m[1, 2] * b[2] + m[1, 3] * b[3]
    return x, y, m[2, 0] * b[0] + m[2, 1] * b[1] + m[2, 2] * b[2] + m[2, 3] * b[3]


@inlined(fastmath=True)
def _write(bound, posed, row, to):  # type: ignore[no-untyped-def]
    """Write a bound vector."""
    x, y, z = 0.0, 0.0, 0.0
    for n in range(bound.first[row], bound.first[row + 1]):
        a, b, c = _transformed(posed[bound.joints[n]], bound.b[n])
        x, y, z = x + a, y + b, z + c
    to[0], to[1], to[2] = x, y, z


@inlined(fastmath=True)
def _square(p, q):  # type: ignore[no-untyped-def]
    """The squared distance of two points."""
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2


@inlined(fastmath=True)
def _enclose(runs, posed, segment, room):  # type: ignore[no-untyped-def]
    """Compute the balls of the runs of a segment, once in a frame."""
    if room.have_balls[segment] == 0:
        room.have_balls[segment] = 1
        for run in range(runs.of_segment[segment], runs.of_segment[segment + 1]):
            ball, radius = room.balls[run], runs.radii[run]
            _write(runs.middles, posed, run, ball)
            for n in range(runs.middles.first[run], runs.middles.first[run + 1]):
                if runs.spread[n] > 0.0:
                    b = runs.middles.b[n]
                    x, y, z = _transformed(posed[runs.middles.joints[n]], b)
                    x, y, z = x - b[3] * ball[0], y - b[3] * ball[1], z - b[3] * ball[2]
                    radius += runs.spread[n] * np.sqrt(x * x + y * y + z * z)
            ball[3] = radius


@inlined(fastmath=True)
def _place(points, posed, run, room):  # type: ignore[no-untyped-def]
    """Compute the places of the points of a run, once in a frame."""
    if room.are_placed[run] == 0:
        room.are_placed[run] = 1
        for point in range(points.runs.first[run], points.runs.first[run + 1]):
            place = room.placed[point]
            _write(points.places, posed, point, place)
            for i in range(3):
                room.blocks[run, i, point - points.runs.first[run]] = place[i]


@inlined(fastmath=True)
def _find_near(runs, limb, part, farthest, room):  # type: ignore[no-untyped-def]
    """Write the runs of a part that may be near a limb; return their number."""
    around, count, first, end = room.ball, 0, runs.of_segment[limb], runs.of_segment[limb + 1]
    for i in range(4):
        around[i] = 0.0
    for run in range(first, end):
        for i in range(3):
            around[i] += room.balls[run, i] / (end - first)
    for run in range(first, end):
        around[3] = max(around[3], np.sqrt(_square(room.balls[run], around)) + room.balls[run, 3])
    for segment in range(len(part)):
        if part[segment]:
            for run in range(runs.of_segment[segment], runs.of_segment[segment + 1]):
                ball = room.balls[run]
                if _square(ball, around) < (ball[3] + around[3] + farthest) ** 2:
                    for i in range(4):
                        room.around[i, count] = ball[i]
                    room.near[count], count = run, count + 1
    return count


@inlined(fastmath=True)
def _gap(points, posed, limb, part, pair, count, farthest, room):  # type: ignore[no-untyped-def]
    """The least height of the points of a limb over the `near` runs, at most `farthest`. If the lowest point only seems
    to be inside, all points that seem so are checked.
    """
    height = _least_height(points, posed, limb, part, pair, count, farthest, False, room)
    point, nearest = room.deepest
    if height < 0.0 and _only_seems_inside(points, posed, point, nearest, height, part, room):
        return _least_height(points, posed, limb, part, pair, count, farthest, True, room)
    return height


@inlined(fastmath=True)
def _only_seems_inside(points, posed, point, nearest, height, part, room):  # type: ignore[no-untyped-def]
    """Whether a point beneath the nearest piece of a surface is still outside of the part."""
    deep = height < -points.radii[nearest]
    return deep and _winding(points, posed, room.placed[point], part, room) < INSIDE


@inlined(fastmath=True)
def _least_height(points, posed, limb, part, pair, count, farthest, checked, room):  # type: ignore[no-untyped-def]
    """The least height of the points of a limb over the `near` runs, at most `farthest`. With `checked`, points that
    only seem to be inside have their positive distance as height.
    """
    least, runs, first = farthest, points.runs, points.runs.of_segment[limb]
    size, start = runs.of_segment[limb + 1] - first, room.lowest[pair]
    before, lowest, nearest = -1, farthest, -1  # the point before, if its height is known, and a bound of heights there
    for n in range(size if count > 0 else 0):
        run = first + (start + n) % size
        ball = room.balls[run]
        if before >= 0 and lowest - np.sqrt(_square(ball, room.placed[before])) - ball[3] >= least:
            continue
        nearer = _find_nearer(ball, nearest, count, farthest, room)
        if nearer == 0:
            continue
        _place(points, posed, run, room)
        for point in range(runs.first[run], runs.first[run + 1]):
            p = room.placed[point]
            if before >= 0 and lowest - np.sqrt(_square(p, room.placed[before])) >= least:
                continue
            found, square = _find_nearest(points, posed, p, nearest, nearer, farthest, room)
            before = -1
            if found >= 0:
                height = _height(points, posed, point, found, square, room)
                if checked and height < least and _only_seems_inside(points, posed, point, found, height, part, room):
                    height = np.sqrt(square)
                before, nearest, lowest = point, found, height - 0.5 * points.radii[found]
                if height < least:
                    least, room.lowest[pair], room.deepest[0], room.deepest[1] = height, run - first, point, found
    return least


@inlined(fastmath=True)
def _find_nearer(ball, guess, count, farthest, room):  # type: ignore[no-untyped-def]
    """Write the `near` runs that may hold the nearest point to some point in a ball; return their number. `guess` is a
    point of these runs, or -1.
    """
    x, y, z, far, nearer = ball[0], ball[1], ball[2], farthest, 0
    if guess >= 0:
        far = min(far, np.sqrt(_square(ball, room.placed[guess])) + ball[3])
    for n in range(count):
        a, b, c = room.around[0, n] - x, room.around[1, n] - y, room.around[2, n] - z
        room.beyond[n] = a * a + b * b + c * c - (room.around[3, n] + ball[3] + far) ** 2
    for n in range(count):  # without branches, which would be guessed wrong
        room.chosen[nearer] = n
        nearer += room.beyond[n] <= 0.0
    for n in range(nearer):
        which = room.chosen[n]
        room.nearer[n] = room.near[which]
        for i in range(4):
            room.enclosing[i, n] = room.around[i, which]
    return nearer


@inlined(fastmath=True)
def _find_nearest(points, posed, p, guess, count, farthest, room):  # type: ignore[no-untyped-def]
    """The nearest point of the `nearer` runs, -1 if none is nearer than `farthest`, and its squared distance."""
    runs, nearest, least, x, y, z = points.runs, -1, farthest * farthest, p[0], p[1], p[2]
    if guess >= 0 and _square(p, room.placed[guess]) < least:
        nearest, least = guess, _square(p, room.placed[guess])
    distance = np.sqrt(least)
    for n in range(count):
        a, b, c = room.enclosing[0, n] - x, room.enclosing[1, n] - y, room.enclosing[2, n] - z
        far = room.enclosing[3, n] + distance
        room.beyond[n] = a * a + b * b + c * c - far * far
    found = 0
    for n in range(count):
        room.chosen[found] = room.nearer[n]
        found += room.beyond[n] < 0.0
    for n in range(found):
        run, hits = room.chosen[n], 0
        _place(points, posed, run, room)
        block = room.blocks[run]
        for k in range(block.shape[1]):
            a, b, c = block[0, k] - x, block[1, k] - y, block[2, k] - z
            hits += a * a + b * b + c * c < least
        if hits > 0:
            for point in range(runs.first[run], runs.first[run + 1]):
                square = _square(p, room.placed[point])
                if square < least:
                    nearest, least = point, square
    return nearest, least


@inlined(fastmath=True)
def _face(points, posed, point, room):  # type: ignore[no-untyped-def]
    """Compute the edges and the normal of the triangle of a point, once in a frame."""
    a, b, c = room.sides[point, 0], room.sides[point, 1], room.sides[point, 2]
    if room.have_sides[point] == 0:
        room.have_sides[point] = 1
        _write(points.first_edges, posed, point, a)
        _write(points.second_edges, posed, point, b)
        x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        size = max(np.sqrt(x * x + y * y + z * z), 1e-300)
        c[0], c[1], c[2] = x / size, y / size, z / size


@inlined(fastmath=True)
def _winding(points, posed, p, part, room):  # type: ignore[no-untyped-def]
    """The winding number of the surface of a part at p: about 1 inside, and about 0 outside."""
    runs, angle = points.runs, 0.0
    for segment in range(len(part)):
        if part[segment]:
            for run in range(runs.of_segment[segment], runs.of_segment[segment + 1]):
                if _square(p, room.balls[run]) > (FAR * room.balls[run, 3]) ** 2:
                    _write_dipole(runs, posed, run, room)
                    angle += _angle(p, room.balls[run], room.dipoles[run])
                else:
                    _place(points, posed, run, room)
                    for point in range(runs.first[run], runs.first[run + 1]):
                        _face(points, posed, point, room)
                        area = np.pi * points.radii[point] ** 2
                        angle += area * _angle(p, room.placed[point], room.sides[point, 2])
    return angle / (4.0 * np.pi)


@inlined(fastmath=True)
def _write_dipole(runs, posed, run, room):  # type: ignore[no-untyped-def]
    """Compute the dipole of a run, once in a frame."""
    if room.have_dipoles[run] == 0:
        room.have_dipoles[run] = 1
        dipole = room.dipoles[run]
        dipole[0], dipole[1], dipole[2] = 0.0, 0.0, 0.0
        for n in range(runs.middles.first[run], runs.middles.first[run + 1]):
            m, d = posed[runs.middles.joints[n]], runs.dipoles[n]
            for i in range(3):
                dipole[i] += m[i, 0] * d[0] + m[i, 1] * d[1] + m[i, 2] * d[2]


@inlined(fastmath=True)
def _angle(p, q, dipole):  # type: ignore[no-untyped-def]
    """The solid angle of a dipole at q, seen from p."""
    x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    square = max(x * x + y * y + z * z, 1e-300)
    return (x * dipole[0] + y * dipole[1] + z * dipole[2]) / (square * np.sqrt(square))


@inlined(fastmath=True)
def _height(points, posed, point, nearest, square, room):  # type: ignore[no-untyped-def]
    """The signed distance of a point from the surface, negative beneath, by its nearest point there: from the plane of
    the triangle over the piece of the surface, and from the edge of the piece beyond. If the triangle is larger than
    the piece, the triangle itself is the piece.
    """
    a, b, c = room.sides[nearest, 0], room.sides[nearest, 1], room.sides[nearest, 2]
    p, q, radius = room.placed[point], room.placed[nearest], points.radii[nearest]
    _face(points, posed, nearest, room)
    height = (p[0] - q[0]) * c[0] + (p[1] - q[1]) * c[1] + (p[2] - q[2]) * c[2]
    if points.are_large[nearest]:
        aside = _off_triangle(a, b, p, q, points.shares[nearest])
    else:
        aside = max(np.sqrt(max(square - height * height, 0.0)) - radius, 0.0)
    if height < 0.0 and aside <= radius:
        return height
    return np.sqrt(height * height + aside * aside)


@inlined(fastmath=True)
def _off_triangle(a, b, p, q, shares):  # type: ignore[no-untyped-def]
    """The distance of p from a triangle in its plane, with the edges a and b, and q at `shares` of these."""
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
    """The squared distance of u a + v b from the segment from 0 to x a + y b, by the scalar products of a and b."""
    along, square = aa * u * x + ab * (u * y + v * x) + bb * v * y, aa * x * x + 2.0 * ab * x * y + bb * y * y
    t = min(max(along / max(square, 1e-300), 0.0), 1.0)
    u, v = u - t * x, v - t * y
    return max(aa * u * u + 2.0 * ab * u * v + bb * v * v, 0.0)
