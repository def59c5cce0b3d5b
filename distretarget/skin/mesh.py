"""The mesh of a character, bound to the joints of its skeleton."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Numbers
from distretarget.skeleton import HALF_TURN

SAME_SHARE = 1e-9  # differences of weights below this are rounding errors
SAME_PLACE = 1e-6  # vertices this near to each other are at one place [sizes of the mesh]


@dataclass(frozen=True, eq=False, kw_only=True)
class Material:
    """How a part of a mesh looks."""

    colour: tuple[float, ...] = (0.8, 0.8, 0.8, 1.0)  # red, green, blue and opacity, linear [0 to 1]
    image: bytes = b""  # the content of its colour texture; empty for none
    normal_map: bytes = b""  # the content of its normal map; empty for none
    mode: str = "OPAQUE"  # alpha mode, "OPAQUE", "MASK" or "BLEND", as in glTF
    cutoff: float = 0.5  # alpha cutoff of the mode "MASK"
    two_sided: bool = False  # whether back faces are drawn


@dataclass(frozen=True, eq=False)
class Looks:
    """How a mesh looks."""

    materials: tuple[Material, ...]
    of_triangle: Numbers  # (triangles,), the index of each triangle's material; -1 for none
    uv: Array  # (vertices, 2), texture coordinates
    normals: Array | None = None  # (vertices, 3), unit normals out of the surface, if its file has them


MeshReader = Callable[[], "SkinnedMesh | None"]
"""Returns the mesh of a character, or None where it has none."""


@dataclass(frozen=True, eq=False)
class SkinnedMesh:
    """The mesh of a character in its bind pose, in which no joint of the skeleton is turned."""

    vertices: Array  # (vertices, 3), positions with the joints at the skeleton's `rest_positions` [file units]
    joints: Numbers  # (vertices, influences), the joints of the skeleton that move each vertex
    weights: Array  # (vertices, influences), their skin weights, which sum to 1
    triangles: Numbers  # (triangles, 3), indices of vertices
    looks: Looks | None = None  # materials and normals, if its file has them
    whole: SkinnedMesh | None = None  # the mesh with all triangles, if this has only some of them

    @cached_property
    def carriers(self) -> Numbers:
        """(vertices,), the joint with the largest weight of each vertex; of several the first."""
        return _with_largest_share(self.joints, self.weights)

    def owners(self, part_of: Numbers, triangles: Numbers) -> Numbers:
        """Return the part that moves most of each triangle, (n,), by the skin weights of its corners.

        Args:
            part_of: (joints,), the part of each joint; -1 for none.
            triangles: (n, 3), indices of vertices.
        """
        parts = part_of[self.joints[triangles]].reshape(len(triangles), 3 * self.joints.shape[1])
        weights = self.weights[triangles].reshape(parts.shape)
        shares = np.stack([((parts == each[:, None]) * weights).sum(axis=1) for each in parts.T], axis=1)
        return _with_largest_share(parts, shares)

    @property
    def firsts(self) -> Numbers:
        """(vertices,), the first vertex at the place of each; files repeat vertices where materials or images meet."""
        size = float(np.ptp(self.vertices, axis=0).max(initial=0.0)) or 1.0
        places = np.round(self.vertices / (SAME_PLACE * size)).astype(np.int64)
        _, first, same = np.unique(places, axis=0, return_index=True, return_inverse=True)
        return np.asarray(first[same.ravel()])

    @cached_property
    def pieces(self) -> Numbers:
        """(vertices,), the index of each vertex's connected piece; triangles that share a corner are in one piece."""
        firsts, count = self.firsts, len(self.vertices)
        a, b = firsts[self.triangles[:, [0, 1]]].ravel(), firsts[self.triangles[:, [1, 2]]].ravel()
        joined = coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
        return np.asarray(connected_components(joined, directed=False)[1][firsts], np.intp)

    def heights(self, motion: Motion, up: Array) -> Array:
        """Return the heights of the vertices, `posed`, along the unit vector `up`, (frames, vertices) [file units]."""
        rest, heights = motion.skeleton.rest_positions, np.zeros((len(motion), len(self.joints)))
        for joint, moved, share in _influences(self.joints, self.weights):
            down = Rotation.from_quat(motion.world_rotations_of(joint)).apply(up, inverse=True)
            above = down @ (self.vertices[moved] - rest[joint]).T + (motion.positions[:, joint] @ up)[:, None]
            heights[:, moved] += share * above
        return heights

    def posed(self, motion: Motion, vertices: Numbers | slice = slice(None)) -> Array:
        """Return vertices in each frame by linear blend skinning, (frames, vertices, 3) [file units]."""
        joints, weights = self.joints[vertices], self.weights[vertices]
        rest, result = motion.skeleton.rest_positions, np.zeros((len(motion), len(joints), 3))
        for joint, moved, share in _influences(joints, weights):
            bound = self.vertices[vertices][moved] - rest[joint]
            matrices = Rotation.from_quat(motion.world_rotations_of(joint)).as_matrix()
            places = np.einsum("fij,vj->fvi", matrices, bound) + motion.positions[:, None, joint]
            result[:, moved] += share[:, None] * places
        return result

    def turned_round(self) -> SkinnedMesh:
        """Return the mesh turned half round about Y, as `Skeleton.turned_round` is."""
        return replace(self, vertices=self.vertices * HALF_TURN, whole=self.whole and self.whole.turned_round())

    def moved(self, by: Array) -> SkinnedMesh:
        """Return the mesh of a body whose joints are displaced by a vector, (3,)."""
        return replace(self, vertices=self.vertices + by, whole=self.whole and self.whole.moved(by))

    def scaled(self, factor: float) -> SkinnedMesh:
        """Return the mesh of a body that is larger by a factor."""
        return replace(self, vertices=factor * self.vertices, whole=self.whole and self.whole.scaled(factor))


def _with_largest_share(numbers: Numbers, shares: Array) -> Numbers:
    """(n,), for each row the number with the largest share, of several the least, so that it does not depend on
    their order, as on the two sides of a body; `numbers` and `shares` are (n, influences).
    """
    are_largest = shares > shares.max(axis=1, keepdims=True, initial=0.0) - SAME_SHARE
    return np.asarray(np.where(are_largest, numbers, np.iinfo(np.intp).max).min(axis=1))


def _influences(joints: Numbers, weights: Array) -> Iterator[tuple[int, Numbers, Array]]:
    """Yield each joint that moves vertices, with the indices of these, (n,), and its weights for them, (n,)."""
    for joint in np.unique(joints[weights > 0.0]).tolist():
        share = np.where(joints == joint, weights, 0.0).sum(axis=1)
        moved = np.flatnonzero(share)
        yield joint, moved, share[moved]


def outermost(points: Array) -> Numbers:
    """Return the indices of points, (n, 3), on their convex hull; of all points if these are few or in one plane."""
    try:
        return np.asarray(ConvexHull(points).vertices, np.intp)
    except (QhullError, ValueError):
        return np.arange(len(points))


def no_mesh() -> SkinnedMesh | None:
    """Return None; the `MeshReader` of a character without a mesh."""
    return None
