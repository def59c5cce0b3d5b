"""The stiffness of the springs that hold resting joints in place. Compiled.

    A = (m (1 - s) / s M + n I / k)^-1

A joint of weight s moves the share s of the way from the rotation copy to its place, for any stiffness k, because M is
the compliance of the body at the joint. The m joints of a region that rest at the same time, such as a hand's fingers,
share the stiffness: with n = max(m / 2, 1), each has 1/n of that of a single joint. (For feet, m is replaced by n.)
"""

from __future__ import annotations

from distretarget.ik.articulation import Articulation
from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import F2, F3, F4, I1, Array, Numbers, clear

LEAST_WEIGHT = 1e-6  # a joint of less weight is free
UNSHARED = 2  # up to this many joints of a region have the full stiffness each; more of them share it


@compiled()
def write_holds(
    weights: F2,
    joints: I1,
    regions: I1,
    feet: int,
    body: Articulation,
    bones: F3,
    stiffness: float,
    A: Out[F4],
    arms: Out[F2],
    M: Out[F2],
) -> None:
    """Write A, (frames, joints, 3, 3), for joints that rest with `weights`, (frames, joints), the first `feet` of which
    are foot joints. `bones`, (frames, joints of the body, 3), are the rotation copy's; `arms`, (parts + 1, 3), and `M`,
    (3, 3), are scratch.
    """
    for frame in range(len(weights)):
        for support in range(len(joints)):
            s = weights[frame, support]
            if s <= LEAST_WEIGHT:
                continue
            resting = _resting_in_region(weights[frame], regions, support)
            n = resting / UNSHARED if resting > UNSHARED else 1.0
            m = n if support < feet else resting
            if s < 1.0:
                write_compliance(body, bones[frame], joints[support], arms, M)
                for i in range(3):
                    for j in range(3):
                        M[i, j] *= m * (1.0 - s) / s
                    M[i, i] += n / stiffness
                _write_inverse(M, A[frame, support])
            else:
                for i in range(3):
                    A[frame, support, i, i] = stiffness / n


@inlined()
def _resting_in_region(weights: Array, regions: Numbers, support: int) -> int:
    """The number of joints of the same region that rest in a frame, this one included."""
    count = 0
    for other in range(len(weights)):
        count += regions[other] == regions[support] and weights[other] > LEAST_WEIGHT
    return count


@inlined()
def write_compliance(body: Articulation, bones: Array, joint: int, arms: Array, M: Array) -> None:
    """Write the compliance M, (3, 3): displacement of a joint per force, against the stiffness of parts and root alone.

    A part of stiffness h, with the lever arm a on the joint, adds [a]^T [a] / h = (|a|^2 I - a a^T) / h. `bones`,
    (joints, 3), are the frame's; `arms`, (parts + 1, 3), is scratch.
    """
    clear(arms)
    while joint > 0:
        parent = body.parents[joint]
        for i in range(3):
            arms[body.parts[parent], i] += bones[joint, i]
        joint = parent
    clear(M)
    for i in range(3):
        M[i, i] = 1.0 / body.stiffness[len(body.stiffness) - 1]
    for part in range(len(arms) - 1):
        square = arms[part, 0] ** 2 + arms[part, 1] ** 2 + arms[part, 2] ** 2
        if square == 0.0:
            continue
        for i in range(3):
            M[i, i] += square / body.stiffness[part]
            for j in range(3):
                M[i, j] -= arms[part, i] * arms[part, j] / body.stiffness[part]


@inlined()
def _write_inverse(M: Array, inverse: Array) -> None:
    """Write the inverse of a symmetric matrix, (3, 3), by its cofactors."""
    a, b, c, d, e, f = M[0, 0], M[0, 1], M[0, 2], M[1, 1], M[1, 2], M[2, 2]
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    D, E, F = a * f - c * c, b * c - a * e, a * d - b * b
    scale = 1.0 / (a * A + b * B + c * C)
    inverse[0, 0], inverse[0, 1], inverse[0, 2] = scale * A, scale * B, scale * C
    inverse[1, 0], inverse[1, 1], inverse[1, 2] = scale * B, scale * D, scale * E
    inverse[2, 0], inverse[2, 1], inverse[2, 2] = scale * C, scale * E, scale * F
