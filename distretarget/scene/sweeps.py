"""Solve a scene in sweeps: each performer by itself, drawn to the present places of the others and of props.

In the first sweep nobody is drawn to other performers. It decides where hips and feet are: from then on the hips stay
there, and limbs and trunk do what contacts ask. How much they do changes smoothly in time. Where a user asks for
contacts, the scene is solved without what is made, and again with it, and blended where it sets in and lets go.

A body of finite stiffness stops short of the places that its springs draw it to. The next sweep draws it further by as
much, as in the method of multipliers (M. J. D. Powell, A method for nonlinear constraints in minimization problems,
1969). Each region of the body is drawn as a whole: a hand that holds a larger one cannot have all joints in their
places.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from distretarget.contact_entries import ContactList
from distretarget.ik.poses import Mapper, Poses
from distretarget.ik.springs import Springs, joined
from distretarget.motion import Motion
from distretarget.numerics.moving import averaged
from distretarget.numerics.time_series import by_shot
from distretarget.numerics.vectors import Array, Numbers, lengths
from distretarget.objectives.body_skin import Skins
from distretarget.objectives.constraints import Carrier, Constraints
from distretarget.objectives.contact import solve_contact
from distretarget.objectives.supports import STIFFNESS
from distretarget.pipeline.constrained_motion import constrained, constrained_supports, dropping, layered, met, unmet
from distretarget.pipeline.performer import Performer
from distretarget.scene.apart import kept_apart
from distretarget.scene.contacts import SceneContacts, common_shots, copy_on_path, find_scene_contacts
from distretarget.scene.props import PlacedProp, Placement, nearest_on_bones
from distretarget.scene.skin import with_skins

MOST_SWEEPS = 4
SETTLED = 0.012  # a mean gap error below this needs no further sweep [leg lengths]
MOST_SHORTFALL = 0.01  # joints are drawn at most this far beyond their places, which may be out of reach [body units]
SMOOTHING = 0.1  # what contacts change is averaged over this time on each side, weighted by a raised cosine [s]
TINY = 1e-12  # divisors are no smaller


@dataclass(frozen=True, eq=False)
class SolvedScene:
    """A scene, solved."""

    contacts: SceneContacts  # what touches in it, with the performers as they were solved
    poses: Sequence[Poses]  # of each performer
    motions: Sequence[Motion]  # of each performer, with its limbs bent as skins ask
    sweeps: int  # how many times all performers were solved
    gap_error: float  # the mean difference between gaps and what they should be [leg lengths]
    unmet: Sequence[tuple[str, ...]]  # of each performer, what was asked of it and could be met in part only


def solve_scene(
    performers: Sequence[Performer],
    props: Sequence[PlacedProp],
    skins: Sequence[Skins | None],
    asked: Sequence[ContactList],
    mapper: Mapper,
    progress: Callable[[int], object],
) -> SolvedScene:
    """Solve a scene. `asked` has the contacts that are asked of each performer; `skins` the surface of each that
    collides with other performers. Raises a ContactsError if what is asked does not suit the clip.
    """

    def constraints_of(motions: Sequence[Motion], places: Sequence[Placement]) -> list[Constraints]:
        others = _carriers(performers, motions, props, places)
        return [
            Constraints.of(contacts, one.clip, one.match.matching.target, one.settings.blend, others)
            for contacts, one in zip(asked, performers, strict=True)
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
    held = solved(replace(free.contacts, performers=tuple(constrained(*each) for each in changed)))
    made, share = (
        [constraints.made for constraints in found],
        np.max([constraints.share for constraints in found], axis=0),
    )
    each = zip(held.contacts.performers, free.contacts.performers, free.motions, held.motions, made, strict=True)
    shown, motions, told = list[Performer](), list[Motion](), list[tuple[str, ...]]()
    for one, alone, without, motion, constraints in each:
        motion = met(one, motion, constraints) if constraints else motion
        motions.append(layered(made, without, motion))
        shown.append(replace(one, supports=constrained_supports(alone.supports, one.supports, share)))
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
    """The place on a prop that is nearest to one, (3,), both relative to its first joint as that is turned, and the
    direction out of it there [target file units].
    """
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
    average = partial(averaged, reach=round(SMOOTHING / contacts.performers[0].clip.frame_time))
    return replace(poses, v=alone.v + by_shot(average, common_shots(contacts.performers), poses.v - alone.v))


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
