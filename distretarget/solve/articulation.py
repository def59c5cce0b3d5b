"""The articulated body: rigid parts that turn on exact bones, and how points pull at them. Compiled.

A part is a joint with the joints that never turn against it. A pose is how far each part deviates from the rotation
copy, a rotation vector in the world [rad], and after the parts how far the root is moved: an array (parts + 1, 3).
World rotations as unknowns leave the deviations independent: R_j = exp(v_part(j)) RC_j, so that a bone of the copy, b,
becomes exp(v) b and nothing but the copy's bones is needed to pose the body.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion, rigid_motion
from distretarget.numerics.kinematics import local_rotations, rotation_products
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

STILL = 2e-5  # a joint whose local quaternion moves by no more than this, the rounding of files, is still ...
SPIKES = 0.05  # ... whatever it does in this part of the frames, which may be bad ones
SMALL = 1e-8  # squared angles below this [rad^2] are served by the first terms of a series


class Body(NamedTuple):
    """A body for the compiled functions. Lengths are in units of the solver.

    Attributes:
        parents: (joints,), -1 for the root.
        parts: (joints,), the part that carries the bones below each joint.
        holds: (parts + 1,), how strongly each part keeps to the copy's rotation, and the root to its path.
    """

    parents: NDArray[np.intp]
    parts: NDArray[np.intp]
    holds: Array


class Work(NamedTuple):
    """Scratch arrays of one body.

    Attributes:
        x: (joints, 3), positions.
        bones: (joints, 3), the posed bone from the parent to each joint.
        turns: (parts, 9), exp(v) of each part, row by row.
        pull: (joints, 3), the gradient with respect to positions; `pull_back` sums it up towards the root.
        arms: (joints, parts, 3), how each joint's position hangs on each part; see `hang`.
    """

    x: Array
    bones: Array
    turns: Array
    pull: Array
    arms: Array


def rigid_heads(copy: Motion) -> NDArray[np.intp]:
    """(joints,), the joint with which each joint deviates as one rigid part: itself, unless it does not turn against
    its parent in the motion (hip joints and collars of many rigs) or cannot, having no rotation channels.

    In a motion in which no joint turns, as in a single frame, only joints that coincide with their parents are rigid.
    """
    skeleton = copy.skeleton
    signs = np.sign(np.einsum("fji,ji->fj", copy.rotations, copy.rotations[0]))
    rotations = signs[..., None] * copy.rotations
    turned = np.linalg.norm(rotations - np.median(rotations, axis=0), axis=2) > STILL
    still = turned.mean(axis=0) <= SPIKES
    if still.all():
        still = skeleton.lengths == 0.0
    still |= np.array([not skeleton.rotation_axes(joint) for joint in range(len(skeleton))])
    heads = np.arange(len(skeleton))
    for joint in range(1, len(skeleton)):
        if still[joint] and skeleton.children[joint]:
            heads[joint] = heads[skeleton.parents[joint]]
    return heads


def _leaves(skeleton: Skeleton) -> NDArray[np.bool_]:
    return np.array([not below for below in skeleton.children])


def _unturned(copy: Motion) -> NDArray[np.bool_]:
    """(joints,), whether a joint never leaves its rest rotation, as twist joints that nothing drives."""
    return np.asarray(np.abs(copy.rotations[..., :3]).max(axis=(0, 2)) < STILL)


def parts_of(skeleton: Skeleton, heads: NDArray[np.intp]) -> NDArray[np.intp]:
    """(joints,), the number of the part that carries the bones below each joint; parts count from the root down, and a
    leaf, which carries none, belongs to its parent's.
    """
    carriers = np.array([joint if below else skeleton.parents[joint] for joint, below in enumerate(skeleton.children)])
    numbers: NDArray[np.intp] = np.unique(heads[np.maximum(carriers, 0)], return_inverse=True)[1]
    return numbers


def subtree_lengths(skeleton: Skeleton, carried: NDArray[np.intp]) -> Array:
    """(joints,), the sum of the lengths of all bones below each joint and of its own [file units], as far as they carry
    any of the joints `carried`: no tails, props and other helpers.
    """
    sums = np.zeros(len(skeleton))
    on_the_way = [*{joint for tip in carried for joint in skeleton.line(int(tip))}]
    sums[on_the_way] = skeleton.lengths[on_the_way]
    for joint in range(len(skeleton) - 1, 0, -1):
        sums[skeleton.parents[joint]] += sums[joint]
    return sums


def posed_motion(copy: Motion, v: Array, parts: NDArray[np.intp], root_positions: Array) -> Motion:
    """The motion whose parts deviate from the copy's rotations by `v`, (frames, parts + 1, 3).

    Leaves keep the copy's world rotations, since nothing hangs on them, unless they never turn against their parents.
    `root_positions`, (frames, 3), are final.
    """
    skeleton = copy.skeleton
    turns = Rotation.from_rotvec(v[:, :-1]).as_quat()[:, parts]
    turns[:, _leaves(skeleton) & ~_unturned(copy)] = [0.0, 0.0, 0.0, 1.0]
    world = rotation_products(turns, copy.world_rotations)
    return rigid_motion(skeleton, root_positions, local_rotations(skeleton.parents, world), copy.frame_time_text)


@njit(cache=True)
def workspace(joints: int, parts: int) -> Work:
    """Scratch arrays for a body of so many joints and parts."""
    return Work(
        np.zeros((joints, 3)),
        np.zeros((joints, 3)),
        np.zeros((parts, 9)),
        np.zeros((joints, 3)),
        np.zeros((joints, parts, 3)),
    )


@njit(cache=True, error_model="numpy", fastmath=True)
def pose_body(v: Array, body: Body, bones: Array, root: Array, work: Work) -> None:
    """Positions and posed bones, written to `work`, of the pose `v` of a frame.

    The frame's copy has `bones`, (joints, 3), from each joint's parent to it, and its root at `root`.
    """
    parts = len(work.turns)
    for part in range(parts):
        _exp(v[part, 0], v[part, 1], v[part, 2], work.turns[part])
    for i in range(3):
        work.x[0, i] = root[i] + v[parts, i]
    for joint in range(1, len(body.parents)):
        parent = body.parents[joint]
        E = work.turns[body.parts[parent]]
        bx, by, bz = bones[joint, 0], bones[joint, 1], bones[joint, 2]
        for i in range(3):
            work.bones[joint, i] = E[3 * i] * bx + E[3 * i + 1] * by + E[3 * i + 2] * bz
            work.x[joint, i] = work.x[parent, i] + work.bones[joint, i]


@njit(cache=True, error_model="numpy", fastmath=True)
def _exp(x: float, y: float, z: float, E: Array) -> None:
    """The rotation matrix of a rotation vector (Rodrigues), row by row."""
    square = x * x + y * y + z * z
    if square < SMALL:
        a, b = 1.0 - square / 6.0, 0.5 - square / 24.0
    else:
        angle = np.sqrt(square)
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
    E[0], E[1], E[2] = 1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y
    E[3], E[4], E[5] = b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x
    E[6], E[7], E[8] = b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)


@njit(cache=True, error_model="numpy", fastmath=True)
def pull_back(v: Array, body: Body, work: Work, gradient: Array) -> float:
    """Turn the gradient with respect to positions, `work.pull`, into that with respect to the pose, written, add what
    the holds 1/2 h |v|^2 contribute, and return their value.

    A bone b of a part turns by dw about its upper end, which moves all that hangs on it by dw x b: the part feels the
    moment b x (sum of the pulls below). dw = J dv with the left Jacobian of the exponential map, so that the gradient
    is J^T times the moment.
    """
    parts = len(work.turns)
    gradient[:] = 0.0
    for joint in range(len(body.parents) - 1, 0, -1):
        parent = body.parents[joint]
        part = body.parts[parent]
        sx, sy, sz = work.pull[joint, 0], work.pull[joint, 1], work.pull[joint, 2]
        bx, by, bz = work.bones[joint, 0], work.bones[joint, 1], work.bones[joint, 2]
        gradient[part, 0] += by * sz - bz * sy
        gradient[part, 1] += bz * sx - bx * sz
        gradient[part, 2] += bx * sy - by * sx
        for i in range(3):
            work.pull[parent, i] += work.pull[joint, i]
    for part in range(parts):
        _to_rotation_vector(v[part], gradient[part])
    for i in range(3):
        gradient[parts, i] = work.pull[0, i]
    value = 0.0
    for part in range(parts + 1):
        for i in range(3):
            gradient[part, i] += body.holds[part] * v[part, i]
            value += 0.5 * body.holds[part] * v[part, i] * v[part, i]
    return value


@njit(cache=True, error_model="numpy", fastmath=True)
def _to_rotation_vector(v: Array, m: Array) -> None:
    """J^T m in place of the moment m, where J^T = I - a [v] + b [v]^2."""
    x, y, z = v[0], v[1], v[2]
    square = x * x + y * y + z * z
    if square < SMALL:
        a, b = 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        angle = np.sqrt(square)
        a, b = (1.0 - np.cos(angle)) / square, (angle - np.sin(angle)) / (square * angle)
    cx, cy, cz = y * m[2] - z * m[1], z * m[0] - x * m[2], x * m[1] - y * m[0]
    m[0] += b * (y * cz - z * cy) - a * cx
    m[1] += b * (z * cx - x * cz) - a * cy
    m[2] += b * (x * cy - y * cx) - a * cz


@njit(cache=True, error_model="numpy", fastmath=True)
def hang(body: Body, work: Work) -> None:
    """For the pose in `work`, the arms: the sum of the bones of each part on the way to each joint. A small turn w of
    the part moves the joint by w x arm.
    """
    work.arms[:] = 0.0
    for joint in range(1, len(body.parents)):
        parent = body.parents[joint]
        for part in range(len(work.turns)):
            for i in range(3):
                work.arms[joint, part, i] = work.arms[parent, part, i]
        for i in range(3):
            work.arms[joint, body.parts[parent], i] += work.bones[joint, i]
