"""Contacts between two performers: the pairs of their joints that come near each other, and the springs that keep them.

A pair is treated as one within a body (`contact_pairs`), but for two things. The normalised distance of two joints is
their distance over the path lengths from each to the root of its body. And each body is solved by itself, so that both
joints are drawn to places in the world: to their common middle, plus and minus half the vector between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.solve.chunks import blocks_of
from distretarget.solve.contact_pairs import activation
from distretarget.solve.settings import ContactSettings
from distretarget.solve.springs import Springs, stiffer_along

Array = NDArray[np.float64]
Joints = NDArray[np.intp]

LEAST_STIFFNESS = 1e-9  # of a joint that is drawn anywhere


@dataclass(frozen=True, eq=False)
class Points:
    """The joints of a performer that may touch another performer.

    Attributes:
        joints: (points,), joints of the target.
        source: (frames, points, 3), where their drivers are in the source's world [source file units].
        reach: (points,), path lengths from the root to them in the source [source file units].
    """

    joints: Joints
    source: Array
    reach: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Touching:
    """The pairs of joints of two performers that come near each other.

    Attributes:
        joints: (2, pairs), the joint of each performer.
        f: (frames, pairs), how far each pair has set in, 0 to 1.
        w: (frames, pairs), the stiffness of each pair.
        vectors: (frames, pairs, 3), from the second to the first joint in the source, scaled [target file units].
    """

    joints: Joints
    f: Array
    w: Array
    vectors: Array


def find_touching(one: Points, other: Points, scale: Array, frame_time: float, settings: ContactSettings) -> Touching:
    """Return the pairs of joints of two performers that come near each other.

    `scale`, (3, 3), takes vectors of the source's world into the target's.
    """
    u, v = _ever_near(one, other, settings.apart)
    d = one.source[:, u] - other.source[:, v]
    D = np.linalg.norm(d, axis=-1) / (one.reach[u] + other.reach[v])
    f = activation(D, settings.lead / frame_time, settings) if len(u) else np.zeros_like(D)
    shared = f / np.sqrt(_sums(f, u, len(one.joints)) * _sums(f, v, len(other.joints)))
    w = settings.pair_stiffness * shared * settings.close / (D + settings.touch)
    return Touching(joints=np.stack([one.joints[u], other.joints[v]]), f=f, w=w, vectors=d @ scale.T)


def touching_springs(
    touching: Touching, copies: tuple[Array, Array], now: tuple[Array, Array], units: tuple[float, float], range_: float
) -> tuple[Springs, Springs]:
    """The springs that draw the joints of either performer to where they touch, in its body units; their arrays have
    the frames in front.

    A joint that touches several others has one spring, with the sum of their energies. `copies` and `now` are the
    positions, (frames, joints, 3), of both performers in the copy and at present [target file units]; `units` are
    their body units, and pairs nearer than about `range_` body units keep their direction.
    """
    gathered = [_Gathered(joints, len(touching.f)) for joints in touching.joints]
    for block in blocks_of(len(touching.f)):
        ends = [positions[block][:, joints] for positions, joints in zip(now, touching.joints, strict=True)]
        before = [positions[block][:, joints] for positions, joints in zip(copies, touching.joints, strict=True)]
        middle, apart = (ends[0] + ends[1]) / 2.0, before[0] - before[1]
        delta = apart + touching.f[block][..., None] * (touching.vectors[block] - apart)
        length = np.linalg.norm(touching.vectors[block], axis=-1)
        e = touching.vectors[block] / np.maximum(length, 1e-12)[..., None]
        for each, sign, unit in zip(gathered, (0.5, -0.5), units, strict=True):
            k = range_**2 / (range_**2 + (length / unit) ** 2)
            each.add(block, stiffer_along(e, touching.w[block], k), (middle + sign * delta) / unit)
    one, other = (each.springs() for each in gathered)
    return one, other


class _Gathered:
    """The springs of all pairs, gathered into one for each joint: sum of A, and of A times the place."""

    def __init__(self, joints: Joints, frames: int) -> None:
        self.joints, self.column = np.unique(joints, return_inverse=True)
        self.A = np.zeros((frames, len(self.joints), 3, 3))
        self.Ay = np.zeros((frames, len(self.joints), 3))

    def add(self, block: slice, A: Array, places: Array) -> None:
        """Add springs of the stiffness A (frames, pairs, 3, 3), to places (frames, pairs, 3)."""
        pulls = (A @ places[..., None])[..., 0]
        for pair, column in enumerate(self.column):
            self.A[block, column] += A[:, pair]
            self.Ay[block, column] += pulls[:, pair]

    def springs(self) -> Springs:
        """One spring for each joint, to the place where all of its own are in balance."""
        firm = self.A + LEAST_STIFFNESS * np.eye(3)
        places = np.linalg.solve(firm, self.Ay[..., None])[..., 0]
        return Springs(self.joints, np.full(len(self.joints), -1), places, self.A)


def _ever_near(one: Points, other: Points, apart: float) -> tuple[Joints, Joints]:
    """The numbers of the points of one and of the other that come nearer than `apart` [D] in any frame."""
    reach = apart * (one.reach[:, None] + other.reach)
    near = np.zeros(reach.shape, bool)
    for block in blocks_of(len(one.source)):
        gaps = one.source[block][:, :, None] - other.source[block][:, None]
        near |= (np.linalg.norm(gaps, axis=-1) < reach).any(axis=0)
    u, v = np.nonzero(near)
    return u, v


def _sums(f: Array, points: Joints, count: int) -> Array:
    """(frames, pairs), 1 plus the sum of the activations of the point that each pair has."""
    sums = np.ones((count, len(f)))
    np.add.at(sums, points, f.T)
    return np.asarray(sums[points].T)
