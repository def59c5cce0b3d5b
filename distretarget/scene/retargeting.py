"""Retarget several performers and props who share a world, each performer to another body, and keep their contacts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import combinations
from types import NoneType
from typing import Any

import numpy as np

from distretarget.baseline.rotation_copy import RootScale, find_root_scale, followed_scale, longest_strides
from distretarget.body.build import OWN_BUILDS, Builds
from distretarget.checks import check_callable, check_kind, check_number
from distretarget.contact_entries import NO_CONTACTS, ContactList
from distretarget.errors import DistretargetError, MatchingError, MotionError, SettingsError
from distretarget.ik.poses import Mapper, Progress, ignore_progress
from distretarget.measure.diff import prop_in_world
from distretarget.measure.gaps import Gap, ScenePart, SkinGap, body_part, measure_gaps, measure_skin_gap
from distretarget.measure.skin import find_skin
from distretarget.motion import Motion, same_time
from distretarget.numerics.parallel import in_threads
from distretarget.numerics.vectors import extent
from distretarget.objectives.activation import DEFAULT_SETTINGS, ContactSettings
from distretarget.objectives.asking import centimetres
from distretarget.objectives.resting_joints import Environment
from distretarget.pipeline.options import HoldMode, Options, SkinMode
from distretarget.pipeline.performer import Match, match_performer, target_for
from distretarget.pipeline.result import RetargetResult
from distretarget.scene.asking import solve_scene
from distretarget.scene.props import PlacedProp, Prop, PropResult, free_placement
from distretarget.scene.skin import skins_in_company
from distretarget.scene.sweeps import SceneContacts
from distretarget.skeleton import LARGEST, SMALLEST, JointMap, Skeleton
from distretarget.target import AnyTarget, LoadedTarget, SkeletonEdit, Target

Gaps = dict[tuple[int, int], Gap | None]

SAME_UNITS = 5.0  # if root scales differ by more than this factor, the files have different units


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneResult:
    """Retargeted performers in one world.

    Pairs are two performers, or a performer and a prop, by their numbers; performers are counted before props.

    Attributes:
        results: one for each performer, in their order.
        props: one for each prop, in their order.
        world_scale: target units per source unit along the floor.
        longest_strides: for each performer, the largest factor by which its strides may exceed those that its own
            `root_scale` makes before its legs are too short.
        gaps: the gap between each pair in source (A) and result (B); None if nothing touches.
        copy_gaps: the same in source and rotation copy.
        skin_gaps: how well the gaps between the skins of each two performers that have skins are kept; None if no
            skins touch.
        sweeps: how many times all performers were solved.
        gap_error: the mean difference between gaps and what they should be, after the last sweep [leg lengths].
        units: for each performer, how many units of its target's file one of the world is, which is that of the first.
    """

    results: tuple[RetargetResult, ...]
    props: tuple[PropResult, ...]
    world_scale: float
    longest_strides: tuple[float, ...]
    gaps: Gaps
    copy_gaps: Gaps
    skin_gaps: dict[tuple[int, int], SkinGap | None]
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

    The world has one scale along the floor, so that performers meet; each has its own scale upwards, so that it stands
    on the floor. Joints of two performers that come near each other are drawn to each other, joints that come near a
    prop to their places on it. Each performer is solved by itself, at first without the others, and all of them again
    while the gaps are off; their order does not matter.

    Where only some bodies look to -Z by convention, as in VRM 0, these are turned round: all results look to +Z, and
    files are written as their characters look.

    Where the root scales of bodies differ by more than five times, their files are taken for ones in different units,
    and results are in the unit of the first; `SceneResult.motions` are in their own.

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
        skin: as in `Options`, for all performers or for each. Where others have a thickness, one without counts as an
            average body to them, unless its skin is "none".
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
    maps = [None] * len(sources) if joint_maps is None else joint_maps
    _check_each("joint_maps", maps, Mapping, NoneType)
    stances = [None] * len(sources) if rests is None else rests
    _check_each("rests", stances, Motion, NoneType)
    modes = [skin] * len(sources) if isinstance(skin, str) else skin
    _check_each("skin", modes, str)
    thick = [OWN_BUILDS] * len(sources) if builds is None else builds
    _check_each("builds", thick, Builds)
    asked = [NO_CONTACTS] * len(sources) if contacts is None else contacts
    _check_each("contacts", asked, ContactList)
    counts = [*map(len, (sources, targets, maps, stances, modes, thick, asked))]
    if not sources or len({*counts}) > 1:
        numbers = "{} sources, {} targets, {} maps, {} rest poses, {} skins, {} builds and {} contact lists".format(
            *counts
        )
        raise SettingsError(f"{numbers}; expected one for each source")
    if world_scale is not None:
        check_number("world_scale", world_scale, SMALLEST, LARGEST)
    check_kind("settings", settings, ContactSettings)
    mapper, progress = in_threads if mapper is None else mapper, ignore_progress if progress is None else progress
    check_callable("mapper", mapper)
    check_callable("progress", progress)
    options = Options(supports=supports, environment=environment)
    _check_times(sources, props)
    sources, targets, props = _looking_alike(sources, targets, props)
    given = maps, stances, thick
    performers = _matched(modes, sources, targets, *given)
    units = _units_of(performers)
    if len({*units}) > 1:
        targets = _in_one_unit(sources, targets, units)
        performers = _matched(modes, sources, targets, *given)
    heights = _root_scales(performers)
    longest = [longest_strides(performer.matching) for performer in performers]
    level = world_scale or followed_scale(heights, longest)
    placed = [_placed(prop, performers, level, heights) for prop in props]
    prepared = [
        performer.performer(RootScale(level, height), options).with_supports(options, settings)
        for performer, height in zip(performers, heights, strict=True)
    ]
    names, company = [prop.name for prop in props], skins_in_company(performers, modes)
    solved = solve_scene(prepared, placed, names, company, asked, mapper, progress)
    results, touching = list[RetargetResult](), solved.contacts
    each = zip(touching.performers, solved.poses, solved.motions, asked, solved.unmet, strict=True)
    for number, (one, pose, posed, said, found) in enumerate(each):
        with _performer(number):
            results.append(replace(one.result(pose, posed=posed), asked=said, unmet=found))
    motions, copies = [one.motion for one in results], [one.rotation_copy for one in results]
    return SceneResult(
        results=tuple(results),
        props=tuple(
            PropResult(prop.name, place.moved(each.motion), each.motion, place.scale, copied.moved(each.motion))
            for prop, each, place, copied in zip(
                props, placed, touching.placements(motions), touching.placements(copies), strict=True
            )
        ),
        world_scale=level,
        longest_strides=tuple(longest),
        gaps=_gaps(touching, results, motions),
        copy_gaps=_gaps(touching, results, copies),
        skin_gaps=_skin_gaps(results),
        sweeps=solved.sweeps,
        gap_error=solved.gap_error,
        units=units,
    )


def _matched(modes: Sequence[SkinMode], *given: Sequence[Any]) -> list[Match]:
    """The performers, in the axes of the first; of each are given source, target, map, rest pose and builds."""
    performers, axes = list[Match](), Options()
    for number, (mode, *each) in enumerate(zip(modes, *given, strict=True)):
        with _performer(number):
            performers.append(match_performer(each[0], each[1], replace(axes, skin=mode), *each[2:]))
        axes = Options(source_up=performers[0].world.source_up, target_up=performers[0].world.up)
    return performers


def _root_scales(performers: Sequence[Match]) -> list[float]:
    """The root scales of performers, which are of a like size in one unit."""
    heights = [find_root_scale(performer.matching) for performer in performers]
    if max(heights) > SAME_UNITS * min(heights):
        with _performer(int(np.argmax(heights)), of_target=True):
            raise MotionError(
                f"the root scale of this target is {max(heights):.3g}, that of another {min(heights):.3g}: their files "
                "seem to be in different units; scale one of the targets"
            )
    return heights


def _units_of(performers: Sequence[Match]) -> tuple[float, ...]:
    """How many units of each target one of the first's is; 1 where all bodies are of a like size as they are."""
    heights = [find_root_scale(performer.matching) for performer in performers]
    if max(heights) <= SAME_UNITS * min(heights):
        return (1.0,) * len(performers)
    cm = [centimetres(performer.matching.target.unit) for performer in performers]
    return tuple(cm[0] / each for each in cm)


def _in_one_unit(sources: Sequence[Motion], targets: Sequence[AnyTarget], units: Sequence[float]) -> list[LoadedTarget]:
    """The targets in the unit of the first."""
    each = zip(sources, targets, units, strict=True)
    return [
        (given if isinstance(given, SkeletonEdit) else target_for(source, given)).scaled(1.0 / unit)
        for source, given, unit in each
    ]


@contextmanager
def _performer(number: int, *, of_target: bool = False) -> Iterator[None]:
    """Errors within are those of a performer."""
    try:
        yield
    except DistretargetError as error:
        error.performer, error.of_target = number, of_target or isinstance(error, MatchingError)
        raise


def _looking_alike(
    sources: Sequence[Motion], targets: Sequence[AnyTarget], props: Sequence[Prop]
) -> tuple[Sequence[Motion], Sequence[AnyTarget], Sequence[Prop]]:
    """All as given; where bodies of some files look to -Z by convention and others do not, as those that look to +Z."""
    goals = [target_for(*each) for each in zip(sources, targets, strict=True)]
    if len({(a.skeleton.looks_back, b.skeleton.looks_back) for a, b in zip(sources, goals, strict=True)}) == 1:
        return sources, targets, props
    turned = [
        given if isinstance(given, SkeletonEdit) else goal.looking_ahead()
        for given, goal in zip(targets, goals, strict=True)
    ]
    moving = [replace(prop, motion=prop.motion.looking_ahead()) for prop in props]
    return [each.looking_ahead() for each in sources], turned, moving


def _placed(prop: Prop, performers: Sequence[Match], level: float, heights: Sequence[float]) -> PlacedProp:
    """A prop in the target's axes, and the joints of targets that hold it."""
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
    free = free_placement(motion.positions, scale, level, matching.source.up_vector)
    prop.check_size(scale, extent(free(motion.positions)))
    return PlacedProp(motion, free, grips, prop.surface)


def _gaps(contacts: SceneContacts, results: Sequence[RetargetResult], motions: Sequence[Motion]) -> Gaps:
    """The gaps while performers move like this and props follow them."""
    bodies = [
        [body_part(one.matching, one.source.positions, motion.positions)]
        for one, motion in zip(results, motions, strict=True)
    ]
    props = []
    for prop, place in zip(contacts.props, contacts.placements(motions), strict=True):
        points, keys = prop.motion.positions, prop.motion.skeleton.keys
        props.append((ScenePart(a=points, b=place(points), keys=keys), place.scale))
    return dict(measure_gaps(bodies, props, contacts.performers[0].clip.scale.level))


def _skin_gaps(results: Sequence[RetargetResult]) -> dict[tuple[int, int], SkinGap | None]:
    """The gaps between the skins of performers that have skins."""
    known = {
        number: (
            find_skin(one.matching.source, one.skins.source.capsules),
            find_skin(one.matching.target, one.skins.target.capsules, one.mesh),
        )
        for number, one in enumerate(results)
        if one.skins
    }
    gaps = {}
    for both in combinations(known, 2):
        sources, motions = ([getattr(results[n], side) for n in both] for side in ("source", "motion"))
        gaps[both] = measure_skin_gap(sources, motions, *zip(*(known[n] for n in both), strict=True))
    return gaps


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
