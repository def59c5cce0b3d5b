"""Balls along the limbs of a body, the pairs of body segments whose surfaces can touch, and their gaps.

A limb is a row of balls: a ball and a capsule are nearest in one point, while two capsules side by side are about
equally near along a line, and their nearest point would jump from end to end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.parallel import over_blocks
from distretarget.numerics.vectors import F1, F2, F3, F4, I1, I2, Array, Numbers
from distretarget.skin.capsules import LIMB_SEGMENTS, SEGMENTS, TRUNK_SEGMENTS, Capsules, gap_at, may_touch, write_axis

SPACING = 1.2  # between the balls of a limb [radii]
MOST_BALLS = 7  # of a capsule
NEVER = 1e9  # the gap offset of a ball and a capsule whose gap is ignored
OVERLAP = 0.5  # the gap of a ball that is deeper than this in a capsule in the reference pose is ignored [radii]

NO_SEGMENTS = np.zeros(0, np.intp)
ARM_PARTS, LEG_PARTS = LIMB_SEGMENTS[:3], LIMB_SEGMENTS[3:]


def _touching_segments() -> list[tuple[int, int]]:
    """The segments that can touch, indices of `SEGMENTS` of balls and of capsules: arms and trunk, arms and legs, the
    two arms, hand and shoulder of one arm, and the two legs. Each of the two arms is balls once, and so are legs, so
    that a body and its mirror image are treated alike; but with hands and forearms, upper arms are capsules only.
    """
    number = SEGMENTS.index
    pairs = []
    for side, opposite in (("left", "right"), ("right", "left")):
        for part in ARM_PARTS:
            limb = number(f"{side} {part}")
            pairs += [(limb, number(trunk)) for trunk in TRUNK_SEGMENTS]
            pairs += [(limb, number(f"{leg} {below}")) for leg in ("left", "right") for below in LEG_PARTS]
            others = ARM_PARTS if part != "upper arm" else ("upper arm",)
            pairs += [(limb, number(f"{opposite} {other}")) for other in others]
        pairs.append((number(f"{side} hand"), number(f"{side} upper arm")))
        pairs += [(number(f"{side} {a}"), number(f"{opposite} {b}")) for a in LEG_PARTS for b in LEG_PARTS]
    return pairs


class Balls(NamedTuple):
    """The balls of the limbs and the capsules of all parts of a body, each ordered by segment."""

    carriers: I1  # (balls,), the capsule whose axis each ball is on
    fractions: F1  # (balls,), its position along that axis, 0 to 1
    radii: F1  # (balls,)
    joints: I1  # (capsules,), the joint that carries each capsule
    cap_radii: F2  # (capsules, 2)
    of_ball: I1  # (segments + 1,), the first ball of each segment
    of_capsule: I1  # (segments + 1,), the first capsule of each segment
    pairs: I2  # (pairs, 2), the segments that can touch: that of the balls, that of the capsules
    # (balls, capsules), subtracted from gaps: the gap in the reference pose if that is negative, else 0, less the
    # overlap that soft tissue allows; `NEVER` for gaps that are ignored
    gap_offsets: F2


def mean_radii(balls: Balls) -> Array:
    """Return the mean radius of the capsules of each segment, (segments,); 0 for segments without capsules."""
    first = balls.of_capsule
    of_segment = np.repeat(np.arange(len(first) - 1), np.diff(first))
    sums = np.bincount(of_segment, balls.cap_radii[: first[-1]].mean(axis=1), len(first) - 1)
    return np.asarray(sums / np.maximum(np.diff(first), 1))


def balls_of(capsules: Capsules, posed: Array) -> Balls:
    """Return the balls of a body with ordered capsules that end at `posed`, (capsules, 2, 3), in the reference pose."""
    carriers, fractions = _rows(capsules)
    radii = (1.0 - fractions) * capsules.radii[carriers, 0] + fractions * capsules.radii[carriers, 1]
    segments = np.arange(len(SEGMENTS) + 1)
    of_ball = np.searchsorted(capsules.segments[carriers], segments)
    of_capsule = np.searchsorted(capsules.segments, segments)
    pairs = np.array(_touching_segments(), np.intp)
    pairs = pairs[(np.diff(of_ball)[pairs[:, 0]] > 0) & (np.diff(of_capsule)[pairs[:, 1]] > 0)]
    none, gap_offsets = np.zeros((0, 0)), np.full((len(carriers), len(capsules)), NEVER)
    balls = Balls(carriers, fractions, radii, capsules.joints, capsules.radii, of_ball, of_capsule, pairs, none)
    _write_gap_offsets(balls, posed, np.zeros(3), np.zeros(8), gap_offsets)
    return balls._replace(gap_offsets=gap_offsets)


def _rows(capsules: Capsules) -> tuple[Numbers, Array]:
    """The capsule of each ball, and its fraction along the capsule's axis."""
    limbs = [each for each, segment in enumerate(capsules.segments.tolist()) if " " in SEGMENTS[segment]]
    carriers: list[int] = []
    fractions: list[float] = []
    for capsule in limbs:
        length = float(np.linalg.norm(capsules.ends[capsule, 1] - capsules.ends[capsule, 0]))
        count = int(np.clip(np.ceil(length / (SPACING * capsules.radii[capsule].mean())) + 1, 2, MOST_BALLS))
        count = 1 if length < 0.1 * capsules.radii[capsule].mean() else count
        carriers += [capsule] * count
        fractions += np.linspace(0.0, 1.0, count).tolist() if count > 1 else [0.5]
    return np.array(carriers, np.intp), np.array(fractions)


@compiled()
def _write_gap_offsets(balls: Balls, posed: F3, p: Out[F1], axis: Out[F1], gap_offsets: Out[F2]) -> None:
    """Write `Balls.gap_offsets` of gaps that are not ignored: the gap in the reference pose, if negative, else 0."""
    for pair in range(len(balls.pairs)):
        a, b = balls.pairs[pair, 0], balls.pairs[pair, 1]
        for capsule in range(balls.of_capsule[b], balls.of_capsule[b + 1]):
            write_axis(posed[capsule], balls.cap_radii[capsule], axis)
            for ball in range(balls.of_ball[a], balls.of_ball[a + 1]):
                _write_centre(balls, posed, ball, p)
                gap = gap_at(p, balls.radii[ball], axis, balls.cap_radii[capsule])[0]
                if gap > -OVERLAP * balls.radii[ball]:
                    gap_offsets[ball, capsule] = min(gap, 0.0)


# ---- balls and capsules posed in a frame, pairs of them that may be near, and their gaps


class Placed(NamedTuple):
    """Balls and capsules posed in a frame, and pairs of them that may be near."""

    centres: F2  # (balls, 4), centre and radius
    axes: F2  # (capsules, 8), see `capsules.write_axis`
    spheres: F2  # (capsules, 4), centre and radius of a sphere round each
    of_segments: F2  # (segments, 4), centre and radius of a sphere round the capsules of each segment
    candidates: I2  # (candidates, 2), ball and capsule of pairs that may be near


def room_for(balls: Balls) -> Placed:
    """Return scratch for the balls and capsules of a frame."""
    capsules, (first, second) = len(balls.joints), balls.pairs.T
    most = np.diff(balls.of_ball)[first] * np.diff(balls.of_capsule)[second]
    return Placed(
        centres=np.zeros((len(balls.carriers), 4)),
        axes=np.zeros((capsules, 8)),
        spheres=np.zeros((capsules, 4)),
        of_segments=np.zeros((len(balls.of_capsule) - 1, 4)),
        candidates=np.zeros((most.max(initial=0), 2), np.intp),
    )


@inlined(fastmath=True)
def place(balls: Balls, ends: Array, placed: Placed) -> None:
    """Pose the balls and capsules for axes that end at `ends`, (capsules, 2, 3)."""
    for capsule in range(len(balls.joints)):
        axis, sphere, radii = placed.axes[capsule], placed.spheres[capsule], balls.cap_radii[capsule]
        write_axis(ends[capsule], radii, axis)
        for i in range(3):
            sphere[i] = axis[i] + 0.5 * axis[3 + i]
        sphere[3] = 0.5 * np.sqrt(axis[3] ** 2 + axis[4] ** 2 + axis[5] ** 2) + max(radii[0], radii[1])
    for ball in range(len(balls.carriers)):
        axis, t = placed.axes[balls.carriers[ball]], balls.fractions[ball]
        for i in range(3):
            placed.centres[ball, i] = axis[i] + t * axis[3 + i]
        placed.centres[ball, 3] = balls.radii[ball]
    for segment in range(len(placed.of_segments)):
        _write_sphere(
            placed.spheres[balls.of_capsule[segment] : balls.of_capsule[segment + 1]], placed.of_segments[segment]
        )


@inlined(fastmath=True)
def _write_sphere(spheres: Array, around: Array) -> None:
    """Write a sphere, (4,), around others, (spheres, 4)."""
    for i in range(4):
        around[i] = 0.0
    for each in spheres:
        for i in range(3):
            around[i] += each[i] / len(spheres)
    for each in spheres:
        apart = np.sqrt((each[0] - around[0]) ** 2 + (each[1] - around[1]) ** 2 + (each[2] - around[2]) ** 2)
        around[3] = max(around[3], apart + each[3])


@inlined(fastmath=True)
def is_near(one: Array, other: Array, far: float) -> bool:
    """Whether the gap between two spheres, (4,), is less than `far`."""
    square = (one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2 + (one[2] - other[2]) ** 2
    return bool(square < max(one[3] + other[3] + far, 0.0) ** 2)


@inlined(fastmath=True)
def find_candidates(balls, pair, far, placed):  # type: ignore[no-untyped-def]
    """Write the candidates of a segment pair, whose gap may be less than `far`; return their number."""
    count, limb, part = 0, balls.pairs[pair, 0], balls.pairs[pair, 1]
    if not is_near(placed.of_segments[limb], placed.of_segments[part], far):
        return 0
    for capsule in range(balls.of_capsule[part], balls.of_capsule[part + 1]):
        carrier, near = -1, False
        for ball in range(balls.of_ball[limb], balls.of_ball[limb + 1]):
            if carrier != balls.carriers[ball]:
                carrier = balls.carriers[ball]
                sphere, near = placed.spheres[carrier], False
                if is_near(sphere, placed.spheres[capsule], far):
                    near = may_touch(sphere, placed.axes[capsule], balls.cap_radii[capsule], far)
            if not near or balls.gap_offsets[ball, capsule] == NEVER:
                continue
            if may_touch(placed.centres[ball], placed.axes[capsule], balls.cap_radii[capsule], far):
                placed.candidates[count, 0], placed.candidates[count, 1] = ball, capsule
                count += 1
    return count


@inlined(fastmath=True)
def gap_of(balls, ball, capsule, placed):  # type: ignore[no-untyped-def]
    """`capsules.gap_at` of a ball and a capsule, with the gap less its offset, see `Balls.gap_offsets`."""
    radii = balls.cap_radii[capsule]
    gap, t, x, y, z = gap_at(placed.centres[ball], balls.radii[ball], placed.axes[capsule], radii)
    return gap - balls.gap_offsets[ball, capsule], t, x, y, z


def segment_gaps(balls: Balls, posed: Array, farthest: float) -> Array:
    """Return the least gap of each segment pair in each frame, (frames, pairs), at most `farthest`, for capsules whose
    ends are at `posed`, (frames, capsules, 2, 3); in the unit of `posed` and of the radii. Overlaps count only beyond
    those of the reference pose.
    """
    gaps = np.empty((len(posed), len(balls.pairs)))

    def write(block: slice) -> None:
        _write_gaps(balls, posed[block], farthest, room_for(balls), gaps[block])

    over_blocks(write, len(posed), len(balls.carriers))
    return gaps


@compiled(fastmath=True)
def _write_gaps(balls: Balls, posed: F4, farthest: float, placed: Placed, gaps: Out[F2]) -> None:
    for frame in range(len(posed)):
        place(balls, posed[frame], placed)
        for pair in range(len(balls.pairs)):
            least = farthest
            for n in range(find_candidates(balls, pair, farthest, placed)):
                ball, capsule = placed.candidates[n, 0], placed.candidates[n, 1]
                if may_touch(placed.centres[ball], placed.axes[capsule], balls.cap_radii[capsule], least):
                    least = min(least, gap_of(balls, ball, capsule, placed)[0])
            gaps[frame, pair] = least


def nearest_skin(balls: Balls, posed: Array, pairs: Numbers, of_first: Numbers = NO_SEGMENTS) -> tuple[Array, Array]:
    """Return the least gap of all segment pairs of the indices `pairs` in each frame, (frames,), and its direction,
    (frames, 3), towards the segment of the pair that is one of `of_first`. Capsules end at `posed`, (frames, capsules,
    2, 3); gaps are as in `segment_gaps`.
    """
    gaps, away = np.full(len(posed), NEVER), np.zeros((len(posed), 3))
    signs = np.where(np.isin(balls.pairs[pairs, 0], of_first), 1.0, -1.0)
    _write_nearest(balls, posed, pairs, signs, room_for(balls), gaps, away)
    return gaps, away


@compiled()
def _write_nearest(balls: Balls, posed: F4, pairs: I1, signs: F1, placed: Placed, gaps: Out[F1], away: Out[F2]) -> None:
    for frame in range(len(posed)):
        place(balls, posed[frame], placed)
        for pair, sign in zip(pairs, signs):  # noqa: B905 - compiled
            for n in range(find_candidates(balls, pair, gaps[frame], placed)):
                gap, _, x, y, z = gap_of(balls, placed.candidates[n, 0], placed.candidates[n, 1], placed)
                if gap < gaps[frame]:
                    gaps[frame], away[frame, 0], away[frame, 1], away[frame, 2] = gap, sign * x, sign * y, sign * z


@compiled(fastmath=True)
def write_exit_distances(
    centres: F3, radii: F1, others: F3, other_radii: F1, along: F2, give: float, ahead: float, exits: Out[F1]
) -> None:
    """Write the distance by which balls leave others along unit vectors n, (frames, 3): the largest x = sqrt(R^2 - d^2
    + (d n)^2) - d n of any two, with d the vector between their centres, and R the sum of their radii less `give`.
    Pairs with a cosine of d and n below `ahead` do not count.
    """
    for frame in range(len(exits)):
        n = along[frame]
        for a in range(len(radii)):
            p = centres[frame, a]
            for b in range(len(other_radii)):
                q, reach = others[frame, b], radii[a] + other_radii[b] - give
                x, y, z = p[0] - q[0], p[1] - q[1], p[2] - q[2]
                square, by = x * x + y * y + z * z, x * n[0] + y * n[1] + z * n[2]
                if reach > 0.0 and square < reach * reach and by >= ahead * np.sqrt(square):
                    exits[frame] = max(exits[frame], np.sqrt(reach * reach - square + by * by) - by)


def ball_gaps(balls: Balls, posed: Array, segment: int, capsules: Numbers) -> Array:
    """Return the least gap of each ball of a segment to some capsules in each frame, (frames, balls). Capsules end at
    `posed`, (frames, capsules, 2, 3). Gap offsets are not subtracted.
    """
    gaps = np.full((len(posed), np.diff(balls.of_ball)[segment]), NEVER)
    _write_ball_gaps(balls, posed, int(balls.of_ball[segment]), capsules, np.zeros(3), np.zeros(8), gaps)
    return gaps


@compiled(fastmath=True)
def _write_ball_gaps(
    balls: Balls, posed: F4, first: int, capsules: I1, p: Out[F1], axis: Out[F1], gaps: Out[F2]
) -> None:
    for frame in range(len(posed)):
        for capsule in capsules:
            radii = balls.cap_radii[capsule]
            write_axis(posed[frame, capsule], radii, axis)
            for n in range(gaps.shape[1]):
                _write_centre(balls, posed[frame], first + n, p)
                gaps[frame, n] = min(gaps[frame, n], gap_at(p, balls.radii[first + n], axis, radii)[0])


@inlined()
def _write_centre(balls: Balls, ends: Array, ball: int, p: Array) -> None:
    """Write the centre of a ball, (3,), for capsules that end at `ends`, (capsules, 2, 3)."""
    carrier, t = balls.carriers[ball], balls.fractions[ball]
    for i in range(3):
        p[i] = (1.0 - t) * ends[carrier, 0, i] + t * ends[carrier, 1, i]
