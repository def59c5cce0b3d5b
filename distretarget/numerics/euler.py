"""Rotations as the angles of BVH channels: continuous over the frames, exact at gimbal lock.

Half angles alpha, beta, gamma about the axes i, j, k of an order: q = q_i(alpha) q_j(beta) q_k(gamma).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled

Array = NDArray[np.float64]

DEGREE = np.pi / 180.0  # [rad]

LOCKED = 1e-13  # below this the sine that separates the first angle from the last is rounding noise
NEARLY_LOCKED = 1e-4  # below this the noise would reach the first two angles where the last is dropped


def euler_angles(rotations: Array, axes: str) -> Array:
    """Return the intrinsic Euler angles of rotations: R = R_axes[0] R_axes[1] R_axes[2].

    Of all angles of a rotation, each frame takes those nearest to the previous frame's, and the first frame the
    smallest. At gimbal lock the first angle keeps its value. Two axes give the first two of three angles, which point
    the third axis as the rotation does; one axis gives the twist about it.

    Args:
        rotations: (frames, 4), unit quaternions x y z w.
        axes: up to three different axes, intrinsic, in the order of the channels: "ZXY", "ZX", "Y", "".

    Returns:
        (frames, len(axes)) [rad].
    """
    if not axes:
        return np.empty((len(rotations), 0))
    order, parity = _order(axes)
    i, j, k = (rotations[:, column] for column in order)
    if len(axes) == 1:
        return _continued(2 * np.arctan2(i, rotations[:, 3])[:, None])
    halves = _half_sums(rotations[:, 3], i, j, parity * k)
    if len(axes) == 2:
        return _continued(_two_angles(halves))
    return _continued(_nearer_twin(_three_angles(halves) * [1, 1, parity]))


def from_euler_angles(angles: Array, axes: str) -> Array:
    """Return the rotations R_axes[0] R_axes[1] R_axes[2], (..., 4), of angles (..., len(axes)) [rad].

    Like scipy's `Rotation.from_euler`, for any number of dimensions and several times as fast.
    """
    rotations = np.empty((*angles.shape[:-1], 4))
    rows = rotations.reshape(-1, 1, 4)
    values, first = np.ascontiguousarray(angles).reshape(len(rows), len(axes)), np.zeros(1, np.intp)
    _write_rotations(values, np.arange(len(axes))[None], 1.0, *_order(axes), first, rows, *_no_turns())
    return rotations


def write_channel_rotations(
    values: Array, columns: NDArray[np.intp], axes: str, joints: NDArray[np.intp], rotations: Array
) -> None:
    """Write the rotations of joints with channels of the same order to `rotations`, (frames, all joints, 4).

    The angles of the `joints`, (joints,), are in the `columns`, (joints, len(axes)), of `values`, (frames, channels)
    [degrees].
    """
    _write_rotations(values, columns, DEGREE, *_order(axes), joints, rotations, *_no_turns())


@compiled()
def _write_rotations(values, columns, unit, order, parity, joints, rotations, cosines, sines):  # type: ignore[no-untyped-def]
    i, j, k = order[0], order[1], order[2]
    for frame in range(len(values)):
        for n in range(len(joints)):
            for axis in range(columns.shape[1]):
                half = unit * values[frame, columns[n, axis]] / 2
                cosines[axis], sines[axis] = np.cos(half), parity * np.sin(half)
            ci, cj, ck = cosines[0], cosines[1], cosines[2]
            si, sj, sk = sines[0], sines[1], sines[2]
            rotation = rotations[frame, joints[n]]
            rotation[i] = parity * (si * cj * ck + ci * sj * sk)
            rotation[j] = parity * (ci * sj * ck - si * cj * sk)
            rotation[k] = parity * (ci * cj * sk + si * sj * ck)
            rotation[3] = ci * cj * ck - si * sj * sk


def _no_turns() -> tuple[Array, Array]:
    """Scratch for cosines and sines of three angles; axes that a joint lacks keep the angle 0."""
    return np.ones(3), np.zeros(3)


def _order(axes: str) -> tuple[NDArray[np.intp], float]:
    """The three axes, as numbers, in an order that begins with `axes`, and the order's parity, 1 or -1."""
    order = axes + "".join(axis for axis in "XYZ" if axis not in axes)
    return np.array(["XYZ".index(axis) for axis in order], np.intp), 1.0 if order in "XYZXY" else -1.0


def restrict(rotations: Array, axes: str) -> Array:
    """The rotations, (frames, 4), that a joint with these channels makes of `rotations`, (frames, 4)."""
    if len(axes) == 3:
        return rotations
    return from_euler_angles(euler_angles(rotations, axes), axes)


class _HalfSums(NamedTuple):
    """Per frame alpha + gamma and alpha - gamma, with gamma times the parity, and sqrt(2) times the sine and the cosine
    of beta + pi/4: where the sine vanishes, the total is undefined, and where the cosine does, the difference.
    """

    total: Array
    difference: Array
    sine: Array
    cosine: Array


def _half_sums(w: Array, i: Array, j: Array, k: Array) -> _HalfSums:
    """The sums from the components of quaternions, with k times the parity of the order.

    (w + j, i + k) = sqrt(2) sin(beta + pi/4) (cos, sin)(alpha + gamma) and
    (w - j, i - k) = sqrt(2) cos(beta + pi/4) (cos, sin)(alpha - gamma), after E. Bernardes and S. Viollet,
    PLoS ONE 17 (2022) e0276302.
    """
    total, difference = np.arctan2(i + k, w + j), np.arctan2(i - k, w - j)
    return _HalfSums(total, difference, np.hypot(w + j, i + k), np.hypot(w - j, i - k))


def _angles(halves: _HalfSums) -> Array:
    """(frames, 3), the angles with the middle one within a right angle; the last one is times the parity."""
    total, difference, sine, cosine = halves
    return np.stack([total + difference, 2 * np.arctan2(sine, cosine) - np.pi / 2, total - difference], axis=1)


def _three_angles(halves: _HalfSums) -> Array:
    """`_angles`, with the first angle held at gimbal lock."""
    total, difference, sine, cosine = halves
    first = _held(total + difference, (sine < LOCKED) | (cosine < LOCKED))
    total = np.where(sine < LOCKED, first - difference, total)
    difference = np.where(cosine < LOCKED, first - total, difference)
    return _angles(halves._replace(total=total, difference=difference))


def _two_angles(halves: _HalfSums) -> Array:
    """(frames, 2), the first two of `_angles` or of their twins, whichever have the last below a right angle. Near the
    lock the last counts as 0, or as half a turn where the twins are taken.
    """
    turned_over = np.cos(halves.total - halves.difference) < 0
    last = np.where(turned_over, np.pi, 0.0)
    total = np.where(halves.sine < NEARLY_LOCKED, halves.difference + last, halves.total)
    difference = np.where(halves.cosine < NEARLY_LOCKED, halves.total - last, halves.difference)
    angles = _angles(halves._replace(total=total, difference=difference))
    return np.where(turned_over[:, None], _twins(angles), angles)[:, :2]


def _held(angles: Array, locked: NDArray[np.bool_]) -> Array:
    """The angles, (frames,), holding the last unlocked value where locked; 0 before the first one."""
    frames = np.arange(1, len(angles) + 1)
    last = np.maximum.accumulate(np.where(locked, 0, frames))
    return np.concatenate([[0.0], angles])[last]


def _nearer_twin(angles: Array) -> Array:
    """(frames, 3), each triple or its twin (a + pi, pi - b, c + pi), whichever is nearer to the previous choice, which
    is (0, 0, 0) before the first frame. Two neighbours either change sides or not, so the choice is a running parity.
    """
    start = np.zeros((1, 3))
    twins = _twins(angles)
    kept = _turns(angles - np.concatenate([start, angles[:-1]]))
    changed = _turns(twins - np.concatenate([start, angles[:-1]]))
    is_twin = np.cumsum(changed < kept) % 2 == 1
    return np.where(is_twin[:, None], twins, angles)


def _twins(angles: Array) -> Array:
    """(frames, 3), the other triples of the same rotations."""
    return angles * [1, -1, 1] + np.pi


def _turns(steps: Array) -> Array:
    """(frames,), the size of steps between angles, (frames, 3), each taken the short way round."""
    sizes: Array = np.linalg.norm(np.remainder(steps + np.pi, 2 * np.pi) - np.pi, axis=1)
    return sizes


def _continued(angles: Array) -> Array:
    """The angles, (frames, n), unwrapped; the first frame takes the angles nearest to 0."""
    start = np.zeros((1, angles.shape[1]))
    return np.unwrap(np.concatenate([start, angles]), axis=0)[1:]
