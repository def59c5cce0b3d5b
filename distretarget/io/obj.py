"""The points of Wavefront OBJ files: things that performers touch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial.distance import cdist

from distretarget.errors import BvhError
from distretarget.io.files import read_text
from distretarget.motion import Motion, rigid_motion
from distretarget.skeleton import LARGEST, POSITION_CHANNELS, ROTATION_CHANNELS, Skeleton

Array = NDArray[np.float64]

MOST_POINTS = 100  # vertices that are kept, spread evenly


def read_obj(path: str | Path) -> Motion:
    """Return the vertices of an OBJ file as a motion of one frame: a thing that stands still.

    Its root is the origin of the file; the vertices, at most `MOST_POINTS` of them, hang from it as fixed joints, each
    from one near to it.

    Raises:
        FileError: the file cannot be read.
        BvhError: a vertex has no three numbers, or there is no vertex.
    """
    vertices = thinned(_vertices(read_text(path), path), MOST_POINTS)
    points = np.concatenate([np.zeros((1, 3)), vertices[np.linalg.norm(vertices, axis=1) > 0]])
    order, before = breadth_first_order(minimum_spanning_tree(cdist(points, points)), 0, directed=False)
    parents = np.argsort(order)[before[order[1:]]]
    offsets = np.diff(points[order], axis=0, prepend=0.0)
    offsets[1:] = points[order[1:]] - points[order[parents]]
    leaves = ~np.isin(np.arange(len(order)), parents)
    leaves[0] = False
    skeleton = Skeleton(
        names=(Path(path).stem, *(f"point{number}" for number in range(1, len(order)))),
        parents=np.append(-1, parents),
        offsets=offsets,
        channels=(POSITION_CHANNELS + ROTATION_CHANNELS, *[()] * (len(order) - 1)),
        end_sites=leaves,
    )
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (1, len(skeleton), 1))
    return rigid_motion(skeleton, np.zeros((1, 3)), rotations, "1")


def thinned(points: Array, most: int) -> Array:
    """Return at most so many of the points, (points, 3): each next one is the farthest from those before it."""
    points = np.unique(points, axis=0)
    chosen, away = [0], np.full(len(points), np.inf)
    while len(chosen) < min(most, len(points)):
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(away.argmax()))
    return points[chosen]


def _vertices(text: str, path: str | Path) -> Array:
    """(vertices, 3), the coordinates in the lines that begin with v."""
    vertices = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append(_vertex(words[1:4], path, number))
    if not vertices:
        raise BvhError(path, 0, 'has no vertices, expected an OBJ file with lines "v x y z"')
    return np.array(vertices)


def _vertex(words: list[str], path: str | Path, line: int) -> list[float]:
    try:
        place = [float(word) for word in words]
    except ValueError:
        place = []
    if len(place) != 3 or not np.abs(place).max() <= LARGEST:
        raise BvhError(path, line, f"found {' '.join(words)!r}, expected three finite coordinates after v")
    return place
