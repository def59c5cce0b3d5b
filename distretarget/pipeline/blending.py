"""Blend from a motion into another that holds in some frames, and back.

What differs, a rotation of each joint and a way of the root, is added to the one motion. Beyond the frames in which the
other holds it goes on as in the nearest of them, and fades. So nothing is solved where nothing is asked, and what eases
in is as smooth as the motion below it.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.numerics.time_series import Shots, slices_of, spans_of
from distretarget.numerics.vectors import lengths

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

GOES_ON = 0.1  # beyond its frames the difference goes on changing as at their end for about this time [s]
SLOPE = 0.05  # how fast it changes there is measured over this time [s]
LEAST = 1e-12  # angles are no smaller [rad]


def blended(without: Motion, held: Motion, share: Array, lead: Numbers, shots: Shots) -> Motion:
    """Return the motion `held` where the share, (frames,), is 1, between the two where it is less, and elsewhere the
    motion `without` it, into which the other fades over `lead` frames, (frames,): those of the frame nearest to it.

    What is farther away does not change at all, nor what is across a cut between `shots`, (frames,).
    """
    roots, rotations = np.array(without.root_positions), np.array(without.rotations)
    for shot in slices_of(shots):
        if share[shot].any():
            added = _added(without[shot], held[shot], share[shot], lead[shot])
            moved = shot.start + np.flatnonzero(added.any(axis=(1, 2)))
            added = added[moved - shot.start]
            turned = _quaternions(rotations[moved]) * Rotation.from_rotvec(added[:, :-1].reshape(-1, 3))
            rotations[moved] = turned.as_quat().reshape(rotations[moved].shape)
            roots[moved] += added[:, -1]
    whole = share == 1.0
    roots[whole], rotations[whole] = held.root_positions[whole], held.rotations[whole]
    return replace(without, root_positions=roots, rotations=rotations)


def _added(without: Motion, held: Motion, share: Array, lead: Numbers) -> Array:
    """(frames, joints + 1, 3), the rotation vectors of joints [rad], and last the way of the root, that are added to
    the frames of one shot.
    """
    turns = (_quaternions(without.rotations).inv() * _quaternions(held.rotations)).as_rotvec()
    ways = held.root_positions - without.root_positions
    differ = np.concatenate([turns.reshape(len(ways), -1, 3), ways[:, None]], axis=1)
    added, spans = share[:, None, None] * differ, spans_of(share > 0.0).tolist()
    slope, goes_on = round(SLOPE / without.frame_time), GOES_ON / without.frame_time

    def beyond(edge: int, inner: int, frames: Numbers) -> Array:
        """What an edge of a span adds in frames beyond it, with the slope between it and a frame inside."""
        t = np.abs(frames - edge)
        far = goes_on * (1.0 - np.exp(-t / goes_on)) / max(abs(edge - inner), 1)
        change = differ[edge] - _nearest(differ[inner], differ[edge])
        ease = share[edge] * _ease(t / (lead[edge] + 1.0))
        return np.asarray(ease[:, None, None] * (differ[edge] + far[:, None, None] * change))

    for before, after in pairwise([None, *spans, None]):
        frames = np.arange(before[1] if before else 0, after[0] if after else len(added))
        of_first = _ease((np.arange(len(frames)) + 1.0) / (len(frames) + 1.0))[:, None, None]
        if before:
            last = before[1] - 1
            kept = of_first if after else 1.0
            added[frames] += kept * beyond(last, max(last - slope, before[0]), frames)
        if after:
            kept = 1.0 - of_first if before else 1.0
            added[frames] += kept * beyond(after[0], min(after[0] + slope, after[1] - 1), frames)
    return np.asarray(added)


def _quaternions(rotations: Array) -> Rotation:
    return Rotation.from_quat(rotations.reshape(-1, 4))


def _nearest(vectors: Array, to: Array) -> Array:
    """(joints + 1, 3), rotation vectors, the other way round where that is nearer; the last is none."""
    others = vectors * (1.0 - 2.0 * np.pi / np.maximum(lengths(vectors), LEAST)[:, None])
    others[-1] = vectors[-1]
    return np.where((lengths(others - to) < lengths(vectors - to))[:, None], others, vectors)


def _ease(t: NDArray[np.floating[Any]]) -> Array:
    """1 at 0, and 0 from 1 on, with the least jerk in between."""
    t = np.clip(t, 0.0, 1.0)
    return np.asarray(1.0 - t * t * t * (10.0 - 15.0 * t + 6.0 * t * t))
