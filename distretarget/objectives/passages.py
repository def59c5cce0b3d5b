"""Limbs that pass through a body, from one side of it to the other, pass slowly.

On some targets no way round the body is left, such as for short arms that reach over a large head. A limb that has to
be on one side of the body in one frame and on the other side in the next would swing fast and far before and after.
Therefore, near such a passage, the limb may overlap the body by the difference of its displacements on the two sides.
"""

from __future__ import annotations

import numpy as np

from distretarget.ik.limb_bends import TAU, limbs_of_pairs
from distretarget.numerics.time_series import Shots, opening, smoothstep
from distretarget.numerics.vectors import Array, Numbers, lengths
from distretarget.objectives.body_skin import BodySkin
from distretarget.skin.balls import mean_radii, segment_gaps

FADES = 2.0  # the overlap is allowed in full up to half this time from a passage, and fades out by it [tau]
LEAST = 1e-9  # the smallest displacement that is divided by [body units]


def overlap_of_passages(
    body: BodySkin, ends: Array, soft: Array, start: Array, shots: Shots, frame_time: float
) -> Array:
    """Return how much more each segment pair may overlap for the passages of its limbs, (frames, pairs) [body units].

    Args:
        body: the body.
        ends: (frames, capsules, 2, 3), the ends of its capsules after limbs have been displaced.
        soft: (frames, pairs), how far segments may overlap.
        start: (frames, limbs, 2, 3), the displacements of limbs that keep them out of the body, each on one side.
        shots: (frames,); nothing passes through a body at a cut.
        frame_time: between frames [s].
    """
    limbs, count = limbs_of_pairs(body.balls, body.displaced), start.shape[1]
    passing = _passing(body, ends, soft, limbs, count, TAU / frame_time)
    passing[np.diff(shots) != 0] = 0.0
    more = np.zeros((len(start), count + 1))  # the last limb stands for all that no limb carries
    more[:, :count] = _differences(start, passing, shots, TAU / frame_time)
    return np.asarray(more[:, limbs].max(axis=2))


def _passing(body: BodySkin, ends: Array, soft: Array, limbs: Numbers, count: int, tau: float) -> Array:
    """(frames - 1, limbs), whether each limb passes through another part between a frame and the next: 1 where it is
    inside by its diameter, 0 up to its radius, or if it stays inside for longer than half of `tau` [frames].
    """
    between, allowed = 0.5 * (ends[1:] + ends[:-1]), np.maximum(soft[1:], soft[:-1])
    depths = -(segment_gaps(body.balls, between, 0.0) + allowed) / mean_radii(body.balls)[body.balls.pairs[:, 0]]
    others = limbs[:, 0] != limbs[:, 1]
    deepest = np.zeros((len(depths), count))
    for limb in range(count):
        deepest[:, limb] = depths[:, others & (limbs == limb).any(axis=1)].max(axis=1, initial=0.0)
    return smoothstep(deepest - opening(deepest, 0.5 * tau) - 1.0)


def _differences(start: Array, passing: Array, shots: Shots, tau: float) -> Array:
    """(frames, limbs), by how much the displacements of each limb exceed those on the other side of a passage."""
    sizes, more, through = lengths(start), np.zeros(start.shape[:2]), np.zeros(start.shape[:2])
    for k in range(1, min(int(FADES * tau), len(start) - 1) + 1):
        through = np.maximum(through[:-1], passing[k - 1 :])  # between each frame and the k-th after it
        weights = smoothstep(np.array(FADES - k / tau)) * through * (shots[k:] == shots[:-k])[:, None]
        common = (start[k:] * start[:-k]).sum(axis=-1)
        for side in (slice(k, None), slice(None, -k)):
            size = sizes[side]
            differ = np.clip(size - common / np.maximum(size, LEAST), 0.0, size)
            more[side] = np.maximum(more[side], weights * differ.max(axis=-1))
    return more
