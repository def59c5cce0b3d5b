"""Balls along the limbs of a body, and the pairs of limb and body part whose surfaces can touch.

A limb is a row of balls: a ball and a capsule always touch in one point, while two capsules that lie side
by side touch along a line, and the point that counts would jump from end to end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, inlined, read_only
from distretarget.numerics.parallel import over_blocks
from distretarget.numerics.vectors import lengths
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.closest import place_on_axis

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

SPACING = 1.2  # between the balls of a limb [radii]
MOST_BALLS = 7  # of a capsule
NEVER = 1e9  # the spare gap of a ball and a capsule that never meet
OVERLAP = 0.5  # balls that are deeper than this in another part in the reference pose do not meet it [radii]

ARM_PARTS = ("hand", "forearm", "upper arm")
LEG_PARTS = ("thigh", "shin", "foot")
TRUNK_PARTS = ("head", "neck", "chest", "belly", "pelvis")


def touching_segments() -> tuple[tuple[int, int], ...]:
    """Return the pairs of segments that can touch, numbers of `SEGMENTS`: arms and trunk, arms and legs, the two arms,
    hand and shoulder of one arm, and the two legs.
    """
    number = SEGMENTS.index
    pairs = []
    for side in ("left", "right"):
        for part in ARM_PARTS:
            limb = number(f"{side} {part}")
            pairs += [(limb, number(trunk)) for trunk in TRUNK_PARTS]
            pairs += [(limb, number(f"{leg} {below}")) for leg in ("left", "right") for below in LEG_PARTS]
            pairs += [(limb, number(f"right {arm}")) for arm in ARM_PARTS if side == "left"]
        pairs.append((number(f"{side} hand"), number(f"{side} upper arm")))
    pairs += [(number(f"left {a}"), number(f"right {b}")) for a in LEG_PARTS for b in LEG_PARTS]
    return tuple(pairs)


TOUCHING = touching_segments()


class Balls(NamedTuple):
    """The balls of the limbs and the capsules of all parts of a body, each ordered by segment."""

    carriers: Numbers  # (balls,), the capsule whose axis each ball is on
    places: Array  # (balls,), where on it, from 0 to 1
    radii: Array  # (balls,)
    joints: Numbers  # (capsules,), the joint that carries each capsule
    cap_radii: Array  # (capsules, 2)
    reaches: Array  # (capsules,), the radius of a ball about the middle of each that holds it
    of_ball: Numbers  # (segments + 1,), the first ball of each segment
    of_capsule: Numbers  # (segments + 1,), the first capsule of each segment
    pairs: Numbers  # (pairs, 2), the segments that can touch: that of the balls, that of the capsules
    # (balls, capsules), the gap in the reference pose where it is less than 0; `NEVER` where the two do not meet
    spare: Array


def ordered(capsules: Capsules) -> Capsules:
    """Return the capsules ordered by segment."""
    order = np.argsort(capsules.segments, kind="stable")
    return Capsules(capsules.joints[order], capsules.ends[order], capsules.radii[order], capsules.segments[order])


def balls_of(capsules: Capsules, posed: Array) -> Balls:
    """Return the balls of a body; its `capsules` are ordered, and `posed`, (capsules, 2, 3), are their ends in the
    reference pose.
    """
    carriers, places = _rows(capsules)
    radii = (1.0 - places) * capsules.radii[carriers, 0] + places * capsules.radii[carriers, 1]
    segments = np.arange(len(SEGMENTS) + 1)
    of_ball = np.searchsorted(capsules.segments[carriers], segments)
    of_capsule = np.searchsorted(capsules.segments, segments)
    pairs = np.array([pair for pair in TOUCHING if _has_both(pair, of_ball, of_capsule)], np.intp).reshape(-1, 2)
    spare = np.full((len(carriers), len(capsules)), NEVER)
    reaches = 0.5 * lengths(capsules.ends[:, 1] - capsules.ends[:, 0]) + capsules.radii.max(axis=1, initial=0.0)
    balls = Balls(carriers, places, radii, capsules.joints, capsules.radii, reaches, of_ball, of_capsule, pairs, spare)
    _write_spare(balls, posed, np.zeros(3), spare)
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


def _has_both(pair: tuple[int, int], of_ball: Numbers, of_capsule: Numbers) -> bool:
    a, b = pair
    return bool(of_ball[a + 1] > of_ball[a] and of_capsule[b + 1] > of_capsule[b])


@compiled()
def _write_spare(balls, posed, p, spare):  # type: ignore[no-untyped-def]
    """Write `Balls.spare`; the balls that meet a capsule have a finite value."""
    for pair in range(len(balls.pairs)):
        a, b = balls.pairs[pair, 0], balls.pairs[pair, 1]
        for ball in range(balls.of_ball[a], balls.of_ball[a + 1]):
            place_ball(balls, ball, posed, p)
            for capsule in range(balls.of_capsule[b], balls.of_capsule[b + 1]):
                gap = gap_between(p, balls.radii[ball], posed[capsule], balls.cap_radii[capsule])
                if gap > -OVERLAP * balls.radii[ball]:
                    spare[ball, capsule] = min(gap, 0.0)


@inlined(fastmath=True)
def place_ball(balls: Balls, ball: int, posed: Array, p: Array) -> None:
    """Write the centre of a ball to p, (3,); `posed`, (capsules, 2, 3), are the ends of the capsules."""
    capsule, t = balls.carriers[ball], balls.places[ball]
    for i in range(3):
        p[i] = (1.0 - t) * posed[capsule, 0, i] + t * posed[capsule, 1, i]


@inlined(fastmath=True)
def gap_between(p: Array, radius: float, ends: Array, radii: Array) -> float:
    """Return the gap between a ball about p, (3,), and a tapered capsule; negative where they overlap."""
    t = place_on_axis(p, ends, radii)
    square = 0.0
    for i in range(3):
        square += (p[i] - (1.0 - t) * ends[0, i] - t * ends[1, i]) ** 2
    return float(np.sqrt(square) - (1.0 - t) * radii[0] - t * radii[1] - radius)


def segment_gaps(balls: Balls, posed: Array, farthest: float) -> Array:
    """Return the least gap of each pair of segments in each frame, (frames, pairs), or `farthest` if that is less, for
    capsules whose ends are at `posed`, (frames, capsules, 2, 3); in the unit of `posed` and of the radii. Overlaps
    count only beyond those of the reference pose.
    """
    gaps = np.empty((len(posed), len(balls.pairs)))
    count = len(balls.carriers)

    def write(block: slice) -> None:
        room = np.empty((count, 3)), np.empty((len(balls.of_ball), 4))
        _write_gaps(balls, read_only(posed[block]), farthest, *room, gaps[block])

    over_blocks(write, len(posed), count)
    return gaps


@compiled(fastmath=True)
def _write_gaps(balls, posed, farthest, centres, spheres, gaps):  # type: ignore[no-untyped-def]
    for frame in range(len(posed)):
        for ball in range(len(balls.carriers)):
            place_ball(balls, ball, posed[frame], centres[ball])
        for segment in range(len(balls.of_capsule) - 1):
            _write_sphere(balls, segment, posed[frame], spheres[segment])
        for pair in range(len(balls.pairs)):
            a, b = balls.pairs[pair, 0], balls.pairs[pair, 1]
            least = farthest
            apart = 0.0
            for i in range(3):
                apart += (spheres[a, i] - spheres[b, i]) ** 2
            if apart < (spheres[a, 3] + spheres[b, 3] + farthest) ** 2:
                for capsule in range(balls.of_capsule[b], balls.of_capsule[b + 1]):
                    ends, radii = posed[frame, capsule], balls.cap_radii[capsule]
                    for ball in range(balls.of_ball[a], balls.of_ball[a + 1]):
                        square, reach = 0.0, least + balls.radii[ball] + balls.reaches[capsule]
                        for i in range(3):
                            square += (centres[ball, i] - 0.5 * (ends[0, i] + ends[1, i])) ** 2
                        if balls.spare[ball, capsule] < NEVER and reach > 0.0 and square < reach * reach:
                            gap = gap_between(centres[ball], balls.radii[ball], ends, radii)
                            least = min(least, gap - balls.spare[ball, capsule])
            gaps[frame, pair] = least


@inlined(fastmath=True)
def _write_sphere(balls, segment, posed, sphere):  # type: ignore[no-untyped-def]
    """Write the centre and the radius of a sphere round the capsules of a segment."""
    first, last = balls.of_capsule[segment], balls.of_capsule[segment + 1]
    for i in range(4):
        sphere[i] = 0.0
    for capsule in range(first, last):
        for end in range(2):
            for i in range(3):
                sphere[i] += posed[capsule, end, i] / (2 * (last - first))
    for capsule in range(first, last):
        for end in range(2):
            square = 0.0
            for i in range(3):
                square += (posed[capsule, end, i] - sphere[i]) ** 2
            sphere[3] = max(sphere[3], np.sqrt(square) + balls.cap_radii[capsule, end])
