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
    A = np.zeros((*supports.weights.shape, 3, 3))
    for support in range(len(supports.joints) if stiffness > 0.0 else 0):
        _write_stiffness(supports, support, body, bones, stiffness, A[:, support])
    return Springs(supports.joints, np.full(len(supports.joints), -1), supports.places / unit, A)


def _write_stiffness(
    supports: Supports, support: int, body: Articulation, bones: Array, stiffness: float, A: Array
) -> None:
    """Write A, (frames, 3, 3), of one of the supports."""
    s, same_region = supports.weights[:, support], supports.regions == supports.regions[support]
    resting = (supports.weights[:, same_region] > LEAST_WEIGHT).sum(axis=1)
    n = np.maximum(resting / FIRM, 1.0)
    m = n if support < supports.feet else resting
    wholly, partly = np.flatnonzero(s >= 1.0), np.flatnonzero((s > LEAST_WEIGHT) & (s < 1.0))
    A[wholly] = (stiffness / n[wholly])[:, None, None] * np.eye(3)
    if len(partly):
        s, m, n = (each[partly, None, None] for each in (s, m, n))
        M = compliance(body, bones[partly], int(supports.joints[support])) * (m * (1.0 - s) / s)
        A[partly] = _inverse(M + n / stiffness * np.eye(3))


def compliance(body: Articulation, bones: Array, joint: int) -> Array:
    """M: (frames, 3, 3), displacement of a joint per force, against the stiffness of parts and root alone; `bones` are
    (frames, joints, 3). A part of stiffness h with the lever arm a adds [a]^T [a] / h = (|a|^2 I - a a^T) / h.
    """
    arms: dict[int, Array] = {}
    while joint > 0:
        parent = int(body.parents[joint])
        part = int(body.parts[parent])
        arms[part] = arms.get(part, 0.0) + bones[:, joint]
        joint = parent
    M = np.tile(np.eye(3) / body.stiffness[-1], (len(bones), 1, 1))
    for part in sorted(arms):
        a, h = arms[part], body.stiffness[part]
        M += ((a**2).sum(axis=1) / h)[:, None, None] * np.eye(3)
        M -= a[:, :, None] * a[:, None, :] / h
    return M


def _inverse(M: Array) -> Array:
    """The inverses of symmetric matrices, (frames, 3, 3), by their cofactors."""
    a, b, c, d, e, f = (M[:, i, j] for i, j in zip(*np.triu_indices(3), strict=True))
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    D, E, F = a * f - c * c, b * c - a * e, a * d - b * b
    scale = 1.0 / (a * A + b * B + c * C)
    return np.moveaxis(scale * np.array([[A, B, C], [B, D, E], [C, E, F]]), -1, 0)
