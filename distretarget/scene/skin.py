"""Skin of performers who share a world: limbs are bent out of other bodies and props, and hands lie on what they touch.

All performers are solved as one body with many limbs, in one unit, so that both limbs of a contact move. Hands that
touch another performer or a prop in the source are drawn to its surface, on a performer to the same place of the body
(`objectives.skin`). Each ball of a limb has one proxy ball on each prop, placed inside its surface at the nearest
point, so that the size and shape of the prop do not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from distretarget.body.build import capsules_by_build
from distretarget.ik.limb_terms import Frames
from distretarget.ik.poses import Poses
from distretarget.ik.springs import Springs
from distretarget.motion import Motion
from distretarget.numerics.time_series import slices_of, smoothstep, spans_of
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths
from distretarget.objectives.anchors import anchor_weight, no_anchors, shared_hands
from distretarget.objectives.approach import LEAD, STEADY
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact_zones import APART, ContactZones, gaps_of_pairs
from distretarget.objectives.part_axes import ARM_PARTS, IS_ROUND, PARTS, rays
from distretarget.objectives.skin import (
    floor_below,
    how_free,
    how_touching,
    limb_displacements,
    limb_places,
    nearness,
    softness,
)
from distretarget.objectives.supports import BLEND
from distretarget.pipeline.options import SkinMode
from distretarget.pipeline.performer import Performer
from distretarget.pipeline.result import Match
from distretarget.scene.contacts import PropContacts, SceneContacts, common_shots
from distretarget.scene.props import PropSurface, nearest_places
from distretarget.skin.balls import NEVER, Balls, segment_gaps
from distretarget.skin.capsules import GROUP, SEGMENTS
from distretarget.skin.displacement import NOTHING
from distretarget.skin.limbs import LEAST, bent, reaching
from distretarget.skin.tangents import Displaced

COUNT = len(SEGMENTS)  # segment s of body i has the number i * COUNT + s
DRAWN_WITHIN = 0.2  # hands are drawn to gaps below this, with full weight below three quarters of it [body units]
PROXY_RADIUS = 0.1  # of the balls that touch the surface of a prop from within [body units]

# Collisions of two bodies are those of segments with segments of the same or a lower rank.
RANKS = {"hand": 4, "forearm": 4, "upper arm": 3, "shin": 2, "foot": 2, "thigh": 1}
RANK = np.array([RANKS.get(name.partition(" ")[2], 0) for name in SEGMENTS])
HARD = SEGMENTS.index("head")  # props count as this segment: hard, and one place
WORSE = 0.01  # bends by which a limb gets deeper than before by more than this, on average, are undone [body units]
# The segments of each of `PARTS` that is no part of an arm, and so stays in place while arms bend.
STEADY_PARTS = [np.array([*map(SEGMENTS.index, names)]) for part, names in PARTS.items() if part not in ARM_PARTS]
SAME_SIDE = 0.7  # hands move to the source's side if the cosine of their direction to its is less, in full below 0
IS_HAND = np.array(["hand" in name for name in SEGMENTS])


@dataclass(frozen=True, eq=False)
class PropShape:
    """A prop whose shape is known: by its surface, or, without one, by its bones."""

    surface: PropSurface | None
    follows: Flags  # (bodies, segments), the segments that the prop follows, which do not collide with it
    is_within: Flags  # (bodies, segments), the segments that may overlap with it as in the source

    @property
    def radius(self) -> float:
        """The radius of its proxy balls [body units]."""
        return PROXY_RADIUS if self.surface else 0.0


class Bodies:
    """Several bodies and props as one body, with the balls, capsules and limbs of all, in the mean body unit.

    Attributes:
        skins: of each body. Skins of bodies marked in `are_sticks` collide with other bodies, not with themselves.
        shapes: of each prop; `moved` returns the motions of the props for motions of the bodies.
        unit: the mean of their body units [file units].
        balls: of all bodies, with the pairs within a body, between two bodies, and between body and prop. The proxy
            balls of prop k for body i of n are numbered as a body of their own, n + k n + i.
        parts: (pairs, 2), the segments of each pair, without the number of the body; `HARD` for a prop.
        encloses: (pairs,), whether the pair may overlap as in the source.
        displaced: how balls and capsules move with the limbs of all bodies.
    """

    def __init__(
        self,
        skins: Sequence[BodySkin],
        are_sticks: Sequence[bool] = (),
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
        pairs = [b.pairs + i * COUNT for i, b in enumerate(own) if not (are_sticks and are_sticks[i])]
        pairs += [_pairs_between(own, *both) for both in permutations(range(len(own)), 2)]
        gap_offsets = np.zeros((balls[-1], capsules[-1]))
        for i, (b, scale) in enumerate(zip(own, scales, strict=True)):
            rows, columns = slice(balls[i], balls[i + 1]), slice(capsules[i], capsules[i + 1])
            gap_offsets[rows][(b.gap_offsets == NEVER).all(axis=1)] = NEVER
            gap_offsets[rows, columns] = np.where(b.gap_offsets == NEVER, NEVER, scale * b.gap_offsets)
        radii = np.repeat([shape.radius for shape in shapes], balls[-1])
        gap_offsets_of_prop = np.where(np.eye(balls[-1], dtype=bool) & (gap_offsets != NEVER).any(axis=1), 0.0, NEVER)
        of_ball, of_capsule = _starts([b.of_ball for b in own], balls), _starts([b.of_capsule for b in own], capsules)
        to_props = [capsules[-1] + k * balls[-1] + of_ball[1:] for k in range(len(shapes))]
        between = sum(map(len, pairs))
        for (k, shape), (i, b) in product(enumerate(shapes), enumerate(own)):  # each segment with its proxy
            colliding = np.flatnonzero((np.diff(b.of_ball) > 0) & ~shape.follows[i])
            pairs.append(colliding[:, None] + COUNT * np.array([i, len(own) * (k + 1) + i]))
        self.balls = Balls(
            carriers=np.concatenate([b.carriers + first for b, first in zip(own, capsules, strict=False)]),
            fractions=np.concatenate([b.fractions for b in own]),
            radii=np.concatenate([scale * b.radii for b, scale in zip(own, scales, strict=True)]),
            joints=np.concatenate([*(b.joints for b in own), np.zeros(len(radii), np.intp)]),
            cap_radii=np.concatenate(
                [*(scale * b.cap_radii for b, scale in zip(own, scales, strict=True)), np.stack([radii] * 2, axis=1)]
            ),
            of_ball=np.concatenate([of_ball, *[np.full(len(of_ball) - 1, balls[-1])] * len(shapes)]),
            of_capsule=np.concatenate([of_capsule, *to_props]),
            pairs=np.concatenate(pairs),
            gap_offsets=np.concatenate([gap_offsets, *[gap_offsets_of_prop] * len(shapes)], axis=1),
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
            mutual=np.equal(*np.isin(self.parts, np.flatnonzero(RANK > 2)).T),  # two arms, or none
        )

    def gaps(self, motions: Sequence[Motion]) -> Array:
        """(frames, pairs), the gap of each pair of segments [mean body units]."""
        return segment_gaps(self.balls, self.posed(motions), DRAWN_WITHIN)

    def limbs(self, motions: Sequence[Motion]) -> Array:
        """(frames, limbs, 3, 3), the top, the middle and the end of each limb [mean body units]."""
        both = zip(self.skins, motions, strict=True)
        return np.concatenate([skin.unit / self.unit * limb_places(skin, motion) for skin, motion in both], axis=1)

    def bent(self, motions: Sequence[Motion], moves: Array) -> list[Motion]:
        """The motions with limbs displaced by `moves`, (frames, limbs, 2, 3) [mean body units]."""
        parts = np.split(self.unit * moves, np.cumsum([len(skin.limbs) for skin in self.skins])[:-1], axis=1)
        return [bent(*each) for each in zip(motions, [skin.limbs for skin in self.skins], parts, strict=True)]

    def posed(self, motions: Sequence[Motion]) -> Array:
        """(frames, capsules, 2, 3), the ends of all capsules in each frame [mean body units]."""
        ends = [skin.unit / self.unit * skin.posed(motion) for skin, motion in zip(self.skins, motions, strict=True)]
        posed = np.concatenate(ends, axis=1)
        if self.shapes:
            t, of_limbs = self.balls.fractions[:, None], posed[:, self.balls.carriers]
            centres = (1.0 - t) * of_limbs[:, :, 0] + t * of_limbs[:, :, 1]
            props = zip(self.shapes, self.moved(motions), strict=True)
            posed = np.concatenate([posed, *(self._proxies(*prop, centres) for prop in props)], axis=1)
        return posed

    def _proxies(self, shape: PropShape, motion: Motion, centres: Array) -> Array:
        """(frames, balls, 2, 3), proxy balls of a prop for balls of limbs; out of reach where the prop is far off."""
        far = DRAWN_WITHIN + self.balls.radii.max(initial=0.0)
        feet, out = nearest_places(shape.surface, motion, self.unit * centres, self.unit * far)
        places = feet / self.unit - shape.radius * out
        places = np.where(np.isfinite(places), places, centres + 4.0 * far)
        return np.repeat(places[:, :, None], 2, axis=2)


def _pairs_between(own: Sequence[Balls], i: int, j: int) -> Numbers:
    """(pairs, 2), the limb segments of body i that collide with segments of body j; two of the same rank once."""
    limbs, parts = np.flatnonzero(np.diff(own[i].of_ball)), np.flatnonzero(np.diff(own[j].of_capsule))
    pairs = [(a, b) for a in limbs for b in parts if RANK[a] > RANK[b] or (RANK[a] == RANK[b] > 0 and i < j)]
    return np.asarray(np.array(pairs, np.intp).reshape(-1, 2) + COUNT * np.array([i, j]))


def _starts(numbers: Iterable[Numbers], firsts: Numbers) -> Numbers:
    """Concatenate lists of where segments begin, each with its end last; `firsts` are the offsets of the lists."""
    starts = [own[:-1] + first for own, first in zip(numbers, firsts, strict=False)]
    return np.asarray(np.concatenate([*starts, firsts[-1:]]))


def collision_skins(matches: Sequence[Match], modes: Sequence[SkinMode]) -> list[Skins | None]:
    """Return the surface of each performer that others stay outside of, an average one if only others have skin."""
    found, any_skin = [], any(match.skins for match in matches)
    for match, mode in zip(matches, modes, strict=True):
        bodies, skins = (match.matching.source, match.matching.target), match.skins
        if any_skin and skins is None and mode != "none":
            skins = Skins.of(match.matching, *map(capsules_by_build, bodies))
        found.append(skins)
    return found


def with_skins(contacts: SceneContacts, poses: Sequence[Poses], skins: Sequence[Skins | None]) -> list[Motion]:
    """Return the performers' motions with limbs bent by their own skins, then by the `skins` of all and by props."""
    performers = contacts.performers
    unbent = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
    known = {number: skin for number, skin in enumerate(skins) if skin}
    if not known:
        return unbent
    numbers, shapes = [*known], _find_shapes(contacts, known)
    are_sticks, props = [performers[i].match.skins is None for i in numbers], [contacts.props[k].motion for k in shapes]
    sources = Bodies([skin.source for skin in known.values()], are_sticks, [*shapes.values()], lambda _: props)
    posed = _with_own_skins(contacts, unbent, sources, known)
    if len(known) < 2 and not shapes:
        return posed
    to_props = contacts.springs_to_props(posed, {*range(len(contacts.props))} - shapes.keys())
    drawn = [_with_springs(performers[i], to_props[i]) for i in numbers]
    touched = [[contacts.on_props[i, k] for k in shapes] for i in numbers]
    with_skin = [_without_supports_on(*each) for each in zip(drawn, touched, strict=True)]

    def all_motions(moved: Sequence[Motion]) -> list[Motion]:
        return [moved[numbers.index(i)] if i in numbers else now for i, now in enumerate(posed)]

    def prop_motions(moved: Sequence[Motion]) -> list[Motion]:
        places = contacts.placements(all_motions(moved))
        return [places[k].moved(contacts.props[k].motion) for k in shapes]

    bodies = Bodies([skin.target for skin in known.values()], are_sticks, [*shapes.values()], prop_motions)
    separated = _separated(with_skin, bodies, sources, [posed[i] for i in numbers])
    return all_motions(_without_worse_bends(with_skin, bodies, [unbent[i] for i in numbers], separated))


def _with_own_skins(
    contacts: SceneContacts, unbent: Sequence[Motion], sources: Bodies, known: Mapping[int, Skins]
) -> list[Motion]:
    """The motions with limbs bent by their own skins, but not limbs that touch another performer or are drawn away."""
    performers, posed = contacts.performers, [*unbent]
    clips = [performers[i].clip for i in known]
    pairs = sources.balls.pairs
    gaps = segment_gaps(sources.balls, sources.posed([clip.source for clip in clips]), APART)
    near, between = nearness(gaps), np.not_equal(*(pairs // COUNT).T)
    drawn = contacts.springs_to_props(unbent) if len(known) == len(unbent) else contacts.springs(unbent, unbent)
    for row, (i, skin) in enumerate(known.items()):
        one, touching = performers[i], np.zeros((len(gaps), len(skin.target.limbs)))
        for number, limb in enumerate(skin.target.limbs):
            segments = np.setdiff1d(skin.target.of_joint[[*limb.joints]], [-1])
            own = np.isin(pairs, row * COUNT + segments).any(axis=1)
            touching[:, number] = near[:, own & between].max(axis=1, initial=0.0)
        others = np.maximum(one.clip.widened(touching, BLEND), _pull(_with_springs(one, drawn[i]), skin.target))
        posed[i] = one.with_own_skin(unbent[i], self_contact=1.0 - others)
    return posed


def _find_shapes(contacts: SceneContacts, skins: Mapping[int, Skins]) -> dict[int, PropShape]:
    """The shapes of the props, by their numbers. A prop does not collide with a hand that is its only holder, since it
    follows this hand; a prop without a surface, such as a stick, may be within the hands that hold it.
    """
    shapes = {}
    for k, prop in enumerate(contacts.props):
        if prop.surface is None and not prop.motion.skeleton.lengths[1:].any():  # no bone has a length
            continue
        holds = np.zeros((len(skins), COUNT), bool)
        for row, (i, skin) in enumerate(skins.items()):
            skeleton = contacts.performers[i].clip.skeleton
            for joint in prop.grips.get(i, ()):
                held_by = skin.target.of_joint[[*skeleton.subtree(joint)]]
                holds[row, held_by[held_by >= 0]] = True
        one_holds = sum(map(len, prop.grips.values())) == 1
        shapes[k] = PropShape(prop.surface, holds & one_holds, holds & (prop.surface is None))
    return shapes


def _without_supports_on(one: Performer, props: Sequence[PropContacts]) -> Performer:
    """The performer without supports, except feet, while these touch props: the shapes of the props hold them."""
    supports, weights = one.supports, np.array(one.supports.weights)
    for near in props:
        for support in range(supports.feet, len(supports.joints)):
            f = near.f[:, near.joints == supports.joints[support]]
            weights[:, support] *= 1.0 - f.max(axis=1, initial=0.0)
    return replace(one, supports=replace(supports, weights=weights))


def _with_springs(one: Performer, springs: Springs) -> Performer:
    return replace(one, supports=replace(one.supports, scene_springs=springs))


def _separated(
    performers: Sequence[Performer], bodies: Bodies, sources: Bodies, posed: Sequence[Motion]
) -> Sequence[Motion]:
    """The motions with limbs bent out of other bodies and props, and hands drawn to what they touch of these."""
    balls, shots = bodies.balls, common_shots(performers)
    clips = [replace(each.clip, shots=shots) for each in performers]
    in_source = segment_gaps(sources.balls, sources.posed([clip.source for clip in clips]), APART)
    in_source = gaps_of_pairs(in_source, sources.balls.pairs, balls.pairs)
    least = np.where(bodies.encloses, np.minimum(in_source, 0.0), 0.0)
    soft, gaps = np.maximum(softness(balls, bodies.parts, in_source), -least), bodies.gaps(posed)
    (one, other), parts = (balls.pairs // COUNT).T, bodies.parts
    zones = ContactZones.of(balls.pairs[:, 0], GROUP[parts[:, 1]] + COUNT * other)  # on each performer and prop
    of_hands = np.where((one != other) & IS_HAND[parts].any(axis=1), in_source, APART)
    touching = how_touching(zones, zones.least(of_hands)) * smoothstep(4.0 * (1.0 - zones.least(gaps) / DRAWN_WITHIN))
    free = []  # not while springs draw limbs to a prop without a shape
    for performer, skin in zip(performers, bodies.skins, strict=True):
        undrawn = 1.0 - _pull(performer, skin)
        free.append(how_free(performer.clip, skin, performer.supports, performer.settings) * undrawn[..., None])
    limbs, touching = [limb for skin in bodies.skins for limb in skin.limbs], clips[0].averaged(touching, BLEND)
    can_move = np.concatenate(free, axis=1)
    posed, anchors = _hands_on_others(clips, sources, bodies, posed, zones, in_source, touching, can_move)
    ends = bodies.posed(posed)
    frames = Frames(
        posed=ends,
        limbs=bodies.limbs(posed),
        free=can_move,
        soft=np.where(one == other, np.maximum(soft, -gaps), soft),  # own parts are apart already
        **floor_below(balls, bodies.displaced, ends, len(limbs), clips[0]),
        target_gaps=zones.least(np.maximum(in_source, least)),
        firmness=touching,
        **anchors,
    )
    moves = limb_displacements(balls, bodies.displaced, zones, frames, limbs, shots, clips[0].frame_time, DRAWN_WITHIN)
    return bodies.bent(posed, moves)


def _hands_on_others(
    clips: Sequence[Clip],
    sources: Bodies,
    bodies: Bodies,
    posed: Sequence[Motion],
    zones: ContactZones,
    in_source: Array,
    firmness: Array,
    free: Array,
) -> tuple[list[Motion], dict[str, Array]]:
    """The motions, and the anchor fields of `Frames` that bring the middle of a hand to the same place of another
    performer's body. Hands on another side of that body than in the source are moved round its axis to the source's
    side, where the shortest path out of it is the right one.
    """
    count, kinds = len(bodies.skins), len(STEADY_PARTS)
    firsts = np.cumsum([0, *(len(skin.limbs) for skin in bodies.skins)])
    fields = no_anchors(len(firmness), int(firsts[-1]), count * kinds)
    moved = [np.zeros((len(firmness), len(skin.limbs), 2, 3)) for skin in bodies.skins]
    for i, j in permutations(range(count), 2):
        one, other = sources.skins[i], bodies.skins[i]
        touched, own = sources.skins[j].landmarks, bodies.skins[j].landmarks
        if touched is None or own is None:
            continue
        axes = touched.axes(clips[j].source), own.axes(posed[j])
        along = np.where(IS_ROUND[:kinds, None], 0.0, axes[1].directions[:, :kinds, 0])
        for limb, (hand, *_) in shared_hands(one, other).items():
            points, now = _middle(one, clips[i].source, hand), _middle(other, posed[i], hand)
            places, out, _ = rays(*axes, np.repeat(points[:, None, None], len(PARTS), axis=2))
            off, out = now[:, None] - places[:, 0, :kinds], out[:, 0, :kinds]
            ends = [(i * COUNT + hand, j * COUNT + parts) for parts in STEADY_PARTS]
            ties = [anchor_weight(bodies.balls.pairs, zones, *both, in_source, firmness) for both in ends]
            at, weights = np.s_[:, firsts[i] + limb, j * kinds : (j + 1) * kinds], np.stack(ties, axis=1)
            fields["anchor_offsets"][at], fields["anchor_rays"][at], fields["anchor_weights"][at] = off, out, weights
            by = _to_side(clips[i], off, out, along, weights) * free[:, firsts[i] + limb, 1, None]
            moved[i][:, limb] += reaching(posed[i], other.limbs[limb], by, 0.0 * by)
    moved = [clip.averaged(each, STEADY) for clip, each in zip(clips, moved, strict=True)]
    fields["anchor_offsets"] += np.concatenate(moved, axis=1)[:, :, None, 1]
    fields["anchor_offsets"] /= bodies.unit
    return [bent(motion, skin.limbs, by) for motion, skin, by in zip(posed, bodies.skins, moved, strict=True)], fields


def _to_side(clip: Clip, off: Array, out: Array, along: Array, weights: Array) -> Array:
    """The displacement, (frames, 3), that turns a point round the axes of parts to the directions `out`, where it is
    on another side. `off` are its offsets from the axes, `along` the directions of these, (frames, parts, 3) each;
    `weights` are (frames, parts).
    """
    radial = off - (off * along).sum(axis=2, keepdims=True) * along
    distances = lengths(radial)
    cosines = (radial * out).sum(axis=2) / np.maximum(distances, LEAST)
    share = clip.widened(weights * smoothstep(1.0 - cosines / SAME_SIDE), LEAD)
    turned = distances[..., None] * out - radial
    return np.asarray((clip.averaged(share, LEAD)[..., None] * turned).sum(axis=1))


def _middle(skin: BodySkin, motion: Motion, segment: int) -> Array:
    """(frames, 3), the mean centre of the balls of a segment [file units]."""
    return np.asarray(skin.unit * skin.centres(skin.posed(motion), segment).mean(axis=1))


def _pull(one: Performer, body: BodySkin) -> Array:
    """(frames, limbs), the largest weight, 0 to 1, with which scene springs draw a joint of each limb."""
    pull = np.zeros((len(one.clip), len(body.limbs)))
    for joint, weight in one.supports.touches:
        for number, limb in enumerate(body.limbs):
            if joint in one.clip.skeleton.subtree(limb.top):
                pull[:, number] = np.maximum(pull[:, number], weight)
    return pull


def _without_worse_bends(
    performers: Sequence[Performer], bodies: Bodies, before: Sequence[Motion], after: Sequence[Motion]
) -> Sequence[Motion]:
    """The motions `after` limbs are bent, but `before` in spans where a limb gets deeper from within a prop."""
    balls, (limbs, others) = bodies.balls, bodies.balls.pairs.T
    on, of_prop = bodies.displaced.limbs[balls.carriers[balls.of_ball[limbs]]], others >= COUNT * len(after)
    gaps, bent_gaps = (bodies.gaps(motions) for motions in (before, after))
    is_bent = np.abs(bodies.limbs(after) - bodies.limbs(before)).max(axis=(2, 3)) > NOTHING
    shots, rotations = common_shots(performers), [motion.rotations.copy() for motion in after]
    for limb, (number, joint) in enumerate((i, each.top) for i, skin in enumerate(bodies.skins) for each in skin.limbs):
        depth, bent_depth = (-each[:, on == limb].min(axis=1, initial=0.0) for each in (gaps, bent_gaps))
        in_prop = gaps[:, (on == limb) & of_prop].min(axis=1, initial=0.0) < 0.0
        joints = np.array([*after[number].skeleton.subtree(joint)])
        for shot in slices_of(shots):
            for first, end in shot.start + spans_of(is_bent[shot, limb]):
                span = slice(first, end)
                if in_prop[span].any() and bent_depth[span].mean() > depth[span].mean() + WORSE:
                    rotations[number][span, joints] = before[number].rotations[span, joints]
    return [replace(motion, rotations=own) for motion, own in zip(after, rotations, strict=True)]
