"""Hands that copied rotations bring deep into a head, or past each other, are on the side on which the source has them.

On a body with a large head, or with short arms, a hand above the head in the source is in the middle of the head. From
there the shortest way out may lead behind the neck, and change from frame to frame. With long arms, hands that clap
pass each other, and the shortest way apart leads each to the other's side. So before limbs leave what they are in, such
a hand goes to the direction from the middle of the head, in the head's own axes, that it has in the source, and to the
source's distance from the head's skin, or as near to that as the arm reaches; and hands that touch go to those from the
middle between the two, in the axes of the trunk.
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

# A hand that is less deep in a head leaves it by the shortest way, which is on the source's side. From the second depth
# on, half-way to the middle, no side is the nearest, and it goes to the source's side first [radii of the head].
SHALLOW, DEEP = 0.1, 0.5
LEAD = 0.15  # it begins to go there twice this time before it gets so deep, and is back twice this time after [s]
STEADY = 0.1  # what the arm does is averaged over this time before and after each frame [s]
HEAD = SEGMENTS.index("head")


def approached(clip: Clip, skins: Skins, posed: Motion, free: Array) -> Motion:
    """Return a motion of the target with hands that are deep in its head, or have passed each other, brought to the
    source's side; `free`, (frames, limbs), is how far the end of each limb can move, 0 to 1.
    """
    one, other = skins.source, skins.target
    hands = {limb: segment for limb, (segment, *_) in shared_hands(one, other).items()}
    before, now = _Hands.of(one, clip.source, hands), _Hands.of(other, posed, hands)
    if before is None or now is None:
        return posed
    middles = [*zip(before.middles, now.middles, strict=True)]
    if skins.are_alike:
        del middles[1:]  # hands of the same body are where they were
    moved = np.zeros((len(posed), len(other.limbs), 2, 3))
    for limb, hand in now.places.items():
        way = np.zeros_like(hand)
        for there, here in middles:
            direction, distance = there.seen(before.places[limb], clip)
            distance *= now.unit / before.unit
            place = here.place_of(direction, distance)
            share = smoothstep((here.depth(hand, place, distance) - SHALLOW) / (DEEP - SHALLOW))[:, None]
            if share.any():
                share = clip.averaged(clip.widened(share, LEAD), LEAD) * free[:, limb, None]
                way += share * (place - hand - way)
        if way.any():
            moved[:, limb] = reaching(posed, other.limbs[limb], way, np.zeros_like(way))
    return bent(posed, other.limbs, clip.averaged(moved, STEADY)) if moved.any() else posed


@dataclass(frozen=True, eq=False)
class _Middle:
    """The middle of a head, or that between two hands, in each frame of a motion [file units]."""

    at: Array  # (frames, 3)
    axes: Array  # (frames, 3, 3), of what it moves with, as rows
    radius: float  # of the head, or of a hand
    is_of_head: bool

    def seen(self, places: Array, clip: Clip) -> tuple[Array, Array]:
        """Return the directions of places, (frames, 3), from the middle, in its axes, and their distances from the
        skin, (frames, 1). Hands that are in each other touch, on the sides that they come from.
        """
        off = np.einsum("fij,fj->fi", self.axes, places - self.at)
        if self.is_of_head:
            return normalised(off), lengths(off)[:, None] - self.radius
        directions = normalised(clip.averaged(off, LEAD))
        return directions, np.maximum((off * directions).sum(axis=1, keepdims=True) - self.radius, 0.0)

    def place_of(self, directions: Array, distances: Array) -> Array:
        """Return where directions and distances from the skin lead, (frames, 3)."""
        off = np.einsum("fij,fi->fj", self.axes, directions)
        return np.asarray(self.at + (self.radius + distances) * off)

    def depth(self, hand: Array, place: Array, distances: Array) -> Array:
        """Return how deep a hand, (frames, 3), is in the head, or by how much it is deeper in the other hand than where
        it belongs, (frames,) [radii]; `distances` are those `seen` in the source, where hands have to touch.
        """
        off = hand - self.at
        if self.is_of_head:
            return np.asarray(1.0 - lengths(off) / self.radius)
        deeper = ((place - hand) * normalised(place - self.at)).sum(axis=1) / self.radius
        return np.asarray(deeper * smoothstep(1.0 - distances[:, 0] / self.radius))


@dataclass(frozen=True, eq=False)
class _Hands:
    """Where the hands of a body are in each frame of a motion [file units], and what they are seen from."""

    places: dict[int, Array]  # (frames, 3), by the arm's number in the target
    middles: tuple[_Middle, ...]
    unit: float  # of the body

    @classmethod
    def of(cls, body: BodySkin, motion: Motion, segments: dict[int, int]) -> _Hands | None:
        """Return those of a body, with the segment of the hand of each arm; None where its head or its landmarks are
        not known.
        """
        head = body.capsules.segments == HEAD
        if not head.any() or body.landmarks is None:
            return None
        ends, axes = body.posed(motion), body.landmarks.axes(motion).directions
        places = {limb: body.unit * body.centres(ends, segment).mean(axis=1) for limb, segment in segments.items()}
        of_head, of_trunk = (axes[:, [*PARTS].index(part)] for part in ("head", "trunk"))
        middle = body.unit * ends[:, head].mean(axis=(1, 2))
        middles = [_Middle(middle, of_head, float(body.capsules.radii[head].mean()), is_of_head=True)]
        if len(places) == 2:
            radii = [body.balls.radii[body.balls_of(segment)].mean() for segment in segments.values()]
            middle = np.mean([*places.values()], axis=0)
            middles.append(_Middle(middle, of_trunk, body.unit * float(np.mean(radii)), is_of_head=False))
        return cls(places, tuple(middles), body.unit)
