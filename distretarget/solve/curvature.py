"""The Gauss-Newton curvature of springs with respect to a pose, and its Cholesky factor. Compiled.

The curvature H is the metric in which the spectral gradient method looks for its direction: the energy is nearly round
there, so that few iterations suffice.

Springs act on few joints, their ends. With K, the stiffness matrix of the ends, and P, which turns forces on the ends
into moments of the parts, H = P K P^T: what it takes grows with the ends, and hardly with the number of springs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import inlined
from distretarget.solve.articulation import Articulation, Scratch, to_rotation_vector
from distretarget.solve.spg import copy_to
from distretarget.solve.springs import Springs, is_negligible

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

LEAST_CURVATURE = 0.01  # of any direction, in the metric alone: so no step turns a part right round


@inlined(fastmath=True)
def active_curvature(v: Array, body: Articulation, scratch: Scratch, springs: Springs) -> tuple[Numbers, Array]:
    """The numbers of the active parts at the pose `v`, and their curvature, (3 active, 3 active); `scratch` has the
    posed bones.

    A part is active if a spring acts on it; the last one is the root's place. All others only have their stiffness, so
    that they keep the copy's rotation and are not unknowns.
    """
    way, ends, count = _ways(springs, body)
    active = _active(way, body, scratch)
    K = _end_stiffness(springs, ends, count)
    forces = np.zeros((len(ends), 3, len(K)))
    for joint, end in enumerate(ends):
        if end >= 0:
            for i in range(3):
                copy_to(forces[joint, i], K[3 * end + i])
    moments = _moments(forces, v, body, scratch, way, active)
    forces = np.zeros((len(ends), 3, 3 * len(active)))
    for joint, end in enumerate(ends):
        if end >= 0:
            for part in range(len(active)):
                for i in range(3):
                    for j in range(3):
                        forces[joint, i, 3 * part + j] = moments[part, j, 3 * end + i]
    H = _moments(forces, v, body, scratch, way, active).reshape(3 * len(active), 3 * len(active))
    for row in range(len(H)):
        H[row, row] += max(body.stiffness[active[row // 3]], LEAST_CURVATURE)
    return active, H


@inlined()
def _ways(springs: Springs, body: Articulation) -> tuple[NDArray[np.bool_], Numbers, int]:
    """Which bones turning moves a spring, named by their lower joints, and the root where a spring is tied to the
    world, (joints,); for each joint the number of the end that it is, -1 if it is none, (joints,); how many ends.

    The bones that move a spring between two joints are those on the path between them.
    """
    way, ends = np.zeros(len(body.parents), np.bool_), np.full(len(body.parents), -1)
    for s in range(len(springs.a)):
        if is_negligible(springs.A, s):
            continue
        a, b = springs.a[s], springs.b[s]
        ends[a] = 0
        if b >= 0:
            ends[b] = 0
        while a != b:  # parents come before their children
            if a > b:
                way[a] = True
                a = body.parents[a]
            else:
                way[b] = True
                b = body.parents[b]
    count = 0
    for joint in range(len(ends)):
        if ends[joint] == 0:
            ends[joint] = count
            count += 1
    return way, ends, count


@inlined()
def _active(way: NDArray[np.bool_], body: Articulation, scratch: Scratch) -> Numbers:
    """The parts that carry a bone of `way`, and the root's place if `way` has the root, in ascending order."""
    is_active = np.zeros(len(body.stiffness), np.bool_)
    is_active[-1] = way[0]
    for joint in range(1, len(way)):
        if way[joint] and _has_length(scratch.bones[joint]):
            is_active[body.parts[body.parents[joint]]] = True
    active, count = np.empty(len(is_active), np.intp), 0
    for part in range(len(is_active)):
        if is_active[part]:
            active[count] = part
            count += 1
    return active[:count]


@inlined()
def _has_length(bone: Array) -> bool:
    return bool(bone[0] != 0.0 or bone[1] != 0.0 or bone[2] != 0.0)


@inlined(fastmath=True)
def _end_stiffness(springs: Springs, ends: Numbers, count: int) -> Array:
    """K, (3 count, 3 count): the forces on the ends that small displacements of them cause."""
    K, A = np.zeros((3 * count, 3 * count)), springs.A
    for s in range(len(springs.a)):
        if is_negligible(springs.A, s):
            continue
        a, b = 3 * ends[springs.a[s]], 3 * ends[springs.b[s]] if springs.b[s] >= 0 else -1
        for i in range(3):
            for j in range(3):
                K[a + i, a + j] += A[s, i, j]
                if b >= 0:
                    K[b + i, b + j] += A[s, i, j]
                    K[a + i, b + j] -= A[s, i, j]
                    K[b + i, a + j] -= A[s, i, j]
    return K


@inlined(fastmath=True)
def _moments(forces, v, body, scratch, way, active):  # type: ignore[no-untyped-def]
    """The moments of the active parts, (active, 3, columns), for columns of forces on the joints, (joints, 3, columns),
    which are overwritten; for the root's place the sum of all forces.

    Each column goes through the same as the gradient in `articulation.pose_gradient`.
    """
    columns = forces.shape[2]
    moments = np.zeros((len(active), 3, columns))
    flat = forces.reshape(len(forces), 3 * columns)
    row = np.zeros(len(v), np.intp)
    for p, part in enumerate(active):
        row[part] = p
    for joint in range(len(way) - 1, 0, -1):
        if way[joint]:
            parent = body.parents[joint]
            if _has_length(scratch.bones[joint]):
                _add_moment(scratch.bones[joint], forces[joint], moments[row[body.parts[parent]]])
            _add(flat[joint], flat[parent])
    J = np.empty((3, 3))
    for p, part in enumerate(active):
        if part == len(v) - 1:
            copy_to(moments[p], forces[0])
        else:
            _write_jacobian(v[part], J)
            _transform(J, moments[p])
    return moments


@inlined(fastmath=True)
def _add_moment(bone: Array, forces: Array, moments: Array) -> None:
    """Add bone x force to the moment, in each column."""
    x, y, z = bone
    fx, fy, fz = forces[0], forces[1], forces[2]
    mx, my, mz = moments[0], moments[1], moments[2]
    for c in range(len(fx)):
        a, b, d = fx[c], fy[c], fz[c]
        mx[c] += y * d - z * b
        my[c] += z * a - x * d
        mz[c] += x * b - y * a


@inlined(fastmath=True)
def _add(values: Array, to: Array) -> None:
    for i in range(len(to)):
        to[i] += values[i]


@inlined(fastmath=True)
def _write_jacobian(v: Array, J: Array) -> None:
    """Write the left Jacobian of the exponential map at v: `to_rotation_vector` turns m into J^T m."""
    for i in range(3):
        for j in range(3):
            J[i, j] = 1.0 if i == j else 0.0
        to_rotation_vector(v, J[i])


@inlined(fastmath=True)
def _transform(J: Array, moments: Array) -> None:
    """Replace the moment m in each column by J^T m."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = J[0, 0], J[1, 0], J[2, 0], J[0, 1], J[1, 1], J[2, 1], J[0, 2], J[1, 2], J[2, 2]
    mx, my, mz = moments[0], moments[1], moments[2]
    for c in range(len(mx)):
        a, b, d = mx[c], my[c], mz[c]
        mx[c] = xx * a + xy * b + xz * d
        my[c] = yx * a + yy * b + yz * d
        mz[c] = zx * a + zy * b + zz * d


@inlined(fastmath=True)
def factorise(H: Array) -> None:
    """Replace the upper triangle of H, (3 n, 3 n), by that of its Cholesky factor U, U^T U = H.

    Loops run over slices from their start: numba's loops that begin at another index are not made for vectors.
    """
    for first in range(0, len(H), 3):
        for above in range(0, first, 3):
            if _size(H[above : above + 3, first : first + 3]) > 0.0:
                for i in range(first, first + 3):
                    _eliminate(H[i, i:], H[above, i:], H[above + 1, i:], H[above + 2, i:])
        for i in range(first, first + 3):
            for k in range(first, i):
                _subtract(H[i, i:], H[k, i:])
            _scale(H[i, i:])


@inlined(fastmath=True)
def _size(block: Array) -> float:
    """The sum of the absolute values of a block, (3, 3)."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += abs(block[i, j])
    return total


@inlined(fastmath=True)
def _eliminate(row: Array, a: Array, b: Array, c: Array) -> None:
    """Subtract from a row what three finished rows above it account for; all begin at the diagonal of the row."""
    x, y, z = a[0], b[0], c[0]
    for j in range(len(row)):
        row[j] -= x * a[j] + y * b[j] + z * c[j]


@inlined(fastmath=True)
def _subtract(row: Array, a: Array) -> None:
    """The same for one row above."""
    x = a[0]
    for j in range(len(row)):
        row[j] -= x * a[j]


@inlined(fastmath=True)
def _scale(row: Array) -> None:
    """Divide a row by the square root of its first element."""
    factor = 1.0 / np.sqrt(row[0])
    for j in range(len(row)):
        row[j] *= factor


@inlined(fastmath=True)
def solve_factored(U: Array, active: Numbers, gradient: Array, d: Array) -> None:
    """Write d = H^-1 gradient of the active parts, and zero of the others; U^T U = H."""
    flat = np.empty(len(U))
    for i in range(len(U)):
        flat[i] = gradient[active[i // 3], i % 3]
    for i in range(len(U)):
        row, rest = U[i, i:], flat[i:]
        value = rest[0] / row[0]
        for j in range(len(rest)):
            rest[j] -= value * row[j]
        rest[0] = value
    d[:] = 0.0
    for i in range(len(U) - 1, -1, -1):
        row, rest = U[i, i + 1 :], flat[i + 1 :]
        total = 0.0
        for j in range(len(rest)):
            total += row[j] * rest[j]
        flat[i] = (flat[i] - total) / U[i, i]
        d[active[i // 3], i % 3] = flat[i]
