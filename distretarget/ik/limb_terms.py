"""The terms of limbs in each frame, as their parts turn: skins, contacts, anchors, the floor, and joints at rest.

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
from distretarget.skin.balls import NEVER, Balls, Placed, find_candidates, gap_of, room_for
from distretarget.skin.capsules import may_touch
from distretarget.skin.tangents import Displaced, place_displaced

# Stiffnesses are relative to that of displacements: with a stiffness of 99 a hundredth of the residual is left. Limbs
# follow targets that change in time within about tau / stiffness^(1/4) (`limb_bends`).
APART = 5000.0  # of gaps that are too small
TOUCH = 600.0  # of contacts
ANCHOR = 75.0  # of anchors on a ray: where a body cannot have both, the gap counts more than the place
USER_ANCHOR = 1500.0  # of anchors without a ray, which are the user's
SOFT = 0.01  # from the surface to this depth the stiffness of gaps grows from 0 to `APART` [body units]
BOUND = 0.01  # from about this residual on, contacts and anchors pull with a constant force [body units]
USER_REACH = 1.0  # contacts of a firmness above 1, which are the user's, pull up to this gap [body units]
SHARED = 0.01  # pairs whose gap exceeds the least by less share a contact, which then moves smoothly [body units]
FLOOR = 1e5  # of the floor, which yields to nothing: without displacements no limb is below it
HELD = 0.01  # the least free share of a joint that rests


class Frames(NamedTuple):
    """Some frames of a body, and the targets of its limbs. Lengths are in body units."""

    posed: F4  # (frames, capsules, 2, 3), the ends of the capsules
    limbs: F4  # (frames, limbs, 3, 3), the top, the middle and the end of each limb
    free: F3  # (frames, limbs, 2), how far middle and end can move, 0 to 1
    soft: F2  # (frames, pairs), how far segments may overlap
    up: F2  # (frames, 3), unit vectors
    above_floor: F3  # (frames, limbs, 2), how far middle and end can sink
    target_gaps: F2  # (frames, zones), the gap of the contact of each zone
    firmness: F2  # (frames, zones), of these contacts, 0 to 1, above 1 for the user's; stiffness grows with its square
    anchor_offsets: F4  # (frames, limbs, anchors, 3), of the limb's point of contact from the start of the ray
    anchor_rays: F4  # (frames, limbs, anchors, 3), directions of the rays; 0 for an anchor at the start itself
    anchor_weights: F3  # (frames, limbs, anchors), 0 to 1
    anchor_shares: F4  # (frames, limbs, anchors, 2), of the other arm's displacements, by which the ray moves


class LimbWorkspace(NamedTuple):
    """Scratch for one frame; the last limb stands for all that no limb carries."""

    placed: Placed
    ends: F3  # (capsules, 2, 3)
    d: F3  # (limbs + 1, 2, 3), the displacements of middle and end
    bones: F3  # (limbs + 1, 2, 3), the turned bones
    series: F3  # (limbs + 1, 2, 2), see `articulation.Scratch`
    rotation: F1  # (9,)
    rows: F2  # (4, 3), dr/dw of the parts of two limbs
    touching: I2  # (candidates, 3), ball, capsule and segment pair of possible contacts
    gaps: F1  # (candidates,), their gaps less `USER_REACH`, negative
    nearest: F1  # (zones,), the least of these
    nearest_before: I2  # (zones, 2), ball and capsule that were nearest in the frame evaluated before; -1 at first
    shares: F1  # (zones,), the sum of the shares of all that share a contact

    @classmethod
    def of(cls, balls: Balls, zones: Numbers, limbs: int) -> LimbWorkspace:
        """Room for a body with so many limbs."""
        candidates, count = int((balls.gap_offsets < NEVER).sum()), int(zones.max(initial=-1)) + 1
        d, bones, series = (np.zeros((limbs + 1, 2, width)) for width in (3, 3, 2))
        ends, touching = np.zeros((len(balls.joints), 2, 3)), np.zeros((candidates, 3), np.intp)
        scratch = d, bones, series, np.zeros(9), np.zeros((4, 3)), touching, np.zeros(candidates), np.zeros(count)
        return cls(room_for(balls), ends, *scratch, np.full((count, 2), -1), np.zeros(count))


@compiled(fastmath=True)
def write_terms(
    balls: Balls,
    displaced: Displaced,
    zones: I1,
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
    of its curvature from the diagonal down, (frames, n, bands). Column k of `columns`, (limbs + 1,), means that the
    unknowns of a limb are the six from 6 k on; it is negative for limbs that do not move.
    """
    for t in range(len(w)):
        clear(slope[t])
        clear(bands[t])
        _pose(w[t], frames.limbs[t], room)
        place_displaced(balls, displaced, frames.posed[t], room.d, room.ends, room.placed)
        gaps, sums = (frames.soft[t], frames.target_gaps[t], frames.firmness[t]), (slope[t], bands[t])
        found, e = _add_gaps(balls, displaced, zones, columns, gaps, w[t], reach, room, sums)
        e += _add_contacts(balls, displaced, zones, columns, gaps, w[t], found, reach, room, sums)
        anchors = frames.anchor_offsets[t], frames.anchor_rays[t], frames.anchor_weights[t], frames.anchor_shares[t]
        e += _add_anchors(anchors, columns, w[t], room, sums)
        e += _add_floor(frames.up[t], frames.above_floor[t], columns, w[t], room, sums)
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
def _add_gaps(balls, displaced, zones, columns, gaps, w, reach, room, sums):  # type: ignore[no-untyped-def]
    """Add the terms of too small gaps, and write possible contacts to `room`; return their number, and the energy."""
    soft, _, firmness = gaps
    energy, placed, found = 0.0, room.placed, 0
    clear(room.shares)
    for zone in range(len(room.nearest)):
        ball, capsule = room.nearest_before[zone]
        room.nearest[zone] = min(gap_of(balls, ball, capsule, placed)[0] - USER_REACH, 0.0) if ball >= 0 else 0.0
    for pair in range(len(balls.pairs)):
        zone, both, least = zones[pair], displaced.mutual[pair], -soft[pair]
        if columns[displaced.limbs[balls.carriers[balls.of_ball[balls.pairs[pair, 0]]]]] < 0:
            continue
        far = -NEVER if firmness[zone] == 0.0 else min(_reach(reach, firmness[zone]), _limit(zone, room))
        for n in range(find_candidates(balls, pair, max(least, far), placed)):
            ball, capsule = placed.candidates[n, 0], placed.candidates[n, 1]
            far = min(far, _limit(zone, room))
            if not may_touch(placed.centres[ball], placed.axes[capsule], balls.cap_radii[capsule], max(least, far)):
                continue
            gap = gap_of(balls, ball, capsule, placed)[0]
            if gap < least:
                e, f, k = _penalty(least - gap)
                energy += e
                _add_gap(balls, displaced, ball, capsule, both, columns, -f, k, w, room, sums)
            if gap < far:
                room.touching[found, 0], room.touching[found, 1], room.touching[found, 2] = ball, capsule, pair
                room.gaps[found], found = gap - USER_REACH, found + 1
                if gap - USER_REACH < room.nearest[zone]:
                    room.nearest[zone] = gap - USER_REACH
                    room.nearest_before[zone, 0], room.nearest_before[zone, 1] = ball, capsule
    return found, energy


@inlined(fastmath=True)
def _reach(reach, firmness):  # type: ignore[no-untyped-def]
    """The largest gap at which a contact pulls."""
    return reach if firmness <= 1.0 else USER_REACH


@inlined(fastmath=True)
def _limit(zone, room):  # type: ignore[no-untyped-def]
    """The gap from which on a pair has no share in the contact of a zone, by the least gap found so far."""
    return room.nearest[zone] + USER_REACH + SHARED


@inlined(fastmath=True)
def _add_contacts(balls, displaced, zones, columns, gaps, w, found, reach, room, sums):  # type: ignore[no-untyped-def]
    """Add the terms of contacts: one for each zone, of its least gap, shared by all pairs that are about as near. Its
    energy is 0 at the largest gap at which it pulls.
    """
    _, target_gaps, firmness = gaps
    energy = 0.0
    for n in range(found):
        zone = zones[room.touching[n, 2]]
        room.shares[zone] += _nearness(room.gaps[n] - room.nearest[zone])
    for n in range(found):
        ball, capsule, pair = room.touching[n, 0], room.touching[n, 1], room.touching[n, 2]
        zone, both = zones[pair], displaced.mutual[pair]
        share = _nearness(room.gaps[n] - room.nearest[zone]) / room.shares[zone]
        if share > 0.0:
            r = room.nearest[zone] + USER_REACH - target_gaps[zone]
            farthest = _reach(reach, firmness[zone]) - target_gaps[zone]
            k, far = TOUCH * firmness[zone] * firmness[zone] * share, np.sqrt(1.0 + r * r / (BOUND * BOUND))
            energy += k * BOUND * (BOUND * far - np.sqrt(BOUND * BOUND + farthest * farthest))
            _add_gap(balls, displaced, ball, capsule, both, columns, k * r / far, k / far, w, room, sums)
    return energy


@inlined(fastmath=True)
def _add_anchors(anchors, columns, w, room, sums):  # type: ignore[no-untyped-def]
    """Add the terms of anchors, and return their energy. The residual is the offset of the point of contact from the
    point on the ray at the same distance from the ray's start.
    """
    offsets, rays, weights, shares = anchors
    energy = 0.0
    for limb in range(len(weights)):
        for n in range(len(weights[limb]) if columns[limb] >= 0 else 0):
            ray, d, firmness = rays[limb, n], room.d[limb, 1], weights[limb, n] * weights[limb, n]
            if firmness <= 0.0:
                continue
            stiffness = firmness * (ANCHOR if ray[0] != 0.0 or ray[1] != 0.0 or ray[2] != 0.0 else USER_ANCHOR)
            by, of_middle, of_end = offsets[limb, n], shares[limb, n, 0], shares[limb, n, 1]
            other = 1 - limb if of_middle + of_end > 0.0 else len(w)  # arms come first
            middle, end = room.d[other]
            x = by[0] + d[0] - of_middle * middle[0] - of_end * end[0]
            y = by[1] + d[1] - of_middle * middle[1] - of_end * end[1]
            z = by[2] + d[2] - of_middle * middle[2] - of_end * end[2]
            away = max(np.sqrt(x * x + y * y + z * z), SHARED)
            r = x - away * ray[0], y - away * ray[1], z - away * ray[2]
            far = np.sqrt(1.0 + (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]) / (BOUND * BOUND))
            energy += stiffness * BOUND * BOUND * (far - 1.0)
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
def _add_floor(up, above_floor, columns, w, room, sums):  # type: ignore[no-untyped-def]
    """Add the terms of middles and ends that sink farther than they can, and return their energy."""
    energy = 0.0
    for limb in range(len(w)):
        for point in range(2 if columns[limb] >= 0 else 0):
            d = room.d[limb, point]
            depth = -(above_floor[limb, point] + up[0] * d[0] + up[1] * d[1] + up[2] * d[2])
            if depth > 0.0:
                energy += 0.5 * FLOOR * depth * depth
                _write_rows(limb, 1.0 - point, 1.0 * point, up[0], up[1], up[2], w, room, 0)
                _add_term(columns[limb], -1, -FLOOR * depth, FLOOR, room.rows, sums)
    return energy


@inlined(fastmath=True)
def _penalty(depth):  # type: ignore[no-untyped-def]
    """The energy, force and stiffness of a penetration: the stiffness is `APART` from the depth `SOFT` on."""
    if depth < SOFT:
        share = depth / SOFT
        return APART * depth * depth * share / 6.0, 0.5 * APART * depth * share, APART * share
    return APART * (0.5 * depth * (depth - SOFT) + SOFT * SOFT / 6.0), APART * (depth - 0.5 * SOFT), APART


@inlined(fastmath=True)
def _nearness(farther: float) -> float:
    """1 for the least gap, falling to 0 for gaps that are larger by `SHARED` or more."""
    t = max(1.0 - farther / SHARED, 0.0)
    return t * t


@inlined(fastmath=True)
def _add_gap(balls, displaced, ball, capsule, both, columns, f, k, w, room, sums):  # type: ignore[no-untyped-def]
    """Add a term of force f and stiffness k of the gap of a ball and a capsule, whose limb moves too if `both` do."""
    _, t, x, y, z = gap_of(balls, ball, capsule, room.placed)
    carrier, at = balls.carriers[ball], balls.fractions[ball]
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
    """Write dr/dw of the parts of a limb for the normal x, y, z, and a point that moves by the shares `middle` and
    `end` of the displacements of middle and end.
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
