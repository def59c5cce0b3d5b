"""Anchors: where on the target's body a touching hand belongs, so that the same points of hand and body touch.

The point of contact on the hand is given by its fraction along the hand from the wrist: the weighted mean of those of
the balls nearest to the touched part. The point at the same fraction along the target's hand belongs on the ray
(`part_axes`) of the point that the source touches.
"""

from __future__ import annotations

import numpy as np

from distretarget.motion import Motion
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.contact_zones import APART, ContactZones
from distretarget.objectives.part_axes import ARM_PARTS, PARTS, rays
from distretarget.skin.balls import ball_gaps
from distretarget.skin.capsules import SEGMENTS

NEARER = 0.01  # parts and balls count whose gap exceeds the least by less than this [body units]


def anchors(
    source: Motion, posed: Motion, skins: Skins, zones: ContactZones, in_source: Array, firmness: Array
) -> dict[str, Array]:
    """Return the anchor fields of `limb_terms.Frames`, with an anchor for each of `PARTS`.

    Args:
        source: the source's motion [file units].
        posed: the target's motion before its limbs bend [file units].
        skins: of source and target.
        zones: of the target.
        in_source: (frames, pairs), the source's gaps [body units].
        firmness: (frames, zones), the weight of each contact, 0 to 1.
    """
    one, other, limbs = skins.source, skins.target, skins.target.limbs
    fields, hands = no_anchors(len(posed), len(limbs), len(PARTS)), shared_hands(one, other)
    if one.landmarks is None or other.landmarks is None or not hands:
        return no_anchors(len(posed), len(limbs))
    for limb, (segment, *_) in hands.items():
        for part, names in enumerate(PARTS.values()):
            touched = np.array([*map(SEGMENTS.index, names)])
            weight = anchor_weight(other.balls.pairs, zones, segment, touched, in_source, firmness)
            fields["anchor_weights"][:, limb, part] = weight
    touch = np.flatnonzero(fields["anchor_weights"].any(axis=(1, 2)))
    if not len(touch):
        return no_anchors(len(posed), len(limbs))
    before, now = source[touch], posed[touch]
    bodies = [(body, motion, body.posed(motion)) for body, motion in ((one, before), (other, now))]
    points = np.zeros((2, len(now), len(hands), len(PARTS), 3))
    for row, (limb, (segment, *wrists)) in enumerate(hands.items()):
        hand_axes = [_hand_axis(*each, segment, wrist) for each, wrist in zip(bodies, wrists, strict=True)]
        of_balls = _fractions_of_balls(one, bodies[0][2], segment, *hand_axes[0])
        for part, names in enumerate(PARTS.values()):
            on = fields["anchor_weights"][touch, limb, part] > 0.0
            fraction = _fraction(one, bodies[0][2], segment, names, of_balls, on)
            for body, (start, axis) in enumerate(hand_axes):
                points[body, :, row, part] = start + fraction[:, None] * axis
    places, out, heights = rays(one.landmarks.axes(before), other.landmarks.axes(now), points[0])
    for row, limb in enumerate(hands):
        fields["anchor_offsets"][touch, limb] = (points[1, :, row] - places[:, row]) / other.unit
        fields["anchor_rays"][touch, limb] = out[:, row]
        fields["anchor_shares"][touch, limb] = _shares(heights[:, row])
    return fields


def no_anchors(frames: int, limbs: int, count: int = 0) -> dict[str, Array]:
    """Return the anchor fields of `limb_terms.Frames` for `count` anchors a limb, all of weight 0."""
    widths = {"anchor_offsets": (3,), "anchor_rays": (3,), "anchor_weights": (), "anchor_shares": (2,)}
    return {name: np.zeros((frames, limbs, count, *width)) for name, width in widths.items()}


def shared_hands(one: BodySkin, other: BodySkin) -> dict[int, tuple[int, int, int]]:
    """Return, by limb index of the other body, the segment of each hand that both bodies have, and its wrist joints in
    both.
    """
    wrists = {one.of_joint[limb.end]: limb.end for limb in one.limbs if limb.is_arm}
    found = {}
    for number, limb in enumerate(other.limbs):
        segment = int(other.of_joint[limb.end])
        is_hand = limb.is_arm and "hand" in SEGMENTS[segment] and segment in wrists
        if is_hand and one.balls_of(segment).size and other.balls_of(segment).size:
            found[number] = segment, wrists[segment], limb.end
    return found


def _hand_axis(body: BodySkin, motion: Motion, ends: Array, segment: int, wrist: int) -> tuple[Array, Array]:
    """The wrist, and twice the vector from it to the middle of the hand, (frames, 3) each [file units]."""
    start = motion.positions[:, wrist]
    return start, 2.0 * (body.unit * body.centres(ends, segment).mean(axis=1) - start)


def _fractions_of_balls(body: BodySkin, ends: Array, segment: int, start: Array, axis: Array) -> Array:
    """(frames, balls), the projection of each ball of a hand onto the hand's axis, (frames, 3) [its lengths]."""
    off = body.unit * body.centres(ends, segment) - start[:, None]
    square = np.maximum((axis**2).sum(axis=1), np.finfo(float).tiny)
    return np.asarray((off @ axis[:, :, None])[..., 0] / square[:, None])


def _fraction(body: BodySkin, ends: Array, segment: int, names: tuple[str, ...], of_balls: Array, on: Flags) -> Array:
    """(frames,), the fraction along a hand at which it touches segments, by those `of_balls`; 0.5 if it is not `on`."""
    fraction = np.full(len(on), 0.5)
    parts = np.flatnonzero(np.isin(body.capsules.segments, [SEGMENTS.index(name) for name in names]))
    if on.any() and len(parts):
        gaps = ball_gaps(body.balls, ends[on], segment, parts)
        weights = np.maximum(1.0 - (gaps - gaps.min(axis=1, keepdims=True)) / NEARER, 0.0)
        fraction[on] = (weights * of_balls[on]).sum(axis=1) / weights.sum(axis=1)
    return fraction


def _shares(heights: Array) -> Array:
    """(frames, parts, 2), the shares of the displacements of the other arm's elbow and wrist by which points on parts
    move, at heights along the axes, (frames, parts); 0 on trunk, legs and head.
    """
    shares, heights = np.zeros((*heights.shape, 2)), np.clip(heights, 0.0, 1.0)
    for part, name in enumerate(PARTS):
        if name in ARM_PARTS:
            s = heights[:, part] if "hand" not in name else np.ones(len(heights))
            shares[:, part] = np.stack([s, 0.0 * s] if "upper" in name else [1.0 - s, s], axis=1)
    return shares


def anchor_weight(
    pairs: Numbers, zones: ContactZones, segment: int, touched: Numbers, in_source: Array, firmness: Array
) -> Array:
    """Return the weight of a limb segment's contact with the `touched` segments, (frames,), 0 to 1. `pairs`, (pairs,
    2), are the segment pairs of `zones`; other arguments as in `anchors`.
    """
    one, other = pairs.T
    on = ((one == segment) & np.isin(other, touched)) | ((other == segment) & np.isin(one, touched))
    found = np.zeros(len(firmness))
    for zone in np.unique(zones.of_pair[on]):
        own = zones.of_pair == zone
        gap = in_source[:, on & own].min(axis=1)
        nearest = smoothstep(1.0 - (gap - in_source[:, own].min(axis=1)) / NEARER)
        found = np.maximum(found, firmness[:, zone] * nearest * (gap < APART))
    return np.asarray(found)
