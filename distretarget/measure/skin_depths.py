"""How deep points of the skin are inside the other parts of a body, or how far off these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.measure.skin_places import PLACE_OF
from distretarget.measure.surface_distances import squared_distance
from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.quaternions import turned
from distretarget.numerics.vectors import B3, F1, F2, F3, F4, I1, I2, I3, Array, Flags
from distretarget.skin.capsules import SEGMENTS

PARTS = SEGMENTS[: SEGMENTS.index("head") + 1]  # whose skin may be inside others: arms, legs and head
LIMBS = PARTS[:4]  # hands and forearms
PASSES = 4  # in which a point is brought back to the bind pose
RIGID = 0.999  # share of a joint from which on nothing else moves a point


class Patches(NamedTuple):
    """Points of one part that one joint moves most, in patches of a few neighbours; behind them the other vertices of
    the mesh, which are looked at around the deepest of these points.
    """

    parts: I1  # (parts + 1,), the first patch of each; the last is their end
    patches: I2  # (patches + 1, 2), joint and first point of each; the last is their end
    balls: F2  # (patches, 4), centre relative to the joint, and radius [file units]
    joints: I2  # (points and others, influences), as in `SkinPoints`, but in this order
    bound: F3  # (points and others, influences, 4), their offsets and weights
    counts: F1  # (points,), the number of vertices that each stands for, those nearest to it
    first: I1  # (points and others + 1,), the first neighbour of each; the last is their end
    neighbours: I1  # those at the other ends of its edges


class Solids(NamedTuple):
    """The inside of a body, in groups of what one joint moves most of one segment: capsules, or a part of a mesh."""

    # (groups + 1, 4), joint and segment of each, its first capsule, and its lattice or -1; the last is their end
    groups: I2
    balls: F2  # (groups, 4), one around each: centre relative to the joint, and radius [file units]
    boxes: F2  # (groups, 6), one around each: its lowest and its highest corner relative to the joint [file units]
    # (capsules, 10), where the axis begins relative to the joint, its direction and its length, the radius where it
    # begins, the change of the radius along it, and how far along it, over a point's distance to the axis, the nearest
    # ball is off the point's foot
    capsules: F2
    lattices: F2  # (lattices, 4), the place of the first node in the bind pose, and the spacing [file units]
    sizes: I2  # (lattices, 4), the numbers of nodes along x, y and z, and the first node
    distances: F1  # (nodes,), from the skin, negative inside [file units]
    nearest: I1  # (nodes,), the triangle nearest to each; -1 where the skin is far
    triangles: I2  # (triangles, 3), the vertices of each
    vertices: F2  # (vertices, 3), in the bind pose [file units]
    joints: I2  # (vertices, 4), those that move each most, the strongest first
    weights: F2  # (vertices, 4), their shares, which sum to 1
    segments: I1  # (vertices,), the segment of each, -1 for none
    rest: F2  # (joints, 3), the places of the joints in the bind pose [file units]

    def of_second_body(self, joints: int) -> Solids:
        """Return the same on joints that are numbered behind as many others."""
        groups, rest = self.groups.copy(), np.concatenate([np.zeros((joints, 3)), self.rest])
        groups[:-1, 0] += joints
        return self._replace(groups=groups, joints=self.joints + joints, rest=rest)


def find_depths(
    patches: Patches,
    solids: Solids,
    posed: tuple[Array, Array],
    reach: Array,
    grazing: float = 0.0,
    alone: Flags | None = None,
) -> tuple[Array, Array, Array]:
    """Return how deep the deepest point of each part is inside each segment, (frames, parts, segments), negative where
    it is that far off, and minus the reach where that is farther [file units]; where this point is in the bind pose of
    the segment, (frames, parts, segments, 3), nan where none was found; and the number of vertices, (frames,), that the
    points of hands and forearms stand for that are inside any segment, deeper than `grazing`.

    Of the segments of one place, `PLACE_OF`, a part is looked for where it is nearest or inside; in segments that are
    `alone`, (frames, parts, segments), wherever it is. `posed` are the positions and world rotations of the joints,
    (frames, joints, 3 and 4); `reach`, (frames or 1, parts, segments), is how far from a segment to look [file units],
    negative infinity for not at all.
    """
    shape = len(posed[0]), len(patches.parts) - 1, len(SEGMENTS)
    depths = np.array(np.broadcast_to(-reach, shape), order="C")
    inside, places = np.zeros(len(depths)), np.full((*shape, 3), np.nan)
    near, last = np.empty((len(solids.balls), 2), np.intp), np.full((*shape[1:], 2), -1, np.intp)
    looked, placed, placed_patches = (np.empty((len(on) + 1, 4)) for on in (solids.balls, solids.balls, patches.balls))
    x, q = map(np.ascontiguousarray, posed)
    _find(
        x,
        q,
        patches,
        solids,
        grazing,
        PLACE_OF,
        np.zeros(shape, bool) if alone is None else alone,
        near,
        np.empty(len(SEGMENTS)),
        np.zeros(4),
        looked,
        placed,
        placed_patches,
        np.empty((len(solids.rest), 12)),
        np.empty(12),
        np.empty((3, 3)),
        last,
        depths,
        places,
        inside,
    )
    return np.where(depths == np.inf, -np.inf, depths), places, inside


@inlined()
def _placed(x, q, v):  # type: ignore[no-untyped-def]
    """The place of v relative to a joint at x with the rotation q."""
    a, b, c = turned(q[0], q[1], q[2], q[3], v[0], v[1], v[2])
    return x[0] + a, x[1] + b, x[2] + c


@inlined()
def _relative(x, q, a, b, c):  # type: ignore[no-untyped-def]
    """The place a b c relative to a joint at x with the rotation q."""
    return turned(-q[0], -q[1], -q[2], q[3], a - x[0], b - x[1], c - x[2])


@inlined()
def _posed(x, q, joints, bound):  # type: ignore[no-untyped-def]
    """The place of a point bound to joints."""
    a = b = c = 0.0
    for n in range(len(joints)):
        share = bound[n, 3]
        if share > 0.0:
            i, j, k = _placed(x[joints[n]], q[joints[n]], bound[n])
            a, b, c = a + share * i, b + share * j, c + share * k
    return a, b, c


@inlined()
def _in_capsules(capsules, first, end, i, j, k):  # type: ignore[no-untyped-def]
    """How deep the point i j k is in some capsules."""
    deepest = -np.inf
    for m in range(first, end):
        e = capsules[m]
        u, v, w = i - e[0], j - e[1], k - e[2]
        squared, radius = u * u + v * v + w * w, e[7]
        if e[6] > 0.0:
            along = u * e[3] + v * e[4] + w * e[5]
            off = max(squared - along * along, 0.0)
            foot = min(max(along + e[9] * np.sqrt(off), 0.0), e[6])
            squared, radius = off + (along - foot) * (along - foot), radius + e[8] * foot
        deepest = max(deepest, radius - np.sqrt(squared))
    return deepest


@inlined()
def _node(lattice, axis, size, place):  # type: ignore[no-untyped-def]
    """The node before a place along an axis of a lattice, how far beyond it the place is, in spacings, and how far off
    the lattice it is, in file units.
    """
    at = (place - lattice[axis]) / lattice[3]
    within = min(max(at, 0.0), size[axis] - 1.0)
    node = min(int(within), size[axis] - 2)
    return node, within - node, (at - within) * lattice[3]


@inlined()
def _on_lattice(body, number, i, j, k):  # type: ignore[no-untyped-def]
    """The distance of the place i j k in the bind pose from the skin of a solid, and the vertex that is nearest; -1
    where the skin is far.
    """
    lattice, size, d = body.lattices[number], body.sizes[number], body.distances
    l, s, u = _node(lattice, 0, size, i)
    m, t, v = _node(lattice, 1, size, j)
    n, r, w = _node(lattice, 2, size, k)
    first, row, layer = size[3] + (l * size[1] + m) * size[2] + n, size[2], size[1] * size[2]
    distance, node = 0.0, first
    for corner in range(2):
        share = s if corner else 1.0 - s
        low, high = (1.0 - r) * d[node] + r * d[node + 1], (1.0 - r) * d[node + row] + r * d[node + row + 1]
        distance += share * ((1.0 - t) * low + t * high)
        node += layer
    off = u * u + v * v + w * w
    if off > 0.0:
        distance = np.sqrt(off + max(distance, 0.0) * max(distance, 0.0))
    triangle = body.nearest[first + (layer if s >= 0.5 else 0) + (row if t >= 0.5 else 0) + (1 if r >= 0.5 else 0)]
    vertex, least = -1, np.inf
    for corner in range(3 if triangle >= 0 else 0):
        place = body.vertices[body.triangles[triangle, corner]]
        squared = (place[0] - i) * (place[0] - i) + (place[1] - j) * (place[1] - j) + (place[2] - k) * (place[2] - k)
        if squared < least:
            vertex, least = body.triangles[triangle, corner], squared
    return distance, vertex


@inlined()
def _move(x, q, o, m):  # type: ignore[no-untyped-def]
    """Write how a joint at x with the rotation q moves what is near it in the bind pose, in which it is at o: a matrix,
    row by row, and a shift.
    """
    for column in range(3):
        u, v = 1.0 if column == 0 else 0.0, 1.0 if column == 1 else 0.0
        m[column], m[3 + column], m[6 + column] = turned(q[0], q[1], q[2], q[3], u, v, 1.0 - u - v)
    for row in range(3):
        m[9 + row] = x[row] - m[3 * row] * o[0] - m[3 * row + 1] * o[1] - m[3 * row + 2] * o[2]


@inlined()
def _blend(moved, body, vertex, blended):  # type: ignore[no-untyped-def]
    """Write how the joints of a vertex move what is near it in the bind pose, as `_move` does."""
    for i in range(12):
        blended[i] = 0.0
    for n in range(4):
        share = body.weights[vertex, n]
        if share > 0.0:
            m = moved[body.joints[vertex, n]]
            for i in range(12):
                blended[i] += share * m[i]


@inlined()
def _alike(body, vertex, other):  # type: ignore[no-untyped-def]
    """Whether one joint alone moves two vertices."""
    alone = body.weights[vertex, 0] > RIGID and body.weights[other, 0] > RIGID
    return alone and body.joints[vertex, 0] == body.joints[other, 0]


@inlined()
def _unblended(m, a, b, c):  # type: ignore[no-untyped-def]
    """The place that a matrix and a shift move to a b c; far off where the matrix is flat."""
    u, v, w = a - m[9], b - m[10], c - m[11]
    d, e, f = m[4] * m[8] - m[5] * m[7], m[5] * m[6] - m[3] * m[8], m[3] * m[7] - m[4] * m[6]
    determinant = m[0] * d + m[1] * e + m[2] * f
    if abs(determinant) < 1e-3:
        return np.inf, np.inf, np.inf
    s = 1.0 / determinant
    return (
        s * (d * u + (m[2] * m[7] - m[1] * m[8]) * v + (m[1] * m[5] - m[2] * m[4]) * w),
        s * (e * u + (m[0] * m[8] - m[2] * m[6]) * v + (m[2] * m[3] - m[0] * m[5]) * w),
        s * (f * u + (m[1] * m[6] - m[0] * m[7]) * v + (m[0] * m[4] - m[1] * m[3]) * w),
    )


@inlined()
def _depth(x, q, moved, body, group, by, a, b, c, blended):  # type: ignore[no-untyped-def]
    """How deep the point a b c is in a group, the segment that it is in, its place in the bind pose, the vertex that is
    nearest there, or -1, and how far off the place may be.

    What moves a point of a mesh is not known before its place in the bind pose is: it is found by repetition, as the
    skin's joints nearest to the place before would have it; first as the vertex `by` or, without one, -1, as the
    group's joint would. What is then left of the way counts as apart.
    """
    joint, lattice = body.groups[group, 0], body.groups[group, 3]
    rest = body.rest[joint]
    if by < 0:
        i, j, k = _relative(x[joint], q[joint], a, b, c)
        i, j, k = i + rest[0], j + rest[1], k + rest[2]
    else:
        _blend(moved, body, by, blended)
        i, j, k = _unblended(blended, a, b, c)
    if lattice < 0:
        i, j, k = i - rest[0], j - rest[1], k - rest[2]
        deep = _in_capsules(body.capsules, body.groups[group, 2], body.groups[group + 1, 2], i, j, k)
        return deep, body.groups[group, 1], i + rest[0], j + rest[1], k + rest[2], -1, 0.0
    distance, vertex = _on_lattice(body, lattice, i, j, k)
    if by < 0 and vertex >= 0 and body.joints[vertex, 0] == joint and body.weights[vertex, 0] > RIGID:
        by = vertex
    left = 0.0
    for _ in range(PASSES):
        if vertex < 0 or vertex == by or (by >= 0 and _alike(body, vertex, by)):
            left = 0.0
            break
        _blend(moved, body, vertex, blended)
        l, m, n = _unblended(blended, a, b, c)
        left = np.sqrt((l - i) * (l - i) + (m - j) * (m - j) + (n - k) * (n - k))
        if not left < np.inf:
            vertex = -1
            break
        i, j, k, by = l, m, n, vertex
        distance, vertex = _on_lattice(body, lattice, i, j, k)
    if vertex < 0:
        return -np.inf, -1, i, j, k, -1, np.inf
    return -distance - left, body.segments[vertex], i, j, k, vertex, left


@inlined()
def _to_triangles(moved, body, lattice, deep, i, j, k, a, b, c, corners):  # type: ignore[no-untyped-def]
    """How deep the point a b c, whose place in the bind pose is i j k, is by the triangles nearest to the nodes of a
    lattice around this place, as they are posed; inside if `deep` is positive. `corners`, (3, 3), is scratch.
    """
    origin, size = body.lattices[lattice], body.sizes[lattice]
    l, _s, _u = _node(origin, 0, size, i)
    m, _t, _v = _node(origin, 1, size, j)
    n, _r, _w = _node(origin, 2, size, k)
    first, least, before = size[3] + (l * size[1] + m) * size[2] + n, np.inf, -1
    for corner in range(8):
        node = first + (corner & 1) * size[1] * size[2] + (corner >> 1 & 1) * size[2] + (corner >> 2)
        triangle = body.nearest[node]
        if triangle < 0 or triangle == before:
            continue
        before = triangle
        for of_triangle in range(3):
            vertex, at = body.triangles[triangle, of_triangle], corners[of_triangle]
            v = body.vertices[vertex]
            at[0] = at[1] = at[2] = 0.0
            for influence in range(4):
                share = body.weights[vertex, influence]
                if share > 0.0:
                    move = moved[body.joints[vertex, influence]]
                    for axis in range(3):
                        row = 3 * axis
                        along = move[row] * v[0] + move[row + 1] * v[1] + move[row + 2] * v[2] + move[9 + axis]
                        at[axis] += share * along
        least = min(least, squared_distance(corners[0], corners[1], corners[2], a, b, c))
    return np.sqrt(least) if deep > 0.0 else -np.sqrt(least)


@inlined()
def _to_skin(x, q, moved, body, placed, group, deep, i, j, k, a, b, c, blended, corners):  # type: ignore[no-untyped-def]
    """How deep the point a b c is by triangles, as `_to_triangles`; if inside, by those around its places in the bind
    pose from all groups, as where skin folds the nearest is not the one that it is inside of.
    """
    lattice = body.groups[group, 3]
    exact = _to_triangles(moved, body, lattice, deep, i, j, k, a, b, c, corners)
    for other in range(len(body.groups) - 1 if exact > 0.0 else 0):
        u, v, w = a - placed[other, 0], b - placed[other, 1], c - placed[other, 2]
        limit = placed[other, 3] + exact
        if other != group and body.groups[other, 3] == lattice and u * u + v * v + w * w < limit * limit:
            _deep, _on, l, m, n, vertex, _left = _depth(x, q, moved, body, other, -1, a, b, c, blended)
            if vertex >= 0:
                exact = min(exact, _to_triangles(moved, body, lattice, 1.0, l, m, n, a, b, c, corners))
    return exact


@inlined()
def _exact(  # type: ignore[no-untyped-def]
    x, q, moved, skin, body, placed, of_place, alone, group, segment, point, deep, place, blended, corners
):
    """The point that is reached from one by way of neighbours that are deeper in a segment, or in those that are looked
    for together with it, and how deep it is, by triangles; writes its place in the bind pose. `deep` and `place` are
    what is known of the first point.
    """
    lattice = body.groups[group, 3]
    if lattice < 0:
        return point, deep
    a, b, c = _posed(x, q, skin.joints[point], skin.bound[point])
    exact = _to_skin(x, q, moved, body, placed, group, deep, place[0], place[1], place[2], a, b, c, blended, corners)
    before = -1
    while before != point:
        before = point
        for n in range(skin.first[before], skin.first[before + 1]):
            other = skin.neighbours[n]
            a, b, c = _posed(x, q, skin.joints[other], skin.bound[other])
            depth, on, i, j, k, _v, _left = _depth(x, q, moved, body, group, -1, a, b, c, blended)
            if on >= 0 and _counts_for(of_place, alone, on, segment):
                depth = _to_skin(x, q, moved, body, placed, group, depth, i, j, k, a, b, c, blended, corners)
                if depth > exact:
                    point, exact = other, depth
                    place[0], place[1], place[2] = i, j, k
    return point, exact


@inlined()
def _apart(ball, other):  # type: ignore[no-untyped-def]
    """The squared distance of the centres of two balls."""
    a, b, c = ball[0] - other[0], ball[1] - other[1], ball[2] - other[2]
    return a * a + b * b + c * c


@inlined()
def _set(ball, x, q, v):  # type: ignore[no-untyped-def]
    """Write the place of the ball v on a joint at x with the rotation q."""
    ball[0], ball[1], ball[2] = _placed(x, q, v)
    ball[3] = v[3]


@inlined()
def _meet(ball, other, reach):  # type: ignore[no-untyped-def]
    """Whether two balls are within reach of each other."""
    limit = ball[3] + other[3] + reach
    return limit > 0.0 and _apart(ball, other) < limit * limit


@inlined()
def _meets_box(ball, box, x, q, reach):  # type: ignore[no-untyped-def]
    """Whether a ball is within reach of a box on a joint at x with the rotation q."""
    i, j, k = _relative(x, q, ball[0], ball[1], ball[2])
    u, v, w = max(box[0] - i, i - box[3], 0.0), max(box[1] - j, j - box[4], 0.0), max(box[2] - k, k - box[5], 0.0)
    limit = max(ball[3] + reach, 0.0)
    return u * u + v * v + w * w <= limit * limit


@inlined()
def _is_beyond(looked, ball, reach):  # type: ignore[no-untyped-def]
    """Whether a ball is farther off than the reach, since depths change no faster than places do; `looked` is a place
    and how deep it is.
    """
    room = -looked[3] - ball[3] - reach
    return room > 0.0 and _apart(looked, ball) < room * room


@inlined()
def _reach(deepest, counted):  # type: ignore[no-untyped-def]
    """How far to look where the deepest point found so far is this deep, and all points inside are counted or not."""
    return 0.0 if counted and 0.0 < deepest < np.inf else -deepest


@inlined()
def _counts_for(of_place, alone, segment, other):  # type: ignore[no-untyped-def]
    """Whether a point in or near a segment is as good as one in or near another."""
    return segment == other or (of_place[segment] == of_place[other] and not alone[other])


@inlined()
def _raise(least, of_place, alone, segment, deep):  # type: ignore[no-untyped-def]
    """Raise how deep a point has to be, so that it need be looked for, after one that is so deep in a segment; in other
    segments all that are inside are looked for.
    """
    for other in range(len(least)):
        if _counts_for(of_place, alone, segment, other):
            least[other] = max(least[other], deep if other == segment else min(deep, 0.0))


@inlined()
def _enclose(ball, balls, first, end):  # type: ignore[no-untyped-def]
    """Write a ball around other balls."""
    for i in range(4):
        ball[i] = 0.0
    for n in range(first, end):
        for i in range(3):
            ball[i] += balls[n, i] / (end - first)
    for n in range(first, end):
        ball[3] = max(ball[3], np.sqrt(_apart(ball, balls[n])) + balls[n, 3])


@compiled()
def _find(
    positions: F3,
    rotations: F3,
    skin: Patches,
    body: Solids,
    grazing: float,
    of_place: I1,
    alone: B3,
    near: Out[I2],
    least: Out[F1],
    at: Out[F1],
    looked: Out[F2],
    placed: Out[F2],
    placed_patches: Out[F2],
    moved: Out[F2],
    blended: Out[F1],
    corners: Out[F2],
    last: Out[I3],
    depths: Out[F3],
    places: Out[F4],
    inside: Out[F1],
) -> None:
    """Write depths, places and counts of vertices inside. Scratch are `near`, (groups, 2), the near groups and the
    vertices by which their points are brought back; `least`, (segments,), how deep points have to be; `at`, (4,), a
    point; `looked`, (groups + 1, 4), where groups were last looked at, and how deep that may be; `placed`, (groups + 1,
    4), and `placed_patches`, (patches + 1, 4), balls in the world; `moved`, (joints, 12), and `blended`, (12,), how
    joints and vertices move; and `corners`, (3, 3), a triangle. `last`, (parts, segments, 2), begins as -1: the point
    and group that were deepest in the frame before, with which the search begins, as all that is farther off need not
    be looked at.
    """
    groups, parts, patches = body.groups, skin.parts, skin.patches
    all_patches = len(patches) - 1
    around = placed_patches[all_patches]
    for frame in range(len(positions)):
        x, q = positions[frame], rotations[frame]
        for joint in range(len(moved)):
            _move(x[joint], q[joint], body.rest[joint], moved[joint])
        for patch in range(all_patches):
            joint = patches[patch, 0]
            _set(placed_patches[patch], x[joint], q[joint], skin.balls[patch])
        for group in range(len(groups) - 1):
            joint = groups[group, 0]
            _set(placed[group], x[joint], q[joint], body.balls[group])
            looked[group, 3] = np.inf
        for part in range(len(parts) - 1):
            near_groups, deepest_of, counted = 0, depths[frame, part], part < len(LIMBS)
            for segment in range(len(least)):
                least[segment] = deepest_of[segment]
            for segment in range(len(least)):
                point, group = last[part, segment, 0], last[part, segment, 1]
                if point >= 0 and (least[segment] < 0.0 or not counted):
                    at[0], at[1], at[2] = _posed(x, q, skin.joints[point], skin.bound[point])
                    if not _meet(placed[group], at, _reach(least[segment], counted)):
                        continue
                    deep, on, i, j, k, _v, _left = _depth(x, q, moved, body, group, -1, at[0], at[1], at[2], blended)
                    if on == segment and deep > least[segment]:
                        # a point that is inside is counted when all are looked at
                        deepest_of[segment] = min(deep, 0.0) if counted else deep
                        _raise(least, of_place, alone[frame, part], segment, deepest_of[segment])
                        places[frame, part, segment, 0] = i
                        places[frame, part, segment, 1] = j
                        places[frame, part, segment, 2] = k
            _enclose(around, placed_patches, parts[part], parts[part + 1])
            for group in range(len(groups) - 1):
                if _meet(placed[group], around, _reach(least[groups[group, 1]], counted)):
                    near[near_groups, 0] = group
                    near_groups += 1
            for patch in range(parts[part], parts[part + 1] if near_groups else parts[part]):
                found, farthest, ball = 0, -np.inf, placed_patches[patch]
                for n in range(near_groups):
                    group = near[n, 0]
                    reach = _reach(least[groups[group, 1]], counted)
                    joint = groups[group, 0]
                    if (
                        not _meet(placed[group], ball, reach)
                        or _is_beyond(looked[group], ball, reach)
                        or not _meets_box(ball, body.boxes[group], x[joint], q[joint], reach)
                    ):
                        continue
                    deep, _on, _i, _j, _k, by, left = _depth(
                        x, q, moved, body, group, -1, ball[0], ball[1], ball[2], blended
                    )
                    for axis in range(3):
                        looked[group, axis] = ball[axis]
                    looked[group, 3] = deep + 2.0 * left if left < np.inf else np.inf
                    if deep + ball[3] > -reach or deep == -np.inf:
                        is_known, farthest = False, max(farthest, reach)
                        for other in range(found):  # groups from which one comes to the same vertex are one
                            is_known = is_known or (by >= 0 and near[other, 1] == by)
                        if not is_known:
                            near[n, 0], near[found, 0], near[found, 1] = near[found, 0], group, by
                            found += 1
                if found == 0:
                    continue
                for point in range(patches[patch, 1], patches[patch + 1, 1]):
                    at[0], at[1], at[2] = _posed(x, q, skin.joints[point], skin.bound[point])
                    is_inside = False
                    for n in range(found):
                        group, by = near[n, 0], near[n, 1]
                        if _is_beyond(looked[group], at, farthest):
                            continue
                        deep, segment, i, j, k, _v, _left = _depth(
                            x, q, moved, body, group, by, at[0], at[1], at[2], blended
                        )
                        if segment < 0 or least[segment] == np.inf:
                            continue
                        if deep > grazing:
                            is_inside = True
                        if deep > deepest_of[segment] and deep > least[segment]:
                            deepest_of[segment] = deep
                            _raise(least, of_place, alone[frame, part], segment, deep)
                            last[part, segment, 0], last[part, segment, 1] = point, group
                            places[frame, part, segment, 0] = i
                            places[frame, part, segment, 1] = j
                            places[frame, part, segment, 2] = k
                    if is_inside and counted:
                        inside[frame] += skin.counts[point]
            for segment in range(len(deepest_of)):
                point, place = last[part, segment, 0], places[frame, part, segment]
                deep, group, on = deepest_of[segment], last[part, segment, 1], alone[frame, part]
                if point >= 0 and place[0] < np.inf and deep > -np.inf and deep >= least[segment]:
                    last[part, segment, 0], deepest_of[segment] = _exact(
                        x,
                        q,
                        moved,
                        skin,
                        body,
                        placed,
                        of_place,
                        on,
                        group,
                        segment,
                        point,
                        deep,
                        place,
                        blended,
                        corners,
                    )
