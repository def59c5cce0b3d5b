"""Depths of the skin of parts of a body in its other parts, or distances from these. Compiled."""

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
from distretarget.numerics.vectors import F1, F2, F3, I1, I2, I3, Array, Numbers
from distretarget.skin.capsules import SEGMENTS

# (segments,), the place of each: head; trunk with thighs, whose border differs between bodies; legs; either arm
PLACE_OF = np.array(
    [
        ("head" in name or "neck" in name)
        + 2 * ("shin" in name or "foot" in name)
        + (3 + name.startswith("right")) * ("arm" in name or "hand" in name)
        for name in SEGMENTS
    ]
)


PARTS = SEGMENTS[: SEGMENTS.index("head") + 1]  # whose depths are measured: arms, legs and head
LIMBS = PARTS[:4]  # hands and forearms


class Patches(NamedTuple):
    """Sample points of the skin, in patches of a few neighbours of one part that one joint moves most. Behind the
    samples are the other vertices of the mesh, among which the search climbs from the deepest samples.
    """

    parts: I1  # (parts + 1,), the first patch of each part; last the end
    patches: I2  # (patches + 1, 2), joint and first sample of each patch; last the end
    balls: F2  # (patches, 4), bounding balls: centre relative to the joint, and radius [file units]
    joints: I2  # (points, influences), as in `SkinPoints`, but in this order
    bound: F3  # (points, influences, 4), offsets and weights of the points
    counts: F1  # (samples,), the number of vertices nearest to each sample
    first: I1  # (points + 1,), where the neighbours of each point begin; last the end
    neighbours: I1  # the points at the other ends of its edges


class Search(NamedTuple):
    """The state of the search for the deepest points of a part."""

    of_place: I1  # (segments,), the place of each segment: its deepest point in any segment of one place counts
    threshold: F1  # (segments,), the depth above which points are still searched for
    near: I2  # (groups, 2), the groups that are near, and the vertices by which points are brought back to them
    visited: F2  # (groups, 4), the last place whose depth in the group was measured, and a bound of its depth
    around: F1  # (4,), a bounding ball of the part
    balls: F2  # (patches, 4), bounding balls of the patches
    at: F1  # (4,), a point
    # (parts, segments, 2), the point and the group that are deepest, -1 for none. The search of a frame begins with
    # those of the frame before, so that the threshold is high from the start.
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
) -> tuple[Array, Array]:
    """Return the depths of the deepest points of parts in segments, (frames, parts, segments), negative outside, and
    minus the reach beyond that [file units]; and the number of vertices of hands and forearms that are inside,
    (frames,). Of the segments of a place, `PLACE_OF`, only the nearest is searched, and those that the part is inside.

    Args:
        patches: points of the parts.
        solids: the segments.
        posed: positions and world rotations of the joints, (frames, joints, 3 and 4).
        reach: the largest distance from a segment to search, (frames or 1, parts, segments) [file units]; negative
            infinity for no search.
        grazing: vertices are inside if they are deeper than this [file units].
    """
    x, q = map(np.ascontiguousarray, posed)
    shape = len(x), len(patches.parts) - 1, len(SEGMENTS)
    depths = np.array(np.broadcast_to(-reach, shape), order="C")
    inside, room = np.zeros(len(depths)), (Posed.of(x.shape[1], solids), Search.of(patches, solids, PLACE_OF))
    _find(x, q, patches, solids, grazing, *room, depths, inside)
    return np.where(depths == np.inf, -np.inf, depths), inside


@compiled()
def _find(
    positions: F3,
    rotations: F3,
    skin: Patches,
    body: Solids,
    grazing: float,
    posed: Posed,
    search: Search,
    depths: Out[F3],
    inside: Out[F1],
) -> None:
    """Write depths and counts of vertices inside."""
    for frame in range(len(positions)):
        pose(posed, body, positions[frame], rotations[frame])
        for patch in range(len(search.balls)):
            set_ball(posed, skin.patches[patch, 0], skin.balls[patch], search.balls[patch])
        for group in range(len(search.visited)):
            search.visited[group, 3] = np.inf
        for part in range(len(skin.parts) - 1):
            found, counted = depths[frame, part], part < len(LIMBS)
            _start_from_last(part, counted, skin, body, posed, search, found)
            near = _near_part(part, counted, skin, body, posed, search)
            for patch in range(skin.parts[part], skin.parts[part + 1] if near else skin.parts[part]):
                close, farthest = _near_patch(search.balls[patch], near, counted, body, posed, search)
                for point in range(skin.patches[patch, 1], skin.patches[patch + 1, 1] if close else 0):
                    deep = _measure_point(part, point, close, farthest, skin, body, posed, search, found)
                    if counted and deep > grazing:
                        inside[frame] += skin.counts[point]
            _refine(part, skin, body, posed, search, found)


@inlined()
def _start_from_last(part, counted, skin, body, posed, search, depths):  # type: ignore[no-untyped-def]
    """Measure the points that were deepest in the frame before."""
    for segment in range(len(depths)):
        search.threshold[segment] = depths[segment]
    for segment in range(len(depths)):
        point, group = search.last[part, segment, 0], search.last[part, segment, 1]
        search.last[part, segment, 0] = -1
        if point < 0 or (search.threshold[segment] >= 0.0 and counted):
            continue
        _set_point(point, skin, posed, search.at)
        if _meet(posed.balls[group], search.at, _reach(search.threshold[segment], counted)):
            deep, on, _i, _j, _k, _v, _left = depth_of(posed, body, group, -1, search.at[0], search.at[1], search.at[2])
            if on == segment and deep > search.threshold[segment]:
                # 0 if inside, so that the patches are searched, too, and all points inside are counted
                depths[segment] = min(deep, 0.0) if counted else deep
                search.last[part, segment, 0] = point
                _raise(search, segment, depths[segment])


@inlined()
def _near_part(part, counted, skin, body, posed, search):  # type: ignore[no-untyped-def]
    """Write the groups whose balls are within reach of a part, and return their number."""
    _enclose(search.around, search.balls, skin.parts[part], skin.parts[part + 1])
    near = 0
    for group in range(len(posed.balls)):
        if _meet(posed.balls[group], search.around, _reach(search.threshold[body.groups[group, 1]], counted)):
            search.near[near, 0] = group
            near += 1
    return near


@inlined()
def _near_patch(ball, near, counted, body, posed, search):  # type: ignore[no-untyped-def]
    """Move the groups that may be within reach of a patch to the front of the near ones, each with its nearest vertex;
    return their number, and the largest reach.
    """
    close, farthest = 0, -np.inf
    for n in range(near):
        group = search.near[n, 0]
        visited, reach = search.visited[group], _reach(search.threshold[body.groups[group, 1]], counted)
        if (
            not _meet(posed.balls[group], ball, reach)
            or _is_beyond(visited, ball, reach)
            or not _meets_box(posed, body.groups[group, 0], body.boxes[group], ball, reach)
        ):
            continue
        deep, _on, _i, _j, _k, by, left = depth_of(posed, body, group, -1, ball[0], ball[1], ball[2])
        visited[0], visited[1], visited[2] = ball[0], ball[1], ball[2]
        visited[3] = deep + 2.0 * left if left < np.inf else np.inf
        if deep + ball[3] > -reach or deep == -np.inf:
            is_known, farthest = False, max(farthest, reach)
            for other in range(close):  # groups with the same nearest vertex are measured once
                is_known = is_known or (by >= 0 and search.near[other, 1] == by)
            if not is_known:
                search.near[n, 0], search.near[close, 0], search.near[close, 1] = search.near[close, 0], group, by
                close += 1
    return close, farthest


@inlined()
def _measure_point(part, point, close, farthest, skin, body, posed, search, depths):  # type: ignore[no-untyped-def]
    """Measure the depths of a point in the first `close` near groups, store those that are the largest so far, and
    return the largest.
    """
    _set_point(point, skin, posed, search.at)
    deepest = -np.inf
    for n in range(close):
        group, by = search.near[n, 0], search.near[n, 1]
        if _is_beyond(search.visited[group], search.at, farthest):
            continue
        deep, on, _i, _j, _k, _v, _left = depth_of(posed, body, group, by, search.at[0], search.at[1], search.at[2])
        if on < 0 or search.threshold[on] == np.inf:
            continue
        deepest = max(deepest, deep)
        if deep > depths[on] and deep > search.threshold[on]:
            depths[on] = deep
            search.last[part, on, 0], search.last[part, on, 1] = point, group
            _raise(search, on, deep)
    return deepest


@inlined()
def _refine(part, skin, body, posed, search, depths):  # type: ignore[no-untyped-def]
    """Climb from the deepest points to deeper neighbours, with depths by triangles."""
    for segment in range(len(depths)):
        point, group, deep = search.last[part, segment, 0], search.last[part, segment, 1], depths[segment]
        if point >= 0 and deep >= search.threshold[segment] and body.groups[group, 3] >= 0:
            search.last[part, segment, 0] = _climb(segment, point, group, skin, body, posed, search, depths)


@inlined()
def _climb(segment, point, group, skin, body, posed, search, depths):  # type: ignore[no-untyped-def]
    """The point that is reached from `point` by going to neighbours that are deeper in a segment, or in others of its
    place. Writes its depth, by triangles.
    """
    at, before = search.at, -1
    _set_point(point, skin, posed, at)
    _deep, _on, i, j, k, _v, _left = depth_of(posed, body, group, -1, at[0], at[1], at[2])
    depths[segment] = depth_by_triangles(posed, body, group, depths[segment], (i, j, k), at)
    while before != point:
        before = point
        for n in range(skin.first[before], skin.first[before + 1]):
            other = skin.neighbours[n]
            _set_point(other, skin, posed, at)
            deep, on, i, j, k, _v, _left = depth_of(posed, body, group, -1, at[0], at[1], at[2])
            if on >= 0 and search.of_place[on] == search.of_place[segment]:
                deep = depth_by_triangles(posed, body, group, deep, (i, j, k), at)
                if deep > depths[segment]:
                    point, depths[segment] = other, deep
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
def _is_beyond(visited, ball, reach):  # type: ignore[no-untyped-def]
    """Whether a ball is beyond the reach of a group, by the depth of a `visited` place: depths change no faster than
    places do.
    """
    room = -visited[3] - ball[3] - reach
    return room > 0.0 and apart(visited, ball) < room * room


@inlined()
def _reach(deepest, counted):  # type: ignore[no-untyped-def]
    """The distance to search if the deepest point so far is this deep; 0 at least to count all points inside."""
    return 0.0 if counted and 0.0 < deepest < np.inf else -deepest


@inlined()
def _raise(search, segment, deep):  # type: ignore[no-untyped-def]
    """Raise the thresholds after a point that is `deep` in a segment; those of other segments of its place to 0 at
    most, so that all points inside these are found.
    """
    for other in range(len(search.threshold)):
        if search.of_place[segment] == search.of_place[other]:
            search.threshold[other] = max(search.threshold[other], deep if other == segment else min(deep, 0.0))


@inlined()
def _enclose(ball, balls, first, end):  # type: ignore[no-untyped-def]
    """Write a bounding ball of other balls."""
    for i in range(4):
        ball[i] = 0.0
    for n in range(first, end):
        for i in range(3):
            ball[i] += balls[n, i] / (end - first)
    for n in range(first, end):
        ball[3] = max(ball[3], np.sqrt(apart(ball, balls[n])) + balls[n, 3])
