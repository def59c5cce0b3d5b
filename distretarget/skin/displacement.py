"""How far limbs have to move so that their balls leave the capsules of other parts: displacements of elbows and wrists.

A ball on the upper arm moves by a share of the elbow's displacement, one on the forearm by shares of the elbow's and the
wrist's, and the hand by the wrist's. Each frame begins with the displacement of the frame before, so that a limb leaves
a body on the side on which it entered; then the displacement shrinks in small steps, after each of which balls that are
inside a capsule are moved out along the shortest way (position based dynamics: Mueller, Heidelberger, Hennix, Ratcliff,
J. Vis. Commun. Image Represent. 18 (2007), doi:10.1016/j.jvcir.2007.01.005). So a limb whose way leads through a body
slides round it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.compiled import compiled, inlined
from distretarget.skin.balls import NEVER, Balls, out_of_reach
from distretarget.skin.closest import LEAST, place_on_axis

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

SWEEPS = 12  # of each frame
SETTLING = 4  # the last sweeps, in which displacements do not shrink
SHRINK = 0.8  # the share of a displacement that a sweep leaves
LEAST_SHARE = 0.3  # balls that move by a smaller share of a displacement stay where they are


class Joints(NamedTuple):
    """The joints that can be displaced, and what moves with them. A share is that of a joint's displacement."""

    of_ball: Numbers  # (balls, 2), the numbers of the displaced joints that move each ball, or -1
    ball_shares: Array  # (balls, 2)
    of_end: Numbers  # (capsules, 2, 2), the same for the ends of the capsules
    end_shares: Array  # (capsules, 2, 2)
    count: int  # the number of joints


def displacements(
    balls: Balls, joints: Joints, posed: Array, wanted: Array, firmness: Array, fresh: NDArray[np.bool_], start: Array
) -> Array:
    """Return the displacements of the joints in each frame, (frames, joints, 3), that bring the parts of a body apart.

    `posed`, (frames, capsules, 2, 3), are the ends of the capsules; `wanted`, (frames, pairs), is the gap that pairs of
    segments that touch are brought to, as far as `firmness`, (frames, pairs), says, 0 to 1. Frames that are `fresh`,
    (frames,), do not begin with the frame before. `start`, (frames, joints, 3), if it has frames, is what the result
    begins with instead, and it does not shrink.
    """
    result = np.zeros((len(posed), joints.count, 3))
    room = np.zeros((len(balls.carriers), 3)), np.zeros(balls.cap_radii.shape + (3,)), np.zeros((2, 3))
    _write_displacements(balls, joints, posed, wanted, firmness, fresh, start, room, result)
    return result


@compiled(fastmath=True)
def _write_displacements(balls, joints, posed, wanted, firmness, fresh, start, room, result):  # type: ignore[no-untyped-def]
    for frame in range(len(posed)):
        d = result[frame]
        given = len(start) > 0
        if given or (frame > 0 and not fresh[frame]):
            for j in range(joints.count):
                for i in range(3):
                    d[j, i] = start[frame, j, i] if given else result[frame - 1, j, i]
        for sweep in range(SWEEPS):
            if not given and sweep < SWEEPS - SETTLING:
                for j in range(joints.count):
                    for i in range(3):
                        d[j, i] *= SHRINK
            moved = 0.0
            for pair in range(len(balls.pairs)):
                limb, part = balls.pairs[pair, 0], balls.pairs[pair, 1]
                if balls.of_ball[limb + 1] > balls.of_ball[limb] and joints.of_ball[balls.of_ball[limb], 0] >= 0:
                    _place(balls, joints, posed[frame], d, limb, part, room)
                    moved += _separate(balls, joints, limb, part, d, room)
                    if firmness[frame, pair] > 0.0:
                        _touch(balls, joints, limb, part, wanted[frame, pair], firmness[frame, pair], d, room)
            if moved == 0.0 and (given or sweep >= SWEEPS - SETTLING):
                break


@inlined(fastmath=True)
def _place(balls, joints, posed, d, limb, part, room):  # type: ignore[no-untyped-def]
    """Write the places of a limb's balls and of the ends of a part's capsules with the displacements d."""
    centres, ends = room[0], room[1]
    for capsule in range(balls.of_capsule[part], balls.of_capsule[part + 1]):
        for end in range(2):
            for i in range(3):
                ends[capsule, end, i] = posed[capsule, end, i]
                for s in range(2):
                    j = joints.of_end[capsule, end, s]
                    if j >= 0:
                        ends[capsule, end, i] += joints.end_shares[capsule, end, s] * d[j, i]
    for ball in range(balls.of_ball[limb], balls.of_ball[limb + 1]):
        capsule, t = balls.carriers[ball], balls.places[ball]
        for i in range(3):
            centres[ball, i] = (1.0 - t) * posed[capsule, 0, i] + t * posed[capsule, 1, i]
            for s in range(2):
                j = joints.of_ball[ball, s]
                if j >= 0:
                    centres[ball, i] += joints.ball_shares[ball, s] * d[j, i]


@inlined(fastmath=True)
def _separate(balls, joints, limb, part, d, room):  # type: ignore[no-untyped-def]
    """Move the balls of a limb out of the capsules of a part; return the sum of the ways."""
    centres, ends, n = room[0], room[1], room[2][0]
    moved = 0.0
    for capsule in range(balls.of_capsule[part], balls.of_capsule[part + 1]):
        radii = balls.cap_radii[capsule]
        for ball in range(balls.of_ball[limb], balls.of_ball[limb + 1]):
            if balls.spare[ball, capsule] == NEVER or out_of_reach(
                centres[ball], balls.radii[ball], ends[capsule], radii, 0.0
            ):
                continue
            gap, t = _gap(balls, ball, capsule, centres[ball], ends[capsule], n)
            if gap < 0.0:
                _move(balls, joints, ball, capsule, t, -gap, n, d, centres, ends)
                moved -= gap
    return moved


@inlined(fastmath=True)
def _touch(balls, joints, limb, part, wanted, firmness, d, room):  # type: ignore[no-untyped-def]
    """Move the ball of a limb that is nearest to a part to the gap that is wanted."""
    centres, ends, n = room[0], room[1], room[2][0]
    least, at, on = NEVER, -1, -1
    for capsule in range(balls.of_capsule[part], balls.of_capsule[part + 1]):
        radii = balls.cap_radii[capsule]
        for ball in range(balls.of_ball[limb], balls.of_ball[limb + 1]):
            if balls.spare[ball, capsule] == NEVER or out_of_reach(
                centres[ball], balls.radii[ball], ends[capsule], radii, least
            ):
                continue
            gap, _ = _gap(balls, ball, capsule, centres[ball], ends[capsule], n)
            if gap < least:
                least, at, on = gap, ball, capsule
    if at >= 0:
        gap, t = _gap(balls, at, on, centres[at], ends[on], n)
        _move(balls, joints, at, on, t, firmness * (wanted - gap), n, d, centres, ends)


@inlined(fastmath=True)
def _gap(balls, ball, capsule, p, ends, n):  # type: ignore[no-untyped-def]
    """The gap between a ball and a capsule, and where on the axis it is; the direction to the ball is written to n."""
    radii = balls.cap_radii[capsule]
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
def _move(balls, joints, ball, capsule, t, way, n, d, centres, ends):  # type: ignore[no-untyped-def]
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
    for i in range(3):
        by = 0.0
        for s in range(2):
            j = joints.of_ball[ball, s]
            if j >= 0:
                change = joints.ball_shares[ball, s] * step * n[i]
                d[j, i] += change
                by += joints.ball_shares[ball, s] * change
            for end in range(2):
                k = joints.of_end[capsule, end, s]
                if k >= 0:
                    weight = t if end == 1 else 1.0 - t
                    d[k, i] -= weight * joints.end_shares[capsule, end, s] * step * n[i]
        centres[ball, i] += by
