"""Skin: limbs bend so that skin touches where it touches in the source, and sinks in nowhere.

It begins with the motion that keeps the contacts of joints. `skin.sides` finds how elbows, wrists and knees bring
limbs out of the body in each frame. From there `ik.limb_bends` solves for all frames at once: limbs stay outside,
skins that touch come to the gap of the source, and limbs move as smoothly as that lets them. It does so with capsules,
and again with these put right by the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from distretarget.body.anatomy import SIDES
from distretarget.ik.limb_bends import FADES, STEPS, TAU, bends
from distretarget.ik.limb_terms import Frames
from distretarget.ik.poses import Chunk, chunks_of
from distretarget.motion import Motion
from distretarget.numerics.parallel import in_threads
from distretarget.numerics.time_series import Shots, smoothstep
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.objectives.activation import ContactSettings
from distretarget.objectives.anchors import anchors, no_anchors
from distretarget.objectives.approach import approached
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.clip import Clip
from distretarget.objectives.mesh_gaps import nearer_than_capsules, spare_of_mesh
from distretarget.objectives.sliding import stays
from distretarget.objectives.spots import APART, IS_HARD, Spots, of_pairs
from distretarget.objectives.supports import Supports
from distretarget.skin.balls import Balls, mean_radii, segment_gaps
from distretarget.skin.capsules import IS_ARM, PLACE, SEGMENTS
from distretarget.skin.limbs import Limb, bent
from distretarget.skin.sides import least_displacements
from distretarget.skin.tangents import Displaced

TOUCH = 0.01  # parts touch up to this gap, and from `APART` on they do not [body units]
# The mesh is looked at before each round of the solve, as other places of it may be nearest once limbs have moved; the
# steps of a round, at most. More rounds of fewer steps keep skin out better than fewer that settle.
ROUNDS = (4, 4, 8)
EACH_OF_TWO = np.sqrt(0.5)  # two arms that touch are two spots, each half as stiff, as stiffness is firmness squared
BY_USER = 2.0  # contacts that a user asks for are firmer than others by this factor
PRESSED = 0.01  # in the source's own body hands and forearms sink in as they do there, but by no more [body units]
REACH = 0.3  # what is farther apart than this in the result, half an arm, is not brought to touch [body units]

# How far flesh gives way to other flesh [mean radius of its capsules]; the skin of an upper arm is the chest's at the
# armpit.
FLESH = {"upper arm": 1.0, "thigh": 0.2, "pelvis": 0.16, "belly": 0.16}
SOFT = np.array([next((value for part, value in FLESH.items() if part in name), 0.0) for name in SEGMENTS])


class SkinGap(NamedTuple):
    """A gap between skins that a user asks for."""

    pairs: Numbers  # (pairs,), of segments of the body, the nearest of which has it
    gap: Array  # (frames,) [body units]
    firmness: Array  # (frames,), 0 to 1


@dataclass(frozen=True, eq=False)
class Reach:
    """Where a user's contacts bring limbs."""

    ways: Array  # (frames, limbs, 3), how far their ends go [body units]
    ties: Array  # (frames, limbs), how far they are held there, 0 to 1
    gaps: tuple[SkinGap, ...]
    anchored: Numbers  # (pairs,), of segments, that touch at anchors

    def __getitem__(self, frames: slice) -> Reach:
        gaps = tuple(SkinGap(each.pairs, each.gap[frames], each.firmness[frames]) for each in self.gaps)
        return Reach(self.ways[frames], self.ties[frames], gaps, self.anchored)

    @property
    def anchors(self) -> dict[str, Array]:
        """The fields of `limb_terms.Frames`, with an anchor without a ray."""
        frames, limbs = self.ties.shape
        fields = no_anchors(frames, limbs, 1)
        return fields | {"off": -self.ways[:, :, None], "ties": self.ties[:, :, None]}


def with_skin(
    clip: Clip,
    skins: Skins,
    posed: Motion,
    supports: Supports,
    settings: ContactSettings,
    reach: Reach | None = None,
    wanted: Flags | None = None,
    alone: Array | None = None,
) -> Motion:
    """Return the motion of a target with its limbs bent as its skin asks, and as a user does; `posed` is the motion
    before. Only frames that are `wanted`, (frames,), need to be right; by default all. Limbs touch the body itself as
    far as they are `alone`, (frames, limbs), 0 to 1; by default all are.
    """
    free = how_free(clip, skins.target, supports, settings)
    alone = np.ones(free.shape[:2]) if alone is None else alone
    ends = free[..., 1] if reach is None else free[..., 1] * (1.0 - reach.ties)
    posed = approached(clip, skins, posed, ends)
    margin = round(FADES * TAU / clip.frame_time)
    chunks = chunks_of(len(clip), margin)
    if wanted is not None:
        chunks = [*_of_wanted(chunks, wanted, margin)]
    posed.positions  # noqa: B018 - once for all chunks

    def displaced(chunk: Chunk) -> Array:
        around = chunk.context
        reaching = reach and reach[around]
        d = _displaced(clip[around], skins, posed[around], free[around], alone[around], around.start, reaching)
        return d[chunk.frames.start - around.start : chunk.frames.stop - around.start]

    d = np.zeros((len(clip), len(skins.target.limbs), 2, 3))
    for chunk, found in zip(chunks, in_threads(displaced, chunks), strict=True):
        d[chunk.frames] = found
    return bent(posed, skins.target.limbs, skins.target.unit * d)


def _of_wanted(chunks: Sequence[Chunk], wanted: Flags, margin: int) -> Iterator[Chunk]:
    """Chunks, each from the first to the last of its frames that are wanted; none without such frames."""
    for chunk in chunks:
        frames = chunk.frames.start + np.flatnonzero(wanted[chunk.frames])
        if len(frames):
            first, end = int(frames[0]), int(frames[-1]) + 1
            context = slice(max(first - margin, 0), min(end + margin, len(wanted)))
            yield replace(chunk, frames=slice(first, end), context=context)


def _displaced(
    clip: Clip, skins: Skins, posed: Motion, free: Array, alone: Array, first: int, reach: Reach | None
) -> Array:
    """How far middle and end of each limb are displaced, (frames, limbs, 2, 3) [body units], in a part of a clip that
    begins with the frame `first`; `free` as `how_free`, and `alone`, (frames, limbs), is 0 while a limb touches others.
    """
    body, shots = skins.target, (clip.shots, clip.frame_time)
    pairs, are_hard = body.balls.pairs, IS_HARD[body.balls.pairs[:, 0]]
    near = partial(nearer_than_capsules, pairs=pairs, first=first, shots=clip.shots)
    frames, spots = _of_source(clip, skins, posed, free, alone, near)
    found = len(spots.limbs)
    if reach is not None:
        frames, spots = _reaching(frames, spots, reach)
    bend = partial(brought_out, body.balls, body.displaced, spots)
    if body.surface is None:
        return bend(frames, body.limbs, *shots, REACH)

    def softer(by: Array) -> Array:
        return np.where(are_hard, frames.soft + by[:, spots.of_pair], frames.soft)

    spare = spare_of_mesh(body, spots, pairs, posed, first)
    # An arm that has passed through an arm is outside beyond it: there, the source has to be outside as well.
    on_arms = np.isin(spots.places, PLACE[:-1][IS_ARM])
    if reach is not None:
        on_arms[spots.of_pair[reach.anchored]] = False
    of_source = spare_of_mesh(skins.source, spots, pairs, clip.source, first)
    spare[:, on_arms] = np.minimum(spare, of_source)[:, on_arms]
    spare[:, found:] = 0.0  # gaps that a user asks for are those of the capsules
    d = find_start(body.balls, body.displaced, frames._replace(soft=softer(spare)), *shots)
    for steps in ROUNDS:
        now = bent(posed, body.limbs, body.unit * d)
        farther = -near(body, spots=spots, motion=now, touching=frames.firmness, spare=spare)
        farther[:, found:] = 0.0
        now_asked = frames._replace(soft=softer(farther), aims=frames.aims - farther)
        d = bend(now_asked, body.limbs, *shots, REACH, d, steps)
    return d


def _of_source(
    clip: Clip, skins: Skins, posed: Motion, free: Array, alone: Array, near: Callable[..., Array]
) -> tuple[Frames, Spots]:
    """What is asked of limbs so that they touch what they touch in the source, and the spots where they can; `near` is
    `nearer_than_capsules` of these frames, others as for `_displaced`.
    """
    body, source, balls = skins.target, skins.source, skins.target.balls
    ends = source.posed(clip.source)
    in_source = segment_gaps(source.balls, ends, APART)
    in_source = of_pairs(in_source, source.balls.pairs, balls.pairs)
    spots = Spots.of(balls.pairs[:, 0], PLACE[balls.pairs[:, 1]])
    gaps = spots.least(in_source)
    gaps -= near(source, spots=spots, motion=clip.source, touching=how_touching(spots, gaps))
    touching = how_touching(spots, gaps)
    firmness = _with_hands(spots, touching, touching * _meant(clip, body, spots)) * _kept(clip, body, spots)
    firmness *= _alone(body, spots, alone) * stays(source, clip.source, ends, spots, touching, clip.shots)
    firmness[:, np.isin(spots.places, PLACE[:-1][IS_ARM])] *= EACH_OF_TWO
    least = -PRESSED if skins.are_alike else 0.0
    pressed = np.where(spots.are_hard, np.clip(-gaps, 0.0, -least), 0.0)
    frames = Frames(
        posed=body.posed(posed),
        limbs=limb_places(body, posed),
        free=free,
        soft=np.maximum(softness(balls, balls.pairs, in_source), pressed[:, spots.of_pair]),
        aims=np.maximum(gaps, least),
        firmness=firmness,
        **anchors(clip.source, posed, skins, spots, in_source, firmness),
    )
    return frames, spots


def _reaching(frames: Frames, spots: Spots, reach: Reach) -> tuple[Frames, Spots]:
    """What is asked of limbs, and the spots, with what a user asks for."""
    aims, firmness = [frames.aims], [frames.firmness]
    for asked in reach.gaps:
        spots = spots.with_own(asked.pairs)
        aims.append(asked.gap[:, None])
        firmness.append(BY_USER * asked.firmness[:, None])
    free = np.maximum(frames.free, reach.ties[..., None])
    held = {key: np.concatenate([getattr(frames, key), more], axis=2) for key, more in reach.anchors.items()}
    return frames._replace(aims=np.hstack(aims), firmness=np.hstack(firmness), free=free, **held), spots


def find_start(balls: Balls, displaced: Displaced, frames: Frames, shots: Shots, frame_time: float) -> Array:
    """Return how far to displace limbs so that they leave bodies on one side while they are in them. A limb that
    changes sides goes through a body within about `TAU`.
    """
    return least_displacements(balls, displaced, *frames[:4], shots=shots, change=2.0 * TAU / frame_time)


def brought_out(
    balls: Balls,
    displaced: Displaced,
    spots: Spots,
    frames: Frames,
    limbs: Sequence[Limb],
    shots: Shots,
    frame_time: float,
    reach: float,
    start: Array | None = None,
    steps: int = STEPS,
) -> Array:
    """Return how far to displace limbs, (frames, limbs, 2, 3), from where they are; see `ik.limb_bends.bends`."""
    start = find_start(balls, displaced, frames, shots, frame_time) if start is None else start
    arms = np.array([limb.is_arm for limb in limbs], bool)
    return bends(balls, displaced, spots.of_pair, frames, arms, start, shots, frame_time, reach, steps)


def limb_places(body: BodySkin, posed: Motion) -> Array:
    """(frames, limbs, 3, 3), the top, the middle and the end of each limb [body units]."""
    joints = np.array([limb.joints for limb in body.limbs], np.intp).reshape(-1, 3)
    return np.asarray(posed.positions[:, joints] / body.unit)


def how_free(clip: Clip, body: BodySkin, supports: Supports, settings: ContactSettings) -> Array:
    """(frames, limbs, 2), how far middle and end of each limb can move, 0 to 1: not while they or what is beyond them
    rest on the world; feet never.
    """
    free = np.ones((len(clip), len(body.limbs), 2))
    held = [*zip(supports.joints.tolist(), supports.weights.T, strict=True)] if settings.foot_lock else []
    for number, limb in enumerate(body.limbs):
        below = {*clip.skeleton.subtree(limb.end)}
        for joint, weight in held:
            if joint in below:
                free[:, number, 1] = np.minimum(free[:, number, 1], 1.0 - weight)
            elif joint == limb.middle:
                free[:, number, 0] = np.minimum(free[:, number, 0], 1.0 - weight)
        if limb.top in {leg.hip for leg in clip.target_legs or ()}:
            free[:, number, 1] = 0.0
    return free


def how_touching(spots: Spots, gaps: Array) -> Array:
    """(frames, spots), how near limbs are to what they touch, 0 to 1, by gaps, (frames, spots). Only hands and forearms
    touch: an upper arm is near the trunk anyway.
    """
    return nearness(gaps) * spots.are_hard


def nearness(gaps: Array) -> Array:
    """How near parts are that touch, by their gaps [body units]: from 0 at `APART` to 1 at `TOUCH`."""
    return smoothstep((APART - gaps) / (APART - TOUCH))


def softness(balls: Balls, parts: Numbers, in_source: Array) -> Array:
    """(frames, pairs), how far segments may overlap [body units]: as far as their flesh gives way, and as far as the
    source's do; hands and forearms not at all. `parts`, (pairs, 2), are what parts of the body these are.
    """
    flesh = SOFT[parts] * mean_radii(balls)[balls.pairs]
    return np.where(IS_HARD[parts[:, 0]], 0.0, np.maximum(flesh.sum(axis=1), -in_source))


def _with_hands(spots: Spots, near: Array, touching: Array) -> Array:
    """(frames, spots), how far spots touch, with forearms near what their hands touch, as the two meet at the wrist."""
    touching = touching.copy()
    for side, place in product(SIDES, np.unique(spots.places)):
        hand, forearm = (
            np.flatnonzero((spots.limbs == SEGMENTS.index(f"{side} {part}")) & (spots.places == place))
            for part in ("hand", "forearm")
        )
        if hand.size:
            touching[:, forearm] = np.maximum(touching[:, forearm], np.minimum(near[:, forearm], touching[:, hand]))
    return touching


def _meant(clip: Clip, body: BodySkin, spots: Spots) -> Array:
    """(frames, spots), how much each is meant to be touched, 0 to 1: by a hand or forearm as far as `Clip.raised_arms`
    says that it is there on purpose, since one that hangs beside the trunk is near it anyway. Arms always mean to touch
    each other.
    """
    of_point, sources = body.of_joint[clip.distances.targets], clip.distances.sources
    meant = np.ones((len(clip), len(spots.limbs)))
    for spot in np.flatnonzero(~np.isin(spots.places, PLACE[:-1][IS_ARM])):
        meant[:, spot] = clip.raised_arms[:, sources[of_point == spots.limbs[spot]]].max(axis=1, initial=0.0)
    return meant


def _alone(body: BodySkin, spots: Spots, alone: Array) -> Array:
    """(frames, spots), 0 while one of the arms that touch there touches others; `alone` as in `_displaced`."""
    kept = np.ones((len(alone), len(spots.limbs)))
    for number, limb in enumerate(limb for limb in body.limbs if limb.is_arm):  # arms come first
        own = body.of_joint[[*limb.joints]]
        on = np.isin(spots.limbs, own) | np.isin(spots.places, PLACE[own])
        kept[:, on] = np.minimum(kept[:, on], alone[:, number, None])
    return kept


def _kept(clip: Clip, body: BodySkin, spots: Spots) -> Array:
    """(frames, spots), 0 where a contact is dropped, else 1."""
    kept = np.ones((len(clip), len(spots.limbs)))
    for spot, (limb, place) in enumerate(zip(spots.limbs, spots.places, strict=True)):
        ends = np.flatnonzero(body.of_joint == limb), np.flatnonzero(PLACE[body.of_joint] == place)
        for drop in clip.drops:
            if any(
                np.isin(a, one).any() and np.isin(b, other).any()
                for a, b in (ends, ends[::-1])
                for one, other in [drop.parts]
            ):
                kept[drop.frames, spot] = 0.0
    return kept
