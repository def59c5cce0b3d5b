"""Solve a scene: performers whose bodies would be in each other move apart, slowly; then sweeps, in each of which each
performer is solved by itself, drawn to the present places of the others and of props.

Balls along the capsules of trunk and head show how far two performers have to part: along the floor, or upwards where
one sits or lies on the other in the source, but for some depth of flesh, and for performers side by side the overlap of
the source. They part and come back mostly while somebody steps; each resting foot moves by the mean over its rest.

The first sweep, without other performers, decides where hips and feet are; then limbs and trunk do what contacts ask,
smoothly in time. Where a user asks for contacts, the scene is solved without and with them, and blended. A body of
finite stiffness stops short of where its springs draw it; the next sweep draws each region further by as much, as in
the method of multipliers (M. J. D. Powell, A method for nonlinear constraints in minimization problems, 1969).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from distretarget.body.anatomy import TRUNK_REGIONS
from distretarget.contact_entries import ContactList
from distretarget.ik.poses import Mapper, Poses
from distretarget.ik.springs import Springs, joined
from distretarget.measure.verdict import Remark
from distretarget.motion import Motion
from distretarget.numerics.moving import averaged
from distretarget.numerics.time_series import by_shot, over_runs, smoothstep, widened
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, level, normalised
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.constraints import Carrier, Constraints
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.supports import STIFFNESS, Supports
from distretarget.pipeline.constrained_motion import blended_supports, constrain, dropping, layered, met, unmet
from distretarget.pipeline.performer import Performer
from distretarget.scene.contacts import SceneContacts, common_shots, copy_on_path, find_scene_contacts, moved_by
from distretarget.scene.props import PlacedProp, Placement, nearest_on_bones
from distretarget.scene.skin import with_skins
from distretarget.skin.balls import write_exit_distances
from distretarget.skin.capsules import SEGMENTS

BALLS = 5  # along each capsule
FLESH = 0.02  # bodies give way, and capsules stand off from the skin, by this together [body units]
TOUCH = 0.04  # bodies that are nearer than this in the source show whether one is on the other [body units]
SPEED = 0.1  # two performers part at most this fast ... [body units/s]
STANDING = 0.2  # ... times this while both stand on both feet
SOFT = 0.25  # and take twice this time to get as fast [s]
BESIDE = 0.1  # performers whose middles are nearer than this along the floor have no direction to part in [body units]
ROUNDS = 3  # in each, all pairs of performers part

IS_CORE = np.array([" " not in name for name in SEGMENTS])
IS_THIGH = np.array(["thigh" in name for name in SEGMENTS])
IS_SEAT = IS_CORE | IS_THIGH
MOST_SWEEPS = 4
SETTLED = 0.012  # a mean gap error below this needs no further sweep [leg lengths]
MOST_SHORTFALL = 0.01  # joints are drawn at most this far beyond their places, which may be out of reach [body units]
SMOOTHING = 0.1  # what contacts change is averaged over this time on each side, weighted by a raised cosine [s]
TINY = 1e-12  # divisors are no smaller


@dataclass(frozen=True, eq=False)
class Core:
    """The parts of a body that only the whole body can move, as balls."""

    centres: Array  # (frames, balls, 3) [mean body units of the performers]
    radii: Array  # (balls,)

    @classmethod
    def of(cls, skin: BodySkin, motion: Motion, unit: float, parts: Flags) -> Core:
        """Return the balls of some parts, (segments,), of a body in a motion; `unit` is that of lengths."""
        whole = skin.capsules
        on = parts[whole.segments]
        ends = whole[on].posed(motion) / unit
        t = np.linspace(0.0, 1.0, BALLS)
        shares = np.stack([1.0 - t, t])
        centres = np.einsum("fcei,eb->fcbi", ends, shares).reshape(len(ends), -1, 3)
        return cls(centres, (whole.radii[on] @ shares).ravel() / unit)

    def way_from(self, other: Core, along: Array, give: float, ahead: float = 0.5) -> Array:
        """(frames,), how far this body has to move along unit vectors, (frames, 3), until it overlaps the other by no
        more than `give`; only balls count that are apart in a direction whose cosine to these is above `ahead`.
        """
        ways, bodies = np.zeros(len(along)), (self.centres, self.radii, other.centres, other.radii)
        centres, radii, others, other_radii, along = map(np.ascontiguousarray, (*bodies, along))
        write_exit_distances(centres, radii, others, other_radii, along, give, ahead, ways)
        return ways


def kept_apart(contacts: SceneContacts, skins: Sequence[Skins | None]) -> SceneContacts:
    """Return the scene with performers apart whose skins would be in each other; `skins` have None for no thickness."""
    known = [number for number, skin in enumerate(skins) if skin]
    ways = [way for both in combinations(known, 2) for way in _ways_between(contacts, skins, both)]
    moves = np.zeros((len(skins), len(contacts.performers[0].clip), 3))
    for _ in range(ROUNDS):
        for way in ways:
            way.add_to(moves)
    moved = [moved_by(*each) for each in zip(contacts.performers, moves, strict=True)]
    return replace(contacts, performers=tuple(moved)) if moves.any() else contacts


@dataclass(frozen=True, eq=False)
class _Way:
    """How two performers part in a direction."""

    numbers: tuple[int, int]
    cores: Sequence[Core]  # of both while nobody is moved
    unit: float  # that of the cores [target file units]
    along: Array  # (frames, 3), the unit vectors along which the first moves, the second against them; or 0
    allowed: Array  # (frames,), the way for which they may stay in each other
    shares: Array  # (frames, 2), of each in the way
    speed: Array  # (frames,), how fast they may part [per frame]
    shots: Numbers  # (frames,)
    soft: float  # frames over which their speed changes

    def add_to(self, moves: Array) -> None:
        """Add to how far performers are moved, (performers, frames, 3), what these two lack [target file units]."""
        one, other = (
            replace(core, centres=core.centres + (moves[number] / self.unit)[:, None])
            for number, core in zip(self.numbers, self.cores, strict=True)
        )
        lack = np.maximum(one.way_from(other, self.along, FLESH) - self.allowed, 0.0)
        if lack.any():
            parted = by_shot(partial(_slowed, frames=self.soft), self.shots, lack, self.speed)
            for number, share in zip(self.numbers, (self.shares * [1.0, -1.0]).T, strict=True):
                moves[number] += self.unit * (share * parted)[:, None] * self.along


def _ways_between(contacts: SceneContacts, skins: Sequence[Skins | None], numbers: tuple[int, int]) -> Iterator[_Way]:
    """The ways in which two performers part: along the floor, or upwards, where the one below stays."""
    up, both = contacts.performers[0].clip.up, [contacts.performers[number] for number in numbers]
    pelvises = [one.clip.source.positions[:, one.clip.drivers[one.clip.pelvis]] @ up for one in both]
    if np.mean(np.subtract(*pelvises)) < 0.0:  # the first is the one that is higher
        numbers, both = numbers[::-1], both[::-1]
    own = [skin for number in numbers if (skin := skins[number])]
    source_unit, unit = (float(np.mean([getattr(skin, side).unit for skin in own])) for side in ("source", "target"))

    def cores(*parts: Flags) -> tuple[list[Core], list[Core]]:
        """Those of the sources, and those of the targets."""
        each = [*zip(both, own, parts, strict=True)]
        return (
            [Core.of(skin.source, one.clip.source, source_unit, some) for one, skin, some in each],
            [Core.of(skin.target, copy_on_path(one), unit, some) for one, skin, some in each],
        )

    shots, time = common_shots(both), both[0].clip.frame_time
    sources, targets = cores(IS_CORE, IS_CORE)
    between = level(np.subtract(*(core.centres.mean(axis=1) for core in targets)), up)
    between = by_shot(partial(averaged, reach=round(SOFT / time)), shots, between)
    aside = normalised(between) * smoothstep(lengths(between) / BESIDE)[:, None]
    upwards = np.broadcast_to(up, aside.shape)
    free = np.stack([_is_free(contacts, number) for number in numbers], axis=1).astype(float)
    steps = np.max([_steps(one.supports) for one in both], axis=0)
    speed = SPEED * time * np.maximum(steps, STANDING)
    way = partial(_Way, numbers, unit=unit, speed=speed, shots=shots, soft=SOFT / time)
    for of_source, of_target in ((sources, targets), cores(IS_SEAT, IS_THIGH)):
        to_part = [of_source[0].way_from(of_source[1], along, -TOUCH, -1.0) for along in (aside, upwards)]
        rests = by_shot(over_runs, shots, np.subtract(*to_part)[:, None], np.min(to_part, axis=0))[:, 0] > 0.0
        yield way(of_target, along=upwards, allowed=np.where(rests, 0.0, np.inf), shares=free * [1.0, 0.0])
        if of_target is targets:
            allowed = np.where(rests, np.inf, sources[0].way_from(sources[1], aside, 0.0))
            yield way(targets, along=aside, allowed=allowed, shares=free / np.maximum(free.sum(axis=1)[:, None], 1.0))


def _slowed(ways: Array, speed: Array, frames: float) -> Array:
    """(frames,), the least above ways, (frames,), that changes by at most `speed` a frame, smoothed over `frames`."""
    s = np.cumsum(speed)
    before = np.maximum.accumulate(ways + s) - s
    after = (np.maximum.accumulate((ways - s)[::-1]) + s[::-1])[::-1]
    return widened(np.maximum(before, after)[:, None], frames)[:, 0]


def _steps(supports: Supports) -> Array:
    """(frames,), 0 while both feet rest, blended to 1."""
    legs = supports.weights[:, : supports.feet].reshape(len(supports.weights), -1, 2)
    return np.asarray(1.0 - legs.max(axis=2).min(axis=1)) if legs.size else np.ones(len(legs))


def _is_free(contacts: SceneContacts, number: int) -> Flags:
    """(frames,), whether a performer can move: in no frame of the shot, its trunk is on a prop that nobody holds."""
    one, sits = contacts.performers[number], np.zeros((len(contacts.performers[number].clip), 1))
    names = np.array(one.clip.regions.names)
    for k, prop in enumerate(contacts.props):
        near = contacts.on_props[number, k]
        of_trunk = np.isin(names[one.clip.regions.of_joint[near.joints]], TRUNK_REGIONS)
        if not prop.grips:
            sits = np.maximum(sits, near.f[:, of_trunk].max(axis=1, initial=0.0)[:, None])
    return by_shot(lambda each: np.full(len(each), not each.any()), one.clip.shots, sits)


@dataclass(frozen=True, eq=False)
class SolvedScene:
    """A scene, solved."""

    contacts: SceneContacts  # what touches in it, with the performers as they were solved
    poses: Sequence[Poses]  # of each performer
    motions: Sequence[Motion]  # of each performer, with its limbs bent as skins ask
    sweeps: int  # how many times all performers were solved
    gap_error: float  # the mean difference between gaps and what they should be [leg lengths]
    unmet: Sequence[tuple[Remark, ...]]  # the constraints of each performer that are met in part only


def solve_scene(
    performers: Sequence[Performer],
    props: Sequence[PlacedProp],
    skins: Sequence[Skins | None],
    contact_lists: Sequence[ContactList],
    mapper: Mapper,
    progress: Callable[[int], object],
) -> SolvedScene:
    """Solve a scene. `contact_lists` has those of each performer; `skins` the surface of each that
    collides with other performers. Raises a ContactsError if an entry does not suit the clip.
    """

    def constraints_of(motions: Sequence[Motion], places: Sequence[Placement]) -> list[Constraints]:
        others = _carriers(performers, motions, props, places)
        return [
            Constraints.of(contacts, one.clip, one.match.anchored_skin, one.settings.blend, others)
            for contacts, one in zip(contact_lists, performers, strict=True)
        ]

    def solved(contacts: SceneContacts) -> SolvedScene:
        poses, sweeps, error = solve_in_sweeps(contacts, mapper, progress)
        motions = with_skins(contacts, poses, skins)
        return SolvedScene(contacts, poses, motions, sweeps, error, [()] * len(performers))

    copies = [copy_on_path(one) for one in performers]
    found = constraints_of(copies, [each.free for each in props])
    dropped = [dropping(one, constraints.drops) for one, constraints in zip(performers, found, strict=True)]
    free = solved(kept_apart(find_scene_contacts(dropped, props), skins))
    if not any(constraints.made for constraints in found):
        return free
    found = constraints_of(free.motions, free.contacts.placements(free.motions))
    changed = zip(free.contacts.performers, found, strict=True)
    held = solved(replace(free.contacts, performers=tuple(constrain(*each) for each in changed)))
    made = [constraints.made for constraints in found]
    share = np.max([constraints.share for constraints in found], axis=0)
    each = zip(held.contacts.performers, free.contacts.performers, free.motions, held.motions, made, strict=True)
    shown, motions, told = list[Performer](), list[Motion](), list[tuple[Remark, ...]]()
    for one, alone, without, motion, constraints in each:
        motion = met(one, motion, constraints) if constraints else motion
        motions.append(layered(made, without, motion))
        shown.append(replace(one, supports=blended_supports(alone.supports, one.supports, share)))
        told.append(tuple(unmet(one, constraints, motions[-1])))
    contacts = replace(free.contacts, performers=tuple(shown))
    return replace(free, contacts=contacts, motions=motions, unmet=told)


def _carriers(
    performers: Sequence[Performer], motions: Sequence[Motion], props: Sequence[PlacedProp], places: Sequence[Placement]
) -> dict[str, Carrier]:
    """What parts may rest on: performers by numbers from 1, while they move like this, and placed props by name."""
    found = {}
    for number, (one, motion) in enumerate(zip(performers, motions, strict=True), 1):
        skin, unit = one.match.skins and one.match.skins.target, one.clip.unit
        radii = [unit * skin.thickness(joint) if skin else 0.0 for joint in range(len(motion.skeleton))]
        found[str(number)] = Carrier(motion=motion, radii=tuple(radii))
    for prop, place in zip(props, places, strict=True):
        found[prop.name] = Carrier(motion=place.moved(prop.motion), nearest=partial(_nearest, prop), is_whole=True)
    return found


def _nearest(prop: PlacedProp, place: Array) -> tuple[Array, Array]:
    """The place on a prop nearest to one, (3,), from its first joint, and the direction out [target file units]."""
    scale, rest = prop.free.scale, prop.motion.skeleton.rest_positions
    if prop.surface:
        farthest = float(lengths(place) / scale + lengths(prop.surface.corners).max())
        near, out = prop.surface.nearest(place[None] / scale, farthest)
        return scale * near[0], out[0]
    if len(rest) == 1:
        return np.zeros(3), place / max(float(lengths(place)), 1e-12)
    near, out = nearest_on_bones(scale * (rest - rest[0])[None], prop.motion.skeleton.parents, place[None, None])
    return near[0, 0], out[0, 0]


def solve_in_sweeps(
    contacts: SceneContacts, mapper: Mapper, progress: Callable[[int], object]
) -> tuple[list[Poses], int, float]:
    """Solve all performers as if alone, and again, drawn to each other, while gaps are off. Return the poses of each,
    the number of sweeps, and the mean gap error after the last [leg lengths].
    """
    performers = contacts.performers

    def solve(number: int, springs: Sequence[Springs]) -> list[Poses]:
        progress(number)
        return [
            solve_contact(one.clip, replace(one.supports, scene_springs=drawn), one.settings, mapper=mapper)
            for one, drawn in zip(performers, springs, strict=True)
        ]

    springs = contacts.springs([copy_on_path(one) for one in performers])
    first = poses = solve(1, springs)
    alone = now = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
    hips = [_springs_of_hips(one, at) for one, at in zip(performers, alone, strict=True)]
    sweep, error = 1, contacts.gap_error(now)
    while error >= SETTLED and sweep < MOST_SWEEPS:
        sweep += 1
        each = zip(performers, contacts.springs(now, alone), springs, now, hips, strict=True)
        springs = [
            joined(with_shortfall(drawn, before, at.positions / one.clip.unit, one.clip.regions.of_joint), held)
            for one, drawn, before, at, held in each
        ]
        poses = [changed_steadily(*both, contacts) for both in zip(solve(sweep, springs), first, strict=True)]
        now = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
        error = contacts.gap_error(now)
    return poses, sweep, error


def changed_steadily(poses: Poses, alone: Poses, contacts: SceneContacts) -> Poses:
    """Return the poses with their deviations from those `alone` averaged over `SMOOTHING` within each shot."""
    average = partial(averaged, reach=round(SMOOTHING / contacts.performers[0].clip.frame_time))
    return replace(poses, v=alone.v + by_shot(average, common_shots(contacts.performers), poses.v - alone.v))


def _springs_of_hips(one: Performer, alone: Motion) -> Springs:
    """The springs that hold the hips of a performer where they are `alone`."""
    legs = one.clip.target_legs
    joints = np.array([leg.hip for leg in legs] if legs else [one.clip.pelvis])
    A = np.broadcast_to(STIFFNESS * np.eye(3), (len(alone), len(joints), 3, 3))
    return Springs(joints, np.full(len(joints), -1), alone.positions[:, joints] / one.clip.unit, A)


def with_shortfall(springs: Springs, before: Springs, x: Array, regions: Numbers) -> Springs:
    """Return the springs of the next sweep, which draw each region further by its shortfall in the last, whose springs
    were those `before`, perhaps with others after them, and positions `x`, (frames, joints, 3) [body units]; `regions`
    are of all joints.
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
