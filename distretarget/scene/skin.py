"""Skin of performers who share a world: limbs leave other bodies and props, and hands that touch them lie on them.

Here all performers are one body with many limbs, in one unit, so that limbs that meet give way alike; their own parts
stay apart as well. Hands that touch another performer or a prop in the source are drawn to its surface, and limbs leave
what they are in, as those of a single performer (`objectives.skin`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from distretarget.body.build import average_for
from distretarget.ik.limb_terms import Frames
from distretarget.ik.poses import Poses
from distretarget.ik.springs import Springs
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.time_series import by_shot, smoothstep, widened
from distretarget.numerics.vectors import Array, normalised
from distretarget.objectives.anchors import no_anchors
from distretarget.objectives.body_skin import Skins
from distretarget.objectives.skin import brought_out, how_free, how_touching, softness
from distretarget.objectives.spots import APART, Spots, of_pairs
from distretarget.pipeline.options import SkinMode
from distretarget.pipeline.performer import Match, Performer
from distretarget.scene.bodies import COUNT, FARTHEST, Bodies, PropShape
from distretarget.scene.contacts import PropContacts
from distretarget.scene.scene_contacts import SceneContacts, common_shots
from distretarget.skin.balls import segment_gaps
from distretarget.skin.capsules import PLACE, SEGMENTS
from distretarget.skin.limbs import Limb

WORSE = 0.01  # a limb that is this much deeper than before is not displaced [body units]
TRIES = 4  # to find the frames in which it stays
BLEND = 0.16  # around frames in which a limb stays, it comes back over this time [s]

IS_HAND = np.array(["hand" in name for name in SEGMENTS])


def skins_in_company(matches: Sequence[Match], modes: Sequence[SkinMode]) -> list[Skins | None]:
    """Return the surface of each performer that the others stay outside of: its own; an average body's if it has none
    but another performer has one; None for the mode "none".
    """
    if not any(match.skins for match in matches):
        return [None] * len(matches)

    def on(matching: Matching) -> Skins | None:
        source, target = (average_for(body).on(body) for body in (matching.source, matching.target))
        return Skins.of(matching, source, target)

    return [
        match.skins or (on(match.matching) if mode != "none" else None)
        for match, mode in zip(matches, modes, strict=True)
    ]


def with_skins(contacts: SceneContacts, poses: Sequence[Poses], skins: Sequence[Skins | None]) -> list[Motion]:
    """Return the performers' motions with limbs bent as their own skins ask, and those that they have to the others."""
    performers = contacts.performers
    posed = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
    unbent, held = posed, zip(performers, contacts.springs(posed, posed), posed, strict=True)
    posed = [_drawn(one, drawn).with_own_skin(now) for one, drawn, now in held]
    known = {number: skin for number, skin in enumerate(skins) if skin}
    numbers, shapes = [*known], _find_shapes(contacts, known)
    if not known or (len(known) < 2 and not shapes):
        return posed
    to_props = contacts.springs_to_props(posed, {*range(len(contacts.props))} - shapes.keys())
    chosen = [_free_of(_drawn(performers[i], to_props[i]), [contacts.on_props[i, k] for k in shapes]) for i in numbers]

    def all_moved(moved: Sequence[Motion]) -> list[Motion]:
        return [moved[numbers.index(i)] if i in numbers else now for i, now in enumerate(posed)]

    def props_moved(moved: Sequence[Motion]) -> list[Motion]:
        places = contacts.placements(all_moved(moved))
        return [places[k].moved(contacts.props[k].motion) for k in shapes]

    sticks = [performers[i].match.skins is None for i in numbers]
    bodies = Bodies([skin.target for skin in known.values()], sticks, [*shapes.values()], props_moved)
    props = [contacts.props[k].motion for k in shapes]
    sources = Bodies([skin.source for skin in known.values()], sticks, [*shapes.values()], lambda _: props)
    apart = _apart(chosen, bodies, sources, [posed[i] for i in numbers])
    return all_moved(_where_it_helps(chosen, bodies, [unbent[i] for i in numbers], apart))


def _find_shapes(contacts: SceneContacts, skins: Mapping[int, Skins]) -> dict[int, PropShape]:
    """The shapes of the props, by their numbers, for performers with these skins. A prop follows a hand that alone
    holds it, and does not keep that hand off. A stick, of which only the line is known, may be within hands that hold
    it.
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


def _free_of(one: Performer, touching: Sequence[PropContacts]) -> Performer:
    """The performer with supports off the feet that do not hold where they touch props, whose shapes do so."""
    supports, weights = one.supports, np.array(one.supports.weights)
    for near in touching:
        for support in range(supports.feet, len(supports.joints)):
            f = near.f[:, near.joints == supports.joints[support]]
            weights[:, support] *= 1.0 - f.max(axis=1, initial=0.0)
    return replace(one, supports=replace(supports, weights=weights))


def _drawn(one: Performer, springs: Springs) -> Performer:
    """Return the performer with its scene springs; its own skin pass then leaves its limbs in scene contact alone."""
    return replace(one, supports=replace(one.supports, scene_springs=springs))


def _apart(
    performers: Sequence[Performer], bodies: Bodies, sources: Bodies, posed: Sequence[Motion]
) -> Sequence[Motion]:
    """The motions of performers with hands that touch others or props drawn to them, and then all skins apart."""
    balls, clips = bodies.balls, [each.clip for each in performers]
    in_source = segment_gaps(sources.balls, sources.posed([clip.source for clip in clips]), APART)
    in_source = of_pairs(in_source, sources.balls.pairs, balls.pairs)
    least = np.where(bodies.encloses, np.minimum(in_source, 0.0), 0.0)
    soft, gaps = np.maximum(softness(balls, bodies.parts, in_source), -least), bodies.gaps(posed)
    (one, other), parts = (balls.pairs // COUNT).T, bodies.parts
    spots = Spots.of(balls.pairs[:, 0], PLACE[parts[:, 1]] + COUNT * other)  # on each performer and prop
    of_hands = np.where((one != other) & IS_HAND[parts].any(axis=1), in_source, APART)
    touching = how_touching(spots, spots.least(of_hands)) * smoothstep(4.0 * (1.0 - spots.least(gaps) / FARTHEST))
    each = zip(performers, bodies.skins, strict=True)
    limbs, shots = [limb for skin in bodies.skins for limb in skin.limbs], common_shots(performers)
    frames = Frames(
        posed=bodies.posed(posed),
        limbs=bodies.limbs(posed),
        free=np.concatenate([how_free(p.clip, body, p.supports, p.settings) for p, body in each], axis=1),
        soft=np.where(one == other, np.maximum(soft, -gaps), soft),  # own parts are apart already
        aims=spots.least(np.maximum(in_source, least)),
        firmness=touching,
        **no_anchors(len(in_source), len(limbs)),
    )
    moves = brought_out(balls, bodies.displaced, spots, frames, limbs, shots, clips[0].frame_time, FARTHEST)
    return bodies.bent(posed, moves)


def _where_it_helps(
    performers: Sequence[Performer], bodies: Bodies, before: Sequence[Motion], after: Sequence[Motion]
) -> Sequence[Motion]:
    """The motions `after` limbs are bent, with each limb as `before` where it is deeper in others than then, blended
    over time: between a body and a wall that leave it no room, it is not displaced.
    """
    shots, time = common_shots(performers), performers[0].clip.frame_time
    on = bodies.displaced.limbs[bodies.balls.carriers[bodies.balls.of_ball[bodies.balls.pairs[:, 0]]]]
    limbs = range(sum(len(skin.limbs) for skin in bodies.skins))

    def depths(motions: Sequence[Motion]) -> Array:
        """(frames, limbs)."""
        gaps = bodies.gaps(motions)
        return np.stack([-gaps[:, on == limb].min(axis=1, initial=0.0) for limb in limbs], axis=1)

    least, result, deeper = depths(before) + WORSE, after, np.zeros((len(shots), len(limbs)), bool)
    for _ in range(TRIES):
        worse = depths(result) > least
        if not worse.any():
            break
        deeper |= worse
        kept = 1.0 - by_shot(partial(widened, frames=BLEND / time), shots, deeper.astype(float))
        shares = np.split(kept.T, np.cumsum([len(skin.limbs) for skin in bodies.skins])[:-1])
        each = zip(bodies.skins, before, after, shares, strict=True)
        result = [_blended(skin.limbs, one, other, share) for skin, one, other, share in each]
    return result


def _blended(limbs: Sequence[Limb], before: Motion, after: Motion, shares: Array) -> Motion:
    """The motion `after` with its limbs turned as `before` but for a share, (limbs, frames)."""
    rotations = after.rotations.copy()
    for limb, share in zip(limbs, shares, strict=True):
        cells = np.ix_(share < 1.0, after.skeleton.subtree(limb.top))
        a, b = before.rotations[cells], after.rotations[cells]
        a = np.where((a * b).sum(axis=-1, keepdims=True) < 0.0, -a, a)
        rotations[cells] = normalised(a + share[share < 1.0, None, None] * (b - a))
    return replace(after, rotations=rotations)
