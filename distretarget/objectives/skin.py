"""Skin: one-sided springs that keep the surfaces of a body's parts apart.

    1/2 sum over balls and capsules   k_p max(0, G_p - gap)^2   +   K c(gap)

gap is that between a ball of a limb and a capsule of another part (`skin.balls`). The first term holds the two parts of
a pair p at the gap G_p that the plan of the clip asks for (`skin_plan`), which leads in time. The second keeps the
surfaces apart everywhere; its force, K (-gap) where they overlap, begins CUSHION / 2 before they touch and grows as the
square of the way up to there, so that the curvature is continuous.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.ik.articulation import Articulation, Scratch
from distretarget.ik.pushes import Pushes, add_force, room_for_pushes
from distretarget.numerics.compiled import inlined
from distretarget.skin.balls import NEVER, Balls, out_of_reach, place_ball
from distretarget.skin.closest import LEAST, place_on_axis

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

STIFFNESS = 300.0  # K
CUSHION = 0.006  # the way over which the force sets in [body units]
NEARLY = 0.002  # pairs that lack less than this to touch may move the parts that carry them [body units]
MOST_PUSHES = 512  # balls and capsules that touch in one frame


class Skin(NamedTuple):
    """The surfaces of a body, and what keeps them apart. All lengths are in body units. With several frames, `ends`,
    `near`, `soft`, `rest` and `k` have the frames as first axis.
    """

    balls: Balls
    ends: Array  # (capsules, 2, 3), the ends of the capsules less their joints, in the rotation copy
    near: NDArray[np.bool_]  # (pairs,), whether a pair of segments may touch
    soft: Array  # (pairs,), how far they may overlap, because flesh gives way
    rest: Array  # (pairs,), G, the gap of each pair of segments
    k: Array  # (pairs,), the stiffness with which it is kept
    posed: Array  # (capsules, 2, 3), scratch
    centres: Array  # (balls, 3), scratch
    force: Array  # (3, 3), scratch
    pushes: Pushes  # scratch


def no_balls() -> Balls:
    """Return the balls and capsules of a body without thickness."""
    none, numbers = np.zeros(0), np.zeros(0, np.intp)
    pairs = np.zeros((0, 2), np.intp)
    return Balls(numbers, none, none, numbers, np.zeros((0, 2)), numbers, numbers, pairs, np.zeros((0, 0)))


def skin_of(balls: Balls, ends: Array, near: NDArray[np.bool_], soft: Array, rest: Array, k: Array) -> Skin:
    """Return the skin of some frames."""
    posed, centres = np.zeros(ends.shape[1:]), np.zeros((len(balls.carriers), 3))
    ends, near, soft, rest, k = (np.ascontiguousarray(each) for each in (ends, near, soft, rest, k))
    return Skin(balls, ends, near, soft, rest, k, posed, centres, np.zeros((3, 3)), room_for_pushes(MOST_PUSHES))


@inlined(fastmath=True)
def skin_in_frame(skin: Skin, frame: int) -> Skin:
    """The skin in one of its frames."""
    return Skin(
        skin.balls,
        skin.ends[frame],
        skin.near[frame],
        skin.soft[frame],
        skin.rest[frame],
        skin.k[frame],
        skin.posed,
        skin.centres,
        skin.force,
        skin.pushes,
    )


@inlined(fastmath=True)
def skin_energy(scratch: Scratch, body: Articulation, skin: Skin) -> float:
    """Return the energy of the skin at the pose of `scratch`, and add its gradient there."""
    energy = 0.0
    for pair in range(len(skin.near)):
        if skin.near[pair]:
            _pose_pair(scratch, body, skin, pair)
            energy += _pair_energy(scratch, body, skin, pair)
    return energy


@inlined(fastmath=True)
def skin_pushes(scratch: Scratch, body: Articulation, skin: Skin) -> int:
    """Write pushes with the Gauss-Newton curvature of the skin at the pose of `scratch`; return how many they are."""
    count = 0
    for pair in range(len(skin.near)):
        if skin.near[pair]:
            _pose_pair(scratch, body, skin, pair)
            count = _write_pushes(scratch, skin, pair, count)
    return count


@inlined(fastmath=True)
def _pose_pair(scratch: Scratch, body: Articulation, skin: Skin, pair: int) -> None:
    """Pose the capsules and the balls of a pair of segments."""
    balls = skin.balls
    for side in range(2):
        segment = balls.pairs[pair, side]
        for capsule in range(balls.of_capsule[segment], balls.of_capsule[segment + 1]):
            joint = balls.joints[capsule]
            E = scratch.rotations[body.parts[joint]]
            for end in range(2):
                x, y, z = skin.ends[capsule, end, 0], skin.ends[capsule, end, 1], skin.ends[capsule, end, 2]
                for i in range(3):
                    at = E[3 * i] * x + E[3 * i + 1] * y + E[3 * i + 2] * z
                    skin.posed[capsule, end, i] = scratch.x[joint, i] + at
    segment = balls.pairs[pair, 0]
    for ball in range(balls.of_ball[segment], balls.of_ball[segment + 1]):
        place_ball(balls, ball, skin.posed, skin.centres[ball])


@inlined(fastmath=True)
def _pair_energy(scratch: Scratch, body: Articulation, skin: Skin, pair: int) -> float:
    balls, force = skin.balls, skin.force
    a, b = balls.pairs[pair, 0], balls.pairs[pair, 1]
    rest, k, energy = skin.rest[pair], skin.k[pair], 0.0
    reach = max(rest, 0.5 * CUSHION)
    for capsule in range(balls.of_capsule[b], balls.of_capsule[b + 1]):
        ends, radii, holder = skin.posed[capsule], balls.cap_radii[capsule], balls.joints[capsule]
        for ball in range(balls.of_ball[a], balls.of_ball[a + 1]):
            if balls.spare[ball, capsule] == NEVER or out_of_reach(
                skin.centres[ball], balls.radii[ball], ends, radii, reach
            ):
                continue
            gap = _write_push(skin, ball, capsule, force[0], force[1]) + skin.soft[pair]
            lack, cushion = rest - gap, 0.5 * CUSHION - gap
            pull = 0.0
            if lack > 0.0:
                energy += 0.5 * k * lack * lack
                pull += k * lack
            if cushion > CUSHION:
                energy += STIFFNESS * (CUSHION * CUSHION / 24.0 + 0.5 * gap * gap)
                pull -= STIFFNESS * gap
            elif cushion > 0.0:
                energy += STIFFNESS * cushion * cushion * cushion / (6.0 * CUSHION)
                pull += 0.5 * STIFFNESS * cushion * cushion / CUSHION
            if pull > 0.0:
                limb = balls.joints[balls.carriers[ball]]
                n = force[0]
                for i in range(3):
                    force[2, i] = skin.centres[ball, i] - scratch.x[limb, i]
                add_force(scratch, body, limb, force[2], n, -pull)
                for i in range(3):
                    force[2, i] = force[1, i] - scratch.x[holder, i]
                add_force(scratch, body, holder, force[2], n, pull)
    return energy


@inlined(fastmath=True)
def _write_pushes(scratch: Scratch, skin: Skin, pair: int, count: int) -> int:
    balls, pushes, force = skin.balls, skin.pushes, skin.force
    a, b = balls.pairs[pair, 0], balls.pairs[pair, 1]
    rest, k = skin.rest[pair], skin.k[pair]
    reach = max(rest, 0.5 * CUSHION) + NEARLY
    for capsule in range(balls.of_capsule[b], balls.of_capsule[b + 1]):
        ends, radii, holder = skin.posed[capsule], balls.cap_radii[capsule], balls.joints[capsule]
        for ball in range(balls.of_ball[a], balls.of_ball[a + 1]):
            if balls.spare[ball, capsule] == NEVER or out_of_reach(
                skin.centres[ball], balls.radii[ball], ends, radii, reach
            ):
                continue
            gap = _write_push(skin, ball, capsule, force[0], force[1]) + skin.soft[pair]
            if gap < reach and count < MOST_PUSHES:
                limb = balls.joints[balls.carriers[ball]]
                lack, cushion = rest - gap, 0.5 * CUSHION - gap
                pushes.a[count], pushes.b[count] = limb, holder
                for i in range(3):
                    pushes.direction[count, i] = force[0, i]
                    pushes.at_a[count, i] = skin.centres[ball, i] - scratch.x[limb, i]
                    pushes.at_b[count, i] = force[1, i] - scratch.x[holder, i]
                share = max(min(cushion / CUSHION, 1.0), 0.0)
                pushes.k[count] = STIFFNESS * share + (k if lack > 0.0 else 0.0)
                count += 1
    return count


@inlined(fastmath=True)
def _write_push(skin: Skin, ball: int, capsule: int, n: Array, q: Array) -> float:
    """Write the unit vector from a capsule to a ball, and the point of the capsule's axis that counts; return the gap
    between the two.
    """
    balls, p, ends = skin.balls, skin.centres[ball], skin.posed[capsule]
    radii = balls.cap_radii[capsule]
    t = place_on_axis(p, ends, radii)
    square = 0.0
    for i in range(3):
        q[i] = (1.0 - t) * ends[0, i] + t * ends[1, i]
        n[i] = p[i] - q[i]
        square += n[i] * n[i]
    distance = np.sqrt(square)
    for i in range(3):
        n[i] /= max(distance, LEAST)
    return float(distance - (1.0 - t) * radii[0] - t * radii[1] - balls.radii[ball] - balls.spare[ball, capsule])
