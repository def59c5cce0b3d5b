"""Rotations as the angles of BVH channels: continuous over the frames, exact at gimbal lock.

Half angles alpha, beta, gamma about the axes i, j, k of an order: q = q_i(alpha) q_j(beta) q_k(gamma).
"""

from __future__ import annotations

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.vectors import F1, F2, F3, I1, I2, Array, Numbers

DEGREE, RADIAN = np.pi / 180.0, 180.0 / np.pi  # [rad], [degrees]
TURN = 2.0 * np.pi

LOCKED = 1e-13  # a smaller sine between the first and the last angle is rounding noise
NEARLY_LOCKED = 1e-4  # with a smaller one, noise would reach the first two angles if the last is dropped


def euler_angles(rotations: Array, axes: str) -> Array:
    """Return the intrinsic Euler angles, (frames, len(axes)) [rad], of rotations, (frames, 4): R = R_axes[0] R_axes[1]
    R_axes[2], with up to three different `axes` in the order of the channels: "ZXY", "ZX", "Y", "".

    Of the triples of angles of a rotation, each frame takes the one nearest to the previous frame's, and the first the
    smallest. At gimbal lock the first angle keeps its value. Two axes give the first two of three angles, which orient
    the third axis; one axis gives the twist about it.
    """
    if not axes:
        return np.empty((len(rotations), 0))
    if len(axes) == 1:
        return _continued(2 * np.arctan2(rotations[:, "XYZ".index(axes)], rotations[:, 3])[:, None])
    if len(axes) == 2:
        return _continued(_two_angles(*_half_sums(rotations, axes)))
    angles, joint, columns = np.empty((len(rotations), 3)), np.zeros(1, np.intp), np.arange(3)[None]
    write_channel_angles(rotations[:, None], joint, axes, columns, angle_state(1), angles, unit=1.0)
    return angles


def angle_state(joints: int) -> Array:
    """Return the initial state of `write_channel_angles`, (joints, 11)."""
    return np.zeros((joints, 11))


def write_channel_angles(
    rotations: Array, joints: Numbers, axes: str, columns: Numbers, state: Array, values: Array, unit: float = RADIAN
) -> None:
    """Write the angles of joints with three channels of the same order to `values`, (frames, channels) [degrees, or any
    `unit` per radian]; the inverse of `write_channel_rotations`, see `euler_angles`.

    The `rotations` are (frames, all joints, 4); the angles of the `joints`, (joints,), go to the `columns`, (joints,
    3). The `state` (`angle_state`) is updated to that of the last frame, to continue with the next frames.
    """
    _, parity = _order(axes)
    for block in blocks_of(len(rotations)):
        halves = np.empty((6, block.stop - block.start, len(joints)))
        halves[:4] = _half_sums(rotations[block][:, joints], axes)
        halves[4:] = np.hypot(halves[:4:2], halves[1:4:2])
        halves[:3] = np.arctan2(halves[::2], halves[1::2])
        _write_angles(halves, parity, state, unit, columns, values[block])


def _half_sums(rotations: Array, axes: str) -> tuple[Array, Array, Array, Array]:
    """(...), i + k, w + j, i - k and w - j of quaternions (..., 4), with i, j, k in the order of the axes, and k and
    gamma multiplied by its parity.

    (w + j, i + k) = sqrt(2) sin(beta + pi/4) (cos, sin)(alpha + gamma) and
    (w - j, i - k) = sqrt(2) cos(beta + pi/4) (cos, sin)(alpha - gamma), after E. Bernardes and S. Viollet,
    PLoS ONE 17 (2022) e0276302. Where the sine vanishes, the total alpha + gamma is undefined, and where the cosine
    does, the difference.
    """
    order, parity = _order(axes)
    i, j, k, w = (rotations[..., column] for column in (*order, 3))
    return i + parity * k, w + j, i - parity * k, w - j


@compiled()
def _write_angles(halves: F3, parity: float, state: Out[F2], unit: float, columns: I2, values: Out[F2]) -> None:
    """Write the angles of a block of frames, continued from frame to frame.

    `halves`, (6, frames, joints), are the total and the difference of the half angles, half of the middle angle, and
    from row 4 on the sine and the cosine of `_half_sums`. `state`, (joints, 11), is that of the last frame: its angles,
    the chosen ones, the whole turns added to these, the first angle to hold at gimbal lock, and the choice of the twin.

    At gimbal lock the first angle is held. Of each triple and its twin (a + pi, pi - b, c + pi), the one nearer to the
    previous frame's choice is taken. It is found by whether the choice changes between neighbouring frames.
    """
    for frame in range(halves.shape[1]):
        for n in range(len(columns)):
            last, total, difference = state[n], halves[0, frame, n], halves[1, frame, n]
            if halves[4, frame, n] < LOCKED or halves[5, frame, n] < LOCKED:
                if halves[4, frame, n] < LOCKED:
                    total = last[9] - difference
                if halves[5, frame, n] < LOCKED:
                    difference = last[9] - total
            else:
                last[9] = total + difference
            a, b, c = total + difference, 2.0 * halves[2, frame, n] - np.pi / 2, parity * (total - difference)
            same = _turn(a - last[0]) ** 2 + _turn(b - last[1]) ** 2 + _turn(c - last[2]) ** 2
            other = _turn(a + np.pi - last[0]) ** 2 + _turn(np.pi - b - last[1]) ** 2
            if other + _turn(c + np.pi - last[2]) ** 2 < same:
                last[10] = 1.0 - last[10]
            last[0], last[1], last[2] = a, b, c
            if last[10] > 0.0:
                a, b, c = a + np.pi, np.pi - b, c + np.pi
            for i in range(3):
                angle = a if i == 0 else b if i == 1 else c
                step = angle - last[3 + i]
                if abs(step) >= np.pi:
                    short = np.remainder(step + np.pi, TURN) - np.pi
                    last[6 + i] += (np.pi if short == -np.pi and step > 0.0 else short) - step
                last[3 + i] = angle
                values[frame, columns[n, i]] = unit * (angle + last[6 + i])


@inlined()
def _turn(step: float) -> float:
    """A step between angles, from -pi to pi."""
    return step - TURN * np.rint(step / TURN)  # type: ignore[no-any-return]


def from_euler_angles(angles: Array, axes: str) -> Array:
    """Return the rotations, (..., 4), of angles (..., len(axes)) [rad]: `Rotation.from_euler`, but far faster."""
    rotations = np.empty((*angles.shape[:-1], 4))
    rows, columns = rotations.reshape(-1, 1, 4), np.arange(len(axes))[None]
    values = np.ascontiguousarray(angles).reshape(len(rows), len(axes))
    write_channel_rotations(values, columns, axes, np.zeros(1, np.intp), rows, unit=1.0)
    return rotations


def write_channel_rotations(
    values: Array, columns: Numbers, axes: str, joints: Numbers, rotations: Array, unit: float = DEGREE
) -> None:
    """Write the rotations of joints with channels of the same order to `rotations`, (frames, all joints, 4).

    The angles of the `joints`, (joints,), are in the `columns`, (joints, len(axes)), of `values`, (frames, channels)
    [degrees, or any `unit` in radians]. Axes that a joint lacks keep the angle 0.
    """
    cosines, sines = np.ones(3), np.zeros(3)
    columns = np.ascontiguousarray(columns)
    _write_rotations(values, columns, unit, *_order(axes), joints, rotations, cosines, sines)


@compiled()
def _write_rotations(
    values: F2,
    columns: I2,
    unit: float,
    order: I1,
    parity: float,
    joints: I1,
    rotations: Out[F3],
    cosines: Out[F1],
    sines: Out[F1],
) -> None:
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


def _order(axes: str) -> tuple[Numbers, float]:
    """The three axes, as numbers, in an order that begins with `axes`, and the order's parity, 1 or -1."""
    order = axes + "".join(axis for axis in "XYZ" if axis not in axes)
    return np.array(["XYZ".index(axis) for axis in order], np.intp), 1.0 if order in "XYZXY" else -1.0


def restrict(rotations: Array, axes: str) -> Array:
    """The rotations, (frames, 4), that a joint with channels about `axes` has for `rotations`, (frames, 4)."""
    if len(axes) == 3:
        return rotations
    return from_euler_angles(euler_angles(rotations, axes), axes)


def _two_angles(a: Array, b: Array, c: Array, d: Array) -> Array:
    """(frames, 2), the first two angles of the triple, or of its twin, whose last angle is below a right angle. Near
    gimbal lock the last angle counts as 0, or as pi if the twin is taken. a to d are the `_half_sums`, (frames,) each.
    """
    total, difference, sine, cosine = np.arctan2(a, b), np.arctan2(c, d), np.hypot(b, a), np.hypot(d, c)
    turned_over = np.cos(total - difference) < 0
    last = np.where(turned_over, np.pi, 0.0)
    sure_total = np.where(sine < NEARLY_LOCKED, difference + last, total)
    sure_difference = np.where(cosine < NEARLY_LOCKED, total - last, difference)
    first, middle = sure_total + sure_difference, 2 * np.arctan2(sine, cosine) - np.pi / 2
    return np.where(turned_over, [first + np.pi, np.pi - middle], [first, middle]).T


def _continued(angles: Array) -> Array:
    """The angles, (frames, n), unwrapped; the first frame takes the angles nearest to 0."""
    start = np.zeros((1, angles.shape[1]))
    return np.unwrap(np.concatenate([start, angles]), axis=0)[1:]
