"""Performers and props together: what touches between them, and the sweeps that keep it together."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.resting import REST_HEIGHT
from distretarget.ik.poses import Mapper, Poses
from distretarget.ik.springs import Springs, joined, no_springs
from distretarget.measure.scene_gaps import TOUCH_DISTANCE
from distretarget.motion import Motion
from distretarget.numerics.kinematics import lowest_heights
from distretarget.numerics.vectors import lengths, spread_out
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.supports import Supports
from distretarget.pipeline.performer import Performer
from distretarget.scene.prop_contacts import (
    LEVER,
    Grasp,
    Placement,
    Touched,
    find_touched,
    held_placement,
    nearest,
    turn_of,
)
from distretarget.scene.touch import Points, Touching, find_touching, gap_errors, touching_springs, with_shortfall

Array = NDArray[np.float64]
Joints = NDArray[np.intp]
Grips = Mapping[int, tuple[int, ...]]
"""The joints of targets that hold a prop, by the numbers of their performers."""

REGION_POINTS = 9  # most joints of a region that may touch others
MOST_SWEEPS = 2  # all performers are solved at most so many times
SETTLED = 0.018  # gaps between what touches are less than this off, on average [leg lengths]


@dataclass(frozen=True, eq=False)
class PlacedProp:
    """A prop in the world of the performers.

    Attributes:
        points: (frames, points, 3), where it is in the source [source file units].
        free: where it is while nobody holds it.
        grips: what holds it.
    """

    points: Array
    free: Placement
    grips: Grips


@dataclass(frozen=True, eq=False)
class Together:
    """Performers and props, and what touches between them.

    Attributes:
        performers: as they are solved, one by one.
        props: what else is in their world.
        touching: for each two performers, by their numbers, their joints that come near each other.
        touched: for each performer and prop, by their numbers, the joints that come near it.
    """

    performers: tuple[Performer, ...]
    props: tuple[PlacedProp, ...]
    touching: Mapping[tuple[int, int], Touching]
    touched: Mapping[tuple[int, int], Touched]

    def placement(self, prop: int, now: Sequence[Motion]) -> Placement:
        """Where a prop is while the performers are where they are now."""
        placed = self.props[prop]
        holds = [hold for number in placed.grips for hold in self._holds(number, prop, now[number])]
        return held_placement(placed.free, holds) if holds else placed.free

    def _holds(self, number: int, prop: int, now: Motion) -> Iterator[Grasp]:
        """How a performer holds a prop."""
        one, touched = self.performers[number], self.touched[number, prop]
        copied, turned = one.clip.copy.world_rotations, now.world_rotations
        for column in np.flatnonzero(np.isin(touched.joints, self.props[prop].grips[number])):
            joint = touched.joints[column]
            turn = turn_of(copied[:, joint], turned[:, joint])
            place = now.positions[:, joint]
            yield Grasp(touched.f[:, column], touched.source[:, column], place, turn, LEVER * one.clip.unit)

    def springs(self, now: Sequence[Motion]) -> list[Springs]:
        """The springs that draw each performer to the others, and to props."""
        springs = [no_springs(len(one.clip)) for one in self.performers]
        copies = [one.clip.copy_on_path(np.arange(len(one.clip.skeleton))) for one in self.performers]
        units = [one.clip.unit for one in self.performers]
        for (i, j), pairs in self.touching.items():
            both = (copies[i], copies[j]), (now[i].positions, now[j].positions), (units[i], units[j])
            for number, more in zip((i, j), touching_springs(pairs, *both), strict=True):
                springs[number] = joined(springs[number], more)
        places = [self.placement(prop, now) for prop in range(len(self.props))]
        for (i, prop), touched in self.touched.items():
            springs[i] = joined(springs[i], touched.springs(places[prop], copies[i], units[i]))
        return springs

    def off(self, now: Sequence[Motion]) -> float:
        """How far the gaps between what touches are off, on average [leg lengths]; 0 where nothing touches."""
        off = [np.zeros(0)]
        for (i, j), pairs in self.touching.items():
            leg = (self.performers[i].clip.unit + self.performers[j].clip.unit) / 4.0
            near = lengths(pairs.vectors) < TOUCH_DISTANCE * leg
            off.append(gap_errors(pairs, now[i].positions, now[j].positions)[near] / leg)
        for (i, prop), touched in self.touched.items():
            placement, leg = self.placement(prop, now), self.performers[i].clip.unit / 2.0
            gaps = nearest(now[i].positions[:, touched.joints], placement(self.props[prop].points))
            wanted = placement.scale * touched.gaps
            off.append(np.abs(gaps - wanted)[wanted < TOUCH_DISTANCE * leg] / leg)
        values = np.concatenate(off)
        return float(values.mean()) if len(values) else 0.0


def brought_together(performers: Sequence[Performer], props: Sequence[PlacedProp]) -> Together:
    """Find what touches, and let what rests on another performer or on a prop rest there."""
    touching = {(i, j): _touching(performers[i], performers[j]) for i, j in combinations(range(len(performers)), 2)}
    touched = {(i, k): _touched(one, prop, i) for i, one in enumerate(performers) for k, prop in enumerate(props)}
    placed = []
    for number, one in enumerate(performers):
        of_others = [
            (pairs.frames, pairs.joints[both.index(number)], pairs.f)
            for both, pairs in touching.items()
            if number in both
        ]
        supports = one.supports
        for k, prop in enumerate(props):
            near = touched[number, k]
            if prop.grips:
                frames, columns = np.nonzero(near.f)
                of_others.append((frames, near.joints[columns], near.f[frames, columns]))
            else:
                supports = _resting_on(supports, near, prop.free)
        placed.append(replace(one, supports=_yielding(one, supports, of_others)))
    return Together(tuple(placed), tuple(props), touching, touched)


@dataclass(frozen=True, eq=False)
class Solved:
    """Performers and props after the last sweep.

    Attributes:
        poses: one for each performer.
        placements: one for each prop.
        sweeps: how many times all performers were solved.
        off: how far what touches is off, on average [leg lengths].
    """

    poses: list[Poses]
    placements: list[Placement]
    sweeps: int
    off: float


def solve_together(together: Together, mapper: Mapper, progress: Callable[[int], object]) -> Solved:
    """Solve all performers, each by itself, until what touches is as near as it should, at most `MOST_SWEEPS` times."""
    performers = together.performers
    now = [_on_path(one) for one in performers]
    springs = together.springs(now)
    for sweep in range(1, MOST_SWEEPS + 1):
        progress(sweep)
        poses = [_solve(one, more, mapper) for one, more in zip(performers, springs, strict=True)]
        now = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
        off = together.off(now)
        if off < SETTLED or sweep == MOST_SWEEPS:
            break
        springs = [
            with_shortfall(more, before, at.positions / one.clip.unit, one.match.matching.regions.of_joint)
            for one, more, before, at in zip(performers, together.springs(now), springs, now, strict=True)
        ]
    return Solved(poses, [together.placement(prop, now) for prop in range(len(together.props))], sweep, off)


def _touching(one: Performer, other: Performer) -> Touching:
    scale = RootScale(one.clip.scale.level, (one.clip.scale.height + other.clip.scale.height) / 2.0)
    up = one.clip.up
    return find_touching(_points(one), _points(other), scale, up, one.clip.frame_time, one.settings)


def _touched(one: Performer, prop: PlacedProp, number: int) -> Touched:
    points, matching, supports = _points(one), one.match.matching, one.supports
    regions = matching.regions.of_joint[points.joints]
    free = np.ones((len(one.clip), len(points.joints)))
    for support, region in enumerate(supports.regions[: supports.feet]):
        free[:, regions == region] *= 1.0 - supports.weights[:, support, None]
    leg = matching.leg_lengths[0] or matching.source.unit
    touched = find_touched(points, regions, prop.points, leg, free, one.clip.frame_time, one.settings)
    holders = prop.grips.get(number, ())
    alone = sum(map(len, prop.grips.values())) == 1
    held = np.isin(matching.regions.of_joint[touched.joints], matching.regions.of_joint[[*holders]])
    return touched.without(held if alone else held & ~np.isin(touched.joints, holders))


def _points(one: Performer) -> Points:
    """The joints of a performer's body that may touch, a few of each region: fingers follow the hand."""
    matching, distances = one.match.matching, one.clip.distances
    tau = matching.source.skeleton.path_lengths
    regions = matching.regions.of_joint[distances.targets]
    kept: list[int] = []
    for region in range(len(matching.regions.names)):
        points = np.flatnonzero(regions == region)
        sources = distances.sources[points]
        kept += points[spread_out(tau[np.ix_(sources, sources)], REGION_POINTS)].tolist() if len(points) else []
    sources = distances.sources[kept]
    joints = distances.targets[kept]
    return Points(
        joints=joints,
        source=one.clip.source.positions[:, sources],
        reach=tau[matching.drivers[matching.pelvis]][sources],
        target_reach=matching.target.skeleton.path_lengths[matching.pelvis][joints],
        shots=one.clip.shots,
    )


def _resting_on(supports: Supports, near: Touched, free: Placement) -> Supports:
    """The same, but what rests, apart from feet, and touches a prop that stands has its place on the prop."""
    places, on_prop = np.array(supports.places), free(near.source)
    for support in range(supports.feet, len(supports.joints)):
        for column in np.flatnonzero(near.joints == supports.joints[support]):
            places[:, support] += near.f[:, column, None] * (on_prop[:, column] - places[:, support])
    return replace(supports, places=places)


def _yielding(one: Performer, supports: Supports, touches: Sequence[tuple[Joints, Joints, Array]]) -> Supports:
    """The same, but what stands still off the floor and touches another performer, or a prop that somebody holds,
    rests on nothing: it goes where the two meet. `touches` are frames, joints and activations.
    """
    matching = one.match.matching
    up, reach = matching.source.up_vector, REST_HEIGHT * matching.leg_lengths[1]
    floor = one.clip.scale.height * lowest_heights(one.clip.source.positions, up)[:, None]
    regions = matching.regions.of_joint
    touched = np.zeros((len(one.clip), len(matching.regions.names)))
    for frames, joints, f in touches:
        np.maximum.at(touched, (frames, regions[joints]), f)
    yields = np.where(supports.places @ up - floor > 2.0 * reach, touched[:, supports.regions], 0.0)
    yields[:, : supports.feet] = 0.0
    return replace(supports, weights=supports.weights * (1.0 - yields))


def _solve(one: Performer, springs: Springs, mapper: Mapper) -> Poses:
    return solve_contact(one.clip, replace(one.supports, scene_springs=springs), one.settings, mapper=mapper)


def _on_path(one: Performer) -> Motion:
    """The rotation copy whose root keeps to its path."""
    return replace(one.clip.copy, root_positions=one.clip.root)
