"""Performers of the sample scenes, who reach for each other, and the tables of what they touch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from sample_body import SIDES, Place, Points, Trunk, aimed_arm, motion, turned
from sample_motions import hanging_arm, planted_feet
from sample_tracks import FPS, Track
from scipy.spatial.transform import Rotation

from distretarget.motion import Motion
from distretarget.scene.props import Prop

NEAREST = ""


@dataclass(frozen=True)
class Contact:
    """Two points that touch from frame `first` to frame `last`, both included.

    Attributes:
        one, other: the number of a performer or, counted on from these, of a prop, and a joint there; `NEAREST` for
            the nearest point of a prop.
    """

    one: tuple[int, str]
    other: tuple[int, str]
    first: int
    last: int


@dataclass(frozen=True)
class SampleScene:
    """Performers, props, and what touches between them."""

    performers: Mapping[str, Motion]
    contacts: tuple[Contact, ...]
    props: tuple[Prop, ...] = ()


@dataclass(frozen=True)
class Reach:
    """Where a hand goes, in the performer's own world.

    Attributes:
        wrist: (frames, 3) or (3,), the place of the wrist [cm].
        hand: the rotation of the hand.
        weight: (frames,), 1 while the hand is there, 0 while the arm hangs.
        elbow: (3,), the direction of the elbow.
    """

    wrist: ArrayLike
    hand: Rotation
    weight: Track
    elbow: ArrayLike = (0.0, -1.0, -0.3)


def performer(t: Track, trunk: Trunk, reaches: Mapping[str, Reach], feet: Mapping | None = None) -> Motion:
    """A body that stands, with hands that reach, by side."""
    arms = {side: hanging_arm(t, 0.2 * number) for number, side in enumerate(SIDES)}
    for side, reach in reaches.items():
        wrist = np.broadcast_to(np.asarray(reach.wrist, float), (len(t), 3))
        arm = aimed_arm(side, trunk.chest(), (wrist, reach.hand), reach.elbow)
        arms[side] = arms[side].blended(arm, reach.weight)
    return motion(trunk, arms, feet or planted_feet(t, width=22, toe_out=9))


def opposite(points: ArrayLike, gap: float) -> Points:
    """Points in the world of a performer who stands `gap` [cm] before this one, and faces it."""
    return np.asarray(points, float) * (-1.0, 1.0, -1.0) + (0.0, 0.0, gap)


def facing(source: Motion, gap: float) -> Motion:
    """The motion of a performer who stands `gap` [cm] before another, and faces it, in the other's world."""
    half = turned(yaw=180.0)
    rotations = np.array(source.rotations)
    rotations[:, 0] = (half * Rotation.from_quat(rotations[:, 0])).as_quat()
    return replace(source, root_positions=opposite(source.root_positions, gap), rotations=rotations)


def on_body(place: Place, offset: ArrayLike) -> Points:
    """(frames, 3), a point of a part of the body."""
    position, rotation = place
    return position + rotation.apply(offset)


def contact(one: tuple[int, str], other: tuple[int, str], start: float, end: float) -> Contact:
    """A contact between two times [s]."""
    return Contact(one, other, int(np.ceil(start * FPS)), int(np.floor(end * FPS)))
