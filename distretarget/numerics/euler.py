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

LOCKED = 1e-13
"""Below it the sine that separates the first angle from the last is rounding noise."""

NEARLY_LOCKED = 1e-4
"""Below it that noise would reach angles whose last one is dropped."""


def euler_angles(rotations: Array, axes: str) -> Array:
    """The angles whose rotations multiply to the given ones: R = R_axes[0] R_axes[1] R_axes[2].

    Of the angles that give the same rotation each frame takes those nearest to the previous frame's; the
    first takes the smallest. At gimbal lock the first angle carries on from the previous frame.

    Two axes give the first two of three angles, which leave the missing axis where the rotation takes it;
    one axis gives the twist, the nearest rotation about it.

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
    """The rotations R_axes[0] R_axes[1] R_axes[2] of angles (..., len(axes)) [rad]; (..., 4), x y z w.

    It is `Rotation.from_euler` of scipy for arrays with any number of dimensions, and several times as fast.
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
    """The cosines and sines of three angles of 0, to be overwritten by those of as many axes as a joint has."""
    return np.ones(3), np.zeros(3)


def _order(axes: str) -> tuple[NDArray[np.intp], float]:
    """The numbers of three axes that begin with the given ones, and the parity of their order, 1 or -1."""
    order = axes + "".join(axis for axis in "XYZ" if axis not in axes)
    return np.array(["XYZ".index(axis) for axis in order], np.intp), 1.0 if order in "XYZXY" else -1.0


def restrict(rotations: Array, axes: str) -> Array:
    """What is left of rotations (frames, 4) on a joint with these channels only; (frames, 4), x y z w."""
    if len(axes) == 3:
        return rotations
    return from_euler_angles(euler_angles(rotations, axes), axes)


class _HalfSums(NamedTuple):
    """Per frame alpha + gamma and alpha - gamma, gamma times the parity of the order, and
    sin and cos of beta + pi/4 times sqrt(2): where these vanish, the angle above them is lost.
    """

    total: Array
    difference: Array
    sine: Array
    cosine: Array


def _half_sums(w: Array, i: Array, j: Array, k: Array) -> _HalfSums:
    """The sums from the parts of the quaternions, k times the parity of the order.

    (w + j, i + k) = sqrt(2) sin(beta + pi/4) (cos, sin)(alpha + gamma) and
    (w - j, i - k) = sqrt(2) cos(beta + pi/4) (cos, sin)(alpha - gamma), after E. Bernardes and S. Viollet,
    PLoS ONE 17 (2022) e0276302.
    """
    total, difference = np.arctan2(i + k, w + j), np.arctan2(i - k, w - j)
    return _HalfSums(total, difference, np.hypot(w + j, i + k), np.hypot(w - j, i - k))


def _angles(halves: _HalfSums) -> Array:
    """Angles (frames, 3), the middle one within a right angle, the last one times the parity."""
    total, difference, sine, cosine = halves
    return np.stack([total + difference, 2 * np.arctan2(sine, cosine) - np.pi / 2, total - difference], axis=1)


def _three_angles(halves: _HalfSums) -> Array:
    """`_angles` with a first one that carries on at the lock."""
    total, difference, sine, cosine = halves
    first = _held(total + difference, (sine < LOCKED) | (cosine < LOCKED))
    total = np.where(sine < LOCKED, first - difference, total)
    difference = np.where(cosine < LOCKED, first - total, difference)
    return _angles(halves._replace(total=total, difference=difference))


def _two_angles(halves: _HalfSums) -> Array:
    """The first two (frames, 2) of `_angles` or their twins, whose last is below a right angle.

    Near the lock the last is taken for zero, before the choice for zero or half a turn.
    """
    turned_over = np.cos(halves.total - halves.difference) < 0
    last = np.where(turned_over, np.pi, 0.0)
    total = np.where(halves.sine < NEARLY_LOCKED, halves.difference + last, halves.total)
    difference = np.where(halves.cosine < NEARLY_LOCKED, halves.total - last, halves.difference)
    angles = _angles(halves._replace(total=total, difference=difference))
    return np.where(turned_over[:, None], _twins(angles), angles)[:, :2]


def _held(angles: Array, locked: NDArray[np.bool_]) -> Array:
    """The angles (frames,), where locked the last one that was not; 0 before the first."""
    frames = np.arange(1, len(angles) + 1)
    last = np.maximum.accumulate(np.where(locked, 0, frames))
    return np.concatenate([[0.0], angles])[last]


def _nearer_twin(angles: Array) -> Array:
    """Each triple (frames, 3) or its twin (a + pi, pi - b, c + pi), whichever is nearer to the choice before.

    Between two triples it only matters whether one of them is a twin, so that the choices are the running
    parity of the changes. The choice before the first frame is (0, 0, 0).
    """
    start = np.zeros((1, 3))
    twins = _twins(angles)
    kept = _turns(angles - np.concatenate([start, angles[:-1]]))
    changed = _turns(twins - np.concatenate([start, angles[:-1]]))
    is_twin = np.cumsum(changed < kept) % 2 == 1
    return np.where(is_twin[:, None], twins, angles)


def _twins(angles: Array) -> Array:
    """The other triples (frames, 3) of the same rotations."""
    return angles * [1, -1, 1] + np.pi


def _turns(steps: Array) -> Array:
    """The size (frames,) of steps between angles (frames, 3), each taken the short way round."""
    sizes: Array = np.linalg.norm(np.remainder(steps + np.pi, 2 * np.pi) - np.pi, axis=1)
    return sizes


def _continued(angles: Array) -> Array:
    """The angles (frames, n) plus the whole turns that bring each nearest to the frame before."""
    start = np.zeros((1, angles.shape[1]))
    return np.unwrap(np.concatenate([start, angles]), axis=0)[1:]
