"""Hands that only brush by, as those of arms that swing past the trunk: such a touch is not meant."""

from __future__ import annotations

from functools import partial

import numpy as np

from distretarget.motion import Motion
from distretarget.numerics.moving import averaged
from distretarget.numerics.time_series import Shots, by_shot, smoothstep
from distretarget.numerics.vectors import Array
from distretarget.objectives.body_skin import BodySkin
from distretarget.objectives.part_axes import PARTS, Axes
from distretarget.objectives.spots import Spots
from distretarget.skin.capsules import IS_ARM, PLACE, SEGMENTS

SLIDES, BRUSHES = 0.35, 0.7  # what slides by up to the first touches, from the second on it brushes by [body units/s]
MEAN_SPAN = 0.15  # the speed is averaged over this time before and after a frame, while they are near [s]
# The parts with an axis of each place to be touched, but the arms: hands that meet mean to.
PARTS_OF = {
    place: [n for n, names in enumerate(PARTS.values()) if PLACE[SEGMENTS.index(names[0])] == place]
    for place in set(PLACE[:-1][~IS_ARM].tolist())
}


def stays(skin: BodySkin, motion: Motion, ends: Array, spots: Spots, near: Array, shots: Shots) -> Array:
    """Return how far what touches each spot stays where it is on the body, and does not slide along it, from 0 to 1,
    (frames, spots).

    Args:
        skin: of the body that touches itself.
        motion: its motion [file units].
        ends: those of its capsules, as `BodySkin.posed` [body units].
        spots: what may touch.
        near: (frames, spots), how near each is to touching, 0 to 1.
        shots: (frames,); nothing is averaged across cuts.
    """
    result = np.ones(near.shape)
    touched = [spot for spot in np.flatnonzero(near.any(axis=0)) if PARTS_OF.get(int(spots.places[spot]))]
    if skin.landmarks is None or not touched:
        return result
    axes = skin.landmarks.axes(motion)
    for spot in touched:
        centre = skin.unit * skin.centres(ends, int(spots.limbs[spot])).mean(axis=1)
        slides = partial(_speed, frame_time=motion.frame_time)
        places = [_place(axes, part, centre) / skin.unit for part in PARTS_OF[int(spots.places[spot])]]
        speeds = [by_shot(slides, shots, place, near[:, spot, None]) for place in places]
        result[:, spot] = smoothstep((BRUSHES - np.min(speeds, axis=0)[:, 0]) / (BRUSHES - SLIDES))
    return result


def _place(axes: Axes, part: int, points: Array) -> Array:
    """(frames, 3), points along the axis of a part, to its front and to its left."""
    return np.asarray(np.einsum("fij,fj->fi", axes.directions[:, part], points - axes.starts[:, part]))


def _speed(places: Array, near: Array, frame_time: float) -> Array:
    """(frames, 1), how fast places, as of `_place`, move along a part, and not to it or from it, on average while they
    are near.
    """
    if len(places) < 2:
        return np.zeros_like(near)
    along, front, left = places.T
    turned = np.hypot(front, left) * np.gradient(np.unwrap(np.arctan2(left, front)))
    speed = np.hypot(np.gradient(along), turned)[:, None] / frame_time
    reach = round(MEAN_SPAN / frame_time)
    weight = np.maximum(averaged(near, reach), np.finfo(float).tiny)
    return np.asarray(averaged(near * speed, reach) / weight)
