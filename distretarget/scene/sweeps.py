"""Solve a scene in sweeps: each performer by itself, drawn to the others and to props where they are at present.

A body of finite stiffness stops short of the places that its springs draw it to. The next sweep draws it further by as
much, as the method of multipliers does (M. J. D. Powell, A method for nonlinear constraints in minimization problems,
1969). Each region of the body counts as a whole: a hand that holds a larger one cannot have all its joints in their
places, and drawing further would only tear at it.
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
SETTLED = 0.018  # mean gap error below which no further sweep follows [leg lengths]
LEVER = 0.02  # the rotation of a joint that holds a prop weighs as much as a point at this distance [body units]
MOST_SHORTFALL = 0.01  # joints are drawn no further beyond their places: what is out of reach stays so [body units]
TINY = 1e-12  # divisors are no smaller


@dataclass(frozen=True, eq=False)
class SceneContacts:
    """Performers and props, and the contacts between them."""

    performers: tuple[Performer, ...]  # as they are solved, one by one
    props: tuple[PlacedProp, ...]
    between: Mapping[tuple[int, int], PerformerContacts]  # of each two performers, by their numbers
    on_props: Mapping[tuple[int, int], PropContacts]  # of each performer and prop, by their numbers

    def placements(self, now: Sequence[Motion]) -> list[Placement]:
        """Where each prop is while the performers move as they do now."""
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
        """The springs that draw each performer to the others, and to props."""
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
        """How far the gaps in contacts are off, on average [leg lengths]; 0 where nothing touches."""
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
    """Find all contacts, and let what rests on another performer or on a prop rest there."""
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
    """Solve all performers, once more if gaps are off. Return the poses of each, how many sweeps there were, and the
    mean gap error after the last [leg lengths].
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
    """Return the springs of the next sweep, drawing further by what each region fell short of its places in the last.

    `before` are the springs of the last sweep, on the same joints, and `x`, (frames, joints, 3), the positions that
    they led to [body units]; `regions` are of all joints.
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
    """The joints of a performer's body that may touch, a few of each region: fingers follow the hand."""
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
    """The contacts of a performer with a prop that some joints hold. Feet that stand stay where they are.

    A single joint that holds a prop carries it: the prop does not draw its region. Of several, each is drawn itself.
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
    """Supports, apart from feet, that touch a prop that nobody holds have their places on the prop."""
    places, on_prop = np.array(supports.places), free(near.source)
    for support in range(supports.feet, len(supports.joints)):
        for column in np.flatnonzero(near.joints == supports.joints[support]):
            places[:, support] += near.f[:, column, None] * (on_prop[:, column] - places[:, support])
    return replace(supports, places=places)


def _yielding(one: Performer, supports: Supports, moving: Sequence[tuple[Numbers, Numbers, Array]]) -> Supports:
    """Supports off the floor that touch another performer or a held prop give way, and go where the two meet.

    `moving` are the frames, joints and activations of contacts with what moves.
    """
    clip, reach = one.clip, REST_HEIGHT * one.clip.leg_lengths[1]
    floor = clip.scale.height * clip.source_floor[:, None]
    touched = np.zeros((len(clip), len(clip.regions.names)))
    for frames, joints, f in moving:
        np.maximum.at(touched, (frames, clip.regions.of_joint[joints]), f)
    yields = np.where(supports.places @ clip.up - floor > 2.0 * reach, touched[:, supports.regions], 0.0)
    yields[:, : supports.feet] = 0.0
    return replace(supports, weights=supports.weights * (1.0 - yields))
