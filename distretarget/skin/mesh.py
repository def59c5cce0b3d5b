"""The mesh of a character, bound to the joints of its skeleton."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion

Array = NDArray[np.float64]

MeshReader = Callable[[], "SkinnedMesh | None"]
"""Returns the mesh of a character, or None where it has none."""


@dataclass(frozen=True, eq=False)
class SkinnedMesh:
    """The mesh of a character in its bind pose, in which no joint of the skeleton is turned.

    Attributes:
        vertices: (vertices, 3), where the joints are at the skeleton's `rest_positions` [file units].
        joints: (vertices, influences), the joints of the skeleton that move each vertex.
        weights: (vertices, influences), their shares, which sum to 1.
        triangles: (triangles, 3), the vertices of each.
    """

    vertices: Array
    joints: NDArray[np.intp]
    weights: Array
    triangles: NDArray[np.intp]

    def posed(self, motion: Motion, vertices: NDArray[np.intp] | slice = slice(None)) -> Array:
        """Return the vertices, or some of them, in each frame of a motion by linear blend skinning, (frames, vertices,
        3) [file units].
        """
        joints, weights = self.joints[vertices], self.weights[vertices]
        rest, result = motion.skeleton.rest_positions, np.zeros((len(motion), len(joints), 3))
        for joint in np.unique(joints[weights > 0.0]).tolist():
            share = np.where(joints == joint, weights, 0.0).sum(axis=1)
            moved = np.flatnonzero(share)
            bound = self.vertices[vertices][moved] - rest[joint]
            matrices = Rotation.from_quat(motion.world_rotations_of(joint)).as_matrix()
            places = np.einsum("fij,vj->fvi", matrices, bound) + motion.positions[:, None, joint]
            result[:, moved] += share[moved, None] * places
        return result


def no_mesh() -> SkinnedMesh | None:
    """Return None, the mesh of what has none."""
    return None
