"""Skin: limbs bend so that skin touches where it touches in the source, and sinks in nowhere.

It begins with the motion that keeps the contacts of joints. In each frame `skin.displacement` finds the displacements
of elbows, wrists and knees that bring limbs out of the body, and skins that touch to the gap of the source. These lead
in time: a limb that is about to sink in begins to leave its way before it arrives, and comes back afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from distretarget.ik.poses import Chunk, chunks_of
from distretarget.motion import Motion
from distretarget.numerics.parallel import blocks_of, in_threads
from distretarget.numerics.time_series import KeyFrames, Shots, averaged, by_shot, median_of_three, smoothstep, widened
from distretarget.numerics.vectors import lengths, normalised
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact import Contacts
from distretarget.objectives.settings import ContactSettings
from distretarget.objectives.skins import BodySkin, Skins
from distretarget.objectives.supports import Supports
from distretarget.skin.balls import Balls, mean_radii
from distretarget.skin.capsules import IS_ARM, PLACE, SEGMENTS
from distretarget.skin.displacement import REACH, displacements
from distretarget.skin.limbs import bent
from distretarget.skin.meetings import segment_gaps
from distretarget.skin.tangents import Displaced

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

TOUCH, APART = 0.01, 0.04  # parts touch up to the first gap, and from the second on they do not [body units]
MARGIN = 0.01  # only what is less than this farther than the nearest touches [body units]
LEAD = 0.08  # a limb leaves its way over twice this time before it would sink in [s]
SETTLE = (0.14, 0.08, 0.06)  # brought out again, displacements are averaged over these times before and after [s]
RATE = 20.0  # displacements are found about as often, and interpolated [1/s]

# How far flesh gives way to other flesh [mean radius of its capsules]; the skin of an upper arm is the chest's at the
# armpit.
FLESH = {"upper arm": 1.0, "thigh": 0.2, "pelvis": 0.16, "belly": 0.16}


def with_skin(clip: Clip, skins: Skins, posed: Motion, supports: Supports, settings: ContactSettings) -> Motion:
    """Return the motion of a target with its limbs bent as its skin asks; `posed` is the motion before."""
    keys = KeyFrames.of(clip.shots, clip.frame_time, RATE)
    margin = round((4.0 * LEAD + sum(SETTLE) + 2.0 * keys.time) / clip.frame_time) + 2
    chunks = chunks_of(len(clip), margin)
    posed.positions  # noqa: B018 - once for all chunks

    def displaced(chunk: Chunk) -> Array:
        around = chunk.context
        d = _displaced(clip[around], skins, posed[around], supports[around], settings, keys[around])
        return d[chunk.frames.start - around.start : chunk.frames.stop - around.start]

    d = np.concatenate([*in_threads(displaced, chunks)])
    return bent(posed, skins.target.limbs, skins.target.unit * d)


def _displaced(
    clip: Clip, skins: Skins, posed: Motion, supports: Supports, settings: ContactSettings, keys: KeyFrames
) -> Array:
    """How far middle and end of each limb are displaced, (frames, limbs, 2, 3) [body units]."""
    body, source, at = skins.target, skins.source, keys.numbers
    balls = body.balls
    ends = median_of_three(body.posed(posed))  # ignores a single faulty frame
    in_source = segment_gaps(source.balls, median_of_three(source.posed(clip.source))[at], APART)
    in_source = of_pairs(in_source, source.balls.pairs, balls.pairs)
    soft = softness(balls, balls.pairs, in_source)
    firmness, aim = _firmness(clip, body, in_source, supports, settings, at), np.maximum(in_source, 0.0)
    given = ends, limb_places(body, posed), how_free(clip, body, supports, settings)
    return led(balls, body.displaced, given, (soft, aim, firmness), keys)


def limb_places(body: BodySkin, posed: Motion) -> Array:
    """(frames, limbs, 3, 3), the top, the middle and the end of each limb [body units]."""
    joints = np.array([limb.joints for limb in body.limbs], np.intp).reshape(-1, 3)
    return median_of_three(posed.positions[:, joints]) / body.unit


def led(
    balls: Balls,
    displaced: Displaced,
    geometry: tuple[Array, Array, Array],
    asked: tuple[Any, ...],
    keys: KeyFrames,
    reach: float = REACH,
) -> Array:
    """Return displacements, (frames, limbs, 2, 3), that begin before they are needed and end after.

    Of the arguments of `displacements`, `geometry` are `posed` to `free` in all frames, and `asked` are `soft` to
    `firmness` at the key frames; `reach` is its own.
    """
    at = keys.numbers
    shots, lead = keys.shots[at], LEAD / keys.time
    find: Callable[..., Array] = partial(displacements, balls, displaced, reach=reach)

    def over_time(change: Callable[[Array], Array], values: Array, shots: Shots = shots) -> Array:
        return by_shot(change, shots, values.reshape(len(values), -1)).reshape(values.shape)

    at_keys = tuple(each[at] for each in geometry)
    soft, aims, firmness = asked
    arms, others = firmness * displaced.mutual, firmness * ~displaced.mutual
    raw = by_shot(find, shots, *at_keys, soft, aims, others)
    size = over_time(lambda each: widened(each, lead), lengths(raw))
    direction = over_time(lambda each: averaged(each, 2 * round(lead) + 1), raw)
    smooth = size[..., None] * normalised(direction)
    for time in SETTLE[:-1]:
        out = find(*at_keys, soft, aims, arms, smooth, raw)  # arms that meet and part do so without a lead
        smooth = over_time(partial(averaged, reach=max(round(time / keys.time), 1)), out)
    soft = keys.between(soft)
    out = find(*geometry, soft, soft, np.zeros_like(soft), keys.between(smooth))
    reach_of_last = max(round(SETTLE[-1] / keys.frame_time), 1)
    return over_time(partial(averaged, reach=reach_of_last), out, keys.shots)


def _firmness(
    clip: Clip, body: BodySkin, in_source: Array, supports: Supports, settings: ContactSettings, at: Numbers
) -> Array:
    """(keys, pairs), how firmly pairs of segments touch, 0 to 1: they touch in the source, and are meant to."""
    touching = how_touching(body.balls.pairs[:, 0], PLACE[body.balls.pairs[:, 1]], in_source)
    if not touching.any():
        return touching
    return touching * _meant(clip, body, touching, supports, settings, at)


def how_free(clip: Clip, body: BodySkin, supports: Supports, settings: ContactSettings) -> Array:
    """(frames, limbs, 2), how far middle and end of each limb can move, 0 to 1: not while they or what is beyond them
    rest on the world, nor while the limb touches another performer; feet never.
    """
    free = np.ones((len(clip), len(body.limbs), 2))
    held = [*zip(supports.joints.tolist(), supports.weights.T, strict=True)] if settings.foot_lock else []
    touches = [*supports.touches]
    for number, limb in enumerate(body.limbs):
        below = {*clip.skeleton.subtree(limb.end)}
        for joint, weight in held:
            if joint in below:
                free[:, number, 1] = np.minimum(free[:, number, 1], 1.0 - weight)
            elif joint == limb.middle:
                free[:, number, 0] = np.minimum(free[:, number, 0], 1.0 - weight)
        for joint, weight in touches:
            if joint in clip.skeleton.subtree(limb.top):
                free[:, number] = np.minimum(free[:, number], 1.0 - weight[:, None])
        if limb.top in {leg.hip for leg in clip.target_legs or ()}:
            free[:, number, 1] = 0.0
    return free


def how_touching(limbs: Numbers, places: Numbers, gaps: Array) -> Array:
    """(frames, pairs), how near pairs of a limb's segment and one at a place are by their gaps, 0 to 1: only arms, and
    only the nearest at each place.
    """
    return np.asarray(smoothstep((APART - gaps) / (APART - TOUCH)) * _nearest(limbs, places, gaps) * IS_ARM[limbs])


def _nearest(limbs: Numbers, places: Numbers, gaps: Array) -> Array:
    """(frames, pairs), 1 for the pair with the least gap of all pairs of a limb and one place, 0 for pairs whose gap is
    larger by `MARGIN` and more.
    """
    nearest = np.empty_like(gaps)
    for limb, where in {*zip(limbs.tolist(), places.tolist(), strict=True)}:
        on = (limbs == limb) & (places == where)
        nearest[:, on] = gaps[:, on].min(axis=1)[:, None]
    return 1.0 - smoothstep((gaps - nearest) / MARGIN)


def softness(balls: Balls, parts: Numbers, in_source: Array) -> Array:
    """(frames, pairs), how far segments may overlap [body units]: as far as their flesh gives way, and as far as the
    source's do; hands and forearms not at all.

    `parts`, (pairs, 2), are the parts of the body that the segments of a pair are.
    """
    flesh = _of_segments(FLESH)[parts] * mean_radii(balls)[balls.pairs]
    hard = np.array(["hand" in SEGMENTS[limb] or "forearm" in SEGMENTS[limb] for limb in parts[:, 0]], bool)
    return np.where(hard, 0.0, np.maximum(flesh.sum(axis=1), -in_source))


def _of_segments(by_part: Mapping[str, float]) -> Array:
    """(segments,), the value of each, given for parts of the body; 0 for others."""
    return np.array([next((value for part, value in by_part.items() if part in name), 0.0) for name in SEGMENTS])


def of_pairs(gaps: Array, pairs: Numbers, wanted: Numbers) -> Array:
    """(frames, wanted pairs), the gaps of pairs, (frames, pairs); `APART` for those that are not there."""
    columns = {pair: column for column, pair in enumerate(map(tuple, pairs.tolist()))}
    result = np.full((len(gaps), len(wanted)), APART)
    for column, pair in enumerate(map(tuple, wanted.tolist())):
        if pair in columns:
            result[:, column] = gaps[:, columns[pair]]
    return result


def _meant(
    clip: Clip, body: BodySkin, touching: Array, supports: Supports, settings: ContactSettings, at: Numbers
) -> Array:
    """(keys, pairs), how much each pair of segments is meant to touch, 0 to 1: the largest activation of a contact
    pair of the first segment and of the place that the second belongs to. Only blocks of frames in which any pair is
    `touching`, (keys, pairs), count, and of the hands' joints only wrists and what is farthest from them.
    """
    pairs, targets = body.balls.pairs, clip.distances.targets
    of_point = body.of_joint[targets]
    chosen = np.ones(len(targets), bool)
    for segment in (number for number, name in enumerate(SEGMENTS) if "hand" in name):
        points = np.flatnonzero(of_point == segment)
        if len(points):
            reach = clip.skeleton.paths_from(targets.item(points[0]))[targets[points]]
            chosen[points] = (points == points[0]) | (points == points[reach.argmax()])
    contacts, meant = Contacts.of(clip, settings, chosen), np.zeros(touching.shape)
    for block in blocks_of(len(clip)):
        keys = slice(*np.searchsorted(at, (block.start, block.stop)))
        if not touching[keys].any():
            continue
        near = contacts.near(block, supports[block].standing)
        of_u, of_v, f = of_point[near.u], of_point[near.v], near.f[at[keys] - block.start]
        for column in np.flatnonzero(touching[keys].any(axis=0)):
            limb, other = pairs[column]
            on = ((of_u == limb) & (PLACE[of_v] == PLACE[other])) | ((of_v == limb) & (PLACE[of_u] == PLACE[other]))
            if on.any():
                meant[keys, column] = f[:, on].max(axis=1)
    return meant
