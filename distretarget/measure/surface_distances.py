"""Signed distances of the nodes of a lattice from a surface of triangles, negative inside.

Distances spread over the lattice from the nodes next to each triangle, each node trying the nearest triangles of its
neighbours (H. Zhao, "A fast sweeping method for Eikonal equations", Mathematics of Computation 74, 2005). The sign is
that of the mean of six winding numbers, along lattice lines to both sides on three axes, so that a hole or a sheet that
one of these lines meets does no harm.
"""

from __future__ import annotations

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import F3, I3, Array, Numbers

SWEEPS = 2  # over the lattice, in each of eight directions
OFF_NODES = 1.3e-4  # offset from the nodes of lines along which triangles are counted, so as to miss edges [spacings]


def distances_on_lattice(surface: Array, closed: Array, shape: tuple[int, ...], limit: float) -> tuple[Array, Numbers]:
    """Return the signed distances of the nodes of a lattice from a surface, and their nearest triangles, -1 beyond the
    limit, (x, y, z) each.

    Args:
        surface: (triangles, 3, 3), the corners of the triangles; node i, j, k is at (i, j, k), so that lengths are in
            spacings of the lattice.
        closed: (triangles, 3, 3), the corners of a closed surface, which decides what is inside.
        shape: the number of nodes along each axis.
        limit: the largest distance.
    """
    distances, nearest, winding = np.full(shape, limit), np.full(shape, -1), np.zeros(shape)
    _write_distances(np.ascontiguousarray(surface), distances, nearest, np.zeros(shape, np.intp))
    _write_winding(np.ascontiguousarray(closed), winding)
    return np.where(np.abs(winding) > 0.5, -distances, distances), nearest


@inlined()
def squared_distance(a, b, c, x, y, z):  # type: ignore[no-untyped-def]
    """The squared distance of a point from the triangle a b c, by the Voronoi region of the point's projection
    (C. Ericson, "Real-Time Collision Detection", 2005, 5.1.5).
    """
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    px, py, pz = x - a[0], y - a[1], z - a[2]
    d1, d2 = ux * px + uy * py + uz * pz, vx * px + vy * py + vz * pz
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    d3, d4, d5, d6 = d1 - uu, d2 - uv, d1 - uv, d2 - vv
    s = t = 0.0
    area_c, area_b, area_a = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        s = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        t = 1.0
    elif area_c <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s = d1 / (d1 - d3)
    elif area_b <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
    elif area_a <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        s = 1.0 - t
    else:
        s, t = area_b / (area_a + area_b + area_c), area_c / (area_a + area_b + area_c)
    ox, oy, oz = px - s * ux - t * vx, py - s * uy - t * vy, pz - s * uz - t * vz
    return ox * ox + oy * oy + oz * oz


@inlined()
def _nodes(corners, axis, around, off, count):  # type: ignore[no-untyped-def]
    """The first node, moved by `off`, within the extent of a triangle along an axis, widened by `around`, and the first
    node beyond.
    """
    low = min(corners[0, axis], corners[1, axis], corners[2, axis]) - around - off
    high = max(corners[0, axis], corners[1, axis], corners[2, axis]) + around - off
    return max(int(np.ceil(low)), 0), min(int(np.floor(high)) + 1, count)


@compiled()
def _write_distances(surface: F3, distances: Out[F3], nearest: Out[I3], found: Out[I3]) -> None:
    """Lower distances to those from the surface, and write the nearest triangles and, to `found`, which is 0, the
    number of the sweep, from 1, in which each was found. A node and a neighbour that have not changed since the last
    sweep in the same direction are skipped.
    """
    shape = distances.shape
    for triangle in range(len(surface)):
        corners = surface[triangle]
        first_x, end_x = _nodes(corners, 0, 1.0, 0.0, shape[0])
        first_y, end_y = _nodes(corners, 1, 1.0, 0.0, shape[1])
        first_z, end_z = _nodes(corners, 2, 1.0, 0.0, shape[2])
        for i in range(first_x, end_x):
            for j in range(first_y, end_y):
                for k in range(first_z, end_z):
                    distance = np.sqrt(squared_distance(corners[0], corners[1], corners[2], i, j, k))
                    if distance < distances[i, j, k]:
                        distances[i, j, k], nearest[i, j, k] = distance, triangle
    for sweep in range(8 * SWEEPS):
        to_x, to_y, to_z = 1 - 2 * (sweep & 1), 1 - (sweep & 2), 1 - (sweep & 4) // 2
        old_x, old_y, old_z = _last_along(sweep, 0), _last_along(sweep, 1), _last_along(sweep, 2)
        for step_x in range(shape[0]):
            i = step_x if to_x > 0 else shape[0] - 1 - step_x
            for step_y in range(shape[1]):
                j = step_y if to_y > 0 else shape[1] - 1 - step_y
                for step_z in range(shape[2]):
                    k = step_z if to_z > 0 else shape[2] - 1 - step_z
                    for axis in range(3):
                        if (step_x if axis == 0 else step_y if axis == 1 else step_z) == 0:
                            continue
                        a = i - to_x if axis == 0 else i
                        b = j - to_y if axis == 1 else j
                        c = k - to_z if axis == 2 else k
                        old = old_x if axis == 0 else old_y if axis == 1 else old_z
                        if found[a, b, c] <= old and found[i, j, k] < old:
                            continue
                        triangle, known = nearest[a, b, c], distances[i, j, k]
                        if triangle < 0 or triangle == nearest[i, j, k] or distances[a, b, c] - 1.0 >= known:
                            continue
                        near = surface[triangle]
                        squared = squared_distance(near[0], near[1], near[2], i, j, k)
                        if squared < known * known:
                            distances[i, j, k], nearest[i, j, k], found[i, j, k] = np.sqrt(squared), triangle, sweep + 1


@inlined()
def _last_along(sweep, axis):  # type: ignore[no-untyped-def]
    """The number, from 1, of the last sweep before one in the same direction along an axis; -1 for none."""
    before = sweep - 1
    while before >= 0 and (before >> axis & 1) != (sweep >> axis & 1):
        before -= 1
    return before + 1 if before >= 0 else -1


@compiled()
def _write_winding(closed: F3, winding: Out[F3]) -> None:
    """Add a sixth of the signed number of triangles on each side of each node along each axis."""
    for triangle in range(len(closed)):
        p = closed[triangle]
        for a in range(3):
            u, v = (a + 1) % 3, (a + 2) % 3
            area = (p[1, u] - p[0, u]) * (p[2, v] - p[0, v]) - (p[1, v] - p[0, v]) * (p[2, u] - p[0, u])
            if area == 0.0:
                continue
            sixth = 1.0 / 6.0 if area > 0.0 else -1.0 / 6.0
            first_u, end_u = _nodes(p, u, 0.0, OFF_NODES, winding.shape[u])
            first_v, end_v = _nodes(p, v, 0.0, OFF_NODES, winding.shape[v])
            for m in range(first_u, end_u):
                for n in range(first_v, end_v):
                    s, t, height, within = m + OFF_NODES, n + OFF_NODES, 0.0, True
                    for corner in range(3):
                        b, c = p[(corner + 1) % 3], p[(corner + 2) % 3]
                        share = ((b[u] - s) * (c[v] - t) - (b[v] - t) * (c[u] - s)) / area
                        within = within and share >= 0.0
                        height += share * p[corner, a]
                    if not within:
                        continue
                    for node in range(winding.shape[a]):
                        value = -sixth if node > height else sixth
                        if a == 0:
                            winding[node, m, n] += value
                        elif a == 1:
                            winding[n, node, m] += value
                        else:
                            winding[m, n, node] += value
