"""How deep the skin of the parts of a body is inside its other parts, or how far off these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.measure.solid_depths import (
    Posed,
    Solids,
    apart,
    depth_by_triangles,
    depth_of,
    placed,
    pose,
    relative,
    set_ball,
)
from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.vectors import B3, F1, F2, F3, F4, I1, I2, I3, Array, Flags, Numbers
from distretarget.skin.capsules import SEGMENTS

# (segments,), the place of each: the head, the trunk with the thighs, where bodies differ, the legs, and both arms
PLACE_OF = np.array(
    [
        ("head" in name or "neck" in name)
        + 2 * ("shin" in name or "foot" in name)
        + (3 + name.startswith("right")) * ("arm" in name or "hand" in name)
        for name in SEGMENTS
    ]
)


PARTS = SEGMENTS[: SEGMENTS.index("head") + 1]  # whose skin may be inside others: arms, legs and head
LIMBS = PARTS[:4]  # hands and forearms


class Patches(NamedTuple):
    """Points of one part that one joint moves most, in patches of a few neighbours; behind them the other vertices of
    the mesh, which are looked at around the deepest of these points.
    """

    parts: I1  # (parts + 1,), the first patch of each; the last is their end
    patches: I2  # (patches + 1, 2), joint and first point of each; the last is their end
    balls: F2  # (patches, 4), centre relative to the joint, and radius [file units]
    joints: I2  # (points and others, influences), as in `SkinPoints`, but in this order
    bound: F3  # (points and others, influences, 4), their offsets and weights
    counts: F1  # (points,), the number of vertices that each stands for, those nearest to it
    first: I1  # (points and others + 1,), the first neighbour of each; the last is their end
    neighbours: I1  # those at the other ends of its edges


class Search(NamedTuple):
    """What is known of the part that is looked at, and scratch."""

    of_place: I1  # (segments,), the place of each: the deepest point in any of one place counts
    least: F1  # (segments,), how deep points have to be, to be looked at
    near: I2  # (groups, 2), the groups that are near, and the vertices by which points are brought back to them
    looked: F2  # (groups, 4), where each was last looked at, and how deep that may be
    around: F1  # (4,), a ball around the part
    balls: F2  # (patches, 4), around the patches
    at: F1  # (4,), a point
    # (parts, segments, 2), the point and the group that were deepest in the frame before, with which the search begins,
    # as all that is farther off need not be looked at; -1 for none
    last: I3

    @classmethod
    def of(cls, patches: Patches, body: Solids, of_place: Numbers) -> Search:
        """Room for the parts of a body; `of_place`, (segments,), is the place of each segment."""
        parts, groups, segments = len(patches.parts) - 1, len(body.balls), len(of_place)
        near, last = np.empty((groups, 2), np.intp), np.full((parts, segments, 2), -1, np.intp)
        balls = np.empty((len(patches.balls), 4))
        return cls(of_place, np.empty(segments), near, np.empty((groups, 4)), np.zeros(4), balls, np.zeros(4), last)


def find_depths(
    patches: Patches,
    solids: Solids,
    posed: tuple[Array, Array],
    reach: Array,
    grazing: float = 0.0,
    alone: Flags | None = None,
) -> tuple[Array, Array, Array]:
    """Return how deep the deepest point of each part is inside each segment, (frames, parts, segments), negative where
    it is that far off, and minus the reach where that is farther [file units]; where this point is in the bind pose of
    the segment, (frames, parts, segments, 3), nan where none was found; and the number of vertices, (frames,), that the
    points of hands and forearms stand for that are inside any segment, deeper than `grazing`.

    Of the segments of one place, `PLACE_OF`, a part is looked for where it is nearest or inside; in segments that are
    `alone`, (frames, parts, segments), wherever it is. `posed` are the positions and world rotations of the joints,
    (frames, joints, 3 and 4); `reach`, (frames or 1, parts, segments), is how far from a segment to look [file units],
    negative infinity for not at all.
    """
    x, q = map(np.ascontiguousarray, posed)
    shape = len(x), len(patches.parts) - 1, len(SEGMENTS)
    depths = np.array(np.broadcast_to(-reach, shape), order="C")
    inside, places = np.zeros(len(depths)), np.full((*shape, 3), np.nan)
    alone = np.zeros(shape, bool) if alone is None else alone
    room = Posed.of(x.shape[1], solids), Search.of(patches, solids, PLACE_OF)
    _find(x, q, patches, solids, grazing, alone, *room, depths, places, inside)
    return np.where(depths == np.inf, -np.inf, depths), places, inside


@compiled()
def _find(
    positions: F3,
    rotations: F3,
    skin: Patches,
    body: Solids,
    grazing: float,
    alone: B3,
    posed: Posed,
    search: Search,
    depths: Out[F3],
    places: Out[F4],
    inside: Out[F1],
) -> None:
    """Write depths, places and counts of vertices inside."""
    for frame in range(len(positions)):
        pose(posed, body, positions[frame], rotations[frame])
        for patch in range(len(search.balls)):
            set_ball(posed, skin.patches[patch, 0], skin.balls[patch], search.balls[patch])
        for group in range(len(search.looked)):
            search.looked[group, 3] = np.inf
        for part in range(len(skin.parts) - 1):
            found, counted = (depths[frame, part], places[frame, part], alone[frame, part]), part < len(LIMBS)
            _begin(part, counted, skin, body, posed, search, found)
            near = _find_near(part, counted, skin, body, posed, search)
            for patch in range(skin.parts[part], skin.parts[part + 1] if near else skin.parts[part]):
                there, farthest = _find_there(search.balls[patch], near, counted, body, posed, search)
                for point in range(skin.patches[patch, 1], skin.patches[patch + 1, 1] if there else 0):
                    deep = _look(part, point, there, farthest, skin, body, posed, search, found)
                    if counted and deep > grazing:
                        inside[frame] += skin.counts[point]
            _refine(part, skin, body, posed, search, found)


@inlined()
def _begin(part, counted, skin, body, posed, search, found):  # type: ignore[no-untyped-def]
    """Look at the points that were deepest in the frame before."""
    depths, places, alone = found
    for segment in range(len(depths)):
        search.least[segment] = depths[segment]
    for segment in range(len(depths)):
        point, group = search.last[part, segment, 0], search.last[part, segment, 1]
        if point < 0 or (search.least[segment] >= 0.0 and counted):
            continue
        _set_point(point, skin, posed, search.at)
        if _meet(posed.balls[group], search.at, _reach(search.least[segment], counted)):
            deep, on, i, j, k, _v, _left = depth_of(posed, body, group, -1, search.at[0], search.at[1], search.at[2])
            if on == segment and deep > search.least[segment]:
                # a point that is inside is counted when all are looked at
                depths[segment] = min(deep, 0.0) if counted else deep
                places[segment, 0], places[segment, 1], places[segment, 2] = i, j, k
                _raise(search, alone, segment, depths[segment])


@inlined()
def _find_near(part, counted, skin, body, posed, search):  # type: ignore[no-untyped-def]
    """Write the groups that a part may be near, and return how many."""
    _enclose(search.around, search.balls, skin.parts[part], skin.parts[part + 1])
    near = 0
    for group in range(len(posed.balls)):
        if _meet(posed.balls[group], search.around, _reach(search.least[body.groups[group, 1]], counted)):
            search.near[near, 0] = group
            near += 1
    return near


@inlined()
def _find_there(ball, near, counted, body, posed, search):  # type: ignore[no-untyped-def]
    """Bring the groups that a patch may be near to the front of the near ones, each with the vertex that is nearest;
    return how many, and how far to look.
    """
    there, farthest = 0, -np.inf
    for n in range(near):
        group = search.near[n, 0]
        looked, reach = search.looked[group], _reach(search.least[body.groups[group, 1]], counted)
        if (
            not _meet(posed.balls[group], ball, reach)
            or _is_beyond(looked, ball, reach)
            or not _meets_box(posed, body.groups[group, 0], body.boxes[group], ball, reach)
        ):
            continue
        deep, _on, _i, _j, _k, by, left = depth_of(posed, body, group, -1, ball[0], ball[1], ball[2])
        looked[0], looked[1], looked[2] = ball[0], ball[1], ball[2]
        looked[3] = deep + 2.0 * left if left < np.inf else np.inf
        if deep + ball[3] > -reach or deep == -np.inf:
            is_known, farthest = False, max(farthest, reach)
            for other in range(there):  # groups from which one comes to the same vertex are one
                is_known = is_known or (by >= 0 and search.near[other, 1] == by)
            if not is_known:
                search.near[n, 0], search.near[there, 0], search.near[there, 1] = search.near[there, 0], group, by
                there += 1
    return there, farthest


@inlined()
def _look(part, point, there, farthest, skin, body, posed, search, found):  # type: ignore[no-untyped-def]
    """Look how deep a point is in the groups that it may be near, note where it is the deepest, and return the largest
    of its depths.
    """
    depths, places, alone = found
    _set_point(point, skin, posed, search.at)
    deepest = -np.inf
    for n in range(there):
        group, by = search.near[n, 0], search.near[n, 1]
        if _is_beyond(search.looked[group], search.at, farthest):
            continue
        deep, on, i, j, k, _v, _left = depth_of(posed, body, group, by, search.at[0], search.at[1], search.at[2])
        if on < 0 or search.least[on] == np.inf:
            continue
        deepest = max(deepest, deep)
        if deep > depths[on] and deep > search.least[on]:
            depths[on] = deep
            places[on, 0], places[on, 1], places[on, 2] = i, j, k
            search.last[part, on, 0], search.last[part, on, 1] = point, group
            _raise(search, alone, on, deep)
    return deepest


@inlined()
def _refine(part, skin, body, posed, search, found):  # type: ignore[no-untyped-def]
    """Find the depth of the deepest points by triangles, and of deeper ones around them."""
    depths, places, _alone = found
    for segment in range(len(depths)):
        point, group, deep = search.last[part, segment, 0], search.last[part, segment, 1], depths[segment]
        is_found = point >= 0 and places[segment, 0] < np.inf and deep > -np.inf and deep >= search.least[segment]
        if is_found and body.groups[group, 3] >= 0:
            search.last[part, segment, 0] = _climb(segment, point, group, skin, body, posed, search, found)


@inlined()
def _climb(segment, point, group, skin, body, posed, search, found):  # type: ignore[no-untyped-def]
    """The point that is reached from one by way of neighbours that are deeper in a segment, or in those that are looked
    for together with it; writes how deep it is, by triangles, and its place in the bind pose.
    """
    depths, places, alone = found
    at, place, before = search.at, places[segment], -1
    _set_point(point, skin, posed, at)
    depths[segment] = depth_by_triangles(posed, body, group, depths[segment], place, at)
    while before != point:
        before = point
        for n in range(skin.first[before], skin.first[before + 1]):
            other = skin.neighbours[n]
            _set_point(other, skin, posed, at)
            deep, on, i, j, k, _v, _left = depth_of(posed, body, group, -1, at[0], at[1], at[2])
            if on >= 0 and _counts_for(search.of_place, alone, on, segment):
                deep = depth_by_triangles(posed, body, group, deep, (i, j, k), at)
                if deep > depths[segment]:
                    point, depths[segment] = other, deep
                    place[0], place[1], place[2] = i, j, k
    return point


@inlined()
def _set_point(point, skin, posed, at):  # type: ignore[no-untyped-def]
    """Write the place of a point of the skin."""
    at[0] = at[1] = at[2] = 0.0
    for n in range(skin.joints.shape[1]):
        share = skin.bound[point, n, 3]
        if share > 0.0:
            a, b, c = placed(posed, skin.joints[point, n], skin.bound[point, n])
            at[0], at[1], at[2] = at[0] + share * a, at[1] + share * b, at[2] + share * c


@inlined()
def _meet(ball, other, reach):  # type: ignore[no-untyped-def]
    """Whether two balls are within reach of each other."""
    limit = ball[3] + other[3] + reach
    return limit > 0.0 and apart(ball, other) < limit * limit


@inlined()
def _meets_box(posed, joint, box, ball, reach):  # type: ignore[no-untyped-def]
    """Whether a ball is within reach of a box on a joint."""
    i, j, k = relative(posed, joint, ball[0], ball[1], ball[2])
    u, v, w = max(box[0] - i, i - box[3], 0.0), max(box[1] - j, j - box[4], 0.0), max(box[2] - k, k - box[5], 0.0)
    limit = max(ball[3] + reach, 0.0)
    return u * u + v * v + w * w <= limit * limit


@inlined()
def _is_beyond(looked, ball, reach):  # type: ignore[no-untyped-def]
    """Whether a ball is farther off than the reach, since depths change no faster than places do; `looked` is a place
    and how deep it is.
    """
    room = -looked[3] - ball[3] - reach
    return room > 0.0 and apart(looked, ball) < room * room


@inlined()
def _reach(deepest, counted):  # type: ignore[no-untyped-def]
    """How far to look where the deepest point found so far is this deep, and all points inside are counted or not."""
    return 0.0 if counted and 0.0 < deepest < np.inf else -deepest


@inlined()
def _counts_for(of_place, alone, segment, other):  # type: ignore[no-untyped-def]
    """Whether a point in or near a segment is as good as one in or near another."""
    return segment == other or (of_place[segment] == of_place[other] and not alone[other])


@inlined()
def _raise(search, alone, segment, deep):  # type: ignore[no-untyped-def]
    """Raise how deep a point has to be, so that it need be looked for, after one that is so deep in a segment; in other
    segments all that are inside are looked for.
    """
    for other in range(len(search.least)):
        if _counts_for(search.of_place, alone, segment, other):
            search.least[other] = max(search.least[other], deep if other == segment else min(deep, 0.0))


@inlined()
def _enclose(ball, balls, first, end):  # type: ignore[no-untyped-def]
    """Write a ball around other balls."""
    for i in range(4):
        ball[i] = 0.0
    for n in range(first, end):
        for i in range(3):
            ball[i] += balls[n, i] / (end - first)
    for n in range(first, end):
        ball[3] = max(ball[3], np.sqrt(apart(ball, balls[n])) + balls[n, 3])
