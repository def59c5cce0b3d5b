"""What limbs have to keep in each frame while their parts are turned: gaps of skin, contacts, and ends that rest.

A term is a function of a residual r, such as a gap, that changes by n . x as a point of a limb moves by x. The point
moves by shares of the displacements of the limb's middle and end, and these by the rotation vectors w of its upper and
its lower part, whose bones are u and l: R(w_u) u - u, and that plus R(w_l) l - l. So dr/dw = J^T (R u x n), as in
`articulation.pose_gradient`. Each term adds f'(r) dr/dw to a slope, and f''(r) dr/dw dr/dw^T to a Gauss-Newton
curvature. Compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.ik.articulation import to_rotation_vector, write_rotation
from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import F1, F2, F3, F4, I1, I2, Array, Numbers, clear
from distretarget.skin.balls import NEVER, Balls, Placed, find_meetings, gap_of, room_for
from distretarget.skin.capsules import may_touch
from distretarget.skin.tangents import Displaced, place_displaced

# Stiffness is relative to that of displacements: a term of 99 leaves a hundredth of what it asks for. Where limbs are
# asked for something that changes in time, they follow within about tau / stiffness^(1/4) (`limb_bends`).
FIRM = 5000.0  # of gaps that are too small
TOUCH = 600.0  # of contacts
TIE = 75.0  # of anchors: place gives way to the gap where a body cannot have both
ASKED = 1500.0  # of anchors without a ray, which a user asks for
GIVES = 0.01  # skin is softer up to this depth, from nothing, so that limbs come upon it smoothly [body units]
WITHIN = 0.01  # contacts that are farther off than this pull no more, and no limb into others [body units]
FAR = 1.0  # contacts of a firmness beyond 1, which a user asks for, are found this far apart [body units]
NEAR = 0.01  # what is less than this farther than the nearest shares a contact: its place does not jump [body units]
HELD = 0.01  # the share of its displacement that is left to the end of a limb that rests


class Frames(NamedTuple):
    """Some frames of a body, and what is asked of its limbs there. Lengths are in body units."""

    posed: F4  # (frames, capsules, 2, 3), the ends of the capsules
    limbs: F4  # (frames, limbs, 3, 3), the top, the middle and the end of each limb
    free: F3  # (frames, limbs, 2), how far middle and end can move, 0 to 1
    soft: F2  # (frames, pairs), how far segments may overlap, because flesh gives way
    aims: F2  # (frames, spots), the gap that limbs are brought to where they touch
    firmness: F2  # (frames, spots), how firmly they are brought there: 0 to 1, or more where a user asks for it
    off: F4  # (frames, limbs, anchors, 3), how far what touches is off the start of the ray that it belongs on
    rays: F4  # (frames, limbs, anchors, 3), the directions of these; 0 where it belongs on their start
    ties: F3  # (frames, limbs, anchors), how far it is brought onto them, 0 to 1
    carried: F4  # (frames, limbs, anchors, 2), the shares of the other arm's displacements that the rays move by


class LimbWorkspace(NamedTuple):
    """Scratch for one frame; the last limb is that of what no limb carries."""

    placed: Placed
    ends: F3  # (capsules, 2, 3)
    d: F3  # (limbs + 1, 2, 3), the displacements of middle and end
    bones: F3  # (limbs + 1, 2, 3), the turned bones
    series: F3  # (limbs + 1, 2, 2), see `articulation.Scratch`
    rotation: F1  # (9,)
    rows: F2  # (4, 3), dr/dw of the parts of two limbs
    touching: I2  # (meetings, 3), the ball, the capsule and the pair of what may touch
    gaps: F1  # (meetings,), by how much their gaps are less than `FAR`, negative
    nearest: F1  # (spots,), the least of these
    nearest_before: I2  # (spots, 2), the ball and the capsule that were nearest in another frame; -1 at first
    shares: F1  # (spots,), the sum of their shares

    @classmethod
    def of(cls, balls: Balls, spots: Numbers, limbs: int) -> LimbWorkspace:
        """Room for a body with so many limbs."""
        meetings, count = int((balls.spare < NEVER).sum()), int(spots.max(initial=-1)) + 1
        d, bones, series = (np.zeros((limbs + 1, 2, width)) for width in (3, 3, 2))
        ends, touching = np.zeros((len(balls.joints), 2, 3)), np.zeros((meetings, 3), np.intp)
        scratch = d, bones, series, np.zeros(9), np.zeros((4, 3)), touching, np.zeros(meetings), np.zeros(count)
        return cls(room_for(balls), ends, *scratch, np.full((count, 2), -1), np.zeros(count))


@compiled(fastmath=True)
def write_terms(
    balls: Balls,
    displaced: Displaced,
    spots: I1,
    columns: I1,
    frames: Frames,
    w: F4,
    reach: float,
    room: LimbWorkspace,
    energy: Out[F1],
    slope: Out[F2],
    bands: Out[F3],
) -> None:
    """Write the energy of the terms of each frame at w, (frames, limbs, 2, 3), its slope, (frames, n), and the columns
    of its curvature from the diagonal down, (frames, n, bands). `columns`, (limbs + 1,), say which six unknowns the
    parts of a limb are; a negative number is that of a limb that stays.
    """
    for t in range(len(w)):
        clear(slope[t])
        clear(bands[t])
        _pose(w[t], frames.limbs[t], room)
        place_displaced(balls, displaced, frames.posed[t], room.d, room.ends, room.placed)
        asked = frames.soft[t], frames.aims[t], frames.firmness[t]
        sums = slope[t], bands[t]
        found, e = _add_gaps(balls, displaced, spots, columns, asked, w[t], reach, room, sums)
        e += _add_contacts(balls, displaced, spots, columns, asked, w[t], found, reach, room, sums)
        e += _add_anchors((frames.off[t], frames.rays[t], frames.ties[t], frames.carried[t]), columns, w[t], room, sums)
        energy[t] = e + _add_holds(frames.free[t], columns, w[t], room, sums)


@compiled(fastmath=True)
def write_displacements(w: F4, limbs: F4, room: LimbWorkspace, d: Out[F4]) -> None:
    """Write the displacements of middle and end of each limb, (frames, limbs, 2, 3)."""
    for t in range(len(w)):
        _pose(w[t], limbs[t], room)
        for limb in range(w.shape[1]):
            for point in range(2):
                for i in range(3):
                    d[t, limb, point, i] = room.d[limb, point, i]


@inlined(fastmath=True)
def _pose(w: Array, limbs: Array, room: LimbWorkspace) -> None:
    """Write the turned bones of limbs, (limbs, 3, 3), and the displacements of their middles and ends."""
    for limb in range(len(w)):
        for part in range(2):
            v, E, bone, by = w[limb, part], room.rotation, room.bones[limb, part], room.d[limb, part]
            write_rotation(v[0], v[1], v[2], E, room.series[limb, part])
            a, b = limbs[limb, part], limbs[limb, part + 1]
            x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            for i in range(3):
                bone[i] = E[3 * i] * x + E[3 * i + 1] * y + E[3 * i + 2] * z
                by[i] = bone[i] - (b[i] - a[i]) + (room.d[limb, 0, i] if part == 1 else 0.0)


@inlined(fastmath=True)
def _add_gaps(balls, displaced, spots, columns, asked, w, reach, room, sums):  # type: ignore[no-untyped-def]
    """Add the terms of gaps that are too small, and note what may touch; return how much that is, and the energy."""
    soft, _, firmness = asked
    energy, placed, found = 0.0, room.placed, 0
    clear(room.shares)
    for spot in range(len(room.nearest)):
        ball, capsule = room.nearest_before[spot]
        room.nearest[spot] = min(gap_of(balls, ball, capsule, placed)[0] - FAR, 0.0) if ball >= 0 else 0.0
    for pair in range(len(balls.pairs)):
        spot, both, least = spots[pair], displaced.mutual[pair], -soft[pair]
        if columns[displaced.limbs[balls.carriers[balls.of_ball[balls.pairs[pair, 0]]]]] < 0:
            continue
        far = -NEVER if firmness[spot] == 0.0 else min(_reach(reach, firmness[spot]), _limit(spot, room))
        for meeting in range(find_meetings(balls, pair, max(least, far), placed)):
            ball, capsule = placed.meetings[meeting, 0], placed.meetings[meeting, 1]
            far = min(far, _limit(spot, room))
            if not may_touch(placed.centres[ball], placed.axes[capsule], balls.cap_radii[capsule], max(least, far)):
                continue
            gap = gap_of(balls, ball, capsule, placed)[0]
            if gap < least:
                e, f, k = _firmly(least - gap)
                energy += e
                _add_gap(balls, displaced, ball, capsule, both, columns, -f, k, w, room, sums)
            if gap < far:
                room.touching[found, 0], room.touching[found, 1], room.touching[found, 2] = ball, capsule, pair
                room.gaps[found], found = gap - FAR, found + 1
                if gap - FAR < room.nearest[spot]:
                    room.nearest[spot] = gap - FAR
                    room.nearest_before[spot, 0], room.nearest_before[spot, 1] = ball, capsule
    return found, energy


@inlined(fastmath=True)
def _reach(reach, firmness):  # type: ignore[no-untyped-def]
    """Up to which gap a contact pulls."""
    return reach if firmness <= 1.0 else FAR


@inlined(fastmath=True)
def _limit(spot, room):  # type: ignore[no-untyped-def]
    """The gap from which on nothing shares the contact of a spot, by the nearest that was found so far."""
    return room.nearest[spot] + FAR + NEAR


@inlined(fastmath=True)
def _add_contacts(balls, displaced, spots, columns, asked, w, found, reach, room, sums):  # type: ignore[no-untyped-def]
    """Add the terms of contacts: at each spot, of the least gap, which all that are about as near share. The energy of
    one is 0 where it begins to pull.
    """
    _, aims, firmness = asked
    energy = 0.0
    for n in range(found):
        spot = spots[room.touching[n, 2]]
        room.shares[spot] += _nearness(room.gaps[n] - room.nearest[spot])
    for n in range(found):
        ball, capsule, pair = room.touching[n, 0], room.touching[n, 1], room.touching[n, 2]
        spot, both = spots[pair], displaced.mutual[pair]
        share = _nearness(room.gaps[n] - room.nearest[spot]) / room.shares[spot]
        if share > 0.0:
            r = room.nearest[spot] + FAR - aims[spot]
            farthest = _reach(reach, firmness[spot]) - aims[spot]
            k, far = TOUCH * firmness[spot] * firmness[spot] * share, np.sqrt(1.0 + r * r / (WITHIN * WITHIN))
            energy += k * WITHIN * (WITHIN * far - np.sqrt(WITHIN * WITHIN + farthest * farthest))
            _add_gap(balls, displaced, ball, capsule, both, columns, k * r / far, k / far, w, room, sums)
    return energy


@inlined(fastmath=True)
def _add_anchors(anchors, columns, w, room, sums):  # type: ignore[no-untyped-def]
    """Add the terms of anchors, of how far the ends of limbs are off the points of their rays that are as far out as
    they are, and return their energy.
    """
    off, rays, ties, carried = anchors
    energy = 0.0
    for limb in range(len(ties)):
        for n in range(len(ties[limb]) if columns[limb] >= 0 else 0):
            ray, d, firmness = rays[limb, n], room.d[limb, 1], ties[limb, n] * ties[limb, n]
            if firmness <= 0.0:
                continue
            stiffness = firmness * (TIE if ray[0] != 0.0 or ray[1] != 0.0 or ray[2] != 0.0 else ASKED)
            by, of_middle, of_end = off[limb, n], carried[limb, n, 0], carried[limb, n, 1]
            other = 1 - limb if of_middle + of_end > 0.0 else len(w)  # arms come first
            middle, end = room.d[other]
            x = by[0] + d[0] - of_middle * middle[0] - of_end * end[0]
            y = by[1] + d[1] - of_middle * middle[1] - of_end * end[1]
            z = by[2] + d[2] - of_middle * middle[2] - of_end * end[2]
            away = max(np.sqrt(x * x + y * y + z * z), NEAR)
            r = x - away * ray[0], y - away * ray[1], z - away * ray[2]
            far = np.sqrt(1.0 + (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]) / (WITHIN * WITHIN))
            energy += stiffness * WITHIN * WITHIN * (far - 1.0)
            for i in range(3):
                a, b, c = -ray[i] * x / away, -ray[i] * y / away, -ray[i] * z / away
                a, b, c = a + (1.0 if i == 0 else 0.0), b + (1.0 if i == 1 else 0.0), c + (1.0 if i == 2 else 0.0)
                _write_rows(limb, 0.0, 1.0, a, b, c, w, room, 0)
                _write_rows(other, -of_middle, -of_end, a, b, c, w, room, 2)
                _add_term(columns[limb], columns[other], stiffness * r[i] / far, stiffness / far, room.rows, sums)
    return energy


@inlined(fastmath=True)
def _add_holds(free, columns, w, room, sums):  # type: ignore[no-untyped-def]
    """Add 1/2 (1 / free^2 - 1) |displacement|^2 of middles and ends, (limbs, 2), and return this."""
    energy = 0.0
    for limb in range(len(w)):
        for point in range(2 if columns[limb] >= 0 else 0):
            f = max(free[limb, point], HELD)
            if f < 1.0:
                for i in range(3):
                    x, y, z = 1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0
                    _write_rows(limb, 1.0 - point, 1.0 * point, x, y, z, w, room, 0)
                    k, r = 1.0 / (f * f) - 1.0, room.d[limb, point, i]
                    energy += 0.5 * k * r * r
                    _add_term(columns[limb], -1, k * r, k, room.rows, sums)
    return energy


@inlined(fastmath=True)
def _firmly(depth):  # type: ignore[no-untyped-def]
    """The energy, the force and the curvature of skin that is pressed in: soft at first, and `FIRM` from `GIVES` on."""
    if depth < GIVES:
        share = depth / GIVES
        return FIRM * depth * depth * share / 6.0, 0.5 * FIRM * depth * share, FIRM * share
    return FIRM * (0.5 * depth * (depth - GIVES) + GIVES * GIVES / 6.0), FIRM * (depth - 0.5 * GIVES), FIRM


@inlined(fastmath=True)
def _nearness(farther: float) -> float:
    """1 for what is nearest, 0 for what is farther by `NEAR` or more."""
    t = max(1.0 - farther / NEAR, 0.0)
    return t * t


@inlined(fastmath=True)
def _add_gap(balls, displaced, ball, capsule, both, columns, f, k, w, room, sums):  # type: ignore[no-untyped-def]
    """Add a term of the gap of a ball and a capsule; the capsule's limb moves too if `both` give way."""
    _, t, x, y, z = gap_of(balls, ball, capsule, room.placed)
    carrier, at = balls.carriers[ball], balls.places[ball]
    of_ball, of_capsule = displaced.shares[carrier], displaced.shares[capsule]
    one, other = displaced.limbs[carrier], displaced.limbs[capsule] if both else len(w)
    a = (1.0 - at) * of_ball[0, 0] + at * of_ball[1, 0]
    b = (1.0 - at) * of_ball[0, 1] + at * of_ball[1, 1]
    c = (t - 1.0) * of_capsule[0, 0] - t * of_capsule[1, 0]
    d = (t - 1.0) * of_capsule[0, 1] - t * of_capsule[1, 1]
    if one == other:
        a, b, other = a + c, b + d, len(w)
    _write_rows(one, a, b, x, y, z, w, room, 0)
    _write_rows(other, c, d, x, y, z, w, room, 2)
    _add_term(columns[one], columns[other], f, k, room.rows, sums)


@inlined(fastmath=True)
def _write_rows(limb, middle, end, x, y, z, w, room, row):  # type: ignore[no-untyped-def]
    """Write by how much a point moves along a normal as the parts of a limb turn; it moves by these shares of the
    displacements of middle and end.
    """
    if limb < len(w):
        for part in range(2):
            share = middle + end if part == 0 else end
            bone, torque = room.bones[limb, part], room.rows[row + part]
            torque[0] = share * (bone[1] * z - bone[2] * y)
            torque[1] = share * (bone[2] * x - bone[0] * z)
            torque[2] = share * (bone[0] * y - bone[1] * x)
            to_rotation_vector(w[limb, part], room.series[limb, part], torque)


@inlined(fastmath=True)
def _add_term(one, other, f, k, rows, sums):  # type: ignore[no-untyped-def]
    """Add f dr/dw to the slope, and k dr/dw dr/dw^T to the bands; `one` and `other` are the columns of two limbs."""
    slope, bands = sums
    for a in range(4):
        of_a = one if a < 2 else other
        first = 6 * of_a + 3 * (a % 2)
        for i in range(3 if of_a >= 0 else 0):
            slope[first + i] += f * rows[a, i]
            for b in range(4):
                of_b = one if b < 2 else other
                below = 6 * of_b + 3 * (b % 2) - first - i
                for j in range(3 if of_b >= 0 else 0):
                    if below + j >= 0:
                        bands[first + i, below + j] += k * rows[a, i] * rows[b, j]
