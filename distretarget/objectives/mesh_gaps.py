"""Corrections of the gaps of capsules by those of the mesh, for hands and forearms that touch, or nearly do.

Capsules leave out up to a third of a surface, and a hand has fingers.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from distretarget.motion import Motion
from distretarget.numerics.moving import averaged
from distretarget.numerics.time_series import Shots, by_shot
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.objectives.body_skin import BodySkin
from distretarget.objectives.contact_zones import ContactZones, gaps_of_pairs
from distretarget.skin.balls import segment_gaps
from distretarget.skin.capsules import GROUP, SEGMENTS

RATE = 30.0  # the mesh is sampled about as often [1/s]
NEAR = 0.03  # meshes may touch where the gap of capsules is less than this [body units]
FARTHEST = 0.06  # gaps of a mesh larger than this are not measured [body units]
MOST = 0.04  # the largest correction [body units]
# Where nothing is to touch, a correction makes capsules thinner by at most this: at the hem of a jacket, the nearest
# point of a coarse mesh jumps by more [body units].
THICKER = 0.01
TRUNK = GROUP[SEGMENTS.index("chest")]
STEADY = 0.07  # corrections are averaged over this time before and after, as the nearest point of a mesh jumps [s]


def mesh_correction(
    body: BodySkin,
    zones: ContactZones,
    pairs: Numbers,
    motion: Motion,
    touching: Array,
    first: int,
    shots: Shots,
    overlap: Array | float = 0.0,
) -> Array:
    """Return the gap of capsules less that of the mesh in each zone, (frames, zones) [body units]; 0 without a mesh.

    Args:
        body: with its capsules, and the surface of its mesh.
        zones: where limbs can touch.
        pairs: (pairs, 2), the segments of the pairs that the zones consist of.
        motion: its frames.
        touching: (frames, zones), more than 0 where limbs are to touch; the mesh is sampled up to larger gaps there.
        first: the index of the first frame in the clip, which decides the frames that are sampled.
        shots: (frames,); nothing is averaged across cuts.
        overlap: (frames, zones), a correction may always make capsules thinner by this, see `false_overlap`.
    """
    if body.surface is None:
        return np.zeros((len(motion), len(zones.limbs)))
    near = np.where(touching > 0.0, FARTHEST, NEAR)
    frames, gaps, of_mesh = _sampled_gaps(body, zones, pairs, motion, first, near)
    known = of_mesh < FARTHEST
    correction = np.subtract(gaps, of_mesh, out=np.zeros(gaps.shape), where=known)
    correction = correction.clip(-np.maximum(np.where(touching > 0.0, MOST, THICKER), overlap)[frames], MOST)
    mean = partial(_averaged, reach=round(STEADY / (_step(motion) * motion.frame_time)))
    correction *= 1.0 - body.overlap.sunk[zones.limbs] * (zones.groups == TRUNK)  # these are in the mesh by build
    return _interpolated(by_shot(mean, shots[frames], correction, known), frames, len(motion))


def false_overlap(
    body: BodySkin, zones: ContactZones, pairs: Numbers, motion: Motion, first: int, least: float
) -> Array:
    """Return how far the capsules of hands and forearms overlap others in a motion although the gap of the mesh is at
    least `least`, (frames, zones) [body units]. Where the gap is smaller, twice the difference is subtracted, down to
    0; without a mesh it is 0. If capsules may overlap by this, limbs whose mesh is no deeper do not move. Other
    arguments as in `mesh_correction`.
    """
    if body.surface is None:
        return np.zeros((len(motion), len(zones.limbs)))
    near = np.zeros((len(motion), len(zones.limbs)))
    frames, gaps, of_mesh = _sampled_gaps(body, zones, pairs, motion, first, near)
    overlap = np.where(zones.are_hard, np.maximum(2.0 * np.minimum(of_mesh - least, 0.0) - gaps, 0.0), 0.0)
    return _interpolated(overlap, frames, len(motion))


def _step(motion: Motion) -> int:
    """The number of frames from one sample of the mesh to the next."""
    return max(round(1.0 / (RATE * motion.frame_time)), 1)


def _sampled_gaps(
    body: BodySkin, zones: ContactZones, pairs: Numbers, motion: Motion, first: int, near: Array
) -> tuple[Numbers, Array, Array]:
    """The sampled frames, and the gaps of capsules and of the mesh there in each zone, (samples, zones) each [body
    units]. Gaps of the mesh are found for hands and forearms where the gap of capsules is less than `near`, (frames,
    zones), and are infinite elsewhere.
    """
    step = _step(motion)
    frames = np.arange(-first % step, len(motion), step)
    motion = motion[frames]
    gaps = zones.least(gaps_of_pairs(segment_gaps(body.balls, body.posed(motion), FARTHEST), body.balls.pairs, pairs))
    wanted = zones.are_hard & (gaps < near[frames])
    groups = [tuple(np.flatnonzero(GROUP[:-1] == group).tolist()) for group in zones.groups]
    parts = [*zip(zones.limbs.tolist(), groups, strict=True)]
    assert body.surface is not None
    of_mesh = body.surface.gaps(motion, parts, wanted, FARTHEST * body.unit) if wanted.any() else gaps
    return frames, gaps, np.where(wanted, of_mesh / body.unit, np.inf)


def _interpolated(values: Array, frames: Numbers, count: int) -> Array:
    """Values of sampled frames, (samples, zones), interpolated in all `count` frames, (frames, zones)."""
    found = np.zeros((count, values.shape[1]))
    for zone in np.flatnonzero(values.any(axis=0)):
        found[:, zone] = np.interp(np.arange(count), frames, values[:, zone])
    return found


def _averaged(values: Array, are_known: Flags, reach: int) -> Array:
    """Values, (samples, zones), averaged over the known ones around each; 0 for unknown ones."""
    known = are_known.astype(float)
    return known * averaged(values, reach) / np.maximum(averaged(known, reach), np.finfo(float).tiny)
