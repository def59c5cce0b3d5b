"""Skin: bends limbs so that skins touch where they touch in the source, and penetrate nowhere.

It starts from the motion that keeps the contacts of joints. `skin.displacement` finds displacements of elbows, wrists
and knees that bring limbs out of the body in each frame. From there `ik.limb_bends` solves for all frames at once:
limbs stay outside, skins in contact come to the gap of the source, and limbs move smoothly. Gaps are those of capsules,
corrected by the mesh before each round of the solve.
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
from distretarget.numerics.moving import largest
from distretarget.numerics.parallel import in_threads
from distretarget.numerics.time_series import Shots, by_shot, smoothstep
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.objectives.activation import ContactSettings
from distretarget.objectives.anchors import anchors, no_anchors
from distretarget.objectives.approach import with_hands_on_source_side
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact_zones import APART, IS_HARD, ContactZones, gaps_of_pairs
from distretarget.objectives.floor import FLOOR_SPAN
from distretarget.objectives.mesh_gaps import false_overlap, mesh_correction
from distretarget.objectives.passages import overlap_of_passages
from distretarget.objectives.sliding import stillness
from distretarget.objectives.supports import Supports
from distretarget.skin.balls import NEVER, Balls, mean_radii, segment_gaps
from distretarget.skin.capsules import GROUP, IS_ARM, SEGMENTS
from distretarget.skin.displacement import least_displacements
from distretarget.skin.limbs import Limb, bent
from distretarget.skin.tangents import LEAST_SHARE, Displaced

TOUCH = 0.01  # parts touch up to this gap, and from `APART` on they do not [body units]
# The most steps of each round of the solve, before which gaps are corrected by the mesh: its nearest points change as
# limbs move. Fewer steps leave hands short of what they touch if that is far.
ROUNDS = (8, 8, 8)
EACH_OF_TWO = np.sqrt(0.5)  # two arms in contact are two zones, each with half the stiffness, which is firmness squared
BY_USER = 2.0  # the firmness of user contacts relative to others
REACH = 0.3  # skins farther apart than this in the result, half an arm, are not drawn together [body units]

# How far soft tissue may overlap [mean radius of its capsules]; an upper arm shares its skin with the chest at the
# armpit.
FLESH = {"upper arm": 1.0, "thigh": 0.2, "pelvis": 0.16, "belly": 0.16}
SOFT = np.array([next((value for part, value in FLESH.items() if part in name), 0.0) for name in SEGMENTS])


class SkinGap(NamedTuple):
    """A gap between skins that the user sets, at the nearest of some segment pairs."""

    pairs: Numbers  # (pairs,), indices of segment pairs of the body
    gap: Array  # (frames,) [body units]
    firmness: Array  # (frames,), 0 to 1


@dataclass(frozen=True, eq=False)
class LimbTargets:
    """The targets that user constraints set for limbs."""

    displacements: Array  # (frames, limbs, 3), of the ends of limbs [body units]
    firmness: Array  # (frames, limbs), of these displacements, 0 to 1
    gaps: tuple[SkinGap, ...]
    anchored: Numbers  # (pairs,), indices of segment pairs in contact at anchors

    def __getitem__(self, frames: slice) -> LimbTargets:
        gaps = tuple(SkinGap(each.pairs, each.gap[frames], each.firmness[frames]) for each in self.gaps)
        return LimbTargets(self.displacements[frames], self.firmness[frames], gaps, self.anchored)

    @property
    def anchors(self) -> dict[str, Array]:
        """The anchor fields of `limb_terms.Frames`: an anchor without a ray for each limb."""
        frames, limbs = self.firmness.shape
        fields, offsets = no_anchors(frames, limbs, 1), -self.displacements[:, :, None]
        return fields | {"anchor_offsets": offsets, "anchor_weights": self.firmness[:, :, None]}


def with_skin(
    clip: Clip,
    skins: Skins,
    posed: Motion,
    supports: Supports,
    settings: ContactSettings,
    targets: LimbTargets | None = None,
    wanted: Flags | None = None,
    self_contact: Array | None = None,
) -> Motion:
    """Return the motion `posed` of a target with its limbs bent so that skins touch as in the source and do not
    penetrate, and the `targets` of user constraints are met. Only frames that are `wanted`, (frames,), need to be
    right; by default all. `self_contact`, (frames, limbs), 0 to 1, weighs contacts of limbs with the body itself.
    """
    free = how_free(clip, skins.target, supports, settings)
    self_contact = np.ones(free.shape[:2]) if self_contact is None else self_contact
    ends = free[..., 1] if targets is None else free[..., 1] * (1.0 - targets.firmness)
    posed = with_hands_on_source_side(clip, skins, posed, ends)
    margin = round(FADES * TAU / clip.frame_time)
    chunks = chunks_of(len(clip), margin)
    if wanted is not None:
        chunks = [*_of_wanted(chunks, wanted, margin)]
    posed.positions  # noqa: B018 - once for all chunks

    def displaced(chunk: Chunk) -> Array:
        around = chunk.context
        here = targets and targets[around]
        d = _displaced(clip[around], skins, posed[around], free[around], self_contact[around], around.start, here)
        return d[chunk.frames.start - around.start : chunk.frames.stop - around.start]

    d = np.zeros((len(clip), len(skins.target.limbs), 2, 3))
    for chunk, found in zip(chunks, in_threads(displaced, chunks), strict=True):
        d[chunk.frames] = found
    return bent(posed, skins.target.limbs, skins.target.unit * d)


def _of_wanted(chunks: Sequence[Chunk], wanted: Flags, margin: int) -> Iterator[Chunk]:
    """Yield chunks cut down to their first and last wanted frames; chunks without any are left out."""
    for chunk in chunks:
        frames = chunk.frames.start + np.flatnonzero(wanted[chunk.frames])
        if len(frames):
            first, end = int(frames[0]), int(frames[-1]) + 1
            context = slice(max(first - margin, 0), min(end + margin, len(wanted)))
            yield replace(chunk, frames=slice(first, end), context=context)


def _displaced(
    clip: Clip, skins: Skins, posed: Motion, free: Array, self_contact: Array, first: int, targets: LimbTargets | None
) -> Array:
    """The displacements of middle and end of each limb, (frames, limbs, 2, 3) [body units], in a part of a clip that
    begins with the frame `first`. `free` is what `how_free` returns; the other arguments are those of `with_skin`.
    """
    body, shots = skins.target, (clip.shots, clip.frame_time)
    pairs, are_hard = body.balls.pairs, IS_HARD[body.balls.pairs[:, 0]]
    zones = ContactZones.of(pairs[:, 0], GROUP[pairs[:, 1]])
    found = len(zones.limbs)
    corrected = partial(mesh_correction, pairs=pairs, first=first, shots=clip.shots)
    of_source = false_overlap(skins.source, zones, pairs, clip.source, first, skins.least_gap)
    frames, touching = _source_contacts(clip, skins, posed, free, self_contact, zones, corrected, of_source)
    if targets is not None:
        frames, zones = _with_targets(frames, zones, targets)
        touching = np.pad(touching, ((0, 0), (0, len(zones.limbs) - found)))  # not in the user's zones
    bend = partial(limb_displacements, body.balls, body.displaced, zones)
    overlap = None if body.surface is None else _false_overlap(skins, posed, zones, of_source, first, targets)
    start = np.zeros((len(clip), len(body.limbs), 2, 3))
    if overlap is None or targets is not None or not skins.are_alike:  # else limbs are on their sides already
        of_mesh = 0.0 if overlap is None else np.where(are_hard, overlap[:, zones.of_pair], 0.0)
        soft = np.maximum(frames.soft, of_mesh)
        start = start_displacements(body.balls, body.displaced, frames._replace(soft=soft), *shots)

    def solved(frames: Frames) -> tuple[Array, Array]:
        """Return the displacements, and how far segments may overlap on the mesh."""
        if overlap is None:
            return bend(frames, body.limbs, *shots, REACH, start), frames.soft
        d = start
        for steps in ROUNDS:
            now = bent(posed, body.limbs, body.unit * d)
            farther = -corrected(body, zones=zones, motion=now, touching=touching, overlap=overlap)
            farther[:, found:] = 0.0
            soft = np.where(are_hard, frames.soft + farther[:, zones.of_pair], frames.soft)
            on_mesh = frames._replace(soft=soft, target_gaps=frames.target_gaps - farther)
            d = bend(on_mesh, body.limbs, *shots, REACH, d, steps)
        return d, soft

    d, soft = solved(frames)
    if not start.any():
        return d
    ends = body.posed(bent(posed, body.limbs, body.unit * d))
    more = overlap_of_passages(body, ends, soft, start, *shots)
    return solved(frames._replace(soft=frames.soft + more))[0] if more.any() else d


def _false_overlap(
    skins: Skins, posed: Motion, zones: ContactZones, of_source: Array, first: int, targets: LimbTargets | None
) -> Array:
    """(frames, zones), how far capsules overlap where the mesh does not. `of_source`, (frames, found zones), is the
    overlap of the source, without zones of the user; other arguments as in `_displaced`.
    """
    pairs, found = skins.target.balls.pairs, of_source.shape[1]
    overlap = false_overlap(skins.target, zones, pairs, posed, first, skins.least_gap)
    # The mesh of an arm that has passed through another arm is outside of it, too: the source's has to be as well.
    on_arms = np.isin(zones.groups, GROUP[:-1][IS_ARM])
    if targets is not None:
        on_arms[zones.of_pair[targets.anchored]] = False
    overlap[:, found:] = 0.0  # the user's gaps are those of capsules
    of_found = overlap[:, :found]
    np.minimum(of_found, of_source, out=of_found, where=on_arms[:found])
    return overlap


def _source_contacts(
    clip: Clip,
    skins: Skins,
    posed: Motion,
    free: Array,
    self_contact: Array,
    zones: ContactZones,
    corrected: Callable[..., Array],
    overlap: Array,
) -> tuple[Frames, Array]:
    """The problem of `limb_bends` that keeps the source's contacts in some zones, and where limbs may be meant to
    touch, (frames, zones), so that gaps are corrected alike on both bodies. `corrected` is `mesh_correction` for these
    frames, `overlap` the false overlap of the source; other arguments as in `_displaced`.
    """
    body, source, balls = skins.target, skins.source, skins.target.balls
    ends = source.posed(clip.source)
    in_source = segment_gaps(source.balls, ends, APART)
    in_source = gaps_of_pairs(in_source, source.balls.pairs, balls.pairs)
    gaps, intent = zones.least(in_source), _intent(clip, body, zones)
    may_touch = how_touching(zones, gaps) * intent
    gaps -= corrected(source, zones=zones, motion=clip.source, touching=may_touch, overlap=overlap)
    touching = how_touching(zones, gaps)
    firmness = _with_forearms(zones, touching, touching * intent) * _not_dropped(clip, body, zones)
    firmness *= _by_limbs(body, zones, self_contact) * stillness(source, clip.source, ends, zones, touching, clip.shots)
    firmness[:, np.isin(zones.groups, GROUP[:-1][IS_ARM])] *= EACH_OF_TWO
    pressed = np.where(zones.are_hard, np.clip(-gaps, 0.0, -skins.least_gap), 0.0)
    own_ends = body.posed(posed)
    frames = Frames(
        posed=own_ends,
        limbs=limb_places(body, posed),
        free=free,
        soft=np.maximum(softness(balls, balls.pairs, in_source), pressed[:, zones.of_pair]),
        **floor_below(balls, body.displaced, own_ends, len(body.limbs), clip),
        target_gaps=np.maximum(gaps, skins.least_gap),
        firmness=firmness,
        **anchors(clip.source, posed, skins, zones, in_source, firmness),
    )
    return frames, may_touch


def _with_targets(frames: Frames, zones: ContactZones, targets: LimbTargets) -> tuple[Frames, ContactZones]:
    """The problem of `limb_bends` and its zones, with the targets of user constraints added."""
    gaps, firmness = [frames.target_gaps], [frames.firmness]
    for each in targets.gaps:
        zones = zones.with_zone_of(each.pairs)
        gaps.append(each.gap[:, None])
        firmness.append(BY_USER * each.firmness[:, None])
    free = np.maximum(frames.free, targets.firmness[..., None])
    fields = {key: np.concatenate([getattr(frames, key), more], axis=2) for key, more in targets.anchors.items()}
    return frames._replace(target_gaps=np.hstack(gaps), firmness=np.hstack(firmness), free=free, **fields), zones


def start_displacements(balls: Balls, displaced: Displaced, frames: Frames, shots: Shots, frame_time: float) -> Array:
    """Return displacements of limbs that bring them out of bodies, each on one side for as long as it is in a body. A
    limb that changes sides passes through the body within about `TAU`; sides do not persist across cuts.
    """
    of_shot = partial(least_displacements, balls, displaced, switch_cost=2.0 * TAU / frame_time)
    return by_shot(of_shot, shots, *frames[:4])


def limb_displacements(
    balls: Balls,
    displaced: Displaced,
    zones: ContactZones,
    frames: Frames,
    limbs: Sequence[Limb],
    shots: Shots,
    frame_time: float,
    reach: float,
    start: Array | None = None,
    steps: int = STEPS,
) -> Array:
    """Return the displacements of limbs, (frames, limbs, 2, 3), by `limb_bends.bends` from `start_displacements`."""
    start = start_displacements(balls, displaced, frames, shots, frame_time) if start is None else start
    arms = np.array([limb.is_arm for limb in limbs], bool)
    return bends(balls, displaced, zones.of_pair, frames, arms, start, shots, frame_time, reach, steps)


def limb_places(body: BodySkin, posed: Motion) -> Array:
    """(frames, limbs, 3, 3), the top, the middle and the end of each limb [body units]."""
    joints = np.array([limb.joints for limb in body.limbs], np.intp).reshape(-1, 3)
    return np.asarray(posed.positions[:, joints] / body.unit)


def how_free(clip: Clip, body: BodySkin, supports: Supports, settings: ContactSettings) -> Array:
    """(frames, limbs, 2), how far middle and end of each limb can move, 0 to 1: 0 for a middle that rests on the world,
    for an end while it or a joint below it does, and for feet always.
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


def floor_below(balls: Balls, displaced: Displaced, posed: Array, limbs: int, clip: Clip) -> dict[str, Array]:
    """The floor fields of `limb_terms.Frames`: no skin about the middle or the end of one of so many limbs sinks below
    the lowest skin of the body within `FLOOR_SPAN`. Its capsules end at `posed`, (frames, capsules, 2, 3).
    """
    heights = posed @ clip.up - balls.cap_radii
    floor = -largest(-heights.min(axis=(1, 2))[:, None], round(FLOOR_SPAN / clip.frame_time))[:, 0]
    above = np.empty((len(posed), limbs, 2))
    for limb, joint in np.ndindex(limbs, 2):
        on = (displaced.limbs == limb)[:, None] & (displaced.shares[..., joint] > LEAST_SHARE)
        above[:, limb, joint] = heights[:, on].min(axis=1, initial=NEVER) - floor
    return {"up": np.broadcast_to(clip.up, (len(posed), 3)), "above_floor": above}


def how_touching(zones: ContactZones, gaps: Array) -> Array:
    """(frames, zones), the weights of contacts by their gaps, (frames, zones), 0 to 1; 0 for all limbs but hands and
    forearms, as an upper arm is always near the trunk.
    """
    return nearness(gaps) * zones.are_hard


def nearness(gaps: Array) -> Array:
    """The weights of contacts by their gaps [body units], from 0 at `APART` to 1 at `TOUCH`."""
    return smoothstep((APART - gaps) / (APART - TOUCH))


def softness(balls: Balls, parts: Numbers, in_source: Array) -> Array:
    """(frames, pairs), how far segments may overlap [body units]: by their soft tissue, or as far as in the source; not
    at all if the limb is a hand or a forearm. `parts`, (pairs, 2), are the segments of the pairs.
    """
    flesh = SOFT[parts] * mean_radii(balls)[balls.pairs]
    return np.where(IS_HARD[parts[:, 0]], 0.0, np.maximum(flesh.sum(axis=1), -in_source))


def _with_forearms(zones: ContactZones, near: Array, touching: Array) -> Array:
    """(frames, zones), contact weights, with those of forearms raised where they are `near` what their hands touch."""
    touching = touching.copy()
    for side, group in product(SIDES, np.unique(zones.groups)):
        hand, forearm = (
            np.flatnonzero((zones.limbs == SEGMENTS.index(f"{side} {part}")) & (zones.groups == group))
            for part in ("hand", "forearm")
        )
        if hand.size:
            touching[:, forearm] = np.maximum(touching[:, forearm], np.minimum(near[:, forearm], touching[:, hand]))
    return touching


def _intent(clip: Clip, body: BodySkin, zones: ContactZones) -> Array:
    """(frames, zones), how far each contact is intended, 0 to 1: by `Clip.raised_arms`, since an arm that hangs is near
    the trunk without touching it; contacts with arms always are.
    """
    of_point, sources = body.of_joint[clip.distances.targets], clip.distances.sources
    intent = np.ones((len(clip), len(zones.limbs)))
    for zone in np.flatnonzero(~np.isin(zones.groups, GROUP[:-1][IS_ARM])):
        intent[:, zone] = clip.raised_arms[:, sources[of_point == zones.limbs[zone]]].max(axis=1, initial=0.0)
    return intent


def _by_limbs(body: BodySkin, zones: ContactZones, self_contact: Array) -> Array:
    """(frames, zones), the least `self_contact`, (frames, limbs), of the arms of each zone."""
    least = np.ones((len(self_contact), len(zones.limbs)))
    for number, limb in enumerate(limb for limb in body.limbs if limb.is_arm):  # arms come first
        own = body.of_joint[[*limb.joints]]
        on = np.isin(zones.limbs, own) | np.isin(zones.groups, GROUP[own])
        least[:, on] = np.minimum(least[:, on], self_contact[:, number, None])
    return least


def _not_dropped(clip: Clip, body: BodySkin, zones: ContactZones) -> Array:
    """(frames, zones), 0 where the user drops a contact, else 1."""
    enabled = np.ones((len(clip), len(zones.limbs)))
    for zone, (limb, group) in enumerate(zip(zones.limbs, zones.groups, strict=True)):
        ends = np.flatnonzero(body.of_joint == limb), np.flatnonzero(GROUP[body.of_joint] == group)
        for drop in clip.drops:
            if any(
                np.isin(a, one).any() and np.isin(b, other).any()
                for a, b in (ends, ends[::-1])
                for one, other in [drop.parts]
            ):
                enabled[drop.frames, zone] = 0.0
    return enabled
