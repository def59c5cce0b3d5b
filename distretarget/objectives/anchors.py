"""Where hands that touch a body belong on it, as in the source."""

from __future__ import annotations

import numpy as np

from distretarget.motion import Motion
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, Numbers
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.part_axes import PARTS, rays
from distretarget.objectives.spots import Spots
from distretarget.skin.capsules import PLACE, SEGMENTS

NEARER = 0.01  # of the parts of a place, those that are less than this farther than the nearest count [body units]


def anchors(
    source: Motion, posed: Motion, skins: Skins, spots: Spots, in_source: Array, firmness: Array
) -> dict[str, Array]:
    """Return the fields `off`, `rays` and `ties` of `limb_terms.Frames`, with an anchor for each of `PARTS`.

    Args:
        source: its motion [file units].
        posed: that of the target, before its limbs bend [file units].
        skins: of both.
        spots: of the target.
        in_source: (frames, pairs), the gaps of the source [body units].
        firmness: (frames, spots), how firmly each spot is touched, 0 to 1.
    """
    one, other, limbs = skins.source, skins.target, skins.target.limbs
    ends = {number: other.of_joint[limb.end] for number, limb in enumerate(limbs) if limb.is_arm}
    hands = {
        number: segment
        for number, segment in ends.items()
        if "hand" in SEGMENTS[segment] and _balls(one, segment).size and _balls(other, segment).size
    }
    if not hands or one.landmarks is None or other.landmarks is None or not firmness.any():
        return no_anchors(len(posed), len(limbs))
    before, now = (
        np.stack([_middle(body, motion, segment) for segment in hands.values()], axis=1)
        for body, motion in ((one, source), (other, posed))
    )
    places, out = rays(one.landmarks.axes(source), other.landmarks.axes(posed), before)
    shape = (len(posed), len(limbs), len(PARTS))
    off, directions, ties = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
    for row, (limb, segment) in enumerate(hands.items()):
        off[:, limb] = (now[:, row, None] - places[:, row]) / other.unit
        directions[:, limb] = out[:, row]
        for part, names in enumerate(PARTS.values()):
            ties[:, limb, part] = _tie(other, spots, segment, names, in_source, firmness)
    return {"off": off, "rays": directions, "ties": ties}


def _balls(body: BodySkin, segment: int) -> Numbers:
    """Return the numbers of the balls of a segment."""
    return np.arange(*body.balls.of_ball[segment : segment + 2])


def _middle(body: BodySkin, motion: Motion, segment: int) -> Array:
    """(frames, 3), the middle of the balls of a segment [file units]."""
    on = _balls(body, segment)
    ends, t = body.posed(motion)[:, body.balls.carriers[on]], body.balls.places[on, None]
    return np.asarray(body.unit * ((1.0 - t) * ends[:, :, 0] + t * ends[:, :, 1]).mean(axis=1))


def _tie(
    body: BodySkin, spots: Spots, segment: int, names: tuple[str, ...], in_source: Array, firmness: Array
) -> Array:
    """(frames,), how far a segment of a limb touches a part of the body with some segments, 0 to 1."""
    numbers = [SEGMENTS.index(name) for name in names]
    pairs, tie = body.balls.pairs, np.zeros(len(firmness))
    for spot in np.flatnonzero((spots.limbs == segment) & (spots.places == PLACE[numbers[0]])):
        own = spots.of_pair == spot
        here = own & np.isin(pairs[:, 1], numbers)
        if here.any():
            farther = in_source[:, here].min(axis=1) - in_source[:, own].min(axis=1)
            tie = np.maximum(tie, firmness[:, spot] * smoothstep(1.0 - farther / NEARER))
    return np.asarray(tie)


def no_anchors(frames: int, limbs: int) -> dict[str, Array]:
    """Return the fields of `limb_terms.Frames` where nothing is anchored."""
    none = np.zeros((frames, limbs, 0, 3))
    return {"off": none, "rays": none, "ties": none[..., 0]}
