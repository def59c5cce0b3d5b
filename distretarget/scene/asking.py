"""A scene as a user asks: solved without what is made, and again with it, and blended where it sets in and lets go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from distretarget.contact_entries import ContactList
from distretarget.ik.poses import Mapper, Poses
from distretarget.motion import Motion
from distretarget.numerics.vectors import lengths
from distretarget.objectives.asking import Carrier, Wishes
from distretarget.objectives.skin import Skins
from distretarget.pipeline.asked_motion import as_asked, asked_supports, dropping, layered, met, unmet
from distretarget.pipeline.performer import Performer
from distretarget.scene.apart import kept_apart
from distretarget.scene.prop_surface import nearest_on_bones
from distretarget.scene.props import PlacedProp, Placement
from distretarget.scene.skin import with_skins
from distretarget.scene.sweeps import SceneContacts, find_contacts, solve_in_sweeps

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SolvedScene:
    """A scene, solved.

    Attributes:
        contacts: what touches in it, with the performers as they were solved.
        poses: of each performer.
        motions: of each performer, with its limbs bent as skins ask.
        sweeps: how many times all performers were solved.
        gap_error: the mean difference between gaps and what they should be [leg lengths].
        unmet: of each performer, what was asked of it and could be met in part only.
    """

    contacts: SceneContacts
    poses: Sequence[Poses]
    motions: Sequence[Motion]
    sweeps: int
    gap_error: float
    unmet: Sequence[tuple[str, ...]]


def solve_scene(
    performers: Sequence[Performer],
    props: Sequence[PlacedProp],
    names: Sequence[str],
    skins: Sequence[Skins | None],
    asked: Sequence[ContactList],
    mapper: Mapper,
    progress: Callable[[int], object],
) -> SolvedScene:
    """Solve a scene, of whose performers different things are asked; `names` are those of the props, and `skins` what
    performers are to each other.

    Raises:
        ContactsError: what is asked does not suit the clip.
    """

    def wishes_of(motions: Sequence[Motion], places: Sequence[Placement]) -> list[Wishes]:
        moved = [place.moved(each.motion) for place, each in zip(places, props, strict=True)]
        others = _others(performers, motions) | _other_props(names, props, moved)
        return [
            Wishes.of(contacts, one.clip, one.match.matching.target, one.settings.blend, others)
            for contacts, one in zip(asked, performers, strict=True)
        ]

    def solved(contacts: SceneContacts) -> SolvedScene:
        poses, sweeps, error = solve_in_sweeps(contacts, mapper, progress)
        motions = with_skins(contacts, poses, skins)
        return SolvedScene(contacts, poses, motions, sweeps, error, [()] * len(performers))

    copies = [replace(one.clip.copy, root_positions=one.clip.root) for one in performers]
    found = wishes_of(copies, [each.free for each in props])
    dropped = [dropping(one, wishes.drops) for one, wishes in zip(performers, found, strict=True)]
    free = solved(kept_apart(find_contacts(dropped, props), skins))
    if not any(wishes.made.wishes for wishes in found):
        return free
    found = wishes_of(free.motions, free.contacts.placements(free.motions))
    changed = zip(free.contacts.performers, found, strict=True)
    held = solved(replace(free.contacts, performers=tuple(as_asked(*each) for each in changed)))
    made, share = [wishes.made for wishes in found], np.max([wishes.share for wishes in found], axis=0)
    each = zip(held.contacts.performers, free.contacts.performers, free.motions, held.motions, made, strict=True)
    shown, motions, told = list[Performer](), list[Motion](), list[tuple[str, ...]]()
    for one, alone, without, motion, wishes in each:
        motion = met(one, motion, wishes) if wishes.wishes else motion
        motions.append(layered(made, without, motion))
        shown.append(replace(one, supports=asked_supports(alone.supports, one.supports, share)))
        told.append(tuple(unmet(one, wishes, motions[-1])))
    contacts = replace(free.contacts, performers=tuple(shown))
    return replace(free, contacts=contacts, motions=motions, unmet=told)


def _others(performers: Sequence[Performer], motions: Sequence[Motion]) -> dict[str, Carrier]:
    """Performers that parts may rest on, by their numbers from 1."""
    found = {}
    for number, (one, motion) in enumerate(zip(performers, motions, strict=True), 1):
        skin, unit = one.match.skins and one.match.skins.target, one.clip.unit
        radii = [unit * skin.thickness(joint) if skin else 0.0 for joint in range(len(motion.skeleton))]
        found[str(number)] = Carrier(motion=motion, radii=tuple(radii))
    return found


def _other_props(names: Sequence[str], props: Sequence[PlacedProp], moved: Sequence[Motion]) -> dict[str, Carrier]:
    """Props that parts may rest on, by their names."""
    each = zip(names, props, moved, strict=True)
    return {name: Carrier(motion=motion, nearest=partial(_nearest, prop), is_whole=True) for name, prop, motion in each}


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
