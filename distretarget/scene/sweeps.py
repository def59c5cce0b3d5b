"""Solve a scene. Performers whose trunks overlap, or a trunk and thighs, are moved apart. Then follow sweeps, which
solve each performer by itself with springs to the present positions of the others and of props.

Balls along the capsules of trunk, head and thighs show how far to move two performers: along the floor, or upwards
where one sits or lies on the other in the source. Some overlap is allowed: the depth of soft tissue and, side by side,
as much as the sources overlap. The offset changes mostly while somebody steps; a resting foot moves by its mean over
the rest.

The first sweep has no springs between performers; hips stay where it puts them. Later sweeps change limbs and trunk,
smoothly in time. With user constraints, the scene is solved without and with them, and blended. A body of finite
stiffness stops short of the rest positions of its springs; the next sweep moves these further by the shortfall, as in
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
from distretarget.numerics.time_series import by_shot, run_means, smoothstep, widened
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, level, normalised
from distretarget.objectives.body_skin import BodySkin, Skins
from distretarget.objectives.constraints import Carrier, Constraints
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.supports import STIFFNESS, Supports
from distretarget.pipeline.constrained_motion import blended_in, blended_supports, constrain, meet, unmet, without_drops
from distretarget.pipeline.performer import Performer
from distretarget.scene.contacts import SceneContacts, common_shots, copy_on_path, find_scene_contacts, moved_by
from distretarget.scene.props import PlacedProp, Placement, nearest_on_bones
from distretarget.scene.skin import with_skins
from distretarget.skin.balls import write_exit_distances
from distretarget.skin.capsules import SEGMENTS

BALLS = 5  # along each capsule
FLESH = 0.02  # allowed overlap: soft tissue, and capsules that reach beyond the skin [body units]
TOUCH = 0.04  # bodies nearer than this in the source show whether one is on the other [body units]
SPEED = 0.1  # the offset between two performers changes at most this fast ... [body units/s]
STANDING = 0.2  # ... times this while both stand on both feet
SOFT = 0.25  # it is smoothed over this time on each side [s]
BESIDE = 0.1  # performers nearer than this along the floor have no direction in which to move apart [body units]
ROUNDS = 3  # over all pairs of performers

IS_CORE = np.array([" " not in name for name in SEGMENTS])
IS_THIGH = np.array(["thigh" in name for name in SEGMENTS])
IS_SEAT = IS_CORE | IS_THIGH
MOST_SWEEPS = 4
SETTLED = 0.012  # a mean gap error below this needs no further sweep [leg lengths]
MOST_SHORTFALL = 0.01  # rest positions, which may be out of reach, are moved further by at most this [body units]
SMOOTHING = 0.1  # changes made by contacts are averaged over this time on each side, weighted by a raised cosine [s]
TINY = 1e-12  # divisors are no smaller


@dataclass(frozen=True, eq=False)
class Core:
    """Parts of a body as balls, such as the trunk, which moves only with the whole body."""

    centres: Array  # (frames, balls, 3) [mean body units of the performers]
    radii: Array  # (balls,)

    @classmethod
    def of(cls, skin: BodySkin, motion: Motion, unit: float, parts: Flags) -> Core:
        """Return the balls of the segments in `parts`, (segments,), of a body in motion, in lengths of `unit`."""
        whole = skin.capsules
        on = parts[whole.segments]
        ends = whole[on].posed(motion) / unit
        t = np.linspace(0.0, 1.0, BALLS)
        shares = np.stack([1.0 - t, t])
        centres = np.einsum("fcei,eb->fcbi", ends, shares).reshape(len(ends), -1, 3)
        return cls(centres, (whole.radii[on] @ shares).ravel() / unit)

    def distance_to_clear(self, other: Core, along: Array, overlap: float, ahead: float = 0.5) -> Array:
        """(frames,), how far to move along unit vectors, (frames, 3), until no balls `ahead` overlap by more than
        `overlap`.
        """
        distances, bodies = np.zeros(len(along)), (self.centres, self.radii, other.centres, other.radii)
        centres, radii, others, other_radii, along = map(np.ascontiguousarray, (*bodies, along))
        write_exit_distances(centres, radii, others, other_radii, along, overlap, ahead, distances)
        return distances


def separated(contacts: SceneContacts, skins: Sequence[Skins | None]) -> SceneContacts:
    """Return the scene with performers moved apart whose trunks overlap; `skins` have None for stick figures."""
    known = [number for number, skin in enumerate(skins) if skin]
    found = [each for both in combinations(known, 2) for each in _separations(contacts, skins, both)]
    moves = np.zeros((len(skins), len(contacts.performers[0].clip), 3))
    for _ in range(ROUNDS):
        for add_to in found:
            add_to(moves)
    moved = [moved_by(*each) for each in zip(contacts.performers, moves, strict=True)]
    return replace(contacts, performers=tuple(moved)) if moves.any() else contacts


def _separations(
    contacts: SceneContacts, skins: Sequence[Skins | None], numbers: tuple[int, int]
) -> Iterator[Callable[[Array], None]]:
    """How two performers are moved apart, along the floor, or upwards, where only the upper one moves: functions that
    add an offset of both to those of all performers, (performers, frames, 3) [target file units].
    """
    up, both = contacts.performers[0].clip.up, [contacts.performers[number] for number in numbers]
    pelvises = [one.clip.source.positions[:, one.clip.drivers[one.clip.pelvis]] @ up for one in both]
    if np.mean(np.subtract(*pelvises)) < 0.0:  # the first is the one that is higher
        numbers, both = numbers[::-1], both[::-1]
    own = [skin for number in numbers if (skin := skins[number])]
    source_unit, unit = (float(np.mean([getattr(skin, side).unit for skin in own])) for side in ("source", "target"))

    def cores(*parts: Flags) -> tuple[list[Core], list[Core]]:
        """The cores of both sources and of both targets, of the given segments of each."""
        each = [*zip(both, own, parts, strict=True)]
        return (
            [Core.of(skin.source, one.clip.source, source_unit, some) for one, skin, some in each],
            [Core.of(skin.target, copy_on_path(one), unit, some) for one, skin, some in each],
        )

    shots, time = common_shots(both), both[0].clip.frame_time
    sources, targets = cores(IS_CORE, IS_CORE)
    between = level(np.subtract(*(core.centres.mean(axis=1) for core in targets)), up)
    between = by_shot(partial(averaged, reach=round(SOFT / time)), shots, between)
    sideways = normalised(between) * smoothstep(lengths(between) / BESIDE)[:, None]
    upwards = np.broadcast_to(up, sideways.shape)
    free = np.stack([_is_free(contacts, number) for number in numbers], axis=1).astype(float)
    steps = np.max([_steps(one.supports) for one in both], axis=0)
    speed = SPEED * time * np.maximum(steps, STANDING)

    def separate(both: Sequence[Core], along: Array, allowed: Array, shares: Array, moves: Array) -> None:
        """Move both apart `along` unit vectors by `shares`, (frames, 2), of what clears them but for `allowed`."""
        one, other = (
            replace(core, centres=core.centres + (moves[number] / unit)[:, None])
            for number, core in zip(numbers, both, strict=True)
        )
        lack = np.maximum(one.distance_to_clear(other, along, FLESH) - allowed, 0.0)
        if lack.any():
            offset = by_shot(partial(_slowed, frames=SOFT / time), shots, lack, speed)
            for number, share in zip(numbers, (shares * [1.0, -1.0]).T, strict=True):
                moves[number] += unit * (share * offset)[:, None] * along

    is_on, shares = np.zeros(len(sideways), bool), free / np.maximum(free.sum(axis=1)[:, None], 1.0)
    for of_source, of_target in ((sources, targets), cores(IS_SEAT, IS_THIGH)):
        to_clear = [of_source[0].distance_to_clear(of_source[1], along, -TOUCH, -1.0) for along in (sideways, upwards)]
        above = by_shot(run_means, shots, np.subtract(*to_clear)[:, None], np.min(to_clear, axis=0))[:, 0] > 0.0
        yield partial(separate, of_target, upwards, np.where(above, 0.0, np.inf), free * [1.0, 0.0])
        is_on |= above
    for of_source, of_target in ((sources, targets), cores(IS_THIGH, IS_CORE), cores(IS_CORE, IS_THIGH)):
        allowed = np.where(is_on, np.inf, of_source[0].distance_to_clear(of_source[1], sideways, 0.0))
        yield partial(separate, of_target, sideways, allowed, shares)


def _slowed(distances: Array, speed: Array, frames: float) -> Array:
    """(frames,), the least curve above `distances` that changes by at most `speed` a frame, smoothed over `frames`."""
    s = np.cumsum(speed)
    before = np.maximum.accumulate(distances + s) - s
    after = (np.maximum.accumulate((distances - s)[::-1]) + s[::-1])[::-1]
    return widened(np.maximum(before, after)[:, None], frames)[:, 0]


def _steps(supports: Supports) -> Array:
    """(frames,), the weight of stepping: 0 while both feet rest, blended to 1."""
    legs = supports.weights[:, : supports.feet].reshape(len(supports.weights), -1, 2)
    return np.asarray(1.0 - legs.max(axis=2).min(axis=1)) if legs.size else np.ones(len(legs))


def _is_free(contacts: SceneContacts, number: int) -> Flags:
    """(frames,), whether a performer may be moved: not in shots in which its trunk is on a prop that nobody holds."""
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
    """A solved scene."""

    contacts: SceneContacts  # its contacts, and the performers as they were solved
    poses: Sequence[Poses]  # of each performer
    motions: Sequence[Motion]  # of each performer, with limbs bent out of skins
    sweeps: int  # how many times all performers were solved
    gap_error: float  # the mean difference between gaps and the wanted ones [leg lengths]
    unmet: Sequence[tuple[Remark, ...]]  # of each performer, the user constraints that are not fully met


def solve_scene(
    performers: Sequence[Performer],
    props: Sequence[PlacedProp],
    skins: Sequence[Skins | None],
    contact_lists: Sequence[ContactList],
    mapper: Mapper,
    progress: Callable[[int], object],
) -> SolvedScene:
    """Solve a scene with the user's entries and each performer's colliding surface; errors as in `Constraints.of`."""

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
    dropped = [without_drops(one, constraints.drops) for one, constraints in zip(performers, found, strict=True)]
    free = solved(separated(find_scene_contacts(dropped, props), skins))
    if not any(constraints.made for constraints in found):
        return free
    found = constraints_of(free.motions, free.contacts.placements(free.motions))
    pairs = zip(free.contacts.performers, found, strict=True)
    bound = solved(replace(free.contacts, performers=tuple(constrain(*pair) for pair in pairs)))
    made = [constraints.made for constraints in found]
    share = np.max([constraints.share for constraints in found], axis=0)
    each = zip(bound.contacts.performers, free.contacts.performers, free.motions, bound.motions, made, strict=True)
    blended, motions, remarks = list[Performer](), list[Motion](), list[tuple[Remark, ...]]()
    for one, before, without, motion, constraints in each:
        motion = meet(one, motion, constraints) if constraints else motion
        motions.append(blended_in(made, without, motion))
        blended.append(replace(one, supports=blended_supports(before.supports, one.supports, share)))
        remarks.append(tuple(unmet(one, constraints, motions[-1])))
    contacts = replace(free.contacts, performers=tuple(blended))
    return replace(free, contacts=contacts, motions=motions, unmet=remarks)


def _carriers(
    performers: Sequence[Performer], motions: Sequence[Motion], props: Sequence[PlacedProp], places: Sequence[Placement]
) -> dict[str, Carrier]:
    """The carriers on which parts may rest, by name: performers, numbered from 1, in motion; and props at `places`."""
    found = {}
    for number, (one, motion) in enumerate(zip(performers, motions, strict=True), 1):
        skin, unit = one.match.skins and one.match.skins.target, one.clip.unit
        radii = [unit * skin.thickness(joint) if skin else 0.0 for joint in range(len(motion.skeleton))]
        found[str(number)] = Carrier(motion=motion, radii=tuple(radii))
    for prop, place in zip(props, places, strict=True):
        found[prop.name] = Carrier(motion=place.moved(prop.motion), nearest=partial(_nearest, prop), is_whole=True)
    return found


def _nearest(prop: PlacedProp, place: Array) -> tuple[Array, Array]:
    """The point of a prop at rest nearest to `place`, both from its first joint, and the direction out of it, (3,)."""
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
    """Solve performers without each other, then with springs while gaps are off; return poses, sweeps, error."""
    performers = contacts.performers

    def solve(number: int, springs: Sequence[Springs]) -> list[Poses]:
        progress(number)
        return [
            solve_contact(one.clip, replace(one.supports, scene_springs=drawn), one.settings, mapper=mapper)
            for one, drawn in zip(performers, springs, strict=True)
        ]

    springs = contacts.springs([copy_on_path(one) for one in performers])
    first = poses = solve(1, springs)
    separate = now = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
    hips = [_hip_springs(one, motion) for one, motion in zip(performers, separate, strict=True)]
    sweep, error = 1, contacts.gap_error(now)
    while error >= SETTLED and sweep < MOST_SWEEPS:
        sweep += 1
        each = zip(performers, contacts.springs(now, separate), springs, now, hips, strict=True)
        springs = [
            joined(with_shortfall(drawn, before, at.positions / one.clip.unit, one.clip.regions.of_joint), held)
            for one, drawn, before, at, held in each
        ]
        poses = [changed_steadily(*both, contacts) for both in zip(solve(sweep, springs), first, strict=True)]
        now = [one.posed(pose) for one, pose in zip(performers, poses, strict=True)]
        error = contacts.gap_error(now)
    return poses, sweep, error


def changed_steadily(poses: Poses, first: Poses, contacts: SceneContacts) -> Poses:
    """Return the poses with their changes from `first` averaged over `SMOOTHING` within each shot."""
    average = partial(averaged, reach=round(SMOOTHING / contacts.performers[0].clip.frame_time))
    return replace(poses, v=first.v + by_shot(average, common_shots(contacts.performers), poses.v - first.v))


def _hip_springs(one: Performer, motion: Motion) -> Springs:
    """The springs that hold the hips of a performer where they are in a motion."""
    legs = one.clip.target_legs
    joints = np.array([leg.hip for leg in legs] if legs else [one.clip.pelvis])
    A = np.broadcast_to(STIFFNESS * np.eye(3), (len(motion), len(joints), 3, 3))
    return Springs(joints, np.full(len(joints), -1), motion.positions[:, joints] / one.clip.unit, A)


def with_shortfall(springs: Springs, before: Springs, x: Array, regions: Numbers) -> Springs:
    """Return the springs with the rest positions of each region moved further by its shortfall in the last sweep, which
    had the springs `before` and led to positions `x`, (frames, joints, 3) [body units].
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
