"""Rotations as the angles of BVH channels: continuous over the frames, exact at gimbal lock.

Half angles alpha, beta, gamma about the axes i, j, k of an order: q = q_i(alpha) q_j(beta) q_k(gamma).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

LOCKED = 1e-13
"""Below it the sine that separates the first angle from the last is rounding noise."""


def euler_angles(rotations: Array, axes: str) -> Array:
    """The angles whose rotations multiply to the given ones: R = R_axes[0] R_axes[1] R_axes[2].

    Of the angles that give the same rotation each frame takes those nearest to the previous frame's; the
    first takes the smallest. At gimbal lock the first angle carries on from the previous frame. Fewer than
    three axes give the nearest rotation they can make: that of a full order with the last angles dropped.

    Args:
        rotations: (frames, 4), unit quaternions x y z w.
        axes: up to three different axes, intrinsic, in the order of the channels: "ZXY", "ZX", "Y", "".

    Returns:
        (frames, len(axes)) [rad].
    """
    if not axes:
        return np.empty((len(rotations), 0))
    order = axes + "".join(axis for axis in "XYZ" if axis not in axes)
    parity = 1.0 if order in "XYZXY" else -1.0
    i, j, k = (rotations[:, "XYZ".index(axis)] for axis in order)
    w = rotations[:, 3]
    if len(axes) == 1:
        return _continued(2 * np.arctan2(i, w)[:, None])
    if len(axes) == 2:
        total, difference = np.arctan2(i + j, w - parity * k), np.arctan2(i - j, w + parity * k)
        return _continued(np.stack([total + difference, total - difference], axis=1))
    return _three_angles(w, i, j, parity * k, parity)


def restrict(rotations: Array, axes: str) -> Array:
    """What is left of rotations (frames, 4) on a joint with these channels only; (frames, 4), x y z w."""
    if len(axes) == 3:
        return rotations
    if not axes:
        return np.tile([0.0, 0.0, 0.0, 1.0], (len(rotations), 1))
    return np.asarray(Rotation.from_euler(axes, euler_angles(rotations, axes)).as_quat())


def _three_angles(w: Array, i: Array, j: Array, k: Array, parity: float) -> Array:
    """Angles (frames, 3) from the quaternions' parts, the last one times the parity of the order.

    (w + j, i + k) = sqrt(2) sin(beta + pi/4) (cos, sin)(alpha + parity gamma) and
    (w - j, i - k) = sqrt(2) cos(beta + pi/4) (cos, sin)(alpha - parity gamma): no angle of these is lost to
    rounding but where its factor vanishes, and there it does not matter (E. Bernardes, S. Viollet, PLoS ONE
    17 (2022) e0276302).
    """
    total, difference = np.arctan2(i + k, w + j), np.arctan2(i - k, w - j)
    sine, cosine = np.hypot(w + j, i + k), np.hypot(w - j, i - k)
    first = _held(total + difference, (sine < LOCKED) | (cosine < LOCKED))
    total = np.where(sine < LOCKED, first - difference, total)
    difference = np.where(cosine < LOCKED, first - total, difference)
    angles = np.stack(
        [first, 2 * np.arctan2(sine, cosine) - np.pi / 2, parity * (total - difference)], axis=1
    )
    return _continued(_nearer_twin(angles))


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
    twins = angles * [1, -1, 1] + np.pi
    kept = _turns(angles - np.concatenate([start, angles[:-1]]))
    changed = _turns(twins - np.concatenate([start, angles[:-1]]))
    is_twin = np.cumsum(changed < kept) % 2 == 1
    return np.where(is_twin[:, None], twins, angles)


def _turns(steps: Array) -> Array:
    """The size (frames,) of steps between angles (frames, 3), each taken the short way round."""
    return np.linalg.norm(np.remainder(steps + np.pi, 2 * np.pi) - np.pi, axis=1)


def _continued(angles: Array) -> Array:
    """The angles (frames, n) plus the whole turns that bring each nearest to the frame before."""
    start = np.zeros((1, angles.shape[1]))
    return np.unwrap(np.concatenate([start, angles]), axis=0)[1:]
