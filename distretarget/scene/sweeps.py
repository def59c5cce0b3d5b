"""Solve a scene in sweeps: each performer by itself, drawn to the present places of the others and of props.

A body of finite stiffness stops short of the places that its springs draw it to. The next sweep draws it further by as
much, as in the method of multipliers (M. J. D. Powell, A method for nonlinear constraints in minimization problems,
1969). Each region of the body is drawn as a whole: a hand that holds a larger one cannot have all joints in their
places.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.resting import REST_HEIGHT
from distretarget.ik.poses import Mapper, Poses
from distretarget.ik.springs import Springs, joined, no_springs
from distretarget.measure.scene_gaps import TOUCH_DISTANCE
from distretarget.motion import Motion
from distretarget.numerics.vectors import lengths, spread_out
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.supports import Supports
from distretarget.pipeline.performer import Performer
from distretarget.scene.performer_contacts import ContactPoints, PerformerContacts, find_performer_contacts
from distretarget.scene.props import Hold, PlacedProp, Placement, PropContacts, find_prop_contacts, held_placement

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

REGION_POINTS = 9  # most joints of a region that may touch others
MOST_SWEEPS = 2
SETTLED = 0.018  # a mean gap error below this needs no further sweep [leg lengths]
LEVER = 0.02  # the rotation of a joint that holds a prop weighs as much as a point at this distance [body units]
MOST_SHORTFALL = 0.01  # joints are drawn at most this far beyond their places, which may be out of reach [body units]
TINY = 1e-12  # divisors are no smaller


@dataclass(frozen=True, eq=False)
class SceneContacts:
    """Performers and props, and the contacts between them."""

    performers: tuple[Performer, ...]  # as they are solved, one by one
    props: tuple[PlacedProp, ...]
    between: Mapping[tuple[int, int], PerformerContacts]  # of each two performers, by their numbers
    on_props: Mapping[tuple[int, int], PropContacts]  # of each performer and prop, by their numbers

    def placements(self, now: Sequence[Motion]) -> list[Placement]:
        """The placement of each prop while the performers move as they do now."""
        return [self._placement(number, prop, now) for number, prop in enumerate(self.props)]

    def _placement(self, number: int, prop: PlacedProp, now: Sequence[Motion]) -> Placement:
        holds = []
        for i, grips in prop.grips.items():
            one, near = self.performers[i], self.on_props[i, number]
            for column in np.flatnonzero(np.isin(near.joints, grips)):
                joint = near.joints[column]
                copied, turned = (
                    Rotation.from_quat(each.world_rotations[:, joint]) for each in (one.clip.copy, now[i])
                )
                turn, place = (turned * copied.inv()).as_matrix(), now[i].positions[:, joint]
                holds.append(Hold(near.f[:, column], near.source[:, column], place, turn, LEVER * one.clip.unit))
        return held_placement(prop.free, holds) if holds else prop.free

    def springs(self, now: Sequence[Motion]) -> list[Springs]:
        """The springs that draw each performer to the others and to props."""
        springs = [no_springs(len(one.clip)) for one in self.performers]
        copies = [one.clip.copy_on_path(np.arange(len(one.clip.skeleton))) for one in self.performers]
        units = [one.clip.unit for one in self.performers]
        for (i, j), near in self.between.items():
            both = (copies[i], copies[j]), (now[i].positions, now[j].positions), (units[i], units[j])
            of_i, of_j = near.springs(*both)
            springs[i], springs[j] = joined(springs[i], of_i), joined(springs[j], of_j)
        places = self.placements(now)
        for (i, k), touching in self.on_props.items():
            springs[i] = joined(springs[i], touching.springs(places[k], copies[i], units[i]))
        return springs

    def gap_error(self, now: Sequence[Motion]) -> float:
        """The mean error of the gaps in contacts [leg lengths]; 0 if nothing touches."""
        placements, measured = self.placements(now), []
        for (i, j), near in self.between.items():
            leg = (self.performers[i].clip.unit + self.performers[j].clip.unit) / 4.0
            measured.append((*near.gaps(now[i].positions, now[j].positions), leg))
        for (i, k), touching in self.on_props.items():
            place, leg = placements[k], self.performers[i].clip.unit / 2.0
            points = place(self.props[k].motion.positions)
            measured.append((*touching.gaps(now[i].positions, points, place.scale), leg))
        errors = [np.abs(gaps - due)[due < TOUCH_DISTANCE * leg] / leg for gaps, due, leg in measured]
        return float(np.concatenate(errors).mean()) if any(map(len, errors)) else 0.0


def find_contacts(performers: Sequence[Performer], props: Sequence[PlacedProp]) -> SceneContacts:
    """Find all contacts, and move supports that rest on another performer or on a prop to there."""
    points = [_contact_points(one) for one in performers]
    between, on_props, supported = {}, {}, []
    for i, j in combinations(range(len(performers)), 2):
        one, height = performers[i], (performers[i].clip.scale.height + performers[j].clip.scale.height) / 2.0
        scale = RootScale(one.clip.scale.level, height)
        between[i, j] = find_performer_contacts(
            points[i], points[j], scale, one.clip.up, one.clip.frame_time, one.settings
        )
    for i, one in enumerate(performers):
        moving = [(near.frames, near.joints[both.index(i)], near.f) for both, near in between.items() if i in both]
        supports = one.supports
        for k, prop in enumerate(props):
            near = on_props[i, k] = _prop_contacts(one, points[i], prop, prop.grips.get(i, ()))
            if prop.grips:
                frames, columns = np.nonzero(near.f)
                moving.append((frames, near.joints[columns], near.f[frames, columns]))
            else:
                supports = _resting_on(supports, near, prop.free)
        supported.append(replace(one, supports=_yielding(one, supports, moving)))
    return SceneContacts(tuple(supported), tuple(props), between, on_props)


def solve_in_sweeps(
    contacts: SceneContacts, mapper: Mapper, progress: Callable[[int], object]
) -> tuple[list[Poses], int, float]:
    """Solve all performers, and once more if gaps are off.

    Return the poses of each, the number of sweeps, and the mean gap error after the last [leg lengths].
    """
    performers = contacts.performers
    now = [replace(one.clip.copy, root_positions=one.clip.root) for one in performers]
    springs = contacts.springs(now)
    for sweep in range(1, MOST_SWEEPS + 1):
        progress(sweep)
        poses = [
            solve_contact(one.clip, replace(one.supports, scene_springs=drawn), one.settings, mapper=mapper)
            for one, drawn in zip(performers, springs, strict=True)
        ]
        now = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
        error = contacts.gap_error(now)
        if error < SETTLED or sweep == MOST_SWEEPS:
            break
        springs = [
            with_shortfall(drawn, before, at.positions / one.clip.unit, one.clip.regions.of_joint)
            for one, drawn, before, at in zip(performers, contacts.springs(now), springs, now, strict=True)
        ]
    return poses, sweep, error


def with_shortfall(springs: Springs, before: Springs, x: Array, regions: Numbers) -> Springs:
    """Return the springs of the next sweep, which draw each region further by its shortfall in the last.

    `before` are the last sweep's springs, on the same joints, and `x`, (frames, joints, 3), its positions [body units];
    `regions` are of all joints.
    """
    short = before.rest - x[:, before.a]
    weights = np.trace(before.A, axis1=-2, axis2=-1)[..., None]
    rest = np.array(springs.rest)
    for region in np.unique(regions[before.a]):
        of_region = regions[before.a] == region
        total = weights[:, of_region].sum(axis=1)
        mean = (weights[:, of_region] * short[:, of_region]).sum(axis=1) / np.maximum(total, TINY)
        mean *= np.minimum(MOST_SHORTFALL / np.maximum(lengths(mean), TINY), 1.0)[:, None]
        rest[:, of_region] += mean[:, None]
    return springs._replace(rest=rest)


def _contact_points(one: Performer) -> ContactPoints:
    """The joints of a performer that may touch, a few of each region: fingers follow the hand."""
    matching, distances = one.match.matching, one.clip.distances
    tau = matching.source.skeleton.path_lengths
    regions = matching.regions.of_joint[distances.targets]
    kept: list[int] = []
    for region in range(len(matching.regions.names)):
        points = np.flatnonzero(regions == region)
        sources = distances.sources[points]
        kept += points[spread_out(tau[np.ix_(sources, sources)], REGION_POINTS)].tolist() if len(points) else []
    sources, joints = distances.sources[kept], distances.targets[kept]
    return ContactPoints(
        joints=joints,
        regions=regions[kept],
        source=matching.source_motion.positions[:, sources],
        reach=tau[matching.drivers[matching.pelvis]][sources],
        target_reach=matching.target.skeleton.path_lengths[matching.pelvis][joints],
        shots=one.clip.shots,
    )


def _prop_contacts(one: Performer, points: ContactPoints, prop: PlacedProp, holders: Sequence[int]) -> PropContacts:
    """The contacts of a performer with a prop, which draws no standing feet.

    If a single joint holds the prop, the prop does not draw the joint's region; several joints are drawn themselves.
    """
    supports = one.supports
    free = np.ones((len(one.clip), len(points.joints)))
    for support, region in enumerate(supports.regions[: supports.feet]):
        free[:, points.regions == region] *= 1.0 - supports.weights[:, support, None]
    leg = one.clip.leg_lengths[0] or one.match.matching.source.unit
    near = find_prop_contacts(points, prop.motion.positions, leg, free, one.clip.frame_time, one.settings)
    regions = one.clip.regions.of_joint
    left = np.isin(regions[near.joints], regions[[*holders]])
    if sum(map(len, prop.grips.values())) > 1:
        left &= ~np.isin(near.joints, holders)
    return replace(near, A=np.where(left[:, None, None], 0.0, near.A))


def _resting_on(supports: Supports, near: PropContacts, free: Placement) -> Supports:
    """Move supports, except feet, that touch a prop nobody holds to their places on the prop."""
    places, on_prop = np.array(supports.places), free(near.source)
    for support in range(supports.feet, len(supports.joints)):
        for column in np.flatnonzero(near.joints == supports.joints[support]):
            places[:, support] += near.f[:, column, None] * (on_prop[:, column] - places[:, support])
    return replace(supports, places=places)


def _yielding(one: Performer, supports: Supports, moving: Sequence[tuple[Numbers, Numbers, Array]]) -> Supports:
    """Weaken supports off the floor that touch another performer or a held prop: they go where the two meet.

    `moving` has the frames, joints and activations of contacts with performers and held props.
    """
    clip, reach = one.clip, REST_HEIGHT * one.clip.leg_lengths[1]
    floor = clip.scale.height * clip.source_floor[:, None]
    touched = np.zeros((len(clip), len(clip.regions.names)))
    for frames, joints, f in moving:
        np.maximum.at(touched, (frames, clip.regions.of_joint[joints]), f)
    yields = np.where(supports.places @ clip.up - floor > 2.0 * reach, touched[:, supports.regions], 0.0)
    yields[:, : supports.feet] = 0.0
    return replace(supports, weights=supports.weights * (1.0 - yields))
