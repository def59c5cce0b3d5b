"""Hands that only slide past a part of the body, such as those of arms that swing past the trunk: no contacts."""

from __future__ import annotations

from functools import partial

import numpy as np

from distretarget.motion import Motion
from distretarget.numerics.moving import averaged
from distretarget.numerics.time_series import Shots, by_shot, smoothstep
from distretarget.numerics.vectors import Array
from distretarget.objectives.body_skin import BodySkin
from distretarget.objectives.contact_zones import ContactZones
from distretarget.objectives.part_axes import PARTS, Axes
from distretarget.skin.capsules import GROUP, IS_ARM, SEGMENTS

# Up to the first speed along the body a limb is in contact; from the second on it only brushes by [body units/s].
SLIDES, BRUSHES = 0.35, 0.7
MEAN_SPAN = 0.15  # the speed is averaged over this time before and after a frame, while they are near [s]
# The indices of the `PARTS` of each group of segments but arms: hands that meet are always in contact.
PARTS_OF = {
    group: [n for n, names in enumerate(PARTS.values()) if GROUP[SEGMENTS.index(names[0])] == group]
    for group in set(GROUP[:-1][~IS_ARM].tolist())
}


def stillness(skin: BodySkin, motion: Motion, ends: Array, zones: ContactZones, near: Array, shots: Shots) -> Array:
    """Return a weight for the contact of each zone, (frames, zones): 1 where the limb hardly slides along the body, 0
    where it only brushes by.

    Args:
        skin: of the body that touches itself.
        motion: its motion [file units].
        ends: of its capsules, as `BodySkin.posed` returns [body units].
        zones: of the body.
        near: (frames, zones), how near each is to touching, 0 to 1.
        shots: (frames,); nothing is averaged across cuts.
    """
    result = np.ones(near.shape)
    touched = [zone for zone in np.flatnonzero(near.any(axis=0)) if PARTS_OF.get(int(zones.groups[zone]))]
    if skin.landmarks is None or not touched:
        return result
    axes = skin.landmarks.axes(motion)
    for zone in touched:
        centre = skin.unit * skin.centres(ends, int(zones.limbs[zone])).mean(axis=1)
        sliding = partial(_speed, frame_time=motion.frame_time)
        places = [_place(axes, part, centre) / skin.unit for part in PARTS_OF[int(zones.groups[zone])]]
        speeds = [by_shot(sliding, shots, place, near[:, zone, None]) for place in places]
        result[:, zone] = smoothstep((BRUSHES - np.min(speeds, axis=0)[:, 0]) / (BRUSHES - SLIDES))
    return result


def _place(axes: Axes, part: int, points: Array) -> Array:
    """(frames, 3), the coordinates of points along the axis of a part, to its front and to its left."""
    return np.asarray(np.einsum("fij,fj->fi", axes.directions[:, part], points - axes.starts[:, part]))


def _speed(places: Array, near: Array, frame_time: float) -> Array:
    """(frames, 1), the speed along and round a part, but not towards it, of coordinates from `_place`, averaged with
    the weights `near`, (frames, 1).
    """
    if len(places) < 2:
        return np.zeros_like(near)
    along, front, left = places.T
    turned = np.hypot(front, left) * np.gradient(np.unwrap(np.arctan2(left, front)))
    speed = np.hypot(np.gradient(along), turned)[:, None] / frame_time
    reach = round(MEAN_SPAN / frame_time)
    weight = np.maximum(averaged(near, reach), np.finfo(float).tiny)
    return np.asarray(averaged(near * speed, reach) / weight)
