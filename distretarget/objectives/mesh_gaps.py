"""How much nearer the surface of a mesh is to what a limb touches than its capsules say.

Capsules leave out up to a third of a surface, and a hand has fingers. So gaps of capsules are put right by those of the
mesh, where limbs touch, or nearly do.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from distretarget.motion import Motion
from distretarget.numerics.moving import averaged
from distretarget.numerics.time_series import Shots, by_shot
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.objectives.body_skin import BodySkin
from distretarget.objectives.spots import Spots, of_pairs
from distretarget.skin.balls import segment_gaps
from distretarget.skin.capsules import PLACE

RATE = 30.0  # the mesh is looked at about as often [1/s]
NEAR = 0.03  # by gaps of capsules that are less than this, meshes may touch [body units]
FARTHEST = 0.06  # what is farther apart is not looked at [body units]
MOST = 0.04  # a mesh and its capsules differ by no more [body units]
# Where nothing is to touch, capsules that seem thicker than their mesh are believed but for so much: at the hem of a
# jacket, the nearest point of a coarse mesh changes by more [body units].
THICKER = 0.01
STEADY = 0.07  # what the mesh says is averaged so long before and after, as its nearest point jumps [s]


def nearer_than_capsules(
    body: BodySkin,
    spots: Spots,
    pairs: Numbers,
    motion: Motion,
    touching: Array,
    first: int,
    shots: Shots,
    spare: Array | float = 0.0,
) -> Array:
    """Return by how much the mesh is nearer than the capsules at each spot, (frames, spots) [body units]: by nothing
    where a body has no mesh.

    Args:
        body: with its capsules, and the surface of its mesh.
        spots: where limbs can touch.
        pairs: (pairs, 2), the segments of the pairs that these are for.
        motion: its frames.
        touching: (frames, spots), more than 0 where limbs are to touch; else what is near is looked at.
        first: the number of the first frame in the clip, of which every so many frames are looked at.
        shots: (frames,); nothing is averaged across cuts.
        spare: (frames, spots), by how much capsules may seem thicker than the mesh, as `spare_of_copy`.
    """
    if body.surface is None:
        return np.zeros((len(motion), len(spots.limbs)))
    near = np.where(touching > 0.0, FARTHEST, NEAR)
    frames, gaps, of_mesh = _looked_at(body, spots, pairs, motion, first, near)
    known = of_mesh < FARTHEST
    off = np.subtract(gaps, of_mesh, out=np.zeros(gaps.shape), where=known)
    off = off.clip(-np.maximum(np.where(touching > 0.0, MOST, THICKER), spare)[frames], MOST)
    averaged_in = partial(_averaged, reach=round(STEADY / (_step(motion) * motion.frame_time)))
    return _between(by_shot(averaged_in, shots[frames], off, known), frames, len(motion))


def spare_of_mesh(body: BodySkin, spots: Spots, pairs: Numbers, motion: Motion, first: int) -> Array:
    """Return how far capsules of hands and forearms may overlap others, (frames, spots) [body units]: as far as they do
    in a motion while its mesh is outside, less by twice the depth where it is inside; by nothing without a mesh. So
    limbs that sink in nowhere stay where they are. Arguments as `nearer_than_capsules`.
    """
    if body.surface is None:
        return np.zeros((len(motion), len(spots.limbs)))
    near = np.zeros((len(motion), len(spots.limbs)))
    frames, gaps, of_mesh = _looked_at(body, spots, pairs, motion, first, near)
    spare = np.where(spots.are_hard, np.maximum(2.0 * np.minimum(of_mesh, 0.0) - gaps, 0.0), 0.0)
    return _between(spare, frames, len(motion))


def _step(motion: Motion) -> int:
    """One of so many frames of a clip is looked at."""
    return max(round(1.0 / (RATE * motion.frame_time)), 1)


def _looked_at(
    body: BodySkin, spots: Spots, pairs: Numbers, motion: Motion, first: int, near: Array
) -> tuple[Numbers, Array, Array]:
    """The frames that are looked at, and the gaps at each spot by capsules and by the mesh there, (some frames, spots)
    each [body units]; the mesh's are infinite but for hands and forearms that are nearer by capsules than `near`,
    (frames, spots).
    """
    step = _step(motion)
    frames = np.arange(-first % step, len(motion), step)
    motion = motion[frames]
    gaps = spots.least(of_pairs(segment_gaps(body.balls, body.posed(motion), FARTHEST), body.balls.pairs, pairs))
    wanted = spots.are_hard & (gaps < near[frames])
    places = [tuple(np.flatnonzero(PLACE[:-1] == place).tolist()) for place in spots.places]
    parts = [*zip(spots.limbs.tolist(), places, strict=True)]
    assert body.surface is not None
    of_mesh = body.surface.gaps(motion, parts, wanted, FARTHEST * body.unit) if wanted.any() else gaps
    return frames, gaps, np.where(wanted, of_mesh / body.unit, np.inf)


def _between(values: Array, frames: Numbers, count: int) -> Array:
    """Values of some frames, (some frames, spots), in all frames, (frames, spots)."""
    found = np.zeros((count, values.shape[1]))
    for spot in np.flatnonzero(values.any(axis=0)):
        found[:, spot] = np.interp(np.arange(count), frames, values[:, spot])
    return found


def _averaged(values: Array, are_known: Flags, reach: int) -> Array:
    """Values, (frames, spots), averaged over those around them that are known; 0 for those that are not."""
    known = are_known.astype(float)
    return known * averaged(values, reach) / np.maximum(averaged(known, reach), np.finfo(float).tiny)
