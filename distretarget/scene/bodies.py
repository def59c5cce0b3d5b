"""Several bodies and props as one body with many limbs, whose surfaces meet.

For each ball of a limb, a prop has one ball that stands for it, inside its surface at the point nearest to the limb's
ball. So the size and the shape of a prop do not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.objectives.body_skin import BodySkin
from distretarget.objectives.skin import limb_places
from distretarget.scene.prop_surface import PropSurface, nearest_places
from distretarget.skin.balls import NEVER, Balls, segment_gaps
from distretarget.skin.capsules import SEGMENTS
from distretarget.skin.limbs import bent
from distretarget.skin.tangents import Displaced

COUNT = len(SEGMENTS)  # segment s of body i has the number i * COUNT + s
FARTHEST = 0.2  # hands are not drawn to what is farther than this; fully from three quarters of it on [body units]
WITHIN = 0.1  # radius of the balls that touch the surface of a prop from within [body units]

# Segments meet those of another body of the same or a lower rank; what is near the trunk hardly gives way.
RANKS = {"hand": 4, "forearm": 4, "upper arm": 3, "shin": 2, "foot": 2, "thigh": 1}
RANK = np.array([RANKS.get(name.partition(" ")[2], 0) for name in SEGMENTS])
HARD = SEGMENTS.index("head")  # a prop is no softer than this, and all of it is one place


@dataclass(frozen=True, eq=False)
class PropShape:
    """A prop whose shape is known: by its surface, or, without one, by its bones."""

    surface: PropSurface | None
    follows: Flags  # (bodies, segments), the segments that it follows and does not keep off
    is_within: Flags  # (bodies, segments), those that may enclose it as in the source

    @property
    def radius(self) -> float:
        """That of its balls [body units]."""
        return WITHIN if self.surface else 0.0


class Bodies:
    """Several bodies and props as one: with the balls, capsules and limbs of all, in the mean body unit.

    The balls of prop k for body i are those of a body of its own, with the number n + k n + i, n being that of bodies.

    Attributes:
        skins: of each body.
        sticks: whether each is thick to the others alone; False for all if not given.
        shapes: of each prop.
        moved: the motions of all props while the bodies move so.
        unit: the mean of their body units [file units].
        balls: of all bodies, with the pairs of each and those of any two, and of each body and prop.
        parts: (pairs, 2), the part of the body that the segments of a pair are; `HARD` for a prop.
        encloses: (pairs,), whether the first may enclose the second as in the source.
        displaced: how they move with the limbs of all bodies.
    """

    def __init__(
        self,
        skins: Sequence[BodySkin],
        sticks: Sequence[bool] = (),
        shapes: Sequence[PropShape] = (),
        moved: Callable[[Sequence[Motion]], Sequence[Motion]] = lambda _motions: (),
    ) -> None:
        self.skins, self.shapes, self.moved = skins, shapes, moved
        self.unit = float(np.mean([skin.unit for skin in skins]))
        own = [skin.balls for skin in skins]
        scales = [skin.unit / self.unit for skin in skins]
        balls, capsules, limbs = (
            np.cumsum([0, *map(len, lists)])
            for lists in ([b.carriers for b in own], [b.joints for b in own], [skin.limbs for skin in skins])
        )
        pairs = [b.pairs + i * COUNT for i, b in enumerate(own) if not (sticks and sticks[i])]
        pairs += [_pairs_between(own, *both) for both in permutations(range(len(own)), 2)]
        spare = np.zeros((balls[-1], capsules[-1]))
        for i, (b, scale) in enumerate(zip(own, scales, strict=True)):
            rows, columns = slice(balls[i], balls[i + 1]), slice(capsules[i], capsules[i + 1])
            spare[rows][(b.spare == NEVER).all(axis=1)] = NEVER
            spare[rows, columns] = np.where(b.spare == NEVER, NEVER, scale * b.spare)
        radii = np.repeat([shape.radius for shape in shapes], balls[-1])
        met = np.where(np.eye(balls[-1], dtype=bool) & (spare != NEVER).any(axis=1), 0.0, NEVER)
        of_ball, of_capsule = _starts([b.of_ball for b in own], balls), _starts([b.of_capsule for b in own], capsules)
        to_props = [capsules[-1] + k * balls[-1] + of_ball[1:] for k in range(len(shapes))]
        between = sum(map(len, pairs))
        for (k, shape), (i, b) in product(enumerate(shapes), enumerate(own)):  # limbs, each with that of the prop
            kept_off = np.flatnonzero((np.diff(b.of_ball) > 0) & ~shape.follows[i])
            pairs.append(kept_off[:, None] + COUNT * np.array([i, len(own) * (k + 1) + i]))
        self.balls = Balls(
            carriers=np.concatenate([b.carriers + first for b, first in zip(own, capsules, strict=False)]),
            places=np.concatenate([b.places for b in own]),
            radii=np.concatenate([scale * b.radii for b, scale in zip(own, scales, strict=True)]),
            joints=np.concatenate([*(b.joints for b in own), np.zeros(len(radii), np.intp)]),
            cap_radii=np.concatenate(
                [*(scale * b.cap_radii for b, scale in zip(own, scales, strict=True)), np.stack([radii] * 2, axis=1)]
            ),
            of_ball=np.concatenate([of_ball, *[np.full(len(of_ball) - 1, balls[-1])] * len(shapes)]),
            of_capsule=np.concatenate([of_capsule, *to_props]),
            pairs=np.concatenate(pairs),
            spare=np.concatenate([spare, *[met] * len(shapes)], axis=1),
        )
        self.parts = self.balls.pairs % COUNT
        self.parts[between:, 1] = HARD
        within = np.reshape([shape.is_within for shape in shapes], (len(shapes), len(own) * COUNT))
        body, prop = self.balls.pairs[between:, 0], self.balls.pairs[between:, 1] // COUNT // len(own) - 1
        self.encloses = np.append(np.zeros(between, bool), np.asarray(within[prop, body], bool))
        shares = [skin.displaced for skin in skins]
        moving = [np.where(m.limbs < 0, -1, m.limbs + first) for m, first in zip(shares, limbs, strict=False)]
        self.displaced = Displaced(
            limbs=np.concatenate([*moving, np.full(len(radii), -1)]),
            shares=np.concatenate([*(m.shares for m in shares), np.zeros((len(radii), 2, 2))]),
            mutual=np.equal(*np.isin(self.parts, np.flatnonzero(RANK > 2)).T),  # as of one body
        )

    def gaps(self, motions: Sequence[Motion]) -> Array:
        """(frames, pairs), the gap of each pair of segments [mean body units]."""
        return segment_gaps(self.balls, self.posed(motions), FARTHEST)

    def limbs(self, motions: Sequence[Motion]) -> Array:
        """(frames, limbs, 3, 3), the top, the middle and the end of each limb [mean body units]."""
        both = zip(self.skins, motions, strict=True)
        return np.concatenate([skin.unit / self.unit * limb_places(skin, motion) for skin, motion in both], axis=1)

    def bent(self, motions: Sequence[Motion], moves: Array) -> list[Motion]:
        """The motions with limbs displaced, (frames, limbs, 2, 3) [mean body units]."""
        parts = np.split(self.unit * moves, np.cumsum([len(skin.limbs) for skin in self.skins])[:-1], axis=1)
        return [bent(*each) for each in zip(motions, [skin.limbs for skin in self.skins], parts, strict=True)]

    def posed(self, motions: Sequence[Motion]) -> Array:
        """(frames, capsules, 2, 3), the ends of all capsules in each frame [mean body units]."""
        ends = [skin.unit / self.unit * skin.posed(motion) for skin, motion in zip(self.skins, motions, strict=True)]
        posed = np.concatenate(ends, axis=1)
        if self.shapes:
            t, of_limbs = self.balls.places[:, None], posed[:, self.balls.carriers]
            centres = (1.0 - t) * of_limbs[:, :, 0] + t * of_limbs[:, :, 1]
            props = zip(self.shapes, self.moved(motions), strict=True)
            posed = np.concatenate([posed, *(self._within(*prop, centres) for prop in props)], axis=1)
        return posed

    def _within(self, shape: PropShape, motion: Motion, centres: Array) -> Array:
        """(frames, balls, 2, 3), where the balls of a prop are that touch its surface next to those of limbs about
        `centres`, (frames, balls, 3); out of reach for those that are far off [mean body units].
        """
        far = FARTHEST + self.balls.radii.max(initial=0.0)
        feet, out = nearest_places(shape.surface, motion, self.unit * centres, self.unit * far)
        within = feet / self.unit - shape.radius * out
        within = np.where(np.isfinite(within), within, centres + 4.0 * far)
        return np.repeat(within[:, :, None], 2, axis=2)


def _pairs_between(own: Sequence[Balls], i: int, j: int) -> Numbers:
    """(pairs, 2), the segments of the limbs of body i that can touch those of body j; two of the same rank once."""
    limbs, parts = np.flatnonzero(np.diff(own[i].of_ball)), np.flatnonzero(np.diff(own[j].of_capsule))
    pairs = [(a, b) for a in limbs for b in parts if RANK[a] > RANK[b] or (RANK[a] == RANK[b] > 0 and i < j)]
    return np.asarray(np.array(pairs, np.intp).reshape(-1, 2) + COUNT * np.array([i, j]))


def _starts(numbers: Iterable[Numbers], firsts: Numbers) -> Numbers:
    """Joined lists of where segments begin, the last of each being its end."""
    starts = [own[:-1] + first for own, first in zip(numbers, firsts, strict=False)]
    return np.asarray(np.concatenate([*starts, firsts[-1:]]))
