"""Several performers, and props, in one world: each on another body, and what touches goes on touching."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import RootScale, find_root_scale, followed_scale, longest_strides
from distretarget.baseline.world import turned
from distretarget.checks import check_kind, check_number
from distretarget.errors import MotionError, SettingsError
from distretarget.ik.poses import Mapper
from distretarget.measure.scene_gaps import Across, ScenePart, body_part, measure_across
from distretarget.motion import Motion, same_time
from distretarget.numerics.parallel import in_threads
from distretarget.objectives.resting_joints import Environment
from distretarget.objectives.settings import DEFAULT_SETTINGS, ContactSettings
from distretarget.pipeline.options import HoldMode, Options
from distretarget.pipeline.performer import Performer, matched_performer, with_supports
from distretarget.pipeline.result import RetargetResult
from distretarget.scene.prop import Prop
from distretarget.scene.prop_contacts import Placement, free_placement
from distretarget.scene.sweeps import PlacedProp, Together, brought_together, solve_together
from distretarget.skeleton import LARGEST, SMALLEST, JointMap, Skeleton
from distretarget.target import SkeletonEdit, Target

Array = NDArray[np.float64]

SAME_UNITS = 5.0  # root scales that differ by more than this are those of files in different units


@dataclass(frozen=True, eq=False)
class PropResult:
    """A prop among the retargeted performers.

    Attributes:
        name: what it is called.
        motion: where it is, in its own size.
        source: where it was in the source, in the target's axes.
        scale: target units per source unit of its size.
    """

    name: str
    motion: Motion
    source: Motion
    scale: float


@dataclass(frozen=True)
class Strides:
    """How long the strides of a performer are, against what its legs alone would make of the source's.

    Attributes:
        factor: in the scene's world.
        longest: that its legs can reach.
    """

    factor: float
    longest: float


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneResult:
    """Retargeted performers in one world.

    Attributes:
        results: one for each performer, in their order.
        props: one for each prop, in their order.
        world_scale: target units per source unit along the floor.
        strides: of each performer, in this world.
        across: for each two of them, performers counted before props, how well they keep touching; props among each
            other are left out.
        sweeps: how many times all performers were solved.
        off: how far the gaps between what touches are off after the last sweep, on average [leg lengths].
    """

    results: tuple[RetargetResult, ...]
    props: tuple[PropResult, ...]
    world_scale: float
    strides: tuple[Strides, ...]
    across: dict[tuple[int, int], Across]
    sweeps: int
    off: float


def retarget_scene(
    sources: Sequence[Motion],
    targets: Sequence[Motion | Skeleton | Target | SkeletonEdit],
    props: Sequence[Prop] = (),
    *,
    joint_maps: Sequence[JointMap | None] | None = None,
    world_scale: float | None = None,
    supports: HoldMode = "hold",
    environment: Environment = "body",
    settings: ContactSettings = DEFAULT_SETTINGS,
    mapper: Mapper = in_threads,
    progress: Callable[[int], object] = lambda _sweep: None,
) -> SceneResult:
    """Retarget several performers who share a world, and keep together what touches between them.

    The world has one scale along the floor, so that they meet; each performer has its own upwards, so that each stands
    on the floor. Joints of two performers that come near each other are drawn to each other, joints that come near a
    prop to their place on it. Each performer is solved by itself, all of them once more if what touches is not in its
    place; their order does not matter.

    Args:
        sources: the performers' motions, in one world, frame by frame.
        targets: a body for each; for its kinds see `retarget`.
        props: what else is in their world, such as chairs, tables and props.
        joint_maps: for each performer as in `retarget`.
        world_scale: target units per source unit along the floor; if not given, the mean of the performers' ratios of
            leg lengths, or as much less as the legs of all can follow.
        supports: as in `retarget`.
        environment: as in `retarget`.
        settings: as in `retarget`.
        mapper: solves the chunks of long clips, as in `retarget`.
        progress: called with the number of each sweep as it begins, from 1.

    Raises:
        SettingsError: there is not a target or map for each source, the world's scale is not above 0, or a prop has
            the scale of no performer or is held by none.
        MotionError: the sources differ in frames or frame times, or targets are in different units.
        MatchingError: a source and its target cannot be matched.
        SkeletonError: a prop is held by a joint that its performer does not have.
    """
    _check_kinds(
        sources=(sources, (Motion,)),
        targets=(targets, (Motion, Skeleton, Target, SkeletonEdit)),
        props=(props, (Prop,)),
    )
    maps = [None] * len(sources) if joint_maps is None else joint_maps
    _check_arguments(sources, targets, maps, world_scale)
    options = Options(supports=supports, environment=environment)
    check_kind("settings", settings, ContactSettings)
    _check_times(sources, props)
    performers = _matched(sources, targets, maps)
    heights = [find_root_scale(performer.matching) for performer in performers]
    _check_units(heights)
    longest = [longest_strides(performer.matching) for performer in performers]
    level = world_scale or followed_scale(heights, longest)
    prepared = [
        with_supports(performer.prepared(RootScale(level, height)), options, settings)
        for performer, height in zip(performers, heights, strict=True)
    ]
    motions = [_in_target_axes(prop.motion, performers[0], len(sources[0])) for prop in props]
    placed = [_placed(prop, motion, performers, level, heights) for prop, motion in zip(props, motions, strict=True)]
    together = brought_together(prepared, placed)
    solved = solve_together(together, mapper, progress)
    results = tuple(one.result(pose) for one, pose in zip(together.performers, solved.poses, strict=True))
    moved = tuple(
        PropResult(prop.name, _moved(motion, place), motion, place.scale)
        for prop, motion, place in zip(props, motions, solved.placements, strict=True)
    )
    return SceneResult(
        results=results,
        props=moved,
        world_scale=level,
        strides=tuple(Strides(level / height, most) for height, most in zip(heights, longest, strict=True)),
        across=_across(together, results, solved.placements, level),
        sweeps=solved.sweeps,
        off=solved.off,
    )


def _check_kinds(**sequences: tuple[Sequence[object], tuple[type, ...]]) -> None:
    """Check that each argument is a sequence, and that all in it are of its kinds."""
    for name, (values, kinds) in sequences.items():
        check_kind(name, values, Sequence)
        for number, value in enumerate(values):
            check_kind(f"{name}[{number}]", value, *kinds)


def _check_arguments(
    sources: Sequence[Motion],
    targets: Sequence[Motion | Skeleton | Target | SkeletonEdit],
    maps: Sequence[JointMap | None],
    world_scale: float | None,
) -> None:
    if not sources or len(sources) != len(targets) or len(maps) != len(sources):
        raise SettingsError(
            f"{len(sources)} sources, {len(targets)} targets and {len(maps)} maps; expected one for each source"
        )
    if world_scale is not None:
        check_number("world_scale", world_scale, SMALLEST, LARGEST)


def _matched(
    sources: Sequence[Motion],
    targets: Sequence[Motion | Skeleton | Target | SkeletonEdit],
    maps: Sequence[JointMap | None],
) -> list[Performer]:
    """The performers, all in the axes of the first."""
    first = matched_performer(sources[0], targets[0], joint_map=maps[0])
    up, target_up = first.world.source_up, first.world.up
    others = [
        matched_performer(source, goal, Options(source_up=up, target_up=target_up), pairs)
        for source, goal, pairs in zip(sources[1:], targets[1:], maps[1:], strict=True)
    ]
    return [first, *others]


def _in_target_axes(motion: Motion, first: Performer, frames: int) -> Motion:
    """A prop's motion in the target's axes, with a frame for each of the scene's."""
    motion = turned(motion, first.world.source_up, first.world.up)
    time = first.matching.source_motion.frame_time_text
    every = np.minimum(np.arange(frames), len(motion) - 1)
    return replace(motion[every], frame_time_text=time)


def _placed(
    prop: Prop, motion: Motion, performers: Sequence[Performer], level: float, heights: Sequence[float]
) -> PlacedProp:
    grips: dict[int, tuple[int, ...]] = {}
    for grip in prop.held_by:
        if not 0 <= grip.performer < len(performers):
            raise SettingsError(f"{prop.name!r} is held by performer {grip.performer}; there are {len(performers)}")
        matching = performers[grip.performer].matching
        driven = np.flatnonzero(matching.drivers == matching.source.skeleton.index(grip.joint))
        if not len(driven):
            raise SettingsError(f"{prop.name!r} is held by {grip.joint!r}, which drives no joint of the target")
        grips[grip.performer] = (*grips.get(grip.performer, ()), *driven[:1].tolist())
    up, scale = performers[0].matching.source.up_vector, _scale_of(prop, level, heights)
    return PlacedProp(motion.positions, free_placement(motion.positions, scale, level, up), grips)


def _scale_of(prop: Prop, level: float, heights: Sequence[float]) -> float:
    match prop.scale:
        case float():
            return prop.scale
        case int():
            if not 0 <= prop.scale < len(heights):
                raise SettingsError(f"{prop.name!r} has the scale of performer {prop.scale}; there are {len(heights)}")
            return heights[prop.scale]
        case _:
            return level


def _moved(motion: Motion, placement: Placement) -> Motion:
    """A prop's motion where its placement takes it."""
    turn = Rotation.from_matrix(placement.turn)
    translations, rotations = placement.scale * motion.translations, np.array(motion.rotations)
    translations[:, 0] = placement(motion.positions[:, :1])[:, 0]
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    skeleton = motion.skeleton.with_offsets(placement.scale * motion.skeleton.offsets)
    return Motion.of_translations(skeleton, translations, rotations, motion.frame_time_text)


def _across(
    together: Together, results: Sequence[RetargetResult], placements: Sequence[Placement], level: float
) -> dict[tuple[int, int], Across]:
    """How well each two keep touching, performers before props."""
    bodies = [body_part(each.matching, each.rotation_copy, each.motion) for each in results]
    copies = [each.rotation_copy for each in results]
    across = {(i, j): measure_across(bodies[i], bodies[j], level) for i, j in combinations(range(len(bodies)), 2)}
    for i, (k, place) in product(range(len(bodies)), enumerate(placements)):
        points = together.props[k].points
        prop = ScenePart(points, together.placement(k, copies)(points), place(points), bodies[i].leg)
        across[i, len(bodies) + k] = measure_across(bodies[i], prop, place.scale)
    return across


def _check_times(sources: Sequence[Motion], props: Sequence[Prop]) -> None:
    frames, time = len(sources[0]), sources[0].frame_time
    everything = [(f"performer {number + 1}", source) for number, source in enumerate(sources)]
    everything += [(repr(prop.name), prop.motion) for prop in props if len(prop.motion) != 1]
    for name, motion in everything:
        if len(motion) != frames:
            raise MotionError(
                f"{name} has {len(motion)} frames and performer 1 has {frames}; cut them to the same frames"
            )
        if not same_time(time, motion.frame_time):
            raise MotionError(
                f"{name} has a frame time of {motion.frame_time:g} s and performer 1 of {time:g} s; "
                "resample one of them"
            )


def _check_units(heights: Sequence[float]) -> None:
    if max(heights) > SAME_UNITS * min(heights):
        raise MotionError(
            f"the targets' root scales go from {min(heights):.3g} to {max(heights):.3g}: their files seem to be in "
            "different units; scale one of the targets"
        )
