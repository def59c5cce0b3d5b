"""A scene as a user asks: solved without what is made, and again with it, and blended where it sets in and lets go."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from distretarget.contact_entries import ContactList
from distretarget.ik.poses import Mapper, Poses
from distretarget.motion import Motion
from distretarget.numerics.vectors import lengths
from distretarget.objectives.asking import Carrier, Wishes
from distretarget.objectives.skins import Skins
from distretarget.pipeline.asked_motion import as_asked, asked_supports, dropping, layered, met, unmet
from distretarget.pipeline.performer import Performer
from distretarget.scene.prop_surface import nearest_on_bones
from distretarget.scene.props import PlacedProp
from distretarget.scene.skin import with_skins
from distretarget.scene.sweeps import SceneContacts, find_contacts, solve_in_sweeps

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
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

    def wishes_of(others: Mapping[str, Carrier]) -> list[Wishes]:
        given = zip(asked, performers, strict=True)
        return [
            Wishes.of(contacts, one.clip, one.match.matching.target, one.settings.blend, others)
            for contacts, one in given
        ]

    copies = [replace(one.clip.copy, root_positions=one.clip.root) for one in performers]
    placements = [each.free for each in props]
    found = wishes_of(
        _others(
            performers, copies, props, names, [p.moved(each.motion) for p, each in zip(placements, props, strict=True)]
        )
    )
    free = _solved(
        [dropping(*each) for each in zip(performers, (w.drops for w in found), strict=True)],
        props,
        skins,
        mapper,
        progress,
    )
    if not any(wishes.made.wishes for wishes in found):
        return free
    places = zip(free.contacts.placements(free.motions), props, strict=True)
    found = wishes_of(_others(performers, free.motions, props, names, [p.moved(each.motion) for p, each in places]))
    changed = [as_asked(*each) for each in zip(performers, found, strict=True)]
    held = _solved(changed, props, skins, mapper, progress)
    made = [wishes.made for wishes in found]
    met_by = zip(held.contacts.performers, held.motions, made, strict=True)
    motions = [met(*each) if each[2].wishes else each[1] for each in met_by]
    layer = partial(layered, made)
    motions = [layer(*each) for each in zip(free.motions, motions, strict=True)]
    share = np.max([each.share for each in made], axis=0)
    supported = zip(free.contacts.performers, held.contacts.performers, strict=True)
    shown = tuple(replace(b, supports=asked_supports(a.supports, b.supports, share)) for a, b in supported)
    told = [tuple(unmet(*each)) for each in zip(held.contacts.performers, made, motions, strict=True)]
    return replace(free, contacts=replace(free.contacts, performers=shown), motions=motions, unmet=told)


def _solved(
    performers: Sequence[Performer],
    props: Sequence[PlacedProp],
    skins: Sequence[Skins | None],
    mapper: Mapper,
    progress: Callable[[int], object],
) -> SolvedScene:
    """The scene of performers as they are."""
    contacts = find_contacts(performers, props)
    poses, sweeps, gap_error = solve_in_sweeps(contacts, mapper, progress)
    return SolvedScene(
        contacts=contacts,
        poses=poses,
        motions=with_skins(contacts, poses, skins),
        sweeps=sweeps,
        gap_error=gap_error,
        unmet=[()] * len(performers),
    )


def _others(
    performers: Sequence[Performer],
    motions: Sequence[Motion],
    props: Sequence[PlacedProp],
    names: Sequence[str],
    moved: Sequence[Motion],
) -> dict[str, Carrier]:
    """What parts may rest on, by its name: performers by their numbers from 1, and props."""
    found = {}
    for number, (one, motion) in enumerate(zip(performers, motions, strict=True), 1):
        skin, unit = one.match.skins and one.match.skins.target, one.clip.unit
        radii = [unit * skin.thickness(joint) if skin else 0.0 for joint in range(len(motion.skeleton))]
        found[str(number)] = Carrier(motion=motion, radii=tuple(radii))
    for name, prop, motion in zip(names, props, moved, strict=True):
        found[name] = Carrier(motion=motion, nearest=partial(_nearest, prop), is_whole=True)
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
