"""How far elbows and wrists have to move so that the balls of the arms leave the capsules of other parts.

A ball on the upper arm moves by a share of the elbow's displacement, one on the forearm by shares of the elbow's and
the wrist's, and the hand by the wrist's. Each frame begins with the displacement of the frame before, so that a limb
leaves a body on the side on which it entered; then the displacement shrinks in small steps, after each of which balls that are
inside a capsule are moved out along the shortest way (position based dynamics: Mueller, Heidelberger, Hennix, Ratcliff,
J. Vis. Commun. Image Represent. 18 (2007), doi:10.1016/j.jvcir.2007.01.005). So a limb whose way leads through a body
slides round it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, inlined
from distretarget.skin.balls import NEVER, Balls, out_of_reach, place_ball
from distretarget.skin.closest import LEAST, place_on_axis

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

SWEEPS = 12  # of each frame
SETTLING = 4  # the last sweeps, in which displacements do not shrink
SHRINK = 0.8  # the share of a displacement that a sweep leaves
REACH = 0.06  # balls and capsules that are farther apart than this do not meet [body units]
MOST_MEETINGS = 2048  # balls and capsules that may meet in one frame
NOTHING = 1e-6  # displacements that add up to less are none [unit of length]
LEAST_SHARE = 0.5  # balls that move by a smaller share of a displacement stay where they are


class Displaced(NamedTuple):
    """The joints that can be displaced, and what moves with them. A share is that of a joint's displacement."""

    of_ball: Numbers  # (balls, 2), the numbers of the displaced joints that move each ball, or -1
    ball_shares: Array  # (balls, 2)
    of_end: Numbers  # (capsules, 2, 2), the same for the ends of the capsules
    end_shares: Array  # (capsules, 2, 2)
    count: int  # the number of joints


def displacements(
    balls: Balls,
    joints: Displaced,
    posed: Array,
    arms: Array,
    near: NDArray[np.bool_],
    soft: Array,
    wanted: Array,
    firmness: Array,
    start: Array,
    *,
    given: bool,
) -> Array:
    """Return the displacements of the joints in each frame, (frames, joints, 3), that bring the parts of a body apart.

    Args:
        balls: of the body, with its capsules.
        joints: what moves with the displaced joints.
        posed: (frames, capsules, 2, 3), the ends of the capsules.
        arms: (frames, arms, 3, 3), the places of shoulders, elbows and wrists, whose distances stay the same.
        near: (frames, pairs), whether two segments can meet.
        soft: (frames, pairs), how far they may overlap, because flesh gives way.
        wanted: (frames, pairs), the gap that segments that touch are brought to.
        firmness: (frames, pairs), how far they are brought there, 0 to 1.
        start: (joints, 3), the displacement before the first frame. If displacements are `given`, (frames, joints, 3),
            what each frame begins with; then nothing shrinks.
    """
    result = np.zeros((len(posed), joints.count, 3))
    before = start if given else np.broadcast_to(start, result.shape)
    found, room = np.zeros((MOST_MEETINGS, 3), np.intp), np.zeros((4, 3))
    before = np.ascontiguousarray(before)
    _write_displacements(balls, joints, posed, arms, near, soft, wanted, firmness, before, given, found, room, result)
    return result


@compiled(fastmath=True)
def _write_displacements(balls, joints, posed, arms, near, soft, wanted, firmness, before, given, found, room, result):  # type: ignore[no-untyped-def]
    for frame in range(len(posed)):
        d = result[frame]
        for j in range(joints.count):
            for i in range(3):
                d[j, i] = before[frame, j, i] if given or frame == 0 else result[frame - 1, j, i]
        count = _find_meetings(balls, joints, posed[frame], near[frame], found, room)
        for sweep in range(SWEEPS):
            settles = given or sweep >= SWEEPS - SETTLING
            size = _shrink(d, 1.0 if settles else SHRINK)
            moved, first = 0.0, 0
            while first < count:
                pair, last = found[first, 0], first + 1
                while last < count and found[last, 0] == pair:
                    last += 1
                least, nearest = NEVER, first
                for meeting in range(first, last):
                    gap, t = _gap(balls, joints, posed[frame], d, found[meeting, 1], found[meeting, 2], room)
                    depth = -gap - soft[frame, pair]
                    if depth > 0.0:
                        _move(joints, found[meeting, 1], found[meeting, 2], t, depth, room[0], d)
                        moved += depth
                        gap += depth
                    if gap < least:
                        least, nearest = gap, meeting
                if firmness[frame, pair] > 0.0:
                    gap, t = _gap(balls, joints, posed[frame], d, found[nearest, 1], found[nearest, 2], room)
                    way = firmness[frame, pair] * (wanted[frame, pair] - gap)
                    _move(joints, found[nearest, 1], found[nearest, 2], t, way, room[0], d)
                    moved += abs(way)
                first = last
            for arm in range(len(arms[frame])):
                _keep_lengths(arms[frame, arm], d[2 * arm : 2 * arm + 2])
            if moved < NOTHING and (settles or size < NOTHING):
                break


@inlined(fastmath=True)
def _shrink(d: Array, share: float) -> float:
    """Shrink displacements to a share, those that are hardly any to 0; return the sum of their absolute values."""
    size = 0.0
    for j in range(len(d)):
        for i in range(3):
            size += abs(d[j, i])
    share = 0.0 if size < NOTHING else share
    for j in range(len(d)):
        for i in range(3):
            d[j, i] *= share
    return size


@inlined(fastmath=True)
def _keep_lengths(arm: Array, d: Array) -> None:
    """Change the displacements of elbow and wrist, (2, 3), by the least that gives the bones of an arm their lengths."""
    for bone in range(2):
        old, new = 0.0, 0.0
        for i in range(3):
            rest = arm[bone + 1, i] - arm[bone, i]
            moved = rest + d[bone, i] - (d[bone - 1, i] if bone > 0 else 0.0)
            old += rest * rest
            new += moved * moved
        if new < LEAST:
            continue
        share = (np.sqrt(old / new) - 1.0) * (1.0 if bone == 0 else 0.5)
        for i in range(3):
            moved = arm[bone + 1, i] - arm[bone, i] + d[bone, i] - (d[bone - 1, i] if bone > 0 else 0.0)
            d[bone, i] += share * moved
            if bone > 0:
                d[bone - 1, i] -= share * moved


@inlined(fastmath=True)
def _find_meetings(balls, joints, posed, near, found, room):  # type: ignore[no-untyped-def]
    """Write the pair, the ball and the capsule of all that may meet to `found`; return how many they are."""
    count, p = 0, room[1]
    for pair in range(len(balls.pairs)):
        limb, part = balls.pairs[pair, 0], balls.pairs[pair, 1]
        if not near[pair] or joints.of_ball[balls.of_ball[limb], 0] < 0:
            continue
        for ball in range(balls.of_ball[limb], balls.of_ball[limb + 1]):
            place_ball(balls, ball, posed, p)
            for capsule in range(balls.of_capsule[part], balls.of_capsule[part + 1]):
                if balls.spare[ball, capsule] < NEVER and not out_of_reach(
                    p, balls.radii[ball], posed[capsule], balls.cap_radii[capsule], REACH
                ):
                    if count < len(found):
                        found[count, 0], found[count, 1], found[count, 2] = pair, ball, capsule
                        count += 1
    return count


@inlined(fastmath=True)
def _gap(balls, joints, posed, d, ball, capsule, room):  # type: ignore[no-untyped-def]
    """The gap between a ball and a capsule with the displacements d, and where on the axis it is; the direction from
    the capsule to the ball is written to `room[0]`.
    """
    n, p, ends, radii = room[0], room[1], room[2:], balls.cap_radii[capsule]
    place_ball(balls, ball, posed, p)
    for i in range(3):
        for end in range(2):
            ends[end, i] = posed[capsule, end, i]
        for s in range(2):
            if joints.of_ball[ball, s] >= 0:
                p[i] += joints.ball_shares[ball, s] * d[joints.of_ball[ball, s], i]
            for end in range(2):
                if joints.of_end[capsule, end, s] >= 0:
                    ends[end, i] += joints.end_shares[capsule, end, s] * d[joints.of_end[capsule, end, s], i]
    t = place_on_axis(p, ends, radii)
    square = 0.0
    for i in range(3):
        n[i] = p[i] - (1.0 - t) * ends[0, i] - t * ends[1, i]
        square += n[i] * n[i]
    distance = np.sqrt(square)
    for i in range(3):
        n[i] /= max(distance, LEAST)
    gap = distance - (1.0 - t) * radii[0] - t * radii[1] - balls.radii[ball] - balls.spare[ball, capsule]
    return gap, t


@inlined(fastmath=True)
def _move(joints, ball, capsule, t, way, n, d):  # type: ignore[no-untyped-def]
    """Displace joints by the least so that a ball and the point t of a capsule move apart by `way` along n."""
    squares = 0.0
    for s in range(2):
        squares += joints.ball_shares[ball, s] ** 2
        for end in range(2):
            weight = t if end == 1 else 1.0 - t
            squares += (weight * joints.end_shares[capsule, end, s]) ** 2
    if squares < LEAST_SHARE * LEAST_SHARE:
        return
    step = way / squares
    for s in range(2):
        for i in range(3):
            if joints.of_ball[ball, s] >= 0:
                d[joints.of_ball[ball, s], i] += joints.ball_shares[ball, s] * step * n[i]
            for end in range(2):
                if joints.of_end[capsule, end, s] >= 0:
                    weight = t if end == 1 else 1.0 - t
                    d[joints.of_end[capsule, end, s], i] -= weight * joints.end_shares[capsule, end, s] * step * n[i]
