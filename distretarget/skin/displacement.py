"""How far elbows, wrists and knees have to move so that the balls of limbs leave the capsules of other parts.

A ball on the upper arm moves by a share of the elbow's displacement, one on the forearm by shares of the elbow's and
the wrist's, and the hand by the wrist's; legs are alike. Each frame begins with the displacement of the frame before,
so that a limb leaves a body on the side on which it entered; then the displacement shrinks in small steps, after each
of which balls that are inside a capsule are moved out along the shortest way (position based dynamics: Mueller,
Heidelberger, Hennix, Ratcliff, J. Vis. Commun. Image Represent. 18 (2007), doi:10.1016/j.jvcir.2007.01.005). So a
limb whose way leads through a body slides round it.

A gap is computed only where it can matter: it is at least what it was less the way that both limbs have gone since.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, inlined
from distretarget.numerics.loops import copy_to
from distretarget.numerics.parallel import over_blocks
from distretarget.skin.balls import NEVER, Balls, place_ball
from distretarget.skin.closest import LEAST, MOST_TAPER

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

SWEEPS = 14  # of each frame
SETTLING = 8  # the last sweeps, in which displacements do not shrink
PARTING = 4  # the last sweeps, in which limbs only come apart
SHRINK = 0.75  # the share of a displacement that a sweep leaves
SETTLED = 5e-4  # sweeps end where limbs move by less than this in sum [body units]
SLACK = 0.01  # what is this much farther apart than limbs have to go may still meet [body units]
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
    count, given = limbs.shape[1], start is not None
    rigid = displaced._replace(of_ball=displaced.of_ball % (count + 1), of_end=displaced.of_end % (count + 1))
    result = np.zeros((len(posed), count + 1, 2, 3))  # the last limb is that of what no limb carries
    free = np.concatenate([free, np.zeros((len(posed), 1, 2))], axis=1)
    if start is not None:
        result[:, :count] = start
    constraints = [np.ascontiguousarray(each) for each in (limbs, free, acts, gaps, soft, wanted, firmness)]

    def write(frames: slice) -> None:
        some = tuple(each[frames] for each in constraints)
        room = _room_for(balls, rigid, count + 1)
        _write_displacements(balls, rigid, posed[frames], some, given, reach, room, result[frames])

    if given:
        over_blocks(write, len(posed), len(balls.carriers))
    else:
        write(slice(None))
    return result[:, :count]


class _Room(NamedTuple):
    """What is known of a frame while limbs move."""

    centres: Array  # (balls, 3), of the balls without displacements
    axes: Array  # (capsules, 8), of the capsules without them: one end, the way to the other, see `_place`
    way: Array  # (limbs,), how far each limb has gone since
    limbs: Numbers  # (pairs, 2), those of the two segments of each pair
    least: Array  # (pairs,), the gap of each pair, or less, plus the ways of its limbs then
    spans: Numbers  # (pairs, 2), the first of its meetings and the one after the last; -1 before they are looked for
    meetings: Numbers  # (meetings, 2), a ball and a capsule that may meet
    bounds: Array  # (meetings,), their gap, or less, plus the ways of the limbs then


def _room_for(balls: Balls, displaced: Displaced, limbs: int) -> _Room:
    """Room for a frame of a body with so many limbs."""
    first, second = balls.pairs.T
    by_ball = [displaced.of_ball[a:b].min(initial=limbs - 1) for a, b in pairwise(balls.of_ball)]
    by_end = [displaced.of_end[a:b].min(initial=limbs - 1) for a, b in pairwise(balls.of_capsule)]
    pairs, most = len(balls.pairs), int((balls.spare < NEVER).sum())
    return _Room(
        centres=np.zeros((len(balls.carriers), 3)),
        axes=np.zeros((len(balls.joints), 8)),
        way=np.zeros(limbs),
        limbs=np.stack([np.array(by_ball, np.intp)[first], np.array(by_end, np.intp)[second]], axis=1),
        least=np.zeros(pairs),
        spans=np.zeros((pairs, 2), np.intp),
        meetings=np.zeros((most, 2), np.intp),
        bounds=np.zeros(most),
    )


@compiled(fastmath=True)
def _write_displacements(balls, displaced, posed, constraints, given, reach, room, result):  # type: ignore[no-untyped-def]
    limbs, free, acts, apart, soft, wanted, firmness = constraints
    for frame in range(len(posed)):
        d, loose = result[frame], free[frame]
        if not given and frame > 0:
            copy_to(d, result[frame - 1])
        if _size_of(d) < NOTHING:
            _shrink(d, 0.0, room.way)
            if not acts[frame]:
                continue
        _place(balls, posed[frame], room)
        near = _begin(d, apart[frame], wanted[frame], firmness[frame], room)
        count = 0
        for sweep in range(SWEEPS):
            settles = given or sweep >= SWEEPS - SETTLING
            if not settles:
                _shrink(d, SHRINK, room.way)
            moved = 0.0
            for pair in range(len(balls.pairs)):
                touch = firmness[frame, pair] if sweep < SWEEPS - PARTING else 0.0
                way = room.way[room.limbs[pair, 0]] + room.way[room.limbs[pair, 1]]
                if touch <= 0.0 and room.least[pair] - way > -soft[frame, pair]:
                    continue
                if room.spans[pair, 0] < 0:
                    far = near + max(apart[frame, pair], 0.0) if firmness[frame, pair] > 0.0 else near
                    count = _find_meetings(balls, displaced, pair, d, min(far, reach), count, room)
                aim = soft[frame, pair], wanted[frame, pair], touch
                moved += _part(balls, displaced, pair, d, loose, aim, room)
            for limb in range(len(limbs[frame])):
                _keep_lengths(limbs[frame, limb], loose[limb], d[limb], room.way, limb)
            if moved < SETTLED and (settles or _size_of(d) < NOTHING):
                break


@inlined(fastmath=True)
def _place(balls, posed, room):  # type: ignore[no-untyped-def]
    """Write where balls and capsules are in a frame. Of an axis of length L: one end, the way to the other, 1 / L^2,
    and c / sqrt(1 - c^2) / L with the taper c, see `closest.place_on_axis`.
    """
    for ball in range(len(balls.carriers)):
        place_ball(balls, ball, posed, room.centres[ball])
    for capsule in range(len(balls.joints)):
        axis, square = room.axes[capsule], 0.0
        for i in range(3):
            axis[i] = posed[capsule, 0, i]
            axis[3 + i] = posed[capsule, 1, i] - posed[capsule, 0, i]
            square += axis[3 + i] ** 2
        axis[6] = 1.0 / square if square > LEAST * LEAST else 0.0
        taper = (balls.cap_radii[capsule, 1] - balls.cap_radii[capsule, 0]) * np.sqrt(axis[6])
        taper = max(min(taper, MOST_TAPER), -MOST_TAPER)
        axis[7] = taper * np.sqrt(axis[6] / (1.0 - taper * taper))
        if axis[6] == 0.0 and balls.cap_radii[capsule, 1] > balls.cap_radii[capsule, 0]:
            axis[7] = NEVER  # the larger ball holds the smaller


@inlined(fastmath=True)
def _begin(d, gaps, wanted, firmness, room):  # type: ignore[no-untyped-def]
    """Forget the meetings of the frame before; return how far apart balls and capsules may be that meet while
    displacements grow as far as segments have to go.
    """
    largest, farthest = 0.0, 0.0
    for limb in range(len(d)):
        room.way[limb] = _largest(d[limb])
        largest = max(largest, room.way[limb])
    for pair in range(len(gaps)):
        room.least[pair], room.spans[pair, 0] = gaps[pair], -1
        farthest = max(farthest, -gaps[pair])
        if firmness[pair] > 0.0:
            farthest = max(farthest, abs(wanted[pair] - gaps[pair]))
    return 2.0 * (largest + farthest) + SLACK


@inlined(fastmath=True)
def _find_meetings(balls, displaced, pair, d, far, count, room):  # type: ignore[no-untyped-def]
    """Write the balls and capsules of a pair of segments that may meet after `count` others; return how many there are
    then.
    """
    limb, part = balls.pairs[pair, 0], balls.pairs[pair, 1]
    gone = room.way[room.limbs[pair, 0]] + room.way[room.limbs[pair, 1]]
    room.spans[pair, 0] = count
    for ball in range(balls.of_ball[limb], balls.of_ball[limb + 1]):
        p, s, a = room.centres[ball], displaced.ball_shares[ball], d[displaced.of_ball[ball]]
        x = p[0] + s[0] * a[0, 0] + s[1] * a[1, 0]
        y = p[1] + s[0] * a[0, 1] + s[1] * a[1, 1]
        z = p[2] + s[0] * a[0, 2] + s[1] * a[1, 2]
        for capsule in range(balls.of_capsule[part], balls.of_capsule[part + 1]):
            axis, thick = room.axes[capsule], balls.radii[ball] + balls.reaches[capsule] + balls.spare[ball, capsule]
            e, f = displaced.end_shares[capsule, 0], displaced.end_shares[capsule, 1]
            b = d[displaced.of_end[capsule]]
            g, h = 0.5 * (e[0] + f[0]), 0.5 * (e[1] + f[1])
            u = x - axis[0] - 0.5 * axis[3] - g * b[0, 0] - h * b[1, 0]
            v = y - axis[1] - 0.5 * axis[4] - g * b[0, 1] - h * b[1, 1]
            w = z - axis[2] - 0.5 * axis[5] - g * b[0, 2] - h * b[1, 2]
            square = u * u + v * v + w * w
            if square < (thick + far) ** 2 and thick < NEVER and count < len(room.meetings):
                room.meetings[count, 0], room.meetings[count, 1] = ball, capsule
                room.bounds[count] = np.sqrt(square) - thick + gone
                count += 1
    room.spans[pair, 1] = count
    return count


@inlined(fastmath=True)
def _part(balls, displaced, pair, d, free, aim, room):  # type: ignore[no-untyped-def]
    """Bring the balls and capsules of a pair of segments apart, and if they touch to the gap that is wanted; return how
    far they were off.
    """
    soft, wanted, touch = aim
    way, first, second = room.way, room.limbs[pair, 0], room.limbs[pair, 1]
    both, begin, end = displaced.mutual[pair], room.spans[pair, 0], room.spans[pair, 1]
    moved, nearest, lowest, least = 0.0, -1, NEVER, NEVER
    for meeting in range(begin, end):
        gone = way[first] + way[second]
        if room.bounds[meeting] - gone <= (lowest if touch > 0.0 else -soft):
            ball, capsule = room.meetings[meeting, 0], room.meetings[meeting, 1]
            gap, t, x, y, z = _gap(balls, displaced, ball, capsule, d, room)
            depth = -gap - soft
            if depth > 0.0 and _move(displaced, ball, capsule, t, depth, x, y, z, both, free, d, way):
                moved += depth
                gap += depth
            room.bounds[meeting] = gap + way[first] + way[second]
            if gap < lowest:
                lowest, nearest = gap, meeting
        least = min(least, room.bounds[meeting])
    room.least[pair] = least
    if touch > 0.0 and nearest >= 0:
        ball, capsule = room.meetings[nearest, 0], room.meetings[nearest, 1]
        gap, t, x, y, z = _gap(balls, displaced, ball, capsule, d, room)
        if _move(displaced, ball, capsule, t, touch * (wanted - gap), x, y, z, both, free, d, way):
            moved += touch * abs(wanted - gap)
        _swap(room.meetings, room.bounds, begin, nearest)
    return moved


@inlined(fastmath=True)
def _swap(meetings, bounds, a, b):  # type: ignore[no-untyped-def]
    """Change the places of two meetings, so that the nearest is the first."""
    ball, capsule, bound = meetings[a, 0], meetings[a, 1], bounds[a]
    meetings[a, 0], meetings[a, 1], bounds[a] = meetings[b, 0], meetings[b, 1], bounds[b]
    meetings[b, 0], meetings[b, 1], bounds[b] = ball, capsule, bound


@inlined(fastmath=True)
def _gap(balls, displaced, ball, capsule, d, room):  # type: ignore[no-untyped-def]
    """The gap between a ball and a capsule with the displacements d, where on the axis it is, and the direction from
    the capsule to the ball.
    """
    p, axis, radii = room.centres[ball], room.axes[capsule], balls.cap_radii[capsule]
    s, e, f = displaced.ball_shares[ball], displaced.end_shares[capsule, 0], displaced.end_shares[capsule, 1]
    a, b = d[displaced.of_ball[ball]], d[displaced.of_end[capsule]]
    g, h = f[0] - e[0], f[1] - e[1]
    ux = axis[3] + g * b[0, 0] + h * b[1, 0]
    uy = axis[4] + g * b[0, 1] + h * b[1, 1]
    uz = axis[5] + g * b[0, 2] + h * b[1, 2]
    wx = p[0] + s[0] * a[0, 0] + s[1] * a[1, 0] - axis[0] - e[0] * b[0, 0] - e[1] * b[1, 0]
    wy = p[1] + s[0] * a[0, 1] + s[1] * a[1, 1] - axis[1] - e[0] * b[0, 1] - e[1] * b[1, 1]
    wz = p[2] + s[0] * a[0, 2] + s[1] * a[1, 2] - axis[2] - e[0] * b[0, 2] - e[1] * b[1, 2]
    along = (wx * ux + wy * uy + wz * uz) * axis[6]
    across = max(wx * wx + wy * wy + wz * wz - along * along / max(axis[6], LEAST), 0.0)
    t = max(min(along + axis[7] * np.sqrt(across), 1.0), 0.0)
    x, y, z = wx - t * ux, wy - t * uy, wz - t * uz
    distance = np.sqrt(x * x + y * y + z * z)
    gap = distance - radii[0] - t * (radii[1] - radii[0]) - balls.radii[ball] - balls.spare[ball, capsule]
    inverse = 1.0 / max(distance, LEAST)
    return gap, t, inverse * x, inverse * y, inverse * z


@inlined(fastmath=True)
def _move(displaced, ball, capsule, t, by, x, y, z, both, free, d, way):  # type: ignore[no-untyped-def]
    """Displace joints by the least so that a ball and the point t of a capsule move apart by a way along (x, y, z);
    return whether they can.
    """
    limb, other = displaced.of_ball[ball], displaced.of_end[capsule] if both else len(d) - 1
    s, e, f = displaced.ball_shares[ball], displaced.end_shares[capsule, 0], displaced.end_shares[capsule, 1]
    p, q = free[limb, 0] * s[0], free[limb, 1] * s[1]
    u, v = (1.0 - t) * e[0] + t * f[0], (1.0 - t) * e[1] + t * f[1]
    g, h = free[other, 0] * u, free[other, 1] * v
    squares = p * s[0] + q * s[1] + g * u + h * v
    if squares < LEAST_SHARE * LEAST_SHARE:
        return False
    step = by / squares
    way[limb] += abs(step) * max(p, q)
    way[other] += abs(step) * max(g, h)
    _add(d[limb], step * p, step * q, x, y, z)
    _add(d[other], -step * g, -step * h, x, y, z)
    return True


@inlined(fastmath=True)
def _add(d, middle, end, x, y, z):  # type: ignore[no-untyped-def]
    """Displace the middle and the end of a limb by these ways along (x, y, z)."""
    d[0, 0] += middle * x
    d[0, 1] += middle * y
    d[0, 2] += middle * z
    d[1, 0] += end * x
    d[1, 1] += end * y
    d[1, 2] += end * z


@inlined(fastmath=True)
def _largest(d: Array) -> float:
    """The largest displacement of a limb, (2, 3)."""
    largest = 0.0
    for joint in range(2):
        largest = max(largest, d[joint, 0] ** 2 + d[joint, 1] ** 2 + d[joint, 2] ** 2)
    return float(np.sqrt(largest))


@inlined(fastmath=True)
def _size_of(d: Array) -> float:
    """The sum of the absolute values of displacements."""
    size = 0.0
    for limb in range(len(d)):
        for joint in range(2):
            for i in range(3):
                size += abs(d[limb, joint, i])
    return size


@inlined(fastmath=True)
def _shrink(d: Array, share: float, way: Array) -> None:
    """Shrink displacements to a share, or to 0 where they are hardly any."""
    share = share if _size_of(d) >= NOTHING else 0.0
    for limb in range(len(d)):
        way[limb] += (1.0 - share) * _largest(d[limb])
        for joint in range(2):
            for i in range(3):
                d[limb, joint, i] *= share


@inlined(fastmath=True)
def _keep_lengths(limb: Array, free: Array, d: Array, way: Array, number: int) -> None:
    """Change the displacements of a limb's middle and end, (2, 3), by the least that gives its bones their lengths."""
    if _largest(d) == 0.0:
        return
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
        way[number] += abs(share) * max(upper, lower) * np.sqrt(new)
        for i in range(3):
            moved = limb[bone + 1, i] - limb[bone, i] + d[bone, i] - (d[0, i] if bone == 1 else 0.0)
            d[bone, i] += share * lower * moved
            if bone == 1:
                d[0, i] -= share * upper * moved
