"""Depths of points inside the parts of a posed body, by the inside of its bind pose. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.measure.surface_distances import squared_distance
from distretarget.numerics.compiled import inlined
from distretarget.numerics.quaternions import rotated
from distretarget.numerics.vectors import B1, F1, F2, I1, I2

PASSES = 4  # of the fixed-point iteration that brings a point back to the bind pose
RIGID = 0.999  # weight from which on a point counts as moved by one joint alone


class Solids(NamedTuple):
    """The inside of a body, capsules or a mesh, in groups of one segment that are moved mostly by one joint."""

    # (groups + 1, 4), joint and segment of each group, its first capsule, and its lattice or -1; last the end
    groups: I2
    balls: F2  # (groups, 4), bounding balls: centre relative to the joint, and radius [file units]
    boxes: F2  # (groups, 6), bounding boxes: lowest and highest corner relative to the joint [file units]
    # (capsules, 10), start of the axis relative to the joint, its direction and its length, the radius at the start,
    # the change of the radius along the axis, and the offset along the axis from the projection of a point to the
    # nearest ball, per distance of the point from the axis
    capsules: F2
    lattices: F2  # (lattices, 4), the position of the first node in the bind pose, and the spacing [file units]
    sizes: I2  # (lattices, 4), the numbers of nodes along x, y and z, and the first node
    distances: F1  # (nodes,), from the skin, negative inside [file units]
    nearest: I1  # (nodes,), the nearest triangle; -1 where the skin is far
    triangles: I2  # (triangles, 3), vertices
    beside: I2  # (triangles, 3), the triangles of the same solid beyond each edge; -1 for none
    vertices: F2  # (vertices, 3), in the bind pose [file units]
    joints: I2  # (vertices, 4), the joints that move a vertex most, the strongest first
    weights: F2  # (vertices, 4), their shares, which sum to 1
    segments: I1  # (vertices,), the segment of each vertex, -1 for none
    rest: F2  # (joints, 3), the positions of the joints in the bind pose [file units]

    def of_second_body(self, joints: int) -> Solids:
        """Return the same solids with joint numbers increased by `joints`, those of a first body."""
        groups, rest = self.groups.copy(), np.concatenate([np.zeros((joints, 3)), self.rest])
        groups[:-1, 0] += joints
        return self._replace(groups=groups, joints=self.joints + joints, rest=rest)


class Posed(NamedTuple):
    """A frame of a body. Vertices are computed when they are needed."""

    places: F2  # (joints, 3), positions
    moves: F2  # (joints, 12), the transforms from the bind pose: a matrix, row by row, and an offset
    balls: F2  # (groups, 4), the bounding balls of the groups
    vertices: F2  # (vertices, 3), positions, if known
    backs: F2  # (vertices, 12), the transforms to the bind pose, if known: an offset to subtract, then a matrix
    known: B1  # (vertices,), whether each is known

    @classmethod
    def of(cls, joints: int, body: Solids) -> Posed:
        """Room for a frame of so many joints."""
        places, moves, balls = np.empty((joints, 3)), np.empty((joints, 12)), np.empty((len(body.balls), 4))
        vertices = len(body.vertices)
        return cls(places, moves, balls, np.empty((vertices, 3)), np.empty((vertices, 12)), np.zeros(vertices, bool))


@inlined()
def pose(posed, body, x, q):  # type: ignore[no-untyped-def]
    """Write a frame, whose joints are at x, (joints, 3), with the world rotations q, (joints, 4)."""
    for joint in range(len(x)):
        m = posed.moves[joint]
        for column in range(3):
            u, v = 1.0 if column == 0 else 0.0, 1.0 if column == 1 else 0.0
            turn = q[joint]
            m[column], m[3 + column], m[6 + column] = rotated(turn[0], turn[1], turn[2], turn[3], u, v, 1.0 - u - v)
        for row in range(3):
            posed.places[joint, row] = m[9 + row] = x[joint, row]
            if joint < len(body.rest):
                o = body.rest[joint]
                m[9 + row] -= m[3 * row] * o[0] + m[3 * row + 1] * o[1] + m[3 * row + 2] * o[2]
    for group in range(len(posed.balls)):
        set_ball(posed, body.groups[group, 0], body.balls[group], posed.balls[group])
    posed.known[:] = False


@inlined()
def placed(posed, joint, v):  # type: ignore[no-untyped-def]
    """The position of v, given relative to a joint."""
    m, x = posed.moves[joint], posed.places[joint]
    return (
        x[0] + m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        x[1] + m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
        x[2] + m[6] * v[0] + m[7] * v[1] + m[8] * v[2],
    )


@inlined()
def relative(posed, joint, a, b, c):  # type: ignore[no-untyped-def]
    """The position a b c relative to a joint, in its axes."""
    m, x = posed.moves[joint], posed.places[joint]
    u, v, w = a - x[0], b - x[1], c - x[2]
    return m[0] * u + m[3] * v + m[6] * w, m[1] * u + m[4] * v + m[7] * w, m[2] * u + m[5] * v + m[8] * w


@inlined()
def set_ball(posed, joint, ball, to):  # type: ignore[no-untyped-def]
    """Write a ball whose centre is given relative to a joint to `to`, by its position."""
    to[0], to[1], to[2] = placed(posed, joint, ball)
    to[3] = ball[3]


@inlined()
def apart(ball, other):  # type: ignore[no-untyped-def]
    """The squared distance of the centres of two balls."""
    a, b, c = ball[0] - other[0], ball[1] - other[1], ball[2] - other[2]
    return a * a + b * b + c * c


@inlined()
def _in_capsules(capsules, first, end, i, j, k):  # type: ignore[no-untyped-def]
    """The largest depth of the point i j k in some capsules."""
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
    """The node before a place along an axis of a lattice, the distance of the place from this node [spacings], and from
    the lattice [file units].
    """
    at = (place - lattice[axis]) / lattice[3]
    within = min(max(at, 0.0), size[axis] - 1.0)
    node = min(int(within), size[axis] - 2)
    return node, within - node, (at - within) * lattice[3]


@inlined()
def _distance(body, number, i, j, k):  # type: ignore[no-untyped-def]
    """The distance of the place i j k in the bind pose from the skin of a solid, interpolated on its lattice."""
    lattice, size, d = body.lattices[number], body.sizes[number], body.distances
    l, s, u = _node(lattice, 0, size, i)
    m, t, v = _node(lattice, 1, size, j)
    n, r, w = _node(lattice, 2, size, k)
    node, row, layer = size[3] + (l * size[1] + m) * size[2] + n, size[2], size[1] * size[2]
    distance = 0.0
    for corner in range(2):
        share = s if corner else 1.0 - s
        low, high = (1.0 - r) * d[node] + r * d[node + 1], (1.0 - r) * d[node + row] + r * d[node + row + 1]
        distance += share * ((1.0 - t) * low + t * high)
        node += layer
    off = u * u + v * v + w * w
    if off > 0.0:
        distance = np.sqrt(off + max(distance, 0.0) * max(distance, 0.0))
    return distance


@inlined()
def _nearest_vertex(body, number, i, j, k):  # type: ignore[no-untyped-def]
    """The vertex nearest to the place i j k in the bind pose, among those of the triangle nearest to the nearest node
    of a solid's lattice; -1 where the skin is far.
    """
    lattice, size = body.lattices[number], body.sizes[number]
    scale = 1.0 / lattice[3]
    l = int(min(max((i - lattice[0]) * scale + 0.5, 0.0), size[0] - 1.0))
    m = int(min(max((j - lattice[1]) * scale + 0.5, 0.0), size[1] - 1.0))
    n = int(min(max((k - lattice[2]) * scale + 0.5, 0.0), size[2] - 1.0))
    triangle, vertex, least = body.nearest[size[3] + (l * size[1] + m) * size[2] + n], -1, np.inf
    for corner in range(3 if triangle >= 0 else 0):
        place = body.vertices[body.triangles[triangle, corner]]
        squared = (place[0] - i) * (place[0] - i) + (place[1] - j) * (place[1] - j) + (place[2] - k) * (place[2] - k)
        if squared < least:
            vertex, least = body.triangles[triangle, corner], squared
    return vertex


@inlined()
def _know(posed, body, vertex):  # type: ignore[no-untyped-def]
    """Write the position of a vertex and its transform to the bind pose, unless they are known. If its joints flatten
    it, the transform leads infinitely far.
    """
    if posed.known[vertex]:
        return
    posed.known[vertex] = True
    a = b = c = d = e = f = g = h = i = u = v = w = 0.0
    for n in range(4):
        share = body.weights[vertex, n]
        if share > 0.0:
            m = posed.moves[body.joints[vertex, n]]
            a, b, c, u = a + share * m[0], b + share * m[1], c + share * m[2], u + share * m[9]
            d, e, f, v = d + share * m[3], e + share * m[4], f + share * m[5], v + share * m[10]
            g, h, i, w = g + share * m[6], h + share * m[7], i + share * m[8], w + share * m[11]
    place, back, rest = posed.vertices[vertex], posed.backs[vertex], body.vertices[vertex]
    place[0] = a * rest[0] + b * rest[1] + c * rest[2] + u
    place[1] = d * rest[0] + e * rest[1] + f * rest[2] + v
    place[2] = g * rest[0] + h * rest[1] + i * rest[2] + w
    j, k, l = e * i - f * h, f * g - d * i, d * h - e * g
    determinant = a * j + b * k + c * l
    if abs(determinant) < 1e-3:
        back[:3], back[3:] = -np.inf, 1.0
        return
    s = 1.0 / determinant
    back[0], back[1], back[2] = u, v, w
    back[3], back[4], back[5] = s * j, s * (c * h - b * i), s * (b * f - c * e)
    back[6], back[7], back[8] = s * k, s * (a * i - c * g), s * (c * d - a * f)
    back[9], back[10], back[11] = s * l, s * (b * g - a * h), s * (a * e - b * d)


@inlined()
def _brought_back(posed, body, vertex, a, b, c):  # type: ignore[no-untyped-def]
    """The place in the bind pose of the point a b c, if it moves as a vertex does."""
    _know(posed, body, vertex)
    m = posed.backs[vertex]
    u, v, w = a - m[0], b - m[1], c - m[2]
    return m[3] * u + m[4] * v + m[5] * w, m[6] * u + m[7] * v + m[8] * w, m[9] * u + m[10] * v + m[11] * w


@inlined()
def _alike(body, vertex, other):  # type: ignore[no-untyped-def]
    """Whether two vertices are moved by the same single joint."""
    alone = body.weights[vertex, 0] > RIGID and body.weights[other, 0] > RIGID
    return alone and body.joints[vertex, 0] == body.joints[other, 0]


@inlined()
def depth_of(posed, body, group, by, a, b, c):  # type: ignore[no-untyped-def]
    """The depth of the point a b c in a group, its segment, its place in the bind pose, the nearest vertex there, or
    -1, and the length of the last step of the iteration.

    In a mesh, the place in the bind pose depends on the joints that move the skin nearest to this place, so it is found
    by fixed-point iteration. It starts with the transform of the vertex `by` or, if that is -1, of the group's joint.
    The length of the last step is subtracted from the depth.
    """
    joint, lattice = body.groups[group, 0], body.groups[group, 3]
    rest = body.rest[joint]
    if by < 0:
        i, j, k = relative(posed, joint, a, b, c)
        i, j, k = i + rest[0], j + rest[1], k + rest[2]
    else:
        i, j, k = _brought_back(posed, body, by, a, b, c)
    if lattice < 0:
        i, j, k = i - rest[0], j - rest[1], k - rest[2]
        deep = _in_capsules(body.capsules, body.groups[group, 2], body.groups[group + 1, 2], i, j, k)
        return deep, body.groups[group, 1], i + rest[0], j + rest[1], k + rest[2], -1, 0.0
    vertex = _nearest_vertex(body, lattice, i, j, k)
    if by < 0 and vertex >= 0 and body.joints[vertex, 0] == joint and body.weights[vertex, 0] > RIGID:
        by = vertex
    left = 0.0
    for _ in range(PASSES):
        if vertex < 0 or vertex == by or (by >= 0 and _alike(body, vertex, by)):
            left = 0.0
            break
        l, m, n = _brought_back(posed, body, vertex, a, b, c)
        left = np.sqrt((l - i) * (l - i) + (m - j) * (m - j) + (n - k) * (n - k))
        if not left < np.inf:
            vertex = -1
            break
        i, j, k, by = l, m, n, vertex
        vertex = _nearest_vertex(body, lattice, i, j, k)
    if vertex < 0:
        return -np.inf, -1, i, j, k, -1, np.inf
    return -_distance(body, lattice, i, j, k) - left, body.segments[vertex], i, j, k, vertex, left


@inlined()
def _squared_apart(posed, body, triangle, a, b, c):  # type: ignore[no-untyped-def]
    """The squared distance of the point a b c from a posed triangle; infinite for no triangle, -1."""
    if triangle < 0:
        return np.inf
    one, two, three = body.triangles[triangle, 0], body.triangles[triangle, 1], body.triangles[triangle, 2]
    _know(posed, body, one)
    _know(posed, body, two)
    _know(posed, body, three)
    return squared_distance(posed.vertices[one], posed.vertices[two], posed.vertices[three], a, b, c)


@inlined()
def _to_triangles(posed, body, lattice, deep, i, j, k, a, b, c):  # type: ignore[no-untyped-def]
    """The depth of the point a b c, whose place in the bind pose is i j k: its distance from the nearest posed
    triangle, positive if `deep` is. The search starts with the triangles of the lattice nodes around i j k and goes on
    to nearer neighbours of these.
    """
    origin, size = body.lattices[lattice], body.sizes[lattice]
    l, _s, _u = _node(origin, 0, size, i)
    m, _t, _v = _node(origin, 1, size, j)
    n, _r, _w = _node(origin, 2, size, k)
    first, least, nearest = size[3] + (l * size[1] + m) * size[2] + n, np.inf, -1
    for corner in range(8):
        node = first + (corner & 1) * size[1] * size[2] + (corner >> 1 & 1) * size[2] + (corner >> 2)
        squared = _squared_apart(posed, body, body.nearest[node], a, b, c)
        if squared < least:
            least, nearest = squared, body.nearest[node]
    before = -1
    while before != nearest:
        before = nearest
        for edge in range(3):
            triangle = body.beside[before, edge]
            squared = _squared_apart(posed, body, triangle, a, b, c)
            if squared < least:
                least, nearest = squared, triangle
    return np.sqrt(least) if deep > 0.0 else -np.sqrt(least)


@inlined()
def depth_by_triangles(posed, body, group, deep, place, at):  # type: ignore[no-untyped-def]
    """The depth of the point `at` by triangles, as `_to_triangles`. `place` and `deep` are its place in the bind pose
    and its depth by its own group. If it is inside, the least depth by all groups of the solid counts: where skin
    folds, the surface that its own group shows may not be the nearest.
    """
    lattice, a, b, c = body.groups[group, 3], at[0], at[1], at[2]
    exact = _to_triangles(posed, body, lattice, deep, place[0], place[1], place[2], a, b, c)
    for other in range(len(body.groups) - 1 if exact > 0.0 else 0):
        limit = posed.balls[other, 3] + exact
        if other != group and body.groups[other, 3] == lattice and apart(posed.balls[other], at) < limit * limit:
            _deep, _on, i, j, k, vertex, _left = depth_of(posed, body, other, -1, a, b, c)
            if vertex >= 0:
                exact = min(exact, _to_triangles(posed, body, lattice, 1.0, i, j, k, a, b, c))
    return exact
