"""What lies or sits on a prop does so with its skin: how much higher a thick body's joints are over the prop."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from distretarget.body.resting import REST_SPEED, joint_speeds
from distretarget.numerics.time_series import averaged, by_shot, over_runs
from distretarget.numerics.vectors import level
from distretarget.objectives.supports import RESTS, ROOT_BLEND
from distretarget.pipeline.performer import Performer
from distretarget.scene.prop_surface import nearest_places
from distretarget.scene.props import PlacedProp, PropContacts
from distretarget.skin.capsules import IS_ARM, SEGMENTS

Array = NDArray[np.float64]

# Parts that rest on their skin; hands are brought to it in the end (`scene.skin`). The last is none.
IS_SEAT = np.array([not IS_ARM[number] and "foot" not in name for number, name in enumerate(SEGMENTS)] + [False])
OVER = 0.3  # a joint is over a prop if the way from there to it has at least this cosine to the vertical
MOVING = 1e-3  # weight of frames in which a joint is still on its way, such as one who sits down
FARTHEST = 0.5  # and the prop is nearer than this [leg lengths]


def rises_over(one: Performer, near: PropContacts, prop: PlacedProp) -> Array:
    """(frames, joints, 3), how much higher than where the prop takes the source's the joints of `near` belong [target
    file units]: as much as brings their skin as far over the prop as the source's, or onto it where that is in it; the
    mean over each rest. 0 for arms and feet, for joints that are beside the prop, and for bodies without thickness.
    """
    clip, undersides, rises = one.clip, one.match.undersides, np.zeros(near.source.shape)
    if undersides is None:
        return rises
    on = np.flatnonzero(IS_SEAT[undersides.target.segments[near.joints]])
    joints, x, far = near.joints[on], near.source[:, on], FARTHEST * clip.leg_lengths[0]
    below = undersides.source.below(clip.source, clip.drivers[joints], clip.up)
    own_below = undersides.target.below(clip.copy, joints, clip.up)
    feet, out = nearest_places(prop.surface, prop.motion, x, far)
    above = np.minimum((x - feet) @ clip.up, below)
    higher = np.where(out @ clip.up > OVER, own_below - prop.free.scale * above, 0.0)
    moves = joint_speeds(clip.source, clip.drivers[joints], clip.shots) > REST_SPEED * clip.leg_lengths[0]
    weights = near.f[:, on] * np.where(moves, MOVING, 1.0)
    for column, each, weight in zip(on, higher.T, weights.T, strict=True):
        rises[:, column] = by_shot(over_runs, clip.shots, each[:, None], weight) * clip.up
    return rises


def seated(one: Performer, near: PropContacts, prop: PlacedProp) -> Performer:
    """Return the performer on a path on which its joints are as high over a prop as they belong."""
    up, copied = one.clip.up, one.clip.copy_on_path(near.joints)
    weights = np.where(near.rises.any(axis=2), near.f, 0.0)
    if not weights.any():
        return one
    off = weights * ((near.places(prop.free) - copied) @ up)
    mean = off.sum(axis=1) / np.maximum(weights.sum(axis=1), 1.0)
    smooth = partial(averaged, reach=round(ROOT_BLEND / one.clip.frame_time))
    return moved_by(one, by_shot(smooth, one.clip.shots, mean)[:, None] * up)


def moved_by(one: Performer, by: Array) -> Performer:
    """Return the performer on its path moved by vectors, (frames, 3) [target file units], and what rests moved by their
    mean over the rest; feet along the floor.
    """
    clip, supports = one.clip, one.supports
    if not by.any():
        return one
    rests, places = supports.weights >= RESTS, np.array(supports.places)
    for support in range(len(supports.joints)):
        is_foot = support < supports.feet
        resting = rests[:, [support, support ^ 1]].any(axis=1) if is_foot else rests[:, support]
        moved = level(by, clip.up) if is_foot else by
        places[:, support] += by_shot(over_runs, clip.shots, moved, resting.astype(float))
    return replace(one, clip=clip.raised(by), supports=replace(supports, places=places))
