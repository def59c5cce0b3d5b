"""Several performers in one world: each on another body, and what touches between them goes on touching."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from types import NoneType
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from distretarget.arguments import check_choice, check_kind, check_number
from distretarget.baseline.root import RootScale, find_root_scale
from distretarget.errors import MotionError, SettingsError
from distretarget.io.target import SkeletonEdit, Target
from distretarget.measure.across import Across, measure_across
from distretarget.motion import Motion
from distretarget.performer import Held, Prepared, matched_performer, with_supports
from distretarget.result import RetargetResult
from distretarget.skeleton import LARGEST, SMALLEST, Skeleton
from distretarget.solve.chunks import Mapper
from distretarget.solve.contact import solve_contact
from distretarget.solve.poses import Poses
from distretarget.solve.resting_joints import Scene
from distretarget.solve.rigid_parts import posed_motion
from distretarget.solve.settings import ContactSettings
from distretarget.solve.springs import Springs, joined, no_springs
from distretarget.solve.touching import Points, Touching, find_touching, touching_springs

Array = NDArray[np.float64]

SWEEPS = 2  # all performers are solved so many times; more change the gaps by a few percent
SAME_UNITS = 5.0  # root scales that differ by more than this are those of files in different units
SAME_TIME = 1e-6  # largest difference between two frame times [of the frame time]


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneResult:
    """Retargeted performers in one world.

    Attributes:
        results: one for each performer, in their order.
        world_scale: target units per source unit along the floor.
        across: for each two performers, by their numbers, how well they keep touching.
        sweeps: how many times all performers were solved.
        moved: how far a joint that touches moved at most in the last sweep [body units].
    """

    results: tuple[RetargetResult, ...]
    world_scale: float
    across: dict[tuple[int, int], Across]
    sweeps: int
    moved: float


def retarget_scene(
    sources: Sequence[Motion],
    targets: Sequence[Motion | Skeleton | Target | SkeletonEdit],
    *,
    world_scale: float | None = None,
    supports: Held = "hold",
    scene: Scene = "body",
    settings: ContactSettings | None = None,
    mapper: Mapper = map,
    progress: Callable[[int], object] = lambda _sweep: None,
) -> SceneResult:
    """Retarget several performers who share a world, and keep together what touches between them.

    The world has one scale along the floor, so that they meet; each performer has its own upwards, so that each stands
    on the floor. Joints of two performers that come near each other are drawn to their common middle. Each performer
    is solved by itself, all of them twice; their order does not matter.

    Args:
        sources: the performers' motions, in one world, frame by frame.
        targets: a body for each; for its kinds see `retarget`.
        world_scale: target units per source unit along the floor; the mean of the performers' ratios of leg lengths if
            not given.
        supports: as in `retarget`.
        scene: as in `retarget`.
        settings: as in `retarget`.
        mapper: solves the chunks of long clips, as in `retarget`.
        progress: called with the number of each sweep as it begins, from 1.

    Raises:
        SettingsError: there is not a target for each source, or the world's scale is not above 0.
        MotionError: the sources differ in frames or frame times, or targets are in different units.
        MatchingError: a source and its target cannot be matched.
    """
    for name, values, kinds in (
        ("sources", sources, (Motion,)),
        ("targets", targets, (Motion, Skeleton, Target, SkeletonEdit)),
    ):
        check_kind(name, values, Sequence)
        for number, value in enumerate(values):
            check_kind(f"{name}[{number}]", value, *kinds)
    check_choice("supports", supports, get_args(Held))
    check_choice("scene", scene, get_args(Scene))
    check_kind("settings", settings, ContactSettings, NoneType)
    if not sources or len(sources) != len(targets):
        raise SettingsError(f"{len(sources)} sources and {len(targets)} targets; expected a target for each source")
    if world_scale is not None:
        check_number("world_scale", world_scale, SMALLEST, LARGEST)
    _check_times(sources)
    first = matched_performer(sources[0], targets[0])
    performers = [
        first,
        *(
            matched_performer(source, goal, source_up=first.world.source_up, target_up=first.world.up)
            for source, goal in zip(sources[1:], targets[1:], strict=True)
        ),
    ]
    heights = [find_root_scale(performer.matching) for performer in performers]
    _check_units(heights)
    level = float(np.mean(heights)) if world_scale is None else world_scale
    if len(heights) == 1 and world_scale is None:
        level = heights[0]
    prepared = [
        with_supports(performer.prepared(RootScale(level, height)), supports, scene, settings or ContactSettings())
        for performer, height in zip(performers, heights, strict=True)
    ]
    touching = {(i, j): _touching(prepared[i], prepared[j]) for i, j in combinations(range(len(prepared)), 2)}
    prepared = [_yielding(one, _activations(number, touching)) for number, one in enumerate(prepared)]
    poses, sweeps, moved = _solved(prepared, touching, mapper, progress)
    results = tuple(one.result(pose) for one, pose in zip(prepared, poses, strict=True))
    return SceneResult(results=results, world_scale=level, across=_across(results, level), sweeps=sweeps, moved=moved)


def _solved(
    prepared: Sequence[Prepared],
    touching: dict[tuple[int, int], Touching],
    mapper: Mapper,
    progress: Callable[[int], object],
) -> tuple[list[Poses], int, float]:
    """The poses of all performers, the number of sweeps, and how far a joint that touches moved in the last."""
    now = [one.problem.copy_on_path for one in prepared]
    for sweep in range(1, SWEEPS + 1):
        progress(sweep)
        springs = _springs(prepared, touching, now)
        poses = [_solve(one, more, mapper) for one, more in zip(prepared, springs, strict=True)]
        before, now = now, [_positions(one, pose) for one, pose in zip(prepared, poses, strict=True)]
        moved = max(
            (_moved(one, more, x, y) for one, more, x, y in zip(prepared, springs, before, now, strict=True)),
            default=0.0,
        )
        if not any(len(more.a) for more in springs):
            break
    return poses, sweep, moved


def _touching(one: Prepared, other: Prepared) -> Touching:
    scale = RootScale(one.scale.level, (one.scale.height + other.scale.height) / 2.0)
    up = one.performer.matching.source.up_vector
    return find_touching(
        _points(one), _points(other), scale.places(np.eye(3), up).T, one.problem.frame_time, one.settings
    )


def _activations(number: int, touching: dict[tuple[int, int], Touching]) -> list[tuple[Touching, NDArray[np.intp]]]:
    """What a performer touches, with its own joints there."""
    return [(pairs, pairs.joints[both.index(number)]) for both, pairs in touching.items() if number in both]


def _yielding(one: Prepared, touches: list[tuple[Touching, NDArray[np.intp]]]) -> Prepared:
    """The same, but what stands still off the floor and touches another performer rests on nothing: it goes where the
    two meet.
    """
    supports, matching = one.supports, one.performer.matching
    up, reach = matching.source.up_vector, one.settings.rest_height * matching.leg_lengths[1]
    floor = one.scale.height * (matching.source_motion.positions @ up).min(axis=1, keepdims=True)
    regions = matching.regions.of_joint
    touched = np.zeros((len(one.problem), len(matching.regions.names)))
    for pairs, joints in touches:
        np.maximum.at(touched, (pairs.frames, regions[joints]), pairs.f)
    yields = np.where(supports.places @ up - floor > 2.0 * reach, touched[:, supports.regions], 0.0)
    yields[:, : supports.feet] = 0.0
    held = replace(supports, weights=supports.weights * (1.0 - yields))
    return replace(one, supports=held, shown=held if len(one.shown.joints) else one.shown)


def _points(one: Prepared) -> Points:
    """The joints of a performer's body."""
    matching, distances = one.performer.matching, one.problem.distances
    flesh = matching.regions.of_joint[distances.targets] >= 0
    sources = distances.sources[flesh]
    reach = matching.source.skeleton.path_lengths[matching.drivers[matching.pelvis]][sources]
    return Points(distances.targets[flesh], matching.source_motion.positions[:, sources], reach)


def _springs(
    prepared: Sequence[Prepared], touching: dict[tuple[int, int], Touching], now: Sequence[Array]
) -> list[Springs]:
    """The springs that draw each performer to the others."""
    springs = [no_springs(len(one.problem)) for one in prepared]
    for (i, j), pairs in touching.items():
        copies = prepared[i].problem.copy_on_path, prepared[j].problem.copy_on_path
        units = prepared[i].problem.unit, prepared[j].problem.unit
        both = touching_springs(pairs, copies, (now[i], now[j]), units, prepared[i].settings.direction_range)
        for number, more in zip((i, j), both, strict=True):
            springs[number] = joined(springs[number], more)
    return springs


def _solve(one: Prepared, springs: Springs, mapper: Mapper) -> Poses:
    supports = replace(one.supports, touching=springs)
    return solve_contact(one.problem, supports, one.settings, mapper=mapper)


def _positions(one: Prepared, poses: Poses) -> Array:
    """(frames, joints, 3), where the joints are [target file units]."""
    root = one.problem.root + poses.v[:, -1]
    return posed_motion(one.copy, poses.v, one.problem.parts, root).positions


def _moved(one: Prepared, springs: Springs, before: Array, now: Array) -> float:
    """How far a joint that touches moved at most [body units]."""
    firm = np.trace(springs.A, axis1=-2, axis2=-1) > 1.0
    ways = np.linalg.norm(now[:, springs.a] - before[:, springs.a], axis=-1) / one.problem.unit
    return float(np.where(firm, ways, 0.0).max(initial=0.0))


def _across(results: Sequence[RetargetResult], level: float) -> dict[tuple[int, int], Across]:
    return {
        (i, j): measure_across(
            (results[i].matching, results[j].matching),
            (results[i].rotation_copy, results[j].rotation_copy),
            (results[i].motion, results[j].motion),
            level,
        )
        for i, j in combinations(range(len(results)), 2)
    }


def _check_times(sources: Sequence[Motion]) -> None:
    frames, time = len(sources[0]), sources[0].frame_time
    for number, source in enumerate(sources):
        if len(source) != frames:
            raise MotionError(
                f"performer {number + 1} has {len(source)} frames and performer 1 has {frames}; cut them to the same "
                "frames"
            )
        if abs(source.frame_time - time) > SAME_TIME * time:
            raise MotionError(
                f"performer {number + 1} has a frame time of {source.frame_time:g} s and performer 1 of {time:g} s; "
                "resample one of them"
            )


def _check_units(heights: Sequence[float]) -> None:
    if max(heights) > SAME_UNITS * min(heights):
        raise MotionError(
            f"the targets' root scales go from {min(heights):.3g} to {max(heights):.3g}: their files seem to be in "
            "different units; scale one of the targets"
        )
