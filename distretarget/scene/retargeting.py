"""Retarget several performers and props who share a world, each performer to another body, and keep their contacts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import combinations
from types import NoneType
from typing import Any, TypeVar

import numpy as np

from distretarget.baseline.rotation_copy import RootScale, common_level_scale, find_root_scale, longest_strides
from distretarget.baseline.world import rise_onto_soles
from distretarget.body.build import OWN_BUILDS, Builds
from distretarget.checks import check_callable, check_kind, check_number
from distretarget.contact_entries import NO_CONTACTS, ContactList
from distretarget.errors import DistretargetError, MatchingError, MotionError, SettingsError
from distretarget.ik.poses import Mapper, Progress, ignore_progress
from distretarget.measure.diff import prop_in_world
from distretarget.measure.gaps import (
    Gap,
    Overlap,
    ScenePart,
    SkinContacts,
    body_part,
    measure_gaps,
    measure_overlap,
    measure_skin_contacts,
)
from distretarget.measure.skin import find_skin
from distretarget.motion import Motion, same_time
from distretarget.numerics.parallel import in_threads
from distretarget.numerics.vectors import extent
from distretarget.objectives.activation import DEFAULT_SETTINGS, ContactSettings
from distretarget.objectives.constraints import centimetres
from distretarget.objectives.resting_joints import Environment
from distretarget.pipeline.options import HoldMode, Options, SkinMode
from distretarget.pipeline.performer import Performer, Transfer, match_performer
from distretarget.pipeline.result import Match, RetargetResult
from distretarget.scene.contacts import SceneContacts
from distretarget.scene.props import PlacedProp, Placement, Prop, PropResult
from distretarget.scene.skin import collision_skins
from distretarget.scene.sweeps import solve_scene
from distretarget.skeleton import LARGEST, SMALLEST, JointMap, Skeleton
from distretarget.target import AnyTarget, SkeletonEdit, Target

Gaps = dict[tuple[int, int], Gap | None]
Value = TypeVar("Value")
Measured = TypeVar("Measured")

SAME_UNITS = 5.0  # if root scales differ by more than this factor, the files have different units


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneResult:
    """Retargeted performers in one world.

    Pairs are two performers, or a performer and a prop, by their numbers; performers are counted before props.

    Attributes:
        results: one for each performer, in their order.
        props: one for each prop, in their order.
        world_scale: target units per source unit along the floor.
        longest_strides: for each performer, the longest strides that its legs allow, relative to the strides with its
            own `root_scale`.
        gaps: the gap between each pair in source (A) and result (B); None if nothing touches.
        copy_gaps: the same in source and rotation copy.
        skin_gaps: how well the gaps between skins are kept, for each two performers that have skins; None if no
            skins touch.
        overlaps: for each two performers that have skins, the frame and parts with the deepest overlap.
        sweeps: how many times all performers were solved.
        gap_error: the mean error of the gaps after the last sweep [leg lengths].
        units: for each performer, its target file's units per unit of the world, whose unit is the first target's.
    """

    results: tuple[RetargetResult, ...]
    props: tuple[PropResult, ...]
    world_scale: float
    longest_strides: tuple[float, ...]
    gaps: Gaps
    copy_gaps: Gaps
    skin_gaps: dict[tuple[int, int], SkinContacts | None]
    overlaps: dict[tuple[int, int], Overlap]
    sweeps: int
    gap_error: float
    units: tuple[float, ...]

    @property
    def motions(self) -> tuple[Motion, ...]:
        """The motions of all results, each in the unit of its target's file."""
        each = zip(self.results, self.units, strict=True)
        return tuple(one.motion if unit == 1.0 else one.motion.scaled(unit) for one, unit in each)


def retarget_scene(
    sources: Sequence[Motion],
    targets: Sequence[AnyTarget],
    props: Sequence[Prop] = (),
    *,
    joint_maps: Sequence[JointMap | None] | None = None,
    rests: Sequence[Motion | None] | None = None,
    world_scale: float | None = None,
    supports: HoldMode = "hold",
    environment: Environment = "body",
    skin: SkinMode | Sequence[SkinMode] = "auto",
    builds: Sequence[Builds] | None = None,
    contacts: Sequence[ContactList] | None = None,
    settings: ContactSettings = DEFAULT_SETTINGS,
    mapper: Mapper | None = None,
    progress: Progress | None = None,
) -> SceneResult:
    """Retarget several performers who share a world, and keep the contacts between them.

    The world has one scale along the floor, so that performers meet; heights have the scale of each performer, so that
    all stand on the floor. Joints of two performers that come near each other are drawn to each other, joints that come
    near a prop to their places on the prop. Each performer is first solved alone. While the gaps are wrong, each is
    solved again with springs to the others. The order of performers does not matter.

    If only some bodies face -Z by convention, as in VRM 0, all results face +Z; files are written in the convention of
    their characters.

    Root scales that differ by a factor of more than five mean that files are in different units. Results are then in
    the unit of the first target, and `SceneResult.motions` in the units of their targets.

    Args:
        sources: the performers' motions, in one world, with the same frames.
        targets: a body for each, as in `retarget`.
        props: what else is in their world, such as chairs, tables and swords.
        joint_maps: for each performer as in `retarget`.
        rests: for each performer the `rest` of `retarget`.
        world_scale: target units per source unit along the floor; if not given, the mean of the performers' ratios of
            leg lengths, or less if the legs of one would be too short.
        supports: as in `retarget`.
        environment: as in `retarget`.
        skin: as in `Options`, for all performers or for each. A performer without skin has that of an average body to
            performers with skin, unless its own is "none".
        builds: for each performer as in `retarget`.
        contacts: for each performer as in `retarget`.
        settings: as in `retarget`.
        mapper: as in `retarget`.
        progress: called with the number of each sweep as it begins, from 1.

    Raises:
        SettingsError: there is not a target, map, skin or build for each source, the world's scale is not above 0, or
            a prop has the scale of, or is held by, a performer that does not exist.
        MotionError: the sources differ in frames or frame times, the sizes of targets are too different, or a prop
            becomes too large to compute with.
        MatchingError: a source and its target cannot be matched.
        SkeletonError: a prop is held by a joint that its performer does not have.
    """
    _check_each("sources", sources, Motion)
    _check_each("targets", targets, Motion, Skeleton, Target, SkeletonEdit)
    _check_each("props", props, Prop)
    count = len(sources)
    maps = _of_each("joint_maps", joint_maps, None, count, Mapping, NoneType)
    stances = _of_each("rests", rests, None, count, Motion, NoneType)
    modes = _of_each("skin", None if isinstance(skin, str) else skin, skin, count, str)
    thick = _of_each("builds", builds, OWN_BUILDS, count, Builds)
    contact_lists = _of_each("contacts", contacts, NO_CONTACTS, count, ContactList)
    counts = [*map(len, (sources, targets, maps, stances, modes, thick, contact_lists))]
    if not sources or len({*counts}) > 1:
        numbers = "{} sources, {} targets, {} maps, {} rest poses, {} skins, {} builds and {} contact lists"
        raise SettingsError(f"{numbers.format(*counts)}; expected one for each source")
    if world_scale is not None:
        check_number("world_scale", world_scale, SMALLEST, LARGEST)
    check_kind("settings", settings, ContactSettings)
    mapper, progress = in_threads if mapper is None else mapper, ignore_progress if progress is None else progress
    check_callable("mapper", mapper)
    check_callable("progress", progress)
    options = [Options(supports=supports, environment=environment, skin=mode) for mode in modes]
    transfers = [*map(Transfer, sources, targets, options, maps, stances, thick)]
    return retarget_transfers(transfers, props, contact_lists, world_scale, settings, mapper, progress)


def retarget_transfers(
    transfers: Sequence[Transfer],
    props: Sequence[Prop],
    contact_lists: Sequence[ContactList],
    world_scale: float | None = None,
    settings: ContactSettings = DEFAULT_SETTINGS,
    mapper: Mapper = in_threads,
    progress: Progress = ignore_progress,
) -> SceneResult:
    """Retarget several performers who share a world; parameters and errors as in `retarget_scene`."""
    _check_times([each.source for each in transfers], props)
    transfers, props = _facing_one_way(transfers, props)
    performers, heights, units = _in_one_unit(transfers)
    longest = [longest_strides(performer.matching) for performer in performers]
    level = world_scale or common_level_scale(heights, longest)
    placed = [_placed(prop, performers, level, heights) for prop in props]
    prepared = []
    for match, height, given in zip(performers, heights, transfers, strict=True):
        soles = height * rise_onto_soles(match.matching, height, match.undersides)  # on the floor that all share
        one = Performer.of(match, RootScale(level, height, soles), given.options)
        prepared.append(one.with_supports(given.options, settings))
    skins = collision_skins(performers, [each.options.skin for each in transfers])
    solved = solve_scene(prepared, placed, skins, contact_lists, mapper, progress)
    results, touching = list[RetargetResult](), solved.contacts
    each = zip(touching.performers, solved.poses, solved.motions, contact_lists, solved.unmet, strict=True)
    for number, (one, pose, posed, entries, unmet) in enumerate(each):
        with _performer(number):
            results.append(replace(one.result(pose, posed=posed), contact_list=entries, unmet=unmet))
    motions, copies = [one.motion for one in results], [one.rotation_copy for one in results]
    moved = zip(placed, touching.placements(motions), touching.placements(copies), strict=True)
    return SceneResult(
        results=tuple(results),
        props=tuple(
            PropResult(prop.name, place.moved(prop.motion), prop.motion, place.scale, copied.moved(prop.motion))
            for prop, place, copied in moved
        ),
        world_scale=level,
        longest_strides=tuple(longest),
        gaps=_gaps(touching, results, motions),
        copy_gaps=_gaps(touching, results, copies),
        skin_gaps=_of_pairs(results, measure_skin_contacts),
        overlaps=_of_pairs(results, lambda _sources, motions, _skins, skins: measure_overlap(motions, skins)),
        sweeps=solved.sweeps,
        gap_error=solved.gap_error,
        units=units,
    )


def _of_each(name: str, given: Sequence[Value] | None, usual: Any, count: int, *kinds: type) -> Sequence[Value]:
    """The values given for each of `count` performers; without any, the usual one for all."""
    values = [usual] * count if given is None else given
    _check_each(name, values, *kinds)
    return values


def _check_each(name: str, values: Sequence[object], *kinds: type) -> None:
    check_kind(name, values, Sequence)
    for number, value in enumerate(values):
        check_kind(f"{name}[{number}]", value, *kinds)


def _check_times(sources: Sequence[Motion], props: Sequence[Prop]) -> None:
    count, time = len(sources[0]), sources[0].frame_time
    moving = [(repr(prop.name), prop.motion) for prop in props if len(prop.motion) != 1]
    for name, motion in [*((f"performer {number}", each) for number, each in enumerate(sources, 1)), *moving]:
        frames, own = len(motion), motion.frame_time
        if frames != count:
            raise MotionError(f"{name} has {frames} frames and performer 1 has {count}; cut them to the same frames")
        if not same_time(time, own):
            raise MotionError(
                f"{name} has a frame time of {own:g} s and performer 1 of {time:g} s; resample one of them"
            )


def _matched(transfers: Sequence[Transfer]) -> list[Match]:
    """The performers, in the axes of the first."""
    performers, axes = list[Match](), dict[str, Any]()
    for number, each in enumerate(transfers):
        with _performer(number):
            performers.append(match_performer(replace(each, options=replace(each.options, **axes))))
        axes = {"source_up": performers[0].world.source_up, "target_up": performers[0].world.up}
    return performers


def _in_one_unit(transfers: Sequence[Transfer]) -> tuple[list[Match], list[float], tuple[float, ...]]:
    """The performers in the unit of the first target, their root scales, and `SceneResult.units`."""
    performers = _matched(transfers)
    heights, units = [find_root_scale(one.matching) for one in performers], [1.0] * len(performers)
    if max(heights) > SAME_UNITS * min(heights):
        cm = [centimetres(one.matching.target.unit) for one in performers]
        units = [cm[0] / each for each in cm]
        both = zip(transfers, units, strict=True)
        performers = _matched([replace(each, target=each.loaded.scaled(1.0 / unit)) for each, unit in both])
        heights = [find_root_scale(one.matching) for one in performers]
    if max(heights) > SAME_UNITS * min(heights):
        with _performer(int(np.argmax(heights)), of_target=True):
            raise MotionError(
                f"the root scale of this target is {max(heights):.3g}, that of another {min(heights):.3g}: their files "
                "seem to be in different units; scale one of the targets"
            )
    return performers, heights, tuple(units)


@contextmanager
def _performer(number: int, *, of_target: bool = False) -> Iterator[None]:
    """Mark errors within as those of a performer, of its target if `of_target`."""
    try:
        yield
    except DistretargetError as error:
        error.performer, error.of_target = number, of_target or isinstance(error, MatchingError)
        raise


def _facing_one_way(transfers: Sequence[Transfer], props: Sequence[Prop]) -> tuple[Sequence[Transfer], Sequence[Prop]]:
    """Return performers and props, all looking to +Z where some but not all bodies look to -Z by convention."""
    if len({(each.source.skeleton.faces_negative_z, each.goal.skeleton.faces_negative_z) for each in transfers}) == 1:
        return transfers, props
    ahead = ((each, each.source.facing_forward(), each.loaded.facing_forward()) for each in transfers)
    turned = [replace(each, source=source, target=target) for each, source, target in ahead]
    return turned, [replace(prop, motion=prop.motion.facing_forward()) for prop in props]


def _placed(prop: Prop, performers: Sequence[Match], level: float, heights: Sequence[float]) -> PlacedProp:
    """Place a prop in the target's world; scales are `level` along the floor and `heights` of the performers."""
    matching = performers[0].matching
    scale = level if prop.scale == "world" else prop.scale
    if isinstance(scale, int):
        if not 0 <= scale < len(heights):
            raise SettingsError(f"{prop.name!r} has the scale of performer {scale}; there are {len(heights)}")
        scale = heights[scale]
    grips: dict[int, tuple[int, ...]] = {}
    for grip in prop.held_by:
        if not 0 <= grip.performer < len(performers):
            raise SettingsError(f"{prop.name!r} is held by performer {grip.performer}; there are {len(performers)}")
        holder = performers[grip.performer].matching
        driven = np.flatnonzero(holder.drivers == holder.source.skeleton.index(grip.joint))
        if not len(driven):
            raise SettingsError(f"{prop.name!r} is held by {grip.joint!r}, which drives no joint of the target")
        grips[grip.performer] = (*grips.get(grip.performer, ()), int(driven[0]))
    source = matching.source_motion
    motion = prop_in_world(prop.motion, performers[0].world, len(source), source.frame_time_text)
    centre, turn = motion.positions.mean(axis=1), np.broadcast_to(np.eye(3), (len(motion), 3, 3))
    free = Placement(centre, RootScale(level, scale).places(centre, matching.source.up_vector), turn, scale)
    prop.check_size(scale, extent(free(motion.positions)))
    return PlacedProp(prop.name, motion, free, grips, prop.surface)


def _gaps(contacts: SceneContacts, results: Sequence[RetargetResult], motions: Sequence[Motion]) -> Gaps:
    """The gaps between performers with these motions, and between them and the props that follow them."""
    each = zip(results, motions, strict=True)
    bodies = [[body_part(one.matching, one.source.positions, motion.positions)] for one, motion in each]
    props = []
    for prop, place in zip(contacts.props, contacts.placements(motions), strict=True):
        x = prop.motion.positions
        props.append((ScenePart(a=x, b=place(x), keys=prop.motion.skeleton.keys), place.scale))
    return dict(measure_gaps(bodies, props, contacts.performers[0].clip.scale.level))


def _of_pairs(results: Sequence[RetargetResult], measure: Callable[..., Measured]) -> dict[tuple[int, int], Measured]:
    """Call `measure` for each two performers with skins: with their sources, results, and skins of both."""
    known, found = {}, {}
    for number, one in enumerate(results):
        if one.skins:
            source_skin = find_skin(one.matching.source, one.skins.source.capsules, one.baseline.match.source_mesh)
            known[number] = source_skin, find_skin(one.matching.target, one.skins.target.capsules, one.mesh)
    for i, j in combinations(known, 2):
        sources, motions = ([getattr(results[n], side) for n in (i, j)] for side in ("source", "motion"))
        found[i, j] = measure(sources, motions, *zip(known[i], known[j], strict=True))
    return found
