"""Types of arrays, and lengths, directions, products and angles of vectors; components are the last axis.

The functions are faster than numpy's `norm` along a short last axis, and than its `cross` for few vectors. Compiled
functions say how many axes an array has: F2 is a contiguous array of floats with two.
"""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import ArrayKind, Out, compiled, inlined

Value = TypeVar("Value", bound=np.generic)

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
Flags = NDArray[np.bool_]
Letters = NDArray[np.uint8]

F1 = Annotated[Array, ArrayKind("float64", 1)]
F2 = Annotated[Array, ArrayKind("float64", 2)]
F3 = Annotated[Array, ArrayKind("float64", 3)]
F4 = Annotated[Array, ArrayKind("float64", 4)]
I1 = Annotated[Numbers, ArrayKind("intp", 1)]
I2 = Annotated[Numbers, ArrayKind("intp", 2)]
B1 = Annotated[Flags, ArrayKind("bool", 1)]
B2 = Annotated[Flags, ArrayKind("bool", 2)]
B3 = Annotated[Flags, ArrayKind("bool", 3)]
I3 = Annotated[Numbers, ArrayKind("intp", 3)]
S2 = Annotated[NDArray[np.int32], ArrayKind("int32", 2)]
L1 = Annotated[Letters, ArrayKind("uint8", 1)]


def lengths(vectors: Array) -> Array:
    """The lengths of vectors (..., n), (...)."""
    squares = np.zeros(vectors.shape[:-1])
    for i in range(vectors.shape[-1]):
        squares += vectors[..., i] ** 2
    return np.sqrt(squares)


def extent(values: Array) -> float:
    """The largest absolute value; 0 without values, nan if any of them is."""
    return float(max(values.max(initial=0.0), -values.min(initial=0.0)))


def normalised(vectors: Array) -> Array:
    """Vectors of length 1 in the same directions, (..., n); a zero vector stays zero."""
    sizes = lengths(vectors)[..., None]
    return np.asarray(np.divide(vectors, sizes, out=np.zeros_like(vectors), where=sizes > 0))


def cross(a: Array, b: Array) -> Array:
    """The cross products of vectors (..., 3)."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def level(vectors: Array, up: Array) -> Array:
    """The horizontal components of vectors (..., 3), perpendicular to the unit vector up, (3,)."""
    return np.asarray(vectors - (vectors @ up)[..., None] * up)


def angles_between(a: Array, b: Array) -> Array:
    """The angles between vectors (..., n) of one shape, (...) [rad]; 0 for a zero vector. Accurate for all angles:
    half an angle is that of the diagonals of a rhombus (W. Kahan).
    """
    diagonals = np.empty((2, *a.shape[:-1]))
    one, other = (np.ascontiguousarray(each).reshape(-1, a.shape[-1]) for each in (a, b))
    _write_diagonals(one, other, diagonals.reshape(2, -1))
    return np.asarray(2.0 * np.arctan2(*diagonals))


@compiled()
def _write_diagonals(a: F2, b: F2, diagonals: Out[F2]) -> None:
    """Write the lengths of the diagonals of rhombi whose sides have the directions of a and b."""
    for n in range(len(a)):
        p = q = less = more = 0.0
        for i in range(a.shape[1]):
            p += a[n, i] * a[n, i]
            q += b[n, i] * b[n, i]
        p, q = np.sqrt(p), np.sqrt(q)
        for i in range(a.shape[1]):
            u, v = a[n, i] * q, b[n, i] * p
            less += (u - v) * (u - v)
            more += (u + v) * (u + v)
        diagonals[0, n], diagonals[1, n] = np.sqrt(less), np.sqrt(more)


def farthest_points(points: Array, most: int) -> Numbers:
    """Return the indices of up to `most` points, (points, dimensions), by farthest-point sampling from the first."""
    chosen, away = [0], np.full(len(points), np.inf)
    while len(chosen) < min(most, len(points)):
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(away.argmax()))
    return np.array(chosen, np.intp)


def bisected(places: Array, on: Numbers, most: int) -> list[Numbers]:
    """Return the indices `on` of places, (n, 3), in groups of `most` at most, bisected along the longest extent."""
    if len(on) <= most:
        return [on]
    in_line = on[np.argsort(places[on, np.ptp(places[on], axis=0).argmax()], kind="stable")]
    half = len(on) // 2
    return bisected(places, in_line[:half], most) + bisected(places, in_line[half:], most)


def read_only(array: NDArray[Value]) -> NDArray[Value]:
    """Return a view that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


@inlined()
def copy_to(target: Array, source: Array) -> None:
    """target[:] = source, for contiguous arrays of one shape."""
    flat_source, flat_target = source.flat, target.flat
    for i in range(source.size):
        flat_target[i] = flat_source[i]


@inlined()
def clear(array: NDArray[Any]) -> None:
    """array[:] = 0, for a contiguous array."""
    flat = array.flat
    for i in range(array.size):
        flat[i] = 0
