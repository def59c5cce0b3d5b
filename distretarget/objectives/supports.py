"""Supports: joints that rest on the world, and the springs that hold them in place.

    1/2 sum over supports   r^T A r,    r = x - place,    A = (m (1 - s) / s M + n I / k)^-1

A joint of weight s moves the share s of the way from the rotation copy to its place, for any stiffness k, because M is
the compliance of the body at the joint. The m joints of a region that rest at the same time, such as a hand's fingers,
share the stiffness: n = max(m / 2, 1), and each gets 1/n of one joint's. (For feet, m is replaced by n.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from distretarget.ik.articulation import Articulation
from distretarget.ik.springs import Springs, no_springs
from distretarget.numerics.compiled import clear, compiled, inlined
from distretarget.numerics.vectors import Array, Numbers
from distretarget.objectives.floor import Floor, no_floor

STIFFNESS = 5000.0  # k, far above all other stiffnesses
RESTS = 0.99  # a joint of this weight or more rests
LEAST_WEIGHT = 1e-6  # a joint of less weight is free
FIRM = 2  # up to this many joints of a region get the full stiffness; more share it
ROOT_BLEND = 0.2  # the root takes about twice this time from one height or shift to the next [s]
BLEND = 0.16  # a joint blends to its place over twice this time before it rests, and away over twice this time [s]


@dataclass(frozen=True, eq=False, kw_only=True)
class Supports:
    """Joints that rest on the world in some frames, and their places. Foot joints come first. Slicing selects frames.

    Attributes:
        joints: (supports,), joints of the target.
        regions: (supports,), the body region of each.
        feet: the number of foot joints: ankle and toe of one leg, then those of the other.
        weights: (frames, supports), 1 while the source's joint rests, blended to 0.
        places: (frames, supports, 3), where the target's joint rests [target file units].
        floor: the heights that other joints stay above [body units].
        scene_springs: springs to other performers and to props [body units].
        asked_springs: springs of contacts and distances that the user asks for [body units].
    """

    joints: Numbers
    regions: Numbers
    feet: int
    weights: Array
    places: Array
    floor: Floor
    scene_springs: Springs
    asked_springs: Springs

    @property
    def standing(self) -> Array:
        """(frames,), 1 while a foot rests, blended to 0."""
        return np.asarray(self.weights[:, : self.feet].max(axis=1, initial=0.0))

    @property
    def touches(self) -> Iterator[tuple[int, Array]]:
        """The joints that touch other performers or props, each with how firmly, (frames,), 0 to 1."""
        springs = self.scene_springs
        stiffness = np.trace(springs.A, axis1=-2, axis2=-1)
        return zip(springs.a.tolist(), (stiffness / (stiffness + 1.0)).T, strict=True)

    def with_joints(self, joints: Numbers, regions: Numbers, weights: Array, places: Array) -> Supports:
        """Return the supports with other joints after these; the arguments are the attributes of these joints."""
        return replace(
            self,
            joints=np.append(self.joints, joints),
            regions=np.append(self.regions, regions),
            weights=np.hstack([self.weights, weights]),
            places=np.hstack([self.places, places]),
        )

    def __getitem__(self, frames: slice) -> Supports:
        return replace(
            self,
            weights=self.weights[frames],
            places=self.places[frames],
            floor=self.floor.of_frames(frames),
            scene_springs=self.scene_springs.of_frames(frames),
            asked_springs=self.asked_springs.of_frames(frames),
        )


def no_supports(frames: int) -> Supports:
    """Return supports of a clip in which nothing rests."""
    none, springs = np.zeros(0, np.intp), no_springs(frames)
    return Supports(
        joints=none,
        regions=none,
        feet=0,
        weights=np.zeros((frames, 0)),
        places=np.zeros((frames, 0, 3)),
        floor=no_floor(frames),
        scene_springs=springs,
        asked_springs=springs,
    )


def support_springs(supports: Supports, body: Articulation, bones: Array, unit: float, stiffness: float) -> Springs:
    """Return the springs of resting joints, frames first; `bones`, (frames, joints, 3), are the rotation copy's [body
    units], `unit` is the body unit [file units], and `stiffness` is k; 0 leaves the joints free.
    """
    weights, joints, regions, feet = supports.weights, supports.joints, supports.regions, supports.feet
    A = np.zeros((*weights.shape, 3, 3))
    if stiffness > 0.0:
        scratch = np.zeros((len(body.stiffness), 3)), np.zeros((3, 3))
        _write_springs(weights, joints, regions, feet, body, bones, stiffness, A, scratch)
    return Springs(joints, np.full(len(joints), -1), supports.places / unit, A)


@compiled()
def _write_springs(weights, joints, regions, feet, body, bones, stiffness, A, scratch):  # type: ignore[no-untyped-def]
    """Write A, (frames, joints, 3, 3); foot joints come first. `scratch` holds lever arms and compliance."""
    arms, M = scratch
    for frame in range(len(weights)):
        for support in range(len(joints)):
            s = weights[frame, support]
            if s <= LEAST_WEIGHT:
                continue
            resting = _resting_in_region(weights[frame], regions, support)
            n = resting / FIRM if resting > FIRM else 1.0
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
        M[i, i] = 1.0 / body.stiffness[-1]
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
