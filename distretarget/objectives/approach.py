"""Moves hands that copied rotations bring deep into the head, or past each other, to the side they are on in the
source.

On a body with a large head or short arms, a hand that is above the head in the source is inside it. From there the
shortest path out may lead behind the neck, and change from frame to frame. With long arms, clapping hands pass each
other, and the shortest path apart leads each to the other's side. So before penetration is resolved, a hand in the head
moves to the source's direction from the centre of the head, in the head's axes, and to the source's distance from the
head's skin, or as near as the arm reaches. Touching hands are placed in the same way relative to the midpoint between
them, in the axes of the trunk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from distretarget.motion import Motion
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, lengths, normalised
from distretarget.objectives.anchors import shared_hands
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.clip import Clip
from distretarget.objectives.part_axes import PARTS
from distretarget.skin.capsules import SEGMENTS
from distretarget.skin.limbs import bent, reaching

# Up to the first depth a hand in the head is not moved: its shortest path out is on the source's side. From the second
# on, half-way to the centre, it is moved in full [radii of the head].
SHALLOW, DEEP = 0.1, 0.5
LEAD = 0.15  # the displacement begins twice this time before the hand is so deep, and ends twice this time after [s]
STEADY = 0.1  # half the window of the moving average of the arm's displacements [s]
HEAD = SEGMENTS.index("head")


def with_hands_on_source_side(clip: Clip, skins: Skins, posed: Motion, free: Array) -> Motion:
    """Return the motion `posed` with hands that are deep in the head, or have passed each other, moved to the side they
    are on in the source. `free`, (frames, limbs), is how far the end of each limb can move, 0 to 1.
    """
    one, other = skins.source, skins.target
    hands = {limb: segment for limb, (segment, *_) in shared_hands(one, other).items()}
    before, now = _Hands.of(one, clip.source, hands), _Hands.of(other, posed, hands)
    if before is None or now is None:
        return posed
    centres = [*zip(before.centres, now.centres, strict=True)]
    if skins.are_alike:
        del centres[1:]  # on the same body the copy has the hands on their own sides
    moved = np.zeros((len(posed), len(other.limbs), 2, 3))
    for limb, hand in now.places.items():
        displacement = np.zeros_like(hand)
        for in_source, in_target in centres:
            direction, distance = in_source.polar(before.places[limb], clip)
            distance *= now.unit / before.unit
            place = in_target.place_at(direction, distance)
            share = smoothstep((in_target.depth(hand, place, distance) - SHALLOW) / (DEEP - SHALLOW))[:, None]
            if share.any():
                share = clip.averaged(clip.widened(share, LEAD), LEAD) * free[:, limb, None]
                displacement += share * (place - hand - displacement)
        if displacement.any():
            moved[:, limb] = reaching(posed, other.limbs[limb], displacement, np.zeros_like(displacement))
    return bent(posed, other.limbs, clip.averaged(moved, STEADY)) if moved.any() else posed


@dataclass(frozen=True, eq=False)
class _Centre:
    """The centre of a head, or the midpoint between two hands, in each frame of a motion [file units]."""

    at: Array  # (frames, 3)
    axes: Array  # (frames, 3, 3), of the head or the trunk, as rows
    radius: float  # of the head, or of a hand
    is_of_head: bool

    def polar(self, places: Array, clip: Clip) -> tuple[Array, Array]:
        """Return the directions from the centre to places, (frames, 3), in its axes, and the distances of places from
        the skin, (frames, 1). Directions of hands are averaged over time, and their distances are at least 0.
        """
        off = np.einsum("fij,fj->fi", self.axes, places - self.at)
        if self.is_of_head:
            return normalised(off), lengths(off)[:, None] - self.radius
        directions = normalised(clip.averaged(off, LEAD))
        return directions, np.maximum((off * directions).sum(axis=1, keepdims=True) - self.radius, 0.0)

    def place_at(self, directions: Array, distances: Array) -> Array:
        """Return the places at some directions and distances from the skin, (frames, 3)."""
        off = np.einsum("fij,fi->fj", self.axes, directions)
        return np.asarray(self.at + (self.radius + distances) * off)

    def depth(self, hand: Array, place: Array, distances: Array) -> Array:
        """Return how deep a hand, (frames, 3), is in the head, (frames,) [radii]; of two hands, how far it is short of
        its `place` along the direction from the midpoint, times a weight that falls to 0 where the source's `distances`
        say that hands do not touch.
        """
        off = hand - self.at
        if self.is_of_head:
            return np.asarray(1.0 - lengths(off) / self.radius)
        deeper = ((place - hand) * normalised(place - self.at)).sum(axis=1) / self.radius
        return np.asarray(deeper * smoothstep(1.0 - distances[:, 0] / self.radius))


@dataclass(frozen=True, eq=False)
class _Hands:
    """The places of a body's hands in each frame of a motion [file units], and the centres they are relative to."""

    places: dict[int, Array]  # (frames, 3), by limb index in the target
    centres: tuple[_Centre, ...]
    unit: float  # the body unit

    @classmethod
    def of(cls, body: BodySkin, motion: Motion, segments: dict[int, int]) -> _Hands | None:
        """Return the hands of a body; None if its head or its landmarks are unknown. `segments` are the hands' by limb
        index.
        """
        head = body.capsules.segments == HEAD
        if not head.any() or body.landmarks is None:
            return None
        ends, axes = body.posed(motion), body.landmarks.axes(motion)
        places = {limb: body.unit * body.centres(ends, segment).mean(axis=1) for limb, segment in segments.items()}
        on_head, on_trunk = map([*PARTS].index, ("head", "trunk"))
        radius = float(body.capsules.radii[head].mean())
        centres = [_Centre(axes.starts[:, on_head], axes.directions[:, on_head], radius, is_of_head=True)]
        if len(places) == 2:
            radii = [body.balls.radii[body.balls_of(segment)].mean() for segment in segments.values()]
            middle = np.mean([*places.values()], axis=0)
            radius = body.unit * float(np.mean(radii))
            centres.append(_Centre(middle, axes.directions[:, on_trunk], radius, is_of_head=False))
        return cls(places, tuple(centres), body.unit)
