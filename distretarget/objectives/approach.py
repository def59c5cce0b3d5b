"""Hands that copied rotations bring deep into a head leave it on the side on which they are in the source.

On a body with a large head, or with short arms, a hand above the head in the source is in the middle of the head. From
there the shortest way out may lead behind the neck, and change from frame to frame. So before limbs leave what they are
in, such a hand goes to the direction from the middle of the head, in the head's own axes, that it has in the source,
and to the source's distance from the head's skin, or as near to that as the arm reaches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from distretarget.motion import Motion
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, lengths
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
    """Return a motion of the target with hands that are deep in its head brought to the source's side of it; `free`,
    (frames, limbs), is how far the end of each limb can move, 0 to 1.
    """
    one, other = skins.source, skins.target
    ends = one.posed(clip.source), other.posed(posed)
    before, now = _Head.of(one, clip.source, ends[0]), _Head.of(other, posed, ends[1])
    if before is None or now is None:
        return posed
    moved = np.zeros((len(posed), len(other.limbs), 2, 3))
    for limb, (segment, *_) in shared_hands(one, other).items():
        hand = now.unit * other.centres(ends[1], segment).mean(axis=1)
        depth = 1.0 - lengths(hand - now.middle) / now.radius
        share = smoothstep((depth - SHALLOW) / (DEEP - SHALLOW))[:, None]
        if share.any():
            share = clip.averaged(clip.widened(share, LEAD), LEAD) * free[:, limb, None]
            seen = before.seen(before.unit * one.centres(ends[0], segment).mean(axis=1))
            way = now.place_of(*seen, now.unit / before.unit) - hand
            moved[:, limb] = reaching(posed, other.limbs[limb], share * way, np.zeros_like(way))
    return bent(posed, other.limbs, clip.averaged(moved, STEADY)) if moved.any() else posed


@dataclass(frozen=True, eq=False)
class _Head:
    """A head in each frame of a motion [file units]."""

    middle: Array  # (frames, 3)
    axes: Array  # (frames, 3, 3), its own directions, as rows
    radius: float
    unit: float  # of its body

    @classmethod
    def of(cls, body: BodySkin, motion: Motion, ends: Array) -> _Head | None:
        """Return the head of a body in a motion, with the ends of its capsules, as `BodySkin.posed`; None where its
        capsules or landmarks are not known.
        """
        on = body.capsules.segments == HEAD
        if not on.any() or body.landmarks is None:
            return None
        axes = body.landmarks.axes(motion).directions[:, [*PARTS].index("head")]
        middle = body.unit * ends[:, on].mean(axis=(1, 2))
        return cls(middle, axes, float(body.capsules.radii[on].mean()), body.unit)

    def seen(self, places: Array) -> tuple[Array, Array]:
        """Return the directions of places, (frames, 3), from the middle, in the head's axes, and their distances from
        its skin, (frames, 1).
        """
        off = np.einsum("fij,fj->fi", self.axes, places - self.middle)
        far = np.maximum(lengths(off)[:, None], np.finfo(float).tiny)
        return off / far, far - self.radius

    def place_of(self, directions: Array, distances: Array, scale: float) -> Array:
        """Return where directions and scaled distances from the skin lead, (frames, 3)."""
        off = np.einsum("fij,fi->fj", self.axes, directions)
        return np.asarray(self.middle + (self.radius + scale * distances) * off)
