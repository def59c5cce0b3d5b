"""The articulated body of inverse kinematics: forward kinematics and gradients of rigid parts. Compiled.

A pose is an array (parts + 1, 3): the deviation of each part from the rotation copy as a rotation vector in the world
[rad], and last the displacement of the root. World rotations as unknowns make the deviations independent of each other:
R_j = exp(v_part(j)) RC_j. A bone b of the rotation copy becomes exp(v) b, so posing needs only the copy's bones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import inlined
from distretarget.numerics.vectors import F1, F2, I1, Array

SMALL = 1e-8  # [rad^2] below this squared angle, Taylor series replace sine and cosine


class Articulation(NamedTuple):
    """The joints and rigid parts of a body, for the compiled functions. Lengths are in units of the solver."""

    parents: I1  # (joints,), -1 for the root
    parts: I1  # (joints,), the part that carries the bones below each joint
    stiffness: F1  # (parts + 1,), h, of each part's rotation against the rotation copy; last, of the root's path


class Scratch(NamedTuple):
    """Arrays that the compiled functions write to, for one body."""

    x: F2  # (joints, 3), positions
    bones: F2  # (joints, 3), the posed bone from the parent to each joint
    rotations: F2  # (parts, 9), exp(v) of each part, row by row
    series: F2  # (parts, 2), (1 - cos t) / t^2 and (t - sin t) / t^3 of the angle t = |v| of each part
    # (joints, 3), the gradient with respect to the positions; `pose_gradient` accumulates it to the root
    gradient: F2

    @classmethod
    def of(cls, body: Articulation) -> Scratch:
        """Scratch arrays for a body."""
        joints, parts = len(body.parents), len(body.stiffness) - 1
        return cls(*(np.zeros(shape) for shape in ((joints, 3), (joints, 3), (parts, 9), (parts, 2), (joints, 3))))


@inlined(fastmath=True)
def pose_body(v: Array, body: Articulation, bones: Array, root: Array, scratch: Scratch) -> None:
    """Write the positions and posed bones of the pose `v` to `scratch`, and zeros to its gradient; `bones`, (joints,
    3), are the rotation copy's in this frame, from each joint's parent to it, and `root`, (3,), its root.
    """
    parts = len(scratch.rotations)
    for part in range(parts):
        write_rotation(v[part, 0], v[part, 1], v[part, 2], scratch.rotations[part], scratch.series[part])
    for i in range(3):
        scratch.x[0, i] = root[i] + v[parts, i]
        scratch.gradient[0, i] = 0.0
    for joint in range(1, len(body.parents)):
        parent = body.parents[joint]
        E = scratch.rotations[body.parts[parent]]
        bx, by, bz = bones[joint, 0], bones[joint, 1], bones[joint, 2]
        for i in range(3):
            scratch.bones[joint, i] = E[3 * i] * bx + E[3 * i + 1] * by + E[3 * i + 2] * bz
            scratch.x[joint, i] = scratch.x[parent, i] + scratch.bones[joint, i]
            scratch.gradient[joint, i] = 0.0


@inlined(fastmath=True)
def write_rotation(x: float, y: float, z: float, E: Array, series: Array) -> None:
    """Write the rotation matrix of a rotation vector, row by row (Rodrigues), and its factors of `Scratch.series`."""
    square = x * x + y * y + z * z
    if square < SMALL:
        a, b, c = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        angle = np.sqrt(square)
        sine = np.sin(angle)
        a, b, c = sine / angle, (1.0 - np.cos(angle)) / square, (angle - sine) / (square * angle)
    E[0], E[1], E[2] = 1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y
    E[3], E[4], E[5] = b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x
    E[6], E[7], E[8] = b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)
    series[0], series[1] = b, c


@inlined(fastmath=True)
def stiffness_energy(v: Array, body: Articulation) -> float:
    """The stiffness terms, the sum of 1/2 h |v|^2."""
    energy = 0.0
    for part in range(len(v)):
        energy += 0.5 * body.stiffness[part] * (v[part, 0] ** 2 + v[part, 1] ** 2 + v[part, 2] ** 2)
    return energy


@inlined(fastmath=True)
def pose_gradient(v: Array, body: Articulation, scratch: Scratch, gradient: Array) -> None:
    """Write the gradient with respect to the pose, of the stiffness terms and of the objective whose gradient with
    respect to the positions is `scratch.gradient`.

    A small rotation dw of a part about the upper end of its bone b moves the whole subtree by dw x b, so the torque on
    the part is b x (sum of the gradients in the subtree). As dw = J dv with the left Jacobian J of the exponential map,
    the gradient is J^T times the torque.
    """
    parts = len(scratch.rotations)
    for part in range(parts):
        gradient[part, 0], gradient[part, 1], gradient[part, 2] = 0.0, 0.0, 0.0
    for joint in range(len(body.parents) - 1, 0, -1):
        parent = body.parents[joint]
        part = body.parts[parent]
        sx, sy, sz = scratch.gradient[joint, 0], scratch.gradient[joint, 1], scratch.gradient[joint, 2]
        bx, by, bz = scratch.bones[joint, 0], scratch.bones[joint, 1], scratch.bones[joint, 2]
        gradient[part, 0] += by * sz - bz * sy
        gradient[part, 1] += bz * sx - bx * sz
        gradient[part, 2] += bx * sy - by * sx
        for i in range(3):
            scratch.gradient[parent, i] += scratch.gradient[joint, i]
    for part in range(parts):
        to_rotation_vector(v[part], scratch.series[part], gradient[part])
    for i in range(3):
        gradient[parts, i] = scratch.gradient[0, i]
    for part in range(parts + 1):
        for i in range(3):
            gradient[part, i] += body.stiffness[part] * v[part, i]


@inlined(fastmath=True)
def to_rotation_vector(v: Array, series: Array, m: Array) -> None:
    """Replace the torque m by J^T m, where J^T = I - a [v] + b [v]^2, with the factors a, b of `Scratch.series`."""
    x, y, z = v[0], v[1], v[2]
    a, b = series[0], series[1]
    cx, cy, cz = y * m[2] - z * m[1], z * m[0] - x * m[2], x * m[1] - y * m[0]
    m[0] += b * (y * cz - z * cy) - a * cx
    m[1] += b * (z * cx - x * cz) - a * cy
    m[2] += b * (x * cy - y * cx) - a * cz
