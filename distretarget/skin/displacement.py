"""How far elbows, wrists and knees have to move so that the balls of limbs leave the capsules of other parts.

A ball on the upper arm moves by a share of the elbow's displacement, one on the forearm by shares of the elbow's and
the wrist's, and the hand by the wrist's; legs are alike. Each frame begins with the displacement of the frame before,
so that a limb leaves a body on the side on which it entered; then the displacement shrinks in small steps, after each
of which balls that are inside a capsule are moved out along the shortest way (position based dynamics: Mueller,
Heidelberger, Hennix, Ratcliff, J. Vis. Commun. Image Represent. 18 (2007), doi:10.1016/j.jvcir.2007.01.005). So a
limb whose way leads through a body slides round it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, inlined
from distretarget.numerics.loops import copy_to
from distretarget.numerics.parallel import over_blocks
from distretarget.skin.balls import NEVER, Balls, place_ball
from distretarget.skin.closest import LEAST, place_on_axis

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

SWEEPS = 14  # of each frame
SETTLING = 8  # the last sweeps, in which displacements do not shrink
PARTING = 4  # the last sweeps, in which limbs only come apart
SHRINK = 0.75  # the share of a displacement that a sweep leaves
SETTLED = 5e-4  # sweeps end where limbs move by less than this in sum [body units]
SLACK = 0.01  # gaps are computed anew when limbs have moved by more than this [body units]
REACH = 0.06  # balls and capsules that are farther apart than this do not meet [body units]
NOTHING = 1e-4  # displacements that add up to less are none [body units]
LEAST_SHARE = 0.5  # balls that move by a smaller share of a displacement stay where they are


class Displaced(NamedTuple):
    """What moves with the joints that can be displaced: the middle of each limb, such as an elbow, and its end. A share
    is that of a joint's displacement.
    """

    of_ball: Numbers  # (balls,), the limb that each ball belongs to; -1 for none
    ball_shares: Array  # (balls, 2)
    of_end: Numbers  # (capsules,), the limb that each capsule belongs to; -1 for none
    end_shares: Array  # (capsules, 2, 2), of its ends
    mutual: NDArray[np.bool_]  # (pairs,), whether both segments of a pair give way, or that of the balls alone


def displacements(
    balls: Balls,
    displaced: Displaced,
    posed: Array,
    limbs: Array,
    free: Array,
    acts: NDArray[np.bool_],
    gaps: Array,
    soft: Array,
    wanted: Array,
    firmness: Array,
    start: Array | None = None,
    reach: float = REACH,
) -> Array:
    """Return how far to displace joints in each frame so that the parts of a body come apart, (frames, limbs, 2, 3).

    Args:
        balls: of the body, with its capsules.
        displaced: what moves with the displaced joints.
        posed: (frames, capsules, 2, 3), the ends of the capsules.
        limbs: (frames, limbs, 3, 3), the top, the middle and the end of each limb; its bones keep their lengths.
        free: (frames, limbs, 2), how far middle and end can move, 0 to 1.
        acts: (frames,), whether anything is to be displaced where nothing was in the frame before.
        gaps: (frames, pairs), those of all pairs of segments as they are, or a smaller one than there is.
        soft: (frames, pairs), how far they may overlap, because flesh gives way.
        wanted: (frames, pairs), the gap that segments that touch are brought to.
        firmness: (frames, pairs), how far they are brought there, 0 to 1.
        start: (frames, limbs, 2, 3), what each frame begins with; then nothing shrinks. None for the result of the
            frame before.
        reach: balls and capsules that are farther apart than this do not meet [body units].
    """
    most = int((balls.spare < NEVER).sum())
    result = np.zeros((len(posed), limbs.shape[1], 2, 3))
    given, before = start is not None, np.zeros_like(result) if start is None else start

    def write(frames: slice) -> None:
        found, room = np.zeros((most, 3), np.intp), np.zeros((4, 3))
        seen = np.zeros(most), np.zeros((len(balls.pairs), *result.shape[1:]))
        arrays = limbs, free, acts, gaps, soft, wanted, firmness
        constraints = tuple(np.ascontiguousarray(each[frames]) for each in arrays)
        _write_displacements(
            balls,
            displaced,
            posed[frames],
            constraints,
            before[frames],
            given,
            reach,
            found,
            seen,
            room,
            result[frames],
        )

    if given:
        over_blocks(write, len(posed), len(balls.carriers))
    else:
        write(slice(None))
    return result


@compiled(fastmath=True)
def _write_displacements(balls, displaced, posed, constraints, before, given, reach, found, seen, room, result):  # type: ignore[no-untyped-def]
    """Write the displacements. `seen`, (meetings,), is the gap of each meeting with the displacements `known[pair]`:
    while its limbs have moved less than that from there, the two do not meet.
    """
    limbs, free, acts, apart, soft, wanted, firmness = constraints
    gaps, known = seen
    for frame in range(len(posed)):
        d, at, loose = result[frame], posed[frame], free[frame]
        if given:
            copy_to(d, before[frame])
        elif frame > 0:
            copy_to(d, result[frame - 1])
        if _shrink(d, 1.0) < NOTHING and not acts[frame]:
            continue
        near = min(_way_to_go(apart[frame], d), reach)
        count = _find_meetings(balls, at, apart[frame], firmness[frame], near, reach, found)
        for sweep in range(SWEEPS):
            settles = given or sweep >= SWEEPS - SETTLING
            if not settles:
                _shrink(d, SHRINK)
            moved, first = 0.0, 0
            while first < count:
                pair, last = found[first, 0], first + 1
                while last < count and found[last, 0] == pair:
                    last += 1
                touch = firmness[frame, pair] if sweep < SWEEPS - PARTING else 0.0
                room_left = apart[frame, pair] + soft[frame, pair]
                if touch > 0.0 or room_left <= _largest_of(displaced, found[first], d):
                    way = NEVER if sweep == 0 else _way_from(d, known[pair])
                    if way > SLACK:
                        copy_to(known[pair], d)
                    aim = soft[frame, pair], wanted[frame, pair], touch
                    met, their_gaps = found[first:last], gaps[first:last]
                    moved += _part(balls, displaced, at, d, met, their_gaps, known[pair], way, aim, loose, room)
                elif sweep == 0:
                    _forget(known[pair])
                first = last
            for limb in range(len(d)):
                _keep_lengths(limbs[frame, limb], loose[limb], d[limb])
            if moved < SETTLED and (settles or _shrink(d, 1.0) < NOTHING):
                break


@inlined(fastmath=True)
def _part(balls, displaced, at, d, met, gaps, known, way, aim, free, room):  # type: ignore[no-untyped-def]
    """Bring the balls and capsules of a pair of segments apart, and if they touch to the gap that is wanted; return how
    far they were off. `way` is how far limbs have moved since their `gaps` were computed, at the displacements `known`.
    """
    soft, wanted, touch = aim
    both, anew = displaced.mutual[met[0, 0]], way > SLACK
    moved, least, nearest = 0.0, NEVER, -1
    for meeting in range(len(met)):
        if not anew and gaps[meeting] - 2.0 * way > (least if touch > 0.0 else -soft):
            continue
        gap, t = _gap(balls, displaced, at, d, met[meeting], room)
        if anew:
            gaps[meeting] = gap
        depth = -gap - soft
        if depth > 0.0 and _move(displaced, met[meeting], t, depth, room[0], both, free, d):
            moved += depth
            gap += depth
            if not anew:
                way = _way_from(d, known)
        if gap < least:
            least, nearest = gap, meeting
    if touch > 0.0 and nearest >= 0:
        gap, t = _gap(balls, displaced, at, d, met[nearest], room)
        change = touch * (wanted - gap)
        if _move(displaced, met[nearest], t, change, room[0], both, free, d):
            moved += abs(change)
    return moved


@inlined(fastmath=True)
def _way_from(d: Array, known: Array) -> float:
    """The largest distance of a displacement from what it was."""
    largest = 0.0
    for limb in range(len(d)):
        for joint in range(2):
            square = 0.0
            for i in range(3):
                square += (d[limb, joint, i] - known[limb, joint, i]) ** 2
            largest = max(largest, square)
    return float(np.sqrt(largest))


@inlined(fastmath=True)
def _largest(d: Array) -> float:
    """The largest displacement of a limb, (2, 3)."""
    largest = 0.0
    for joint in range(2):
        largest = max(largest, d[joint, 0] ** 2 + d[joint, 1] ** 2 + d[joint, 2] ** 2)
    return float(np.sqrt(largest))


@inlined(fastmath=True)
def _largest_of(displaced, meeting, d):  # type: ignore[no-untyped-def]
    """How far the two segments of a meeting may have moved towards each other."""
    limb, other = displaced.of_ball[meeting[1]], displaced.of_end[meeting[2]]
    return (_largest(d[limb]) if limb >= 0 else 0.0) + (_largest(d[other]) if other >= 0 else 0.0)


@inlined(fastmath=True)
def _way_to_go(gaps: Array, d: Array) -> float:
    """How far apart balls and capsules may be that meet while the displacements grow as far as segments overlap."""
    deepest, largest = 0.0, 0.0
    for pair in range(len(gaps)):
        deepest = max(deepest, -gaps[pair])
    for limb in range(len(d)):
        largest = max(largest, _largest(d[limb]))
    return 2.0 * (largest + deepest) + SLACK


@inlined(fastmath=True)
def _forget(known: Array) -> None:
    """Write displacements that are far from any to `known`."""
    for limb in range(len(known)):
        for joint in range(2):
            for i in range(3):
                known[limb, joint, i] = NEVER


@inlined(fastmath=True)
def _shrink(d: Array, share: float) -> float:
    """Shrink displacements to a share, those that are hardly any to 0; return the sum of their absolute values."""
    size = 0.0
    for limb in range(len(d)):
        for joint in range(2):
            for i in range(3):
                size += abs(d[limb, joint, i])
    share = 0.0 if size < NOTHING else share
    for limb in range(len(d)):
        for joint in range(2):
            for i in range(3):
                d[limb, joint, i] *= share
    return size


@inlined(fastmath=True)
def _keep_lengths(limb: Array, free: Array, d: Array) -> None:
    """Change the displacements of a limb's middle and end, (2, 3), by the least that gives its bones their lengths."""
    for bone in range(2):
        old, new = 0.0, 0.0
        for i in range(3):
            rest = limb[bone + 1, i] - limb[bone, i]
            moved = rest + d[bone, i] - (d[0, i] if bone == 1 else 0.0)
            old += rest * rest
            new += moved * moved
        upper, lower = free[0] if bone == 1 else 0.0, free[bone]
        if new < LEAST or upper + lower <= 0.0:
            continue
        share = (np.sqrt(old / new) - 1.0) / (upper + lower)
        for i in range(3):
            moved = limb[bone + 1, i] - limb[bone, i] + d[bone, i] - (d[0, i] if bone == 1 else 0.0)
            d[bone, i] += share * lower * moved
            if bone == 1:
                d[0, i] -= share * upper * moved


@inlined(fastmath=True)
def _find_meetings(balls, posed, gaps, firmness, near, reach, found):  # type: ignore[no-untyped-def]
    """Write the pair, the ball and the capsule of all that may meet to `found`; return how many they are."""
    count = 0
    for pair in range(len(balls.pairs)):
        farthest = reach if firmness[pair] > 0.0 else near
        if gaps[pair] >= farthest:
            continue
        limb, part = balls.pairs[pair, 0], balls.pairs[pair, 1]
        for ball in range(balls.of_ball[limb], balls.of_ball[limb + 1]):
            carrier, t = balls.carriers[ball], balls.places[ball]
            x = (1.0 - t) * posed[carrier, 0, 0] + t * posed[carrier, 1, 0]
            y = (1.0 - t) * posed[carrier, 0, 1] + t * posed[carrier, 1, 1]
            z = (1.0 - t) * posed[carrier, 0, 2] + t * posed[carrier, 1, 2]
            for capsule in range(balls.of_capsule[part], balls.of_capsule[part + 1]):
                ends, within = posed[capsule], farthest + balls.radii[ball] + balls.reaches[capsule]
                u = x - 0.5 * (ends[0, 0] + ends[1, 0])
                v = y - 0.5 * (ends[0, 1] + ends[1, 1])
                w = z - 0.5 * (ends[0, 2] + ends[1, 2])
                if (
                    balls.spare[ball, capsule] < NEVER
                    and u * u + v * v + w * w < within * within
                    and count < len(found)
                ):
                    found[count, 0], found[count, 1], found[count, 2] = pair, ball, capsule
                    count += 1
    return count


@inlined(fastmath=True)
def _gap(balls, displaced, posed, d, meeting, room):  # type: ignore[no-untyped-def]
    """The gap between a ball and a capsule with the displacements d, and where on the axis it is; the direction from
    the capsule to the ball is written to `room[0]`.
    """
    ball, capsule = meeting[1], meeting[2]
    n, p, ends, radii = room[0], room[1], room[2:], balls.cap_radii[capsule]
    place_ball(balls, ball, posed, p)
    limb, other = displaced.of_ball[ball], displaced.of_end[capsule]
    for i in range(3):
        for end in range(2):
            ends[end, i] = posed[capsule, end, i]
        for joint in range(2):
            if limb >= 0:
                p[i] += displaced.ball_shares[ball, joint] * d[limb, joint, i]
            if other >= 0:
                for end in range(2):
                    ends[end, i] += displaced.end_shares[capsule, end, joint] * d[other, joint, i]
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
def _move(displaced, meeting, t, way, n, both, free, d):  # type: ignore[no-untyped-def]
    """Displace joints by the least so that a ball and the point t of a capsule move apart by `way` along n; return
    whether they can.
    """
    ball, capsule = meeting[1], meeting[2]
    limb, other = displaced.of_ball[ball], displaced.of_end[capsule] if both else -1
    squares, share = 0.0, displaced.end_shares[capsule]
    for joint in range(2):
        if limb >= 0:
            squares += free[limb, joint] * displaced.ball_shares[ball, joint] ** 2
        if other >= 0:
            squares += free[other, joint] * ((1.0 - t) * share[0, joint] + t * share[1, joint]) ** 2
    if squares < LEAST_SHARE * LEAST_SHARE:
        return False
    step = way / squares
    for joint in range(2):
        for i in range(3):
            if limb >= 0:
                d[limb, joint, i] += free[limb, joint] * displaced.ball_shares[ball, joint] * step * n[i]
            if other >= 0:
                along = (1.0 - t) * share[0, joint] + t * share[1, joint]
                d[other, joint, i] -= free[other, joint] * along * step * n[i]
    return True
