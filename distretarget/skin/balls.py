"""Balls along the limbs of a body, and the pairs of limb and body part whose surfaces can touch.

A limb is a row of balls: a ball and a capsule always touch in one point, while two capsules that lie side
by side touch along a line, and the point that counts would jump from end to end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import compiled
from distretarget.numerics.vectors import Array, Numbers
from distretarget.skin.capsules import LIMB_SEGMENTS, SEGMENTS, TRUNK_SEGMENTS, Capsules, gap_at, write_axis

SPACING = 1.2  # between the balls of a limb [radii]
MOST_BALLS = 7  # of a capsule
NEVER = 1e9  # the spare gap of a ball and a capsule that never meet
OVERLAP = 0.5  # balls that are deeper than this in another part in the reference pose do not meet it [radii]

ARM_PARTS, LEG_PARTS = LIMB_SEGMENTS[:3], LIMB_SEGMENTS[3:]


def _touching_segments() -> list[tuple[int, int]]:
    """The pairs of segments that can touch, numbers of `SEGMENTS`: arms and trunk, arms and legs, the two arms,
    hand and shoulder of one arm, and the two legs.
    """
    number = SEGMENTS.index
    pairs = []
    for side in ("left", "right"):
        for part in ARM_PARTS:
            limb = number(f"{side} {part}")
            pairs += [(limb, number(trunk)) for trunk in TRUNK_SEGMENTS]
            pairs += [(limb, number(f"{leg} {below}")) for leg in ("left", "right") for below in LEG_PARTS]
            pairs += [(limb, number(f"right {arm}")) for arm in ARM_PARTS if side == "left"]
        pairs.append((number(f"{side} hand"), number(f"{side} upper arm")))
    pairs += [(number(f"left {a}"), number(f"right {b}")) for a in LEG_PARTS for b in LEG_PARTS]
    return pairs


class Balls(NamedTuple):
    """The balls of the limbs and the capsules of all parts of a body, each ordered by segment."""

    carriers: Numbers  # (balls,), the capsule whose axis each ball is on
    places: Array  # (balls,), where on it, from 0 to 1
    radii: Array  # (balls,)
    joints: Numbers  # (capsules,), the joint that carries each capsule
    cap_radii: Array  # (capsules, 2)
    of_ball: Numbers  # (segments + 1,), the first ball of each segment
    of_capsule: Numbers  # (segments + 1,), the first capsule of each segment
    pairs: Numbers  # (pairs, 2), the segments that can touch: that of the balls, that of the capsules
    # (balls, capsules), the gap in the reference pose where it is less than 0; `NEVER` where the two do not meet
    spare: Array


def mean_radii(balls: Balls) -> Array:
    """Return the mean radius of the capsules of each segment, (segments,); 0 for segments without any."""
    first = balls.of_capsule
    of_segment = np.repeat(np.arange(len(first) - 1), np.diff(first))
    sums = np.bincount(of_segment, balls.cap_radii[: first[-1]].mean(axis=1), len(first) - 1)
    return np.asarray(sums / np.maximum(np.diff(first), 1))


def balls_of(capsules: Capsules, posed: Array) -> Balls:
    """The balls of a body; `posed`, (capsules, 2, 3), are the ends of its ordered capsules in the reference pose."""
    carriers, places = _rows(capsules)
    radii = (1.0 - places) * capsules.radii[carriers, 0] + places * capsules.radii[carriers, 1]
    segments = np.arange(len(SEGMENTS) + 1)
    of_ball = np.searchsorted(capsules.segments[carriers], segments)
    of_capsule = np.searchsorted(capsules.segments, segments)
    pairs = np.array(_touching_segments(), np.intp)
    pairs = pairs[(np.diff(of_ball)[pairs[:, 0]] > 0) & (np.diff(of_capsule)[pairs[:, 1]] > 0)]
    spare = np.full((len(carriers), len(capsules)), NEVER)
    balls = Balls(carriers, places, radii, capsules.joints, capsules.radii, of_ball, of_capsule, pairs, spare)
    _write_spare(balls, posed, np.zeros(3), np.zeros(8), spare)
    return balls


def _rows(capsules: Capsules) -> tuple[Numbers, Array]:
    """The capsule and the place on it of each ball."""
    limbs = [each for each, segment in enumerate(capsules.segments.tolist()) if " " in SEGMENTS[segment]]
    carriers: list[int] = []
    places: list[float] = []
    for capsule in limbs:
        length = float(np.linalg.norm(capsules.ends[capsule, 1] - capsules.ends[capsule, 0]))
        count = int(np.clip(np.ceil(length / (SPACING * capsules.radii[capsule].mean())) + 1, 2, MOST_BALLS))
        count = 1 if length < 0.1 * capsules.radii[capsule].mean() else count
        carriers += [capsule] * count
        places += np.linspace(0.0, 1.0, count).tolist() if count > 1 else [0.5]
    return np.array(carriers, np.intp), np.array(places)


@compiled()
def _write_spare(balls, posed, p, axis, spare):  # type: ignore[no-untyped-def]
    """Write `Balls.spare`; the balls that meet a capsule have a finite value."""
    for pair in range(len(balls.pairs)):
        a, b = balls.pairs[pair, 0], balls.pairs[pair, 1]
        for capsule in range(balls.of_capsule[b], balls.of_capsule[b + 1]):
            write_axis(posed[capsule], balls.cap_radii[capsule], axis)
            for ball in range(balls.of_ball[a], balls.of_ball[a + 1]):
                carrier, t = balls.carriers[ball], balls.places[ball]
                for i in range(3):
                    p[i] = (1.0 - t) * posed[carrier, 0, i] + t * posed[carrier, 1, i]
                gap = gap_at(p, balls.radii[ball], axis, balls.cap_radii[capsule])[0]
                if gap > -OVERLAP * balls.radii[ball]:
                    spare[ball, capsule] = min(gap, 0.0)
