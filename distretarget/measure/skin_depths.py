"""How deep points of hands and forearms are inside the other parts of a body, or how far off these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.quaternions import turned
from distretarget.numerics.vectors import F1, F2, F3, I1, I2, I3, Array
from distretarget.skin.capsules import SEGMENTS

LIMBS = ("left hand", "right hand", "left forearm", "right forearm")


class Patches(NamedTuple):
    """Points of one limb that one joint moves most, in patches of a few neighbours."""

    limbs: I1  # (limbs + 1,), the first patch of each; the last is their end
    patches: I2  # (patches + 1, 2), joint and first point of each; the last is their end
    balls: F2  # (patches, 4), centre relative to the joint, and radius [file units]
    joints: I2  # (points, influences), as in `SkinPoints`, but in this order
    bound: F3  # (points, influences, 4), their offsets and weights
    counts: F1  # (points,)


class Clusters(NamedTuple):
    """Capsules in groups of one joint and segment, and these in clusters of a few neighbours, each within a ball."""

    groups: I2  # (groups + 1, 3), the joint and the segment of each, and its first cluster; the last is their end
    first: I1  # (clusters + 1,), the first capsule of each; the last is their end
    balls: F2  # (groups + clusters, 4), centre relative to the joint, and radius [file units]
    # (capsules, 10), where the axis begins relative to the joint, its direction and its length, the radius where it
    # begins, the change of the radius along it, and how far along it, over a point's distance to the axis, the nearest
    # ball is off the point's foot
    capsules: F2


def find_depths(
    patches: Patches, clusters: Clusters, posed: tuple[Array, Array], reach: Array, grazing: float = 0.0
) -> tuple[Array, Array]:
    """Return how deep the deepest point of each limb is inside each segment, (frames, limbs, segments), negative where
    it is that far off, and minus the reach where that is farther [file units]; and the number of vertices, (frames,),
    that the points stand for that are inside any segment, deeper than `grazing`.

    `posed` are the positions and world rotations of the joints, (frames, joints, 3 and 4); `reach`, (frames or 1,
    limbs, segments), is how far from a segment to look [file units], negative infinity for not at all.
    """
    depths = np.array(np.broadcast_to(-reach, (len(posed[0]), len(LIMBS), len(SEGMENTS))), order="C")
    inside, near = np.zeros(len(depths)), np.empty((4, len(clusters.balls)), np.intp)
    placed, placed_patches = np.empty((len(clusters.balls), 4)), np.empty((len(patches.balls) + 2, 4))
    last = np.full((len(LIMBS), len(SEGMENTS), 3), -1, np.intp)
    x, q = map(np.ascontiguousarray, posed)
    _find(x, q, patches, clusters, grazing, near, placed, placed_patches, last, depths, inside)
    return np.where(depths == np.inf, -np.inf, depths), inside


@inlined()
def _placed(x, q, v):  # type: ignore[no-untyped-def]
    """The place of v relative to a joint at x with the rotation q."""
    a, b, c = turned(q[0], q[1], q[2], q[3], v[0], v[1], v[2])
    return x[0] + a, x[1] + b, x[2] + c


@inlined()
def _relative(x, q, a, b, c):  # type: ignore[no-untyped-def]
    """The place a b c relative to a joint at x with the rotation q."""
    return turned(-q[0], -q[1], -q[2], q[3], a - x[0], b - x[1], c - x[2])


@inlined()
def _posed(x, q, joints, bound):  # type: ignore[no-untyped-def]
    """The place of a point bound to joints."""
    a = b = c = 0.0
    for n in range(len(joints)):
        share = bound[n, 3]
        if share > 0.0:
            i, j, k = _placed(x[joints[n]], q[joints[n]], bound[n])
            a, b, c = a + share * i, b + share * j, c + share * k
    return a, b, c


@inlined()
def _depth(capsules, first, end, deepest, i, j, k):  # type: ignore[no-untyped-def]
    """How deep the point i j k is in some capsules, if deeper than `deepest`; else this."""
    for m in range(first, end):
        e = capsules[m]
        u, v, w = i - e[0], j - e[1], k - e[2]
        squared, radius = u * u + v * v + w * w, e[7]
        if e[6] > 0.0:
            along = u * e[3] + v * e[4] + w * e[5]
            off = max(squared - along * along, 0.0)
            foot = min(max(along + e[9] * np.sqrt(off), 0.0), e[6])
            squared, radius = off + (along - foot) ** 2, radius + e[8] * foot
        room = radius - deepest
        if room > 0.0 and squared < room * room:
            deepest = radius - np.sqrt(squared)
    return deepest


@inlined()
def _apart(ball, other):  # type: ignore[no-untyped-def]
    """The squared distance of the centres of two balls."""
    a, b, c = ball[0] - other[0], ball[1] - other[1], ball[2] - other[2]
    return a * a + b * b + c * c


@inlined()
def _set(ball, x, q, v):  # type: ignore[no-untyped-def]
    """Write the place of the ball v on a joint at x with the rotation q."""
    ball[0], ball[1], ball[2] = _placed(x, q, v)
    ball[3] = v[3]


@inlined()
def _meet(ball, other, reach):  # type: ignore[no-untyped-def]
    """Whether two balls are within reach of each other."""
    limit = ball[3] + other[3] + reach
    return limit > 0.0 and _apart(ball, other) < limit * limit


@inlined()
def _reach(deepest):  # type: ignore[no-untyped-def]
    """How far to look where the deepest point found so far is this deep; all points inside are counted."""
    return 0.0 if 0.0 < deepest < np.inf else -deepest


@inlined()
def _enclose(ball, balls, first, end):  # type: ignore[no-untyped-def]
    """Write a ball around other balls."""
    for i in range(4):
        ball[i] = 0.0
    for n in range(first, end):
        for i in range(3):
            ball[i] += balls[n, i] / (end - first)
    for n in range(first, end):
        ball[3] = max(ball[3], np.sqrt(_apart(ball, balls[n])) + balls[n, 3])


@compiled()
def _find(
    positions: F3,
    rotations: F3,
    skin: Patches,
    body: Clusters,
    grazing: float,
    near: Out[I2],
    placed: Out[F2],
    placed_patches: Out[F2],
    last: Out[I3],
    depths: Out[F3],
    inside: Out[F1],
) -> None:
    """Write depths and counts of vertices inside; `near`, (4, balls), `placed`, (balls, 4), and `placed_patches`,
    (patches + 2, 4), are scratch: the near groups, and the near clusters and their groups; and balls in the world.
    `last`, (limbs, segments, 3), begins as -1: the point, cluster and group that were deepest in the frame before, with
    which the search begins, as all that is farther off need not be looked at.
    """
    groups, first, balls, capsules = body.groups, body.first, body.balls, body.capsules
    limbs, patches = skin.limbs, skin.patches
    all_groups, all_patches = len(groups) - 1, len(patches) - 1
    place, around = placed_patches[all_patches], placed_patches[all_patches + 1]
    for frame in range(len(positions)):
        x, q = positions[frame], rotations[frame]
        for patch in range(all_patches):
            joint = patches[patch, 0]
            _set(placed_patches[patch], x[joint], q[joint], skin.balls[patch])
        for group in range(all_groups):
            joint = groups[group, 0]
            _set(placed[group], x[joint], q[joint], balls[group])
            near[2, group] = 0  # its clusters are not placed yet
        for limb in range(len(limbs) - 1):
            near_groups, deepest_of = 0, depths[frame, limb]
            for segment in range(len(deepest_of)):
                point, cluster, group = last[limb, segment, 0], last[limb, segment, 1], last[limb, segment, 2]
                if point >= 0 and deepest_of[segment] < 0.0:
                    a, b, c = _posed(x, q, skin.joints[point], skin.bound[point])
                    i, j, k = _relative(x[groups[group, 0]], q[groups[group, 0]], a, b, c)
                    deepest = _depth(capsules, first[cluster], first[cluster + 1], deepest_of[segment], i, j, k)
                    deepest_of[segment] = min(deepest, 0.0)
            _enclose(around, placed_patches, limbs[limb], limbs[limb + 1])
            for group in range(all_groups):
                if not _meet(placed[group], around, _reach(deepest_of[groups[group, 1]])):
                    continue
                near[0, near_groups] = group
                near_groups += 1
                if near[2, group] == 0:
                    near[2, group], joint = 1, groups[group, 0]
                    for ball in range(all_groups + groups[group, 2], all_groups + groups[group + 1, 2]):
                        _set(placed[ball], x[joint], q[joint], balls[ball])
            for patch in range(limbs[limb], limbs[limb + 1] if near_groups else limbs[limb]):
                found = 0  # near clusters
                for n in range(near_groups):
                    group, ball = near[0, n], placed_patches[patch]
                    reach = _reach(deepest_of[groups[group, 1]])
                    if not _meet(placed[group], ball, reach):
                        continue
                    joint, limit = groups[group, 0], -reach - ball[3]
                    i, j, k = _relative(x[joint], q[joint], ball[0], ball[1], ball[2])
                    for cluster in range(groups[group, 2], groups[group + 1, 2]):
                        if not _meet(placed[all_groups + cluster], ball, reach):
                            continue
                        if _depth(capsules, first[cluster], first[cluster + 1], limit, i, j, k) > limit:
                            near[1, found], near[3, found] = cluster, group
                            found += 1
                if found == 0:
                    continue
                for point in range(patches[patch, 1], patches[patch + 1, 1]):
                    a, b, c = _posed(x, q, skin.joints[point], skin.bound[point])
                    place[0], place[1], place[2] = a, b, c
                    is_inside = False
                    for n in range(found):
                        cluster, group = near[1, n], near[3, n]
                        joint, segment, ball = groups[group, 0], groups[group, 1], all_groups + cluster
                        deepest = deepest_of[segment]
                        if not is_inside and deepest > 0.0:
                            deepest = 0.0
                        room = balls[ball, 3] - deepest
                        if room <= 0.0 or _apart(placed[ball], place) >= room * room:
                            continue
                        i, j, k = _relative(x[joint], q[joint], a, b, c)
                        deepest = _depth(capsules, first[cluster], first[cluster + 1], deepest, i, j, k)
                        if deepest > grazing:
                            is_inside = True
                        if deepest > deepest_of[segment]:
                            deepest_of[segment] = deepest
                            last[limb, segment, 0], last[limb, segment, 1], last[limb, segment, 2] = (
                                point,
                                cluster,
                                group,
                            )
                    if is_inside:
                        inside[frame] += skin.counts[point]
