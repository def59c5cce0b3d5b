"""Solve a scene in sweeps: each performer by itself, drawn to the present places of the others and of props.

In the first sweep nobody is drawn to other performers. It decides where hips and feet are: from then on the hips stay
there, and limbs and trunk do what contacts ask. How much they do changes smoothly in time.

A body of finite stiffness stops short of the places that its springs draw it to. The next sweep draws it further by as
much, as in the method of multipliers (M. J. D. Powell, A method for nonlinear constraints in minimization problems,
1969). Each region of the body is drawn as a whole: a hand that holds a larger one cannot have all joints in their
places.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, takewhile

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.anatomy import TRUNK_REGIONS
from distretarget.body.resting import REST_HEIGHT
from distretarget.ik.poses import Mapper, Poses
from distretarget.ik.springs import Springs, joined, no_springs
from distretarget.measure.gaps import TOUCH_DISTANCE
from distretarget.motion import Motion
from distretarget.numerics.time_series import averaged, by_shot
from distretarget.numerics.vectors import lengths, spread_out
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.supports import STIFFNESS, Supports
from distretarget.pipeline.performer import Performer
from distretarget.scene.performer_contacts import ContactPoints, PerformerContacts, find_performer_contacts
from distretarget.scene.props import Hold, PlacedProp, Placement, PropContacts, find_prop_contacts, held_placement
from distretarget.scene.seats import rises_over, seated

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

REGION_POINTS = 9  # most joints of a region that may touch others
MOST_SWEEPS = 4
SETTLED = 0.012  # a mean gap error below this needs no further sweep [leg lengths]
LEVER = 0.02  # the rotation of a joint that holds a prop weighs as much as a point at this distance [body units]
MOST_SHORTFALL = 0.01  # joints are drawn at most this far beyond their places, which may be out of reach [body units]
TRUNK_GIVE = 0.2  # how far a trunk leans towards another performer, to the length of a limb that reaches [body units]
SMOOTHING = 0.1  # what contacts change is averaged over this time on each side, weighted by a raised cosine [s]
TINY = 1e-12  # divisors are no smaller


@dataclass(frozen=True, eq=False)
class SceneContacts:
    """Performers and props, and the contacts between them."""

    performers: tuple[Performer, ...]  # as they are solved, one by one
    props: tuple[PlacedProp, ...]
    between: Mapping[tuple[int, int], PerformerContacts]  # of each two performers, by their numbers
    on_props: Mapping[tuple[int, int], PropContacts]  # of each performer and prop, by their numbers
    gives: tuple[Array, ...]  # of each performer, (frames, joints), see `how_far_joints_give`

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

    def springs(self, now: Sequence[Motion], alone: Sequence[Motion] | None = None) -> list[Springs]:
        """The springs that draw each performer to the others and to props, from where it is `alone`.

        Without `alone`, those to other performers have no stiffness.
        """
        start = alone or now
        springs = [no_springs(len(one.clip)) for one in self.performers]
        for (i, j), near in self.between.items():
            one, other = self.performers[i], self.performers[j]
            positions = (start[i].positions, start[j].positions), (now[i].positions, now[j].positions)
            drawn = near.springs(*positions, (self.gives[i], self.gives[j]), (one.clip.unit, other.clip.unit))
            for number, each in zip((i, j), drawn, strict=True):
                springs[number] = joined(springs[number], each if alone else each._replace(A=0.0 * each.A))
        return [joined(*both) for both in zip(springs, self.springs_to_props(now), strict=True)]

    def springs_to_props(self, now: Sequence[Motion], props: Container[int] | None = None) -> list[Springs]:
        """The springs that draw each performer to props, where these are while the performers move as they do now; to
        some of them by their numbers, or to all.
        """
        springs, places = [no_springs(len(one.clip)) for one in self.performers], self.placements(now)
        copies = [one.clip.copy_on_path(np.arange(len(one.clip.skeleton))) for one in self.performers]
        for (i, k), touching in self.on_props.items():
            if props is not None and k not in props:
                continue
            unit = self.performers[i].clip.unit
            springs[i] = joined(springs[i], touching.springs(places[k], copies[i], unit))
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
                near = on_props[i, k] = replace(near, rises=rises_over(one, near, prop))
                one = seated(replace(one, supports=supports), near, prop)
                supports = _resting_on(one.supports, near, prop.free)
        supported.append(replace(one, supports=_yielding(one, supports, moving)))
    return SceneContacts(tuple(supported), tuple(props), between, on_props, tuple(map(how_far_joints_give, supported)))


def how_far_joints_give(one: Performer) -> Array:
    """(frames, joints), how far each joint goes to meet another performer's, in proportion [target file units].

    A joint of a limb goes as far as the limb is long up to it, one of the trunk as far as the trunk leans. A limb that
    rests on the world gives no more than the trunk.
    """
    clip, skeleton = one.clip, one.clip.skeleton
    trunk = np.isin(np.append(clip.regions.names, ""), TRUNK_REGIONS)[clip.regions.of_joint]
    limbs = [[*takewhile(lambda each: not trunk[each], skeleton.line(joint))] for joint in range(len(skeleton))]
    length = np.array([skeleton.paths_from(limb[0])[limb[-1]] if limb else 0.0 for limb in limbs])
    held = np.zeros((len(clip), len(skeleton)))
    for support, joint in enumerate(one.supports.joints):
        held[:, limbs[joint]] = np.maximum(held[:, limbs[joint]], one.supports.weights[:, support, None])
    return np.asarray(length * (1.0 - held) + TRUNK_GIVE * clip.unit)


def solve_in_sweeps(
    contacts: SceneContacts, mapper: Mapper, progress: Callable[[int], object]
) -> tuple[list[Poses], int, float]:
    """Solve all performers as if alone, and again, drawn to each other, while gaps are off.

    Return the poses of each, the number of sweeps, and the mean gap error after the last [leg lengths].
    """
    performers = contacts.performers

    def solve(number: int, springs: Sequence[Springs]) -> list[Poses]:
        progress(number)
        return [
            solve_contact(one.clip, replace(one.supports, scene_springs=drawn), one.settings, mapper=mapper)
            for one, drawn in zip(performers, springs, strict=True)
        ]

    springs = contacts.springs([replace(one.clip.copy, root_positions=one.clip.root) for one in performers])
    first = poses = solve(1, springs)
    alone = now = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
    hips = [_springs_of_hips(one, at) for one, at in zip(performers, alone, strict=True)]
    sweep, error = 1, contacts.gap_error(now)
    while error >= SETTLED and sweep < MOST_SWEEPS:
        sweep += 1
        springs = [
            joined(with_shortfall(drawn, before, at.positions / one.clip.unit, one.clip.regions.of_joint), held)
            for one, drawn, before, at, held in zip(
                performers, contacts.springs(now, alone), springs, now, hips, strict=True
            )
        ]
        poses = [smoothed(*both, contacts) for both in zip(solve(sweep, springs), first, strict=True)]
        now = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
        error = contacts.gap_error(now)
    return poses, sweep, error


def smoothed(poses: Poses, alone: Poses, contacts: SceneContacts) -> Poses:
    """Return the poses with their deviations from those `alone` averaged over `SMOOTHING` within each shot."""
    clips = [one.clip for one in contacts.performers]
    shots = np.sum([clip.shots for clip in clips], axis=0)  # a new shot at the cuts of any performer
    average = partial(averaged, reach=round(SMOOTHING / clips[0].frame_time))
    return replace(poses, v=alone.v + by_shot(average, shots, poses.v - alone.v))


def _springs_of_hips(one: Performer, alone: Motion) -> Springs:
    """The springs that hold the hips of a performer where they are `alone`."""
    legs = one.clip.target_legs
    joints = np.array([leg.hip for leg in legs] if legs else [one.clip.pelvis])
    A = np.broadcast_to(STIFFNESS * np.eye(3), (len(alone), len(joints), 3, 3))
    return Springs(joints, np.full(len(joints), -1), alone.positions[:, joints] / one.clip.unit, A)


def with_shortfall(springs: Springs, before: Springs, x: Array, regions: Numbers) -> Springs:
    """Return the springs of the next sweep, which draw each region further by its shortfall in the last.

    `before` are the last sweep's springs, on the same joints and perhaps others after them, and `x`,
    (frames, joints, 3), its positions [body units]; `regions` are of all joints.
    """
    a, count = springs.a, len(springs.a)
    short = before.rest[:, :count] - x[:, a]
    weights = np.trace(before.A[:, :count], axis1=-2, axis2=-1)[..., None]
    rest = np.array(springs.rest)
    for region in np.unique(regions[a]):
        of_region = regions[a] == region
        total = weights[:, of_region].sum(axis=1)
        mean = (weights[:, of_region] * short[:, of_region]).sum(axis=1) / np.maximum(total, TINY)
        mean *= np.minimum(MOST_SHORTFALL / np.maximum(lengths(mean), TINY), 1.0)[:, None]
        rest[:, of_region] += mean[:, None]
    return springs._replace(rest=rest)


def _contact_points(one: Performer) -> ContactPoints:
    """The joints of a performer that may touch, a few of each region: fingers follow the hand."""
    matching, distances = one.match.matching, one.clip.distances
    skeleton = matching.source.skeleton
    regions = matching.regions.of_joint[distances.targets]
    kept: list[int] = []
    for region in range(len(matching.regions.names)):
        points = np.flatnonzero(regions == region)
        tau = skeleton.paths_among(distances.sources[points])
        kept += points[spread_out(tau, REGION_POINTS)].tolist() if len(points) else []
    sources, joints = distances.sources[kept], distances.targets[kept]
    return ContactPoints(
        joints=joints,
        regions=regions[kept],
        source=matching.source_motion.positions[:, sources],
        reach=skeleton.paths_from(matching.drivers.item(matching.pelvis))[sources],
        target_reach=matching.target.skeleton.paths_from(matching.pelvis)[joints],
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
    places, on_prop = np.array(supports.places), near.places(free)
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
