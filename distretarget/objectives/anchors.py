"""Where hands that touch a body belong on it: the same place of the hand on the same place of the body.

A hand touches with its nearest balls, about as far along it as these are, from the wrist; the same share of the way
along the target's hand belongs on the ray (`part_axes`) of the place that is touched.
"""

from __future__ import annotations

import numpy as np

from distretarget.motion import Motion
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.part_axes import ARM_PARTS, PARTS, rays
from distretarget.objectives.spots import Spots
from distretarget.skin.balls import ball_gaps
from distretarget.skin.capsules import SEGMENTS

NEARER = 0.01  # what is less than this farther than the nearest counts, of parts and of balls [body units]


def anchors(
    source: Motion, posed: Motion, skins: Skins, spots: Spots, in_source: Array, firmness: Array
) -> dict[str, Array]:
    """Return the fields `off`, `rays`, `ties` and `carried` of `limb_terms.Frames`, with an anchor for each of `PARTS`.

    Args:
        source: its motion [file units].
        posed: that of the target, before its limbs bend [file units].
        skins: of both.
        spots: of the target.
        in_source: (frames, pairs), the gaps of the source [body units].
        firmness: (frames, spots), how firmly each spot is touched, 0 to 1.
    """
    one, other, limbs = skins.source, skins.target, skins.target.limbs
    fields, hands = no_anchors(len(posed), len(limbs), len(PARTS)), shared_hands(one, other)
    if one.landmarks is None or other.landmarks is None or not hands:
        return no_anchors(len(posed), len(limbs))
    for limb, (segment, *_) in hands.items():
        for part, names in enumerate(PARTS.values()):
            touched = np.array([*map(SEGMENTS.index, names)])
            fields["ties"][:, limb, part] = tie(other.balls.pairs, spots, segment, touched, in_source, firmness)
    touch = np.flatnonzero(fields["ties"].any(axis=(1, 2)))
    if not len(touch):
        return no_anchors(len(posed), len(limbs))
    before, now = source[touch], posed[touch]
    bodies = [(body, motion, body.posed(motion)) for body, motion in ((one, before), (other, now))]
    points = np.zeros((2, len(now), len(hands), len(PARTS), 3))
    for row, (limb, (segment, *wrists)) in enumerate(hands.items()):
        ways = [_way(*each, segment, wrist) for each, wrist in zip(bodies, wrists, strict=True)]
        along = _along(one, bodies[0][2], segment, *ways[0])
        for part, names in enumerate(PARTS.values()):
            on = fields["ties"][touch, limb, part] > 0.0
            share = _how_far_along(one, bodies[0][2], segment, names, along, on)
            for body, (start, way) in enumerate(ways):
                points[body, :, row, part] = start + share[:, None] * way
    places, out, heights = rays(one.landmarks.axes(before), other.landmarks.axes(now), points[0])
    for row, limb in enumerate(hands):
        fields["off"][touch, limb] = (points[1, :, row] - places[:, row]) / other.unit
        fields["rays"][touch, limb] = out[:, row]
        fields["carried"][touch, limb] = _carried(heights[:, row])
    return fields


def no_anchors(frames: int, limbs: int, count: int = 0) -> dict[str, Array]:
    """Return the fields of `limb_terms.Frames` for so many anchors that hold nothing."""
    none = np.zeros((frames, limbs, count, 3))
    return {
        "off": none,
        "rays": none.copy(),
        "ties": np.zeros(none.shape[:3]),
        "carried": np.zeros((*none.shape[:3], 2)),
    }


def shared_hands(one: BodySkin, other: BodySkin) -> dict[int, tuple[int, int, int]]:
    """Return the segment of the hand of each arm of the other body, and the wrists of both bodies, by the arm's number;
    of arms that both bodies have.
    """
    wrists = {one.of_joint[limb.end]: limb.end for limb in one.limbs if limb.is_arm}
    found = {}
    for number, limb in enumerate(other.limbs):
        segment = int(other.of_joint[limb.end])
        is_hand = limb.is_arm and "hand" in SEGMENTS[segment] and segment in wrists
        if is_hand and one.balls_of(segment).size and other.balls_of(segment).size:
            found[number] = segment, wrists[segment], limb.end
    return found


def _way(body: BodySkin, motion: Motion, ends: Array, segment: int, wrist: int) -> tuple[Array, Array]:
    """The wrist, and the way from there through the middle of a hand as far again, (frames, 3) each [file units]."""
    start = motion.positions[:, wrist]
    return start, 2.0 * (body.unit * body.centres(ends, segment).mean(axis=1) - start)


def _along(body: BodySkin, ends: Array, segment: int, start: Array, way: Array) -> Array:
    """(frames, balls), how far along a hand each of its balls is, in ways of the hand."""
    off = body.unit * body.centres(ends, segment) - start[:, None]
    square = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
    return np.asarray((off @ way[:, :, None])[..., 0] / square[:, None])


def _how_far_along(body: BodySkin, ends: Array, segment: int, names: tuple[str, ...], along: Array, on: Flags) -> Array:
    """(frames,), how far along a hand it touches some segments, by `along` of its balls, and its middle elsewhere."""
    share = np.full(len(on), 0.5)
    parts = np.flatnonzero(np.isin(body.capsules.segments, [SEGMENTS.index(name) for name in names]))
    if on.any() and len(parts):
        gaps = ball_gaps(body.balls, ends[on], segment, parts)
        weights = np.maximum(1.0 - (gaps - gaps.min(axis=1, keepdims=True)) / NEARER, 0.0)
        share[on] = (weights * along[on]).sum(axis=1) / weights.sum(axis=1)
    return share


def _carried(heights: Array) -> Array:
    """(frames, parts, 2), the share of the displacements of the middle and the end of the other arm that a place of a
    part moves by, at heights, (frames, parts).
    """
    carried, heights = np.zeros((*heights.shape, 2)), np.clip(heights, 0.0, 1.0)
    for part, name in enumerate(PARTS):
        if name in ARM_PARTS:
            s = heights[:, part] if "hand" not in name else np.ones(len(heights))
            carried[:, part] = np.stack([s, 0.0 * s] if "upper" in name else [1.0 - s, s], axis=1)
    return carried


def tie(pairs: Numbers, spots: Spots, segment: int, touched: Numbers, in_source: Array, firmness: Array) -> Array:
    """Return how far a segment of a limb touches some others, (frames,), 0 to 1; `pairs`, (pairs, 2), are the segments
    of `spots`, and the other arguments as in `anchors`.
    """
    one, other = pairs.T
    on = ((one == segment) & np.isin(other, touched)) | ((other == segment) & np.isin(one, touched))
    found = np.zeros(len(firmness))
    for spot in np.unique(spots.of_pair[on]):
        own = spots.of_pair == spot
        farther = in_source[:, on & own].min(axis=1) - in_source[:, own].min(axis=1)
        found = np.maximum(found, firmness[:, spot] * smoothstep(1.0 - farther / NEARER))
    return np.asarray(found)
