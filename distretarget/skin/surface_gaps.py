"""How far points on a surface that moves with joints are from others on it. Compiled.

Points are in runs of neighbours, each in a ball, so that the nearest point is looked for only in runs whose balls are
near enough. The height over a surface changes by no more than the way from one place to another, and where another
piece of the surface is the nearest, here by half its radius at most: places that cannot be the lowest, by the place
before, are left out.

Parts are open where others begin, and skin folds, so that what lies behind the nearest piece of a surface may be
outside. What is deeper than this piece is wide is inside only where the winding number of the part is more than a half
(Barill, Dickson, Schmidt, Levin and Jacobson, "Fast winding numbers for soups and clouds", 2018): points are dipoles,
and far runs the sum of theirs, turned as joints turn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import B1, B2, F1, F2, F3, F4, I1, indices

INSIDE = 0.5  # the least winding number of what is inside
FAR = 2.0  # what is farther away than so many radii of a run is seen as one dipole


class Bound(NamedTuple):
    """Vectors that are bound to joints: sums of R b + w x over joints with the rotations R and the places x."""

    first: I1  # (vectors + 1,), the first row of each in what follows; the last is their end
    joints: I1  # (rows,), the joints
    b: F2  # (rows, 4), b and w


class Runs(NamedTuple):
    """Runs of points that are neighbours, ordered by segment, and the balls that hold them in all poses."""

    first: I1  # (runs + 1,), the first point of each; the last is their end
    of_segment: I1  # (segments + 1,), the first run of each segment; the last is their end
    middles: Bound  # the centres of the balls
    radii: F1  # (runs,), of the balls, but for what follows
    dipoles: F2  # (rows of the middles, 3), the normals at rest times the areas of what each joint moves of it
    # (rows of the middles,), how far the weights of a joint are off their mean, in shares of that: a radius grows by so
    # much of each row's way from the centre
    spread: F1


class Points(NamedTuple):
    """Points on the outside of a surface, in runs."""

    places: Bound
    one: Bound  # an edge of the triangle of each ...
    other: Bound  # ... and another, such that their cross product leads out
    radii: F1  # (points,), of the piece of surface that each stands for
    shares: F2  # (points, 2), how far along its edges each is, 0 to 1
    are_large: B1  # (points,), whether its triangle is larger than that piece
    runs: Runs


class GapWorkspace(NamedTuple):
    """Scratch for one frame."""

    placed: F2  # (points, 3)
    sides: F3  # (points, 3, 3), the edges of their triangles, and the normals
    balls: F2  # (runs, 4), and their radii
    have_balls: I1  # (segments,), whether the balls of its runs are known ...
    are_placed: I1  # (runs,), ... whether its points are ...
    have_sides: I1  # (points,), ... whether its triangle is ...
    have_dipoles: I1  # (runs,), ... and whether its dipole is
    dipoles: F2  # (runs, 3)
    near: I1  # (runs,), those of a part that are near a limb ...
    around: F2  # (4, runs), ... their balls ...
    beyond: F1  # (runs,), ... and more than 0 for those that are not near a run of the limb
    nearer: I1  # (runs,), those that are
    lowest: I1  # (pairs,), the run that was lowest in the frame before, counted from the first of the limb
    deepest: I1  # (2,), the point of a limb that is lowest, and what is nearest to it
    ball: F1  # (4,), around a limb

    @classmethod
    def of(cls, points: Points, pairs: int) -> GapWorkspace:
        """Room to look for the gaps of so many pairs."""
        count, runs, segments = len(points.radii), len(points.runs.radii), len(points.runs.of_segment) - 1
        placed, sides, ball, balls, around = (
            np.zeros(shape) for shape in ((count, 3), (count, 3, 3), 4, (runs, 4), (4, runs))
        )
        have_balls, have_sides, lowest, are_placed, near, nearer, have_dipoles, deepest = (
            np.zeros(size, np.intp) for size in (segments, count, pairs, runs, runs, runs, runs, 2)
        )
        known = balls, have_balls, are_placed, have_sides, have_dipoles, np.zeros((runs, 3))
        return cls(placed, sides, *known, near, around, np.zeros(runs), nearer, lowest, deepest, ball)


@compiled(fastmath=True)
def write_gaps(
    points: Points, moved: F4, limbs: I1, parts: B2, wanted: B2, farthest: float, room: GapWorkspace, gaps: Out[F2]
) -> None:
    """Write the least height of the points of limbs over parts, (frames, pairs), where it is wanted and less than
    `farthest`. `moved`, (frames, joints, 3, 4), are rotations and places of joints; `limbs`, (pairs,), are segments,
    and `parts`, (pairs, segments), have several.
    """
    for frame in range(len(moved)):
        for known in (room.have_balls, room.are_placed, room.have_sides, room.have_dipoles):
            for n in range(len(known)):
                known[n] = 0
        for pair in range(len(limbs)):
            if wanted[frame, pair]:
                for segment in range(len(room.have_balls)):
                    if parts[pair, segment] or segment == limbs[pair]:
                        _enclose(points.runs, moved[frame], segment, room)
                count = _find_near(points.runs, limbs[pair], parts[pair], farthest, room)
                gaps[frame, pair] = _gap(points, moved[frame], limbs[pair], parts[pair], pair, count, farthest, room)


@inlined(fastmath=True)
def _moved(m, b):  # type: ignore[no-untyped-def]
    """R b + w x of a joint, (3, 4)."""
    x = m[0, 0] * b[0] + m[0, 1] * b[1] + m[0, 2] * b[2] + m[0, 3] * b[3]
    y = m[1, 0] * b[0] + m[1, 1] * b[1] + m[1, 2] * b[2] + m[1, 3] * b[3]
    return x, y, m[2, 0] * b[0] + m[2, 1] * b[1] + m[2, 2] * b[2] + m[2, 3] * b[3]


@inlined(fastmath=True)
def _write(bound, moved, row, to):  # type: ignore[no-untyped-def]
    """Write a bound vector."""
    x, y, z = 0.0, 0.0, 0.0
    for n in range(bound.first[row], bound.first[row + 1]):
        a, b, c = _moved(moved[bound.joints[n]], bound.b[n])
        x, y, z = x + a, y + b, z + c
    to[0], to[1], to[2] = x, y, z


@inlined(fastmath=True)
def _square(p, q):  # type: ignore[no-untyped-def]
    """The squared distance of two points."""
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2


@inlined(fastmath=True)
def _enclose(runs, moved, segment, room):  # type: ignore[no-untyped-def]
    """Write the balls of the runs of a segment once in a frame."""
    if room.have_balls[segment] == 0:
        room.have_balls[segment] = 1
        for run in range(runs.of_segment[segment], runs.of_segment[segment + 1]):
            ball, radius = room.balls[run], runs.radii[run]
            _write(runs.middles, moved, run, ball)
            for n in range(runs.middles.first[run], runs.middles.first[run + 1]):
                if runs.spread[n] > 0.0:
                    b = runs.middles.b[n]
                    x, y, z = _moved(moved[runs.middles.joints[n]], b)
                    x, y, z = x - b[3] * ball[0], y - b[3] * ball[1], z - b[3] * ball[2]
                    radius += runs.spread[n] * np.sqrt(x * x + y * y + z * z)
            ball[3] = radius


@inlined(fastmath=True)
def _place(points, moved, run, room):  # type: ignore[no-untyped-def]
    """Write the places of the points of a run once in a frame."""
    if room.are_placed[run] == 0:
        room.are_placed[run] = 1
        for point in range(points.runs.first[run], points.runs.first[run + 1]):
            _write(points.places, moved, point, room.placed[point])


@inlined(fastmath=True)
def _find_near(runs, limb, part, farthest, room):  # type: ignore[no-untyped-def]
    """Write the runs of a part that may be near a limb; return how many there are."""
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
def _gap(points, moved, limb, part, pair, count, farthest, room):  # type: ignore[no-untyped-def]
    """The least height of the points of a limb over runs that were found, or `farthest`. If the deepest is not inside,
    all that seem to be are looked at.
    """
    height = _least_height(points, moved, limb, part, pair, count, farthest, False, room)
    point, nearest = room.deepest
    if height < 0.0 and _only_seems_inside(points, moved, point, nearest, height, part, room):
        return _least_height(points, moved, limb, part, pair, count, farthest, True, room)
    return height


@inlined(fastmath=True)
def _only_seems_inside(points, moved, point, nearest, height, part, room):  # type: ignore[no-untyped-def]
    """Whether a point beneath the piece of a surface that is nearest is outside of the part all the same."""
    deep = height < -points.radii[nearest]
    return deep and _winding(points, moved, room.placed[point], part, room) < INSIDE


@inlined(fastmath=True)
def _least_height(points, moved, limb, part, pair, count, farthest, checked, room):  # type: ignore[no-untyped-def]
    """The least height of the points of a limb over runs that were found, or `farthest`; if it is `checked`, of points
    that only seem to be inside their distance.
    """
    least, runs, first = farthest, points.runs, points.runs.of_segment[limb]
    size, start = runs.of_segment[limb + 1] - first, room.lowest[pair]
    before, lowest, nearest = -1, farthest, -1  # the point before, if its height is known, and what is lowest around it
    for n in range(size if count > 0 else 0):
        run = first + (start + n) % size
        ball = room.balls[run]
        if before >= 0 and lowest - np.sqrt(_square(ball, room.placed[before])) - ball[3] >= least:
            continue
        nearer = _find_nearer(ball, nearest, count, farthest, room)
        if nearer == 0:
            continue
        _place(points, moved, run, room)
        for point in range(runs.first[run], runs.first[run + 1]):
            p = room.placed[point]
            if before >= 0 and lowest - np.sqrt(_square(p, room.placed[before])) >= least:
                continue
            found, square = _find_nearest(points, moved, p, nearest, nearer, farthest, room)
            before = -1
            if found >= 0:
                height = _height(points, moved, point, found, square, room)
                if checked and height < least and _only_seems_inside(points, moved, point, found, height, part, room):
                    height = np.sqrt(square)
                before, nearest, lowest = point, found, height - 0.5 * points.radii[found]
                if height < least:
                    least, room.lowest[pair], room.deepest[0], room.deepest[1] = height, run - first, point, found
    return least


@inlined(fastmath=True)
def _find_nearer(ball, guess, count, farthest, room):  # type: ignore[no-untyped-def]
    """Write those of the near runs that may have the nearest point of any point in a ball; return how many there are.
    `guess` is a point of theirs, or -1.
    """
    x, y, z, far, nearer = ball[0], ball[1], ball[2], farthest, 0
    if guess >= 0:
        far = min(far, np.sqrt(_square(ball, room.placed[guess])) + ball[3])
    for n in indices(0, count):
        a, b, c = room.around[0, n] - x, room.around[1, n] - y, room.around[2, n] - z
        room.beyond[n] = a * a + b * b + c * c - (room.around[3, n] + ball[3] + far) ** 2
    for n in range(count):
        if room.beyond[n] <= 0.0:
            room.nearer[nearer], nearer = room.near[n], nearer + 1
    return nearer


@inlined(fastmath=True)
def _find_nearest(points, moved, p, guess, count, farthest, room):  # type: ignore[no-untyped-def]
    """The nearest point of runs that were found, -1 if none is nearer than `farthest`, and the squared distance."""
    runs, nearest, least = points.runs, -1, farthest * farthest
    if guess >= 0 and _square(p, room.placed[guess]) < least:
        nearest, least = guess, _square(p, room.placed[guess])
    way = np.sqrt(least)
    for n in range(count):
        run = room.nearer[n]
        if _square(p, room.balls[run]) < (room.balls[run, 3] + way) ** 2:
            _place(points, moved, run, room)
            for point in range(runs.first[run], runs.first[run + 1]):
                square = _square(p, room.placed[point])
                if square < least:
                    nearest, least = point, square
            way = np.sqrt(least)
    return nearest, least


@inlined(fastmath=True)
def _face(points, moved, point, room):  # type: ignore[no-untyped-def]
    """Write the edges of the triangle of a point, and its normal, once in a frame."""
    a, b, c = room.sides[point, 0], room.sides[point, 1], room.sides[point, 2]
    if room.have_sides[point] == 0:
        room.have_sides[point] = 1
        _write(points.one, moved, point, a)
        _write(points.other, moved, point, b)
        x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        size = max(np.sqrt(x * x + y * y + z * z), 1e-300)
        c[0], c[1], c[2] = x / size, y / size, z / size


@inlined(fastmath=True)
def _winding(points, moved, p, part, room):  # type: ignore[no-untyped-def]
    """How many times the surface of a part winds round a place: about 1 inside, and about 0 outside."""
    runs, angle = points.runs, 0.0
    for segment in range(len(part)):
        if part[segment]:
            for run in range(runs.of_segment[segment], runs.of_segment[segment + 1]):
                if _square(p, room.balls[run]) > (FAR * room.balls[run, 3]) ** 2:
                    _write_dipole(runs, moved, run, room)
                    angle += _angle(p, room.balls[run], room.dipoles[run])
                else:
                    _place(points, moved, run, room)
                    for point in range(runs.first[run], runs.first[run + 1]):
                        _face(points, moved, point, room)
                        area = np.pi * points.radii[point] ** 2
                        angle += area * _angle(p, room.placed[point], room.sides[point, 2])
    return angle / (4.0 * np.pi)


@inlined(fastmath=True)
def _write_dipole(runs, moved, run, room):  # type: ignore[no-untyped-def]
    """Write the dipole of a run once in a frame."""
    if room.have_dipoles[run] == 0:
        room.have_dipoles[run] = 1
        dipole = room.dipoles[run]
        dipole[0], dipole[1], dipole[2] = 0.0, 0.0, 0.0
        for n in range(runs.middles.first[run], runs.middles.first[run + 1]):
            m, d = moved[runs.middles.joints[n]], runs.dipoles[n]
            for i in range(3):
                dipole[i] += m[i, 0] * d[0] + m[i, 1] * d[1] + m[i, 2] * d[2]


@inlined(fastmath=True)
def _angle(p, q, dipole):  # type: ignore[no-untyped-def]
    """The solid angle of a dipole at q, seen from p."""
    x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    square = max(x * x + y * y + z * z, 1e-300)
    return (x * dipole[0] + y * dipole[1] + z * dipole[2]) / (square * np.sqrt(square))


@inlined(fastmath=True)
def _height(points, moved, point, nearest, square, room):  # type: ignore[no-untyped-def]
    """How far off the surface a point is, negative beneath, by the nearest point of that: off its triangle's plane
    within its piece of the surface, and off that piece's edge beyond. Of a triangle that is larger than the piece, the
    triangle is the piece.
    """
    a, b, c = room.sides[nearest, 0], room.sides[nearest, 1], room.sides[nearest, 2]
    p, q, radius = room.placed[point], room.placed[nearest], points.radii[nearest]
    _face(points, moved, nearest, room)
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
