"""Rotations that bring vectors onto vectors, and rotations as arrays of numbers."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.numerics.quaternions import least_rotation
from distretarget.numerics.vectors import Array

PULL = 1e-6  # weight of the identity in the fit of several vectors, relative to that of the vectors


def best_rotation(a: Array, b: Array) -> Array:
    """(frames, 4), the rotations that bring vectors `a` closest to `b`, both (frames, vectors, 3).

    For one vector this is the least rotation; for several the Kabsch fit, doi:10.1107/S0567739476001873, with a weight
    `PULL` on the identity, which decides the twist if all vectors are collinear.
    """
    if a.shape[1] == 1:
        return least_rotation(a[:, 0], b[:, 0])
    H = b.transpose(0, 2, 1) @ a
    H += PULL * np.linalg.norm(H, axis=(1, 2))[:, None, None] * np.eye(3)
    return Rotation.from_matrix(nearest_rotations(H)).as_quat()


def nearest_rotations(H: Array) -> Array:
    """(frames, 3, 3), the proper rotation matrices nearest to matrices H, (frames, 3, 3), by singular values."""
    U, _, Vt = np.linalg.svd(H)
    U[:, :, 2] *= np.linalg.det(U @ Vt)[:, None]
    return np.asarray(U @ Vt)


def least(a: Array, b: Array) -> Rotation:
    """The rotation that brings vectors a closest to b, both (vectors, 3), as `best_rotation`."""
    return Rotation.from_quat(best_rotation(a[None], b[None])[0])


def least_matrix(a: Array, b: Array) -> Array:
    """`least` as a matrix, (3, 3), without scipy's rotations, which are slow for single ones."""
    x, y, z, w = best_rotation(a[None], b[None])[0].tolist()
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


RotationKind = Literal["quaternion", "matrix", "6d"]


def represented(quaternions: Array, kind: RotationKind) -> Array:
    """Unit quaternions (..., 4), x y z w, in another representation: "quaternion" as they are, "matrix" (..., 3, 3), or
    "6d" (..., 6), the first column of the matrix and then the second, which is continuous and so suits learning
    (Zhou, Barnes, Lu, Yang, Li, "On the Continuity of Rotation Representations in Neural Networks", CVPR 2019).
    """
    if kind == "quaternion":
        return quaternions
    matrices = np.asarray(Rotation.from_quat(quaternions).as_matrix())
    return matrices if kind == "matrix" else np.concatenate([matrices[..., 0], matrices[..., 1]], axis=-1)


def from_represented(values: Array) -> Array:
    """Return the quaternions (..., 4) of rotations in any representation (`represented`); a ValueError for others."""
    if values.shape[-2:] == (3, 3) and values.ndim > 3:
        return Rotation.from_matrix(values.reshape(-1, 3, 3)).as_quat().reshape(*values.shape[:-2], 4)
    if values.shape[-1] == 6:
        one, other = values[..., :3], values[..., 3:]
        return from_represented(np.stack([one, other, np.cross(one, other)], axis=-1))
    return Rotation.from_quat(values.reshape(-1, 4)).as_quat().reshape(values.shape)


def continuous(rotations: Array) -> Array:
    """Return quaternions, (frames, joints, 4), each with the sign that is nearer to the previous frame's."""
    flips = (rotations[1:] * rotations[:-1]).sum(axis=2) < 0
    signs = np.where(np.logical_xor.accumulate(flips, axis=0), -1.0, 1.0)
    return np.concatenate([rotations[:1], rotations[1:] * signs[:, :, None]])
