"""The soles of feet over time: how far their lowest points are below the toes, by the joints or by the mesh.

While a foot of the source rests, its sole lies on what it rests on: it does not rise or sink, and on a level floor it
is as high as any other (`level_on_floor`). What joints show of it wanders: its height is steadied over each rest. From
one rest to the next the offset of the sole from its level is interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.limbs import Leg
from distretarget.body.soles import Sole, floor_height, level_on_floor, sole_height
from distretarget.matching.undersides import Undersides
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of
from distretarget.numerics.time_series import averaged, by_shot, median_of_three, steadied
from distretarget.numerics.vectors import lengths
from distretarget.objectives.clip import Clip

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROLL = 0.05  # height over which the lowest point of the sole rolls from heel to toe [leg lengths]
WAY = 0.1  # a place is averaged over about the way that a foot which does not stand still moves meanwhile [leg lengths]
STILL = 1e-5  # a foot counts as moving at least as far as this in each frame [leg lengths]
STEADY = 0.05  # speeds of feet are averaged over this time before and after [s]
LITTLE = 1e-3  # weight of a foot that hardly rests


@dataclass(frozen=True, eq=False)
class Foot:
    """A foot over the frames of a motion."""

    hip: Array  # (frames, 3), the places of the leg's hip joint [file units]
    toe: Array  # (frames, 3), its places [file units]
    bone: Array  # (frames, 3), from toe to ankle [file units]
    # (frames,), how far the lowest point of the sole is below the toe; it rolls smoothly from heel to toe [file units]
    below: Array

    @classmethod
    def of(cls, motion: Motion, leg: Leg, sole: Sole, up: Array, length: float) -> Foot:
        """The foot of a leg in a motion; `length` is that of the legs [file units]."""
        positions = motion.positions
        toe = positions[:, leg.toe]
        bone = positions[:, leg.ankle] - toe
        normal = Rotation.from_quat(motion.world_rotations_of(leg.ankle)).apply(sole.normal) @ up
        under = np.outer(np.maximum(normal, 0.0), sole.heights) - (
            heights_of(positions, sole.joints, up) - (toe @ up)[:, None]
        )
        heel, others = under[:, 0], under[:, 1:]
        front = others.max(axis=1) if others.shape[1] else heel
        below = (heel + front + np.hypot(heel - front, ROLL * length)) / 2.0
        return cls(positions[:, leg.hip], toe, bone, below)


def on_mesh(
    clip: Clip, undersides: Undersides, rests: Sequence[Array], sources: Sequence[Foot], copies: Sequence[Foot]
) -> list[Foot]:
    """Return the feet of the rotation copy with the lowest points of their mesh as soles: so far below the toe that the
    foot lock brings them to their level. What this changes is averaged over `STEADY`, as a sole may have edges.

    `rests`, (frames, 2) each, is how much ankle and toe of the source rest; `sources` and `copies` are feet by joints.
    """
    scale, up = clip.scale.height, clip.up
    levels = sole_levels(clip, rests)
    smooth = partial(averaged, reach=round(STEADY / clip.frame_time))
    feet = []
    for level, pair, source, copy in zip(levels.T, clip.legs, sources, copies, strict=True):
        own = undersides.target.lowest_of_foot(clip.copy, pair.target.ankle, up) + undersides.soles[1]
        rise = scale * (level - source.toe @ up) + copy.toe @ up - own
        feet.append(replace(copy, below=scale * source.below + by_shot(smooth, clip.shots, rise)))
    return feet


def sole_levels(clip: Clip, rests: Sequence[Array]) -> Array:
    """Return how high the lowest points of the source's soles belong, (frames, legs) [source file units]; `rests`,
    (frames, 2) each, is how much ankle and toe rest.
    """
    heights, steady_heights, up, length = [], [], clip.up, clip.leg_lengths[0]
    steady = partial(steadied_offset, reach=round(STEADY / clip.frame_time))
    for pair, resting in zip(clip.legs, rests, strict=True):
        height = sole_height(clip.source, pair.source_sole, up)
        paths = clip.source.positions[:, [pair.source.ankle, pair.source.toe]] / length
        found = by_shot(steady, clip.shots, height[:, None], resting.max(axis=1), paths)
        heights.append(height)
        steady_heights.append(found[:, 0])
    rest = np.stack([each.max(axis=1) == 1.0 for each in rests], axis=1)
    on_floor = partial(_on_floor, length=length)
    return by_shot(on_floor, clip.shots, np.stack(heights, axis=1), np.stack(steady_heights, axis=1), rest)


def _on_floor(heights: Array, steady_heights: Array, rests: Flags, length: float) -> Array:
    """(frames, legs), the levels of one shot of soles with these `heights`, steadied as well, which rest or not;
    (frames, legs) each. `length` is that of a leg.
    """
    if not rests.any():
        return heights
    rises = level_on_floor(steady_heights, floor_height(heights, rests), rests, length) - heights
    levels = heights.copy()
    for leg, resting in enumerate(rests.T):
        frames = np.flatnonzero(resting)
        if len(frames):
            levels[:, leg] += np.interp(np.arange(len(levels)), frames, rises[frames, leg])
    return levels


def steadied_offset(offset: Array, weights: Array, paths: Array, reach: int) -> Array:
    """Return an offset, (frames, n), steadied, as firmly from one frame to the next as (`WAY` / step of ankle or toe,
    the lesser)^2; `paths`, (frames, 2, 3), are theirs [leg lengths], averaged over `reach` frames.
    """
    paths = averaged(median_of_three(paths), reach)  # the median ignores a single faulty frame
    steps = lengths(np.diff(paths, axis=0, append=paths[-1:])).min(axis=1)
    return steadied(median_of_three(offset), weights + LITTLE, (WAY / np.maximum(steps, STILL)) ** 2)
