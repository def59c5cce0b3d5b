"""Quaternions, x y z w as in scipy: products, rotated vectors, and the least rotations between directions."""

from __future__ import annotations

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import F1, F2, F3, I1, Array, Numbers


@inlined()
def multiply(x, y, z, w, q, product):  # type: ignore[no-untyped-def]
    """Write the product of the quaternion x y z w and q; `product` may be q itself."""
    i, j, k, r = q[0], q[1], q[2], q[3]
    product[0] = w * i + x * r + y * k - z * j
    product[1] = w * j - x * k + y * r + z * i
    product[2] = w * k + x * j - y * i + z * r
    product[3] = w * r - x * i - y * j - z * k


@inlined()
def rotated(x, y, z, w, a, b, c):  # type: ignore[no-untyped-def]
    """Return the vector a b c turned by the quaternion x y z w."""
    i, j, k = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2.0 * (w * i + y * k - z * j),
        b + 2.0 * (w * j + z * i - x * k),
        c + 2.0 * (w * k + x * j - y * i),
    )


def turned_by(rotations: Array, vector: Array) -> Array:
    """(frames, 3), a vector, (3,), turned by rotations, (frames, 4)."""
    vectors = np.empty((len(rotations), 3))
    _write_turned(np.ascontiguousarray(rotations), np.ascontiguousarray(vector), vectors)
    return vectors


@compiled()
def _write_turned(rotations: F2, vector: F1, vectors: Out[F2]) -> None:
    for n in range(len(rotations)):
        q = rotations[n]
        vectors[n, 0], vectors[n, 1], vectors[n, 2] = rotated(q[0], q[1], q[2], q[3], vector[0], vector[1], vector[2])


def rotation_products(first: Array, of_first: Numbers, second: Array) -> Array:
    """(frames, joints, 4), the product of the rotation with index `of_first`, (joints,), in `first`, (frames, n, 4),
    and the joint's rotation in `second`, (joints, 4); the identity if `of_first` is negative.
    """
    product = np.empty((len(first), len(second), 4))
    _products(np.ascontiguousarray(first), of_first, second, product)
    return product


@compiled()
def _products(first: F3, of_first: I1, second: F2, product: Out[F3]) -> None:
    for frame in range(len(first)):
        for joint in range(len(of_first)):
            if of_first[joint] >= 0:
                p = first[frame, of_first[joint]]
                multiply(p[0], p[1], p[2], p[3], second[joint], product[frame, joint])
            else:
                for i in range(4):
                    product[frame, joint, i] = 1.0 if i == 3 else 0.0


@compiled()
def first_not_unit(quaternions: F2, error: float) -> int:
    """Return the index of the first quaternion, of (n, 4), whose length is not 1 within `error`; -1 if none is."""
    for n in range(len(quaternions)):
        q = quaternions[n]
        if not abs(np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) - 1.0) < error:
            return n
    return -1


def least_rotation(a: Array, b: Array) -> Array:
    """(frames, 4), the least rotations from the directions of `a` to those of `b`, both (frames, 3).

    Opposite directions rotate about an axis perpendicular to `a` and to a coordinate axis; zero vectors stay.
    """
    quaternions = np.empty((len(a), 4))
    _write_least(np.ascontiguousarray(a), np.ascontiguousarray(b), quaternions)
    return quaternions


@compiled()
def _write_least(a: F2, b: F2, quaternions: Out[F2]) -> None:
    for n in range(len(a)):
        x, y, z = a[n, 0], a[n, 1], a[n, 2]
        u, v, w = b[n, 0], b[n, 1], b[n, 2]
        scale = np.sqrt(x * x + y * y + z * z) * np.sqrt(u * u + v * v + w * w)
        cosine = x * u + y * v + z * w
        i, j, k, r = y * w - z * v, z * u - x * w, x * v - y * u, scale + cosine
        if scale + cosine <= 1e-12 * scale:
            if abs(x) <= abs(y) and abs(x) <= abs(z):
                i, j, k, r = 0.0, z, -y, 0.0
            elif abs(y) <= abs(z):
                i, j, k, r = -z, 0.0, x, 0.0
            else:
                i, j, k, r = y, -x, 0.0, 0.0
        if scale == 0.0:
            i, j, k, r = 0.0, 0.0, 0.0, 1.0
        size = np.sqrt(i * i + j * j + k * k + r * r)
        quaternions[n, 0], quaternions[n, 1], quaternions[n, 2] = i / size, j / size, k / size
        quaternions[n, 3] = r / size
