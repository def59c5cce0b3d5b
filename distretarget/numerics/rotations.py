"""Rotations that bring vectors onto vectors, and rotations as arrays of numbers."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.numerics.vectors import cross, dots, lengths

PULL = 1e-6  # how much the fit of several vectors prefers no rotation, against the vectors


def best_rotation(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(frames, 4), the rotations that take vectors `a` nearest to `b`, both (frames, vectors, 3).

    For one vector the least rotation; for several the Kabsch fit, doi:10.1107/S0567739476001873, drawn to the least by
    `PULL`, which decides where the vectors leave a turn free (all on one line).
    """
    if a.shape[1] == 1:
        return least_rotation(a[:, 0], b[:, 0])
    H = b.transpose(0, 2, 1) @ a
    H += PULL * np.linalg.norm(H, axis=(1, 2))[:, None, None] * np.eye(3)
    return Rotation.from_matrix(nearest_rotations(H)).as_quat()


def nearest_rotations(H: NDArray[np.float64]) -> NDArray[np.float64]:
    """(frames, 3, 3), the rotation matrices nearest to matrices H, (frames, 3, 3): proper ones, without a mirror."""
    U, _, Vt = np.linalg.svd(H)
    U[:, :, 2] *= np.linalg.det(U @ Vt)[:, None]
    return np.asarray(U @ Vt)


def least_rotation(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(frames, 4), the smallest rotations that turn the directions of `a` to those of `b`, both (frames, 3).

    Opposite directions turn about the axis across `a` that is nearest to a coordinate axis; a zero vector is not
    turned.
    """
    scale = lengths(a) * lengths(b)
    cosine = dots(a, b)
    quaternions = np.concatenate([cross(a, b), (scale + cosine)[:, None]], axis=1)
    opposite = scale + cosine <= 1e-12 * scale
    if opposite.any():
        away = a[opposite]
        quaternions[opposite] = np.pad(cross(away, np.eye(3)[np.argmin(np.abs(away), axis=1)]), ((0, 0), (0, 1)))
    quaternions[scale == 0] = [0.0, 0.0, 0.0, 1.0]
    return np.asarray(quaternions / lengths(quaternions)[:, None])


def least(a: NDArray[np.float64], b: NDArray[np.float64]) -> Rotation:
    """The rotation that takes vectors a nearest to b, both (vectors, 3); see `best_rotation`."""
    return Rotation.from_quat(best_rotation(a[None], b[None])[0])


RotationKind = Literal["quaternion", "matrix", "6d"]


def represented(quaternions: NDArray[np.float64], kind: RotationKind) -> NDArray[np.float64]:
    """Unit quaternions (..., 4), x y z w, in another representation: "quaternion" as they are, "matrix" (..., 3, 3), or
    "6d" (..., 6), the first column of the matrix and then the second, which is continuous and so suits learning
    (Zhou, Barnes, Lu, Yang, Li, "On the Continuity of Rotation Representations in Neural Networks", CVPR 2019).

    Raises:
        ValueError: no such kind.
    """
    if kind == "quaternion":
        return quaternions
    matrices = Rotation.from_quat(quaternions).as_matrix()
    match kind:
        case "matrix":
            return np.asarray(matrices)
        case "6d":
            return np.concatenate([matrices[..., 0], matrices[..., 1]], axis=-1)
    raise ValueError(f"no representation {kind!r}; there are {', '.join(get_args(RotationKind))}")
