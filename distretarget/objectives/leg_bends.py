"""Bends of legs in the rotation copy before it is solved: feet that swing, and knees that bend backwards.

The source's swinging foot passes just over the floor; a longer foot, or one on other legs, would pass through it. Then
the knee bends, and raises the ankle by

    lift = floor + min(source's sole over its floor, scaled, CLEARANCE) - lowest point of the copied foot

if that is positive, widened in time: the foot begins to rise before, and comes down after. The floor of a foot is the
height of its sole at rest, interpolated between rests; without any rest, as on a treadmill, the lowest height of any
sole. The foot keeps its rotation.

Straight legs in motion capture often bend a little backwards. If a foot rests nearer to the hips than in the copy, the
knee would bend farther backwards, and snap to the front when the copied knee does. Such knees are straightened.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from distretarget.body.axes import perpendicular
from distretarget.body.resting import feet_resting
from distretarget.body.soles import sole_height
from distretarget.matching.undersides import Undersides
from distretarget.numerics.time_series import smoothstep
from distretarget.numerics.vectors import Array, angles_between, lengths, normalised
from distretarget.objectives.clip import Clip, LegPair
from distretarget.objectives.foot_lock import lowest_of_foot, sole_levels
from distretarget.objectives.supports import Supports
from distretarget.skin.limbs import Limb, bent

CLEARANCE = 0.03  # the largest clearance over the floor that a swinging foot is raised to [leg lengths]
SCUFF = 0.005  # depth in the floor that is left to a swinging foot [leg lengths]
SWING_BLEND = 0.1  # a foot rises over twice this time, and comes down over as much [s]
STRAIGHT_KNEE = 0.1  # knees nearer than this to the line from hip to ankle bend towards where the foot points [shins]
BACKWARDS = np.radians(10)  # knees bent backwards by up to this are straightened; from twice this on they stay [rad]
NEARER = 0.01  # knees are straightened in full where the foot comes nearer to the hips by this or more [shins]


def with_swinging_feet_up(clip: Clip, feet: Supports, limbs: Sequence[Limb], undersides: Undersides | None) -> Clip:
    """Return the clip with the legs of its rotation copy bent where feet would swing through the floor. `feet` are the
    supports of feet, `limbs` those of the target; the clip's root path has to be final.
    """
    if not clip.legs:
        return clip
    moved = np.zeros((len(clip), len(limbs), 2, 3))
    free = 1.0 - feet.weights[:, : feet.feet].reshape(len(clip), -1, 2).max(axis=2)
    lifts = clip.widened(free * _lifts(clip, undersides), SWING_BLEND)
    for leg, pair, number in _known_legs(clip, limbs):
        if lifts[:, leg].any():
            moved[:, number] = _raised(clip, limbs[number], pair.target.toe, lifts[:, leg, None])
    return _bent(clip, limbs, moved)


def with_straight_knees(clip: Clip, feet: Supports, limbs: Sequence[Limb]) -> Clip:
    """Return the clip with knees of its rotation copy straightened that bend a little backwards, away from where the
    foot points, while the foot rests nearer to the hips than in the copy; arguments as in `with_swinging_feet_up`.
    """
    moved = np.zeros((len(clip), len(limbs), 2, 3))
    for leg, pair, number in _known_legs(clip, limbs):
        hip, knee, ankle, toe = (clip.copy.positions[:, each] for each in (*limbs[number].joints, pair.target.toe))
        thigh, shin = knee - hip, ankle - knee
        leg_line, place = ankle - hip, feet.places[:, 2 * leg] - (clip.root - clip.copy.root_positions)
        axis = normalised(leg_line)
        forward = normalised(perpendicular(toe - ankle, axis))
        back = np.maximum(-(perpendicular(thigh, axis) * forward).sum(axis=1), 0.0)
        nearer, size = lengths(leg_line) - lengths(place - hip), NEARER * lengths(shin)
        nearer = np.divide(nearer, size, out=np.zeros_like(size), where=size > 0.0)
        firm = feet.weights[:, 2 * leg] * np.clip(nearer, 0.0, 1.0)
        firm *= 1.0 - smoothstep(angles_between(thigh, shin) / BACKWARDS - 1.0)
        moved[:, number, 0] = (firm * back)[:, None] * forward
    return _bent(clip, limbs, moved)


def _known_legs(clip: Clip, limbs: Sequence[Limb]) -> Iterator[tuple[int, LegPair, int]]:
    """Yield the indices of legs among those of the clip and among the target's `limbs`."""
    numbers = {limb.end: number for number, limb in enumerate(limbs)}
    for leg, pair in enumerate(clip.legs):
        if pair.target.ankle in numbers:
            yield leg, pair, numbers[pair.target.ankle]


def _bent(clip: Clip, limbs: Sequence[Limb], moved: Array) -> Clip:
    return replace(clip, copy=bent(clip.copy, limbs, moved)) if moved.any() else clip


def _lifts(clip: Clip, undersides: Undersides | None) -> Array:
    """(frames, legs), how far each foot of the rotation copy has to be raised, with the root on its path [target file
    units].
    """
    up, (source_length, length), frames = clip.up, clip.leg_lengths, np.arange(len(clip))
    rests = [feet_resting(clip.source, pair.source, up, source_length, clip.shots) for pair in clip.legs]
    soles, own = _soles(clip, rests, undersides)
    soles, lifts = clip.scale.heights(soles), np.zeros_like(soles)
    own += ((clip.root - clip.copy.root_positions) @ up)[:, None]
    for leg, rest in enumerate(rests):
        known = np.flatnonzero(rest.max(axis=1) == 1.0)
        floor = np.interp(frames, known, soles[known, leg]) if len(known) else soles.min()
        lifts[:, leg] = np.minimum(soles[:, leg], floor + CLEARANCE * length) - own[:, leg]
    return np.maximum(lifts - SCUFF * length, 0.0)


def _soles(clip: Clip, rests: Sequence[Array], undersides: Undersides | None) -> tuple[Array, Array]:
    """The heights of the lowest points of soles, of source and rotation copy, (frames, legs) each [file units of each];
    `rests` is how much ankle and toe of each leg rest, (frames, 2).
    """
    if undersides is None or not undersides.feet_on_mesh:
        heights = [
            (sole_height(clip.source, pair.source_sole, clip.up), sole_height(clip.copy, pair.target_sole, clip.up))
            for pair in clip.legs
        ]
        source, own = np.array(heights).reshape(len(clip.legs), 2, len(clip)).transpose(1, 2, 0)
        return source, own
    lowest = [lowest_of_foot(clip.copy, pair.target.ankle, pair.target_sole, clip.up, undersides) for pair in clip.legs]
    return sole_levels(clip, rests), np.stack(lowest, axis=1) + undersides.soles[1]


def _raised(clip: Clip, limb: Limb, toe: int, lift: Array) -> Array:
    """The displacements of knee and ankle, (frames, 2, 3), that raise the ankle by `lift`, (frames, 1) [file units]. A
    knee that the copy bends backwards comes forwards as the lift grows.
    """
    hip, knee, ankle, toes = (clip.copy.positions[:, joint] for joint in (*limb.joints, toe))
    thigh, shin = lengths(knee - hip)[:, None], lengths(ankle - knee)[:, None]
    leg = ankle + lift * clip.up - hip
    far = lengths(leg)[:, None]
    down = leg / far
    off = perpendicular(knee - hip, normalised(ankle - hip))
    forward = normalised(perpendicular(toes - ankle, down))
    forward = normalised(perpendicular(off + STRAIGHT_KNEE * shin * forward, down))
    before = (off * forward).sum(axis=1, keepdims=True)
    aside = perpendicular(off, forward)
    along = (thigh**2 - shin**2 + far**2) / (2.0 * far)
    square = thigh**2 - along**2 - (aside**2).sum(axis=1, keepdims=True)
    bend = np.sqrt(np.maximum(square, np.finfo(float).tiny))
    bend *= 1.0 - 2.0 * smoothstep(-before / bend)
    moved = np.stack([hip + along * down + aside + bend * forward - knee, lift * clip.up], axis=1)
    return np.where(lift[:, None] > 0.0, moved, 0.0)
