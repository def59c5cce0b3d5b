"""Read Wavefront OBJ files: the vertices and triangles of props."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import depth_first_order, minimum_spanning_tree
from scipy.spatial.distance import cdist

from distretarget.errors import BvhError
from distretarget.io.bvh import NUMBER
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, farthest_points
from distretarget.skeleton import ALL_CHANNELS, LARGEST, Skeleton

CORNER = re.compile(r"-?[0-9]{1,18}(?=/|$)")  # the number of a vertex, also in words such as 3/1/2
MOST_POINTS = 100  # vertices of a prop that become joints, spread evenly


def parse_obj(text: str, path: str | Path) -> tuple[Array, NDArray[np.intp]]:
    """Return vertices and triangles, (n, 3) each, of an OBJ text; faces become fans. A BvhError if it is not valid."""
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        kind, *words = line.split() or [""]
        if kind == "v":
            vertices.append([float(word) for word in words[:3] if NUMBER.fullmatch(word)])
            if len(vertices[-1]) != 3 or not np.abs(vertices[-1]).max() <= LARGEST:
                found = " ".join(words[:3])
                raise BvhError(path, number, f"found {found!r}, expected three finite coordinates after v")
        elif kind == "f":
            corners = [_corner(word, len(vertices), path, number) for word in words]
            triangles += [(corners[0], *both) for both in pairwise(corners[1:])]
    if not vertices:
        raise BvhError(path, 0, 'has no vertices, expected a BVH file, or an OBJ file with lines "v x y z"')
    return np.array(vertices), np.array(triangles, np.intp).reshape(-1, 3)


def _corner(word: str, before: int, path: str | Path, line: int) -> int:
    """The index, from 0, of the vertex that a word such as 3, 3/1/2 or -1 names; -1 is the last of those `before`."""
    number = int(found[0]) if (found := CORNER.match(word)) else 0
    if not 1 <= abs(number) <= before:
        raise BvhError(
            path, line, f"found {word!r} in a face, expected the number of one of the {before} vertices above"
        )
    return number - 1 if number > 0 else before + number


def static_prop(vertices: Array, name: str) -> Motion:
    """Return a still prop: at most `MOST_POINTS` of the vertices as joints, connected by a minimum spanning tree."""
    distinct = np.unique(vertices, axis=0)
    points = distinct[farthest_points(distinct, MOST_POINTS)]
    order, before = depth_first_order(minimum_spanning_tree(cdist(points, points)), 0, directed=False)
    parents = np.argsort(order)[before[order[1:]]]
    leaves = ~np.isin(np.arange(len(order)), parents)
    leaves[0] = False
    skeleton = Skeleton(
        names=(name, *(f"point{number}" for number in range(1, len(order)))),
        parents=np.append(-1, parents),
        offsets=points[order] - points[order[np.append(0, parents)]],
        channels=(ALL_CHANNELS, *[()] * (len(order) - 1)),
        end_sites=leaves,
    )
    return Motion(skeleton, points[:1], skeleton.rest_rotations[None], "1")
