"""Skin of performers who share a world: limbs leave the other bodies, and what touches in the source lies on them.

Here all performers are one body with many limbs, in one unit, so that limbs that meet give way alike; their own parts
stay apart as well. First, hands that touch another performer in the source are drawn to its skin, then limbs leave what
they are in, leading in time as those of a single performer (`objectives.skin`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from distretarget.ik.poses import Poses
from distretarget.ik.springs import Springs
from distretarget.motion import Motion
from distretarget.numerics.key_frames import KeyFrames
from distretarget.numerics.time_series import averaged, by_shot, median_of_three, smoothstep
from distretarget.objectives.skin import (
    APART,
    LITTLE,
    RATE,
    how_free,
    how_touching,
    led,
    limb_places,
    of_pairs,
    softness,
)
from distretarget.objectives.skins import BodySkin, Skins
from distretarget.pipeline.performer import Performer
from distretarget.scene.sweeps import SceneContacts
from distretarget.skin.balls import NEVER, Balls, segment_gaps
from distretarget.skin.capsules import PLACE, SEGMENTS
from distretarget.skin.displacement import Displaced, displacements
from distretarget.skin.limbs import bent

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Numbers = NDArray[np.intp]

COUNT = len(SEGMENTS)  # segment s of body i has the number i * COUNT + s
BLEND = 0.16  # hands are drawn by the average over this time on each side, weighted by a raised cosine [s]
FARTHEST = 0.2  # hands are not drawn to what is farther than this; fully from three quarters of it on [body units]

IS_HAND = np.array(["hand" in name for name in SEGMENTS])
# Segments meet those of another body of the same or a lower rank; what is near the trunk hardly gives way.
RANKS = {"hand": 4, "forearm": 4, "upper arm": 3, "shin": 2, "foot": 2, "thigh": 1}
RANK = np.array([RANKS.get(name.partition(" ")[2], 0) for name in SEGMENTS])


def with_skins(contacts: SceneContacts, poses: Sequence[Poses]) -> list[Motion]:
    """Return the performers' motions with limbs bent as their own skins ask, and those of the others."""
    performers = contacts.performers
    posed = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
    held = zip(performers, contacts.springs(posed, posed), posed, strict=True)
    posed = [_drawn(one, drawn).with_own_skin(now) for one, drawn, now in held]
    known = {number: one.match.skins for number, one in enumerate(performers) if one.match.skins}
    numbers = [*known]
    if len(numbers) < 2:
        return posed
    to_props = contacts.springs_to_props(posed)
    chosen = [_drawn(performers[i], to_props[i]) for i in numbers]
    moved = _apart(chosen, [*known.values()], [posed[i] for i in numbers])
    return [moved[numbers.index(i)] if i in numbers else now for i, now in enumerate(posed)]


def _drawn(one: Performer, springs: Springs) -> Performer:
    """The performer with springs to what it touches: there its own skin does not move it."""
    return replace(one, supports=replace(one.supports, scene_springs=springs))


def _apart(performers: Sequence[Performer], skins: Sequence[Skins], posed: Sequence[Motion]) -> Sequence[Motion]:
    """The motions of performers with hands that touch others drawn to them, and then all skins apart."""
    bodies, sources = Bodies([each.target for each in skins]), Bodies([each.source for each in skins])
    balls, clips = bodies.balls, [each.clip for each in performers]
    in_source = segment_gaps(sources.balls, sources.posed([clip.source for clip in clips]), APART)
    in_source = of_pairs(in_source, sources.balls.pairs, balls.pairs)
    soft, own = softness(balls.pairs % COUNT, in_source), np.equal(*(balls.pairs // COUNT).T)
    of_each = zip(performers, bodies.skins, strict=True)
    free = np.concatenate([how_free(one.clip, body, one.supports, one.settings) for one, body in of_each], axis=1)
    shots, time = np.sum([clip.shots for clip in clips], axis=0), clips[0].frame_time  # a new shot at any one's cuts

    ends, gaps = bodies.posed(posed), bodies.gaps(posed)
    firmness = _touching(balls.pairs, in_source) * smoothstep(4.0 * (1.0 - gaps / FARTHEST))
    wanted = gaps + firmness * (np.maximum(in_source, 0.0) - gaps)
    drawn = np.asarray((np.abs(wanted - gaps) > LITTLE).any(axis=1))
    if drawn.any():
        find = partial(displacements, balls, bodies.displaced, reach=FARTHEST)
        moves = by_shot(find, shots, ends, bodies.limbs(posed), free, drawn, gaps, soft, wanted, firmness)
        moves = by_shot(partial(averaged, reach=round(BLEND / time)), shots, moves)
        posed, drawn = bodies.bent(posed, moves), np.asarray(moves.any(axis=(1, 2, 3)))

    ends, gaps = bodies.posed(posed), bodies.gaps(posed)
    acts = ((gaps + soft < -LITTLE) & (~own | drawn[:, None])).any(axis=1)
    if not acts.any():
        return posed
    keys, given = KeyFrames.of(shots, time, RATE), (ends, bodies.limbs(posed), free)
    asked = tuple(each[keys.numbers] for each in (acts, gaps, soft, gaps, np.zeros_like(gaps)))
    return bodies.bent(posed, led(balls, bodies.displaced, given, asked, keys, FARTHEST))


def _touching(pairs: Numbers, in_source: Array) -> Array:
    """(frames, pairs), how much a hand touches another performer in the source, 0 to 1; 0 for other pairs."""
    (one, other), (limbs, parts) = (pairs // COUNT).T, (pairs % COUNT).T
    hands = (one != other) & (IS_HAND[limbs] | IS_HAND[parts])
    places = PLACE[parts] + COUNT * (other + pairs.max(initial=0) * one)  # of each two performers
    return np.asarray(hands * how_touching(limbs, places, in_source))


class Bodies:
    """Several bodies as one: with the balls, capsules and limbs of all, in their mean body unit.

    Attributes:
        skins: of each body.
        unit: the mean of their body units [file units].
        balls: of all bodies, with the pairs of each and those of any two.
        displaced: how they move with the limbs of all bodies.
    """

    def __init__(self, skins: Sequence[BodySkin]) -> None:
        self.skins = skins
        self.unit = float(np.mean([skin.unit for skin in skins]))
        own = [skin.balls for skin in skins]
        scales = [skin.unit / self.unit for skin in skins]
        balls, capsules, limbs = (
            np.cumsum([0, *map(len, lists)])
            for lists in ([b.carriers for b in own], [b.joints for b in own], [skin.limbs for skin in skins])
        )
        pairs = [b.pairs + i * COUNT for i, b in enumerate(own)]
        pairs += [_pairs_between(own, *both) for both in permutations(range(len(own)), 2)]
        spare = np.zeros((balls[-1], capsules[-1]))
        for i, (b, scale) in enumerate(zip(own, scales, strict=True)):
            rows, columns = slice(balls[i], balls[i + 1]), slice(capsules[i], capsules[i + 1])
            spare[rows][(b.spare == NEVER).all(axis=1)] = NEVER
            spare[rows, columns] = np.where(b.spare == NEVER, NEVER, scale * b.spare)
        self.balls = Balls(
            carriers=np.concatenate([b.carriers + first for b, first in zip(own, capsules, strict=False)]),
            places=np.concatenate([b.places for b in own]),
            radii=np.concatenate([scale * b.radii for b, scale in zip(own, scales, strict=True)]),
            joints=np.concatenate([b.joints for b in own]),
            cap_radii=np.concatenate([scale * b.cap_radii for b, scale in zip(own, scales, strict=True)]),
            reaches=np.concatenate([scale * b.reaches for b, scale in zip(own, scales, strict=True)]),
            of_ball=_starts([b.of_ball for b in own], balls),
            of_capsule=_starts([b.of_capsule for b in own], capsules),
            pairs=np.concatenate(pairs),
            spare=spare,
        )
        moved = [skin.displaced for skin in skins]
        self.displaced = Displaced(
            of_ball=np.concatenate([_shifted(m.of_ball, by) for m, by in zip(moved, limbs, strict=False)]),
            ball_shares=np.concatenate([m.ball_shares for m in moved]),
            of_end=np.concatenate([_shifted(m.of_end, by) for m, by in zip(moved, limbs, strict=False)]),
            end_shares=np.concatenate([m.end_shares for m in moved]),
            mutual=np.equal(*np.isin(self.balls.pairs % COUNT, np.flatnonzero(RANK > 2)).T),  # as of one body
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
        return median_of_three(np.concatenate(ends, axis=1))


def _pairs_between(own: Sequence[Balls], i: int, j: int) -> Numbers:
    """(pairs, 2), the segments of the limbs of body i that can touch those of body j; two of the same rank once."""
    limbs, parts = np.flatnonzero(np.diff(own[i].of_ball)), np.flatnonzero(np.diff(own[j].of_capsule))
    pairs = [(a, b) for a in limbs for b in parts if RANK[a] > RANK[b] or (RANK[a] == RANK[b] > 0 and i < j)]
    return np.asarray(np.array(pairs, np.intp).reshape(-1, 2) + COUNT * np.array([i, j]))


def _starts(numbers: Iterable[Numbers], firsts: Numbers) -> Numbers:
    """Joined lists of where segments begin, the last of each being its end."""
    starts = [own[:-1] + first for own, first in zip(numbers, firsts, strict=False)]
    return np.asarray(np.concatenate([*starts, firsts[-1:]]))


def _shifted(limbs: Numbers, by: int) -> Numbers:
    """The numbers of limbs, plus `by`; -1, which is none, stays."""
    return np.asarray(np.where(limbs < 0, limbs, limbs + by))
