"""Gaps between performers and props that touch: how well a result keeps them, and two scenes against each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.rotation_copy import find_root_scale, followed_scale, longest_strides
from distretarget.baseline.world import turned
from distretarget.checks import check_kind, check_number
from distretarget.errors import MotionError, SettingsError
from distretarget.matching.matching import Matching
from distretarget.measure.diff import Diff
from distretarget.motion import Motion, same_time
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.vectors import lengths
from distretarget.skeleton import LARGEST, SMALLEST

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

TOUCH_DISTANCE = 0.07  # points of two sides touch where they are nearer than this in the source [leg lengths]


@dataclass(frozen=True)
class Across:
    """The gaps between points of two sides that touch in the source, in units of the source's world.

    Attributes:
        leg: the length of a leg in the source, the mean of both sides [source file units].
        frames: in how many frames anything touches.
        source, rotation_copy, result: mean gap over all pairs of points that touch and all frames in which they do
            [source file units]; nan where nothing touches.
    """

    leg: float
    frames: int
    source: float
    rotation_copy: float
    result: float


@dataclass(frozen=True, eq=False)
class ScenePart:
    """The points of a performer or a prop, in the source, the rotation copy and the result.

    Attributes:
        source, rotation_copy, result: (frames, points, 3) each [file units].
        leg: length of a leg in the source, of the performer who touches a prop [source file units].
    """

    source: Array
    rotation_copy: Array
    result: Array
    leg: float


def body_part(matching: Matching, copy: Motion, result: Motion) -> ScenePart:
    """Return the points of a performer: all driven joints of its body."""
    joints = matching.body_joints
    source = matching.source_motion.positions[:, matching.drivers[joints]]
    return ScenePart(source, copy.positions[:, joints], result.positions[:, joints], matching.leg_lengths[0])


def measure_across(one: ScenePart, other: ScenePart, scale: float) -> Across:
    """Measure the gaps between two sides; `scale` is in target units per source unit."""
    leg = (one.leg + other.leg) / 2.0
    sides = [
        (one.source, other.source),
        *((a / scale, b / scale) for a, b in ((one.rotation_copy, other.rotation_copy), (one.result, other.result))),
    ]
    frames, count, totals = 0, 0, np.zeros(3)
    for frame, u, v in touching_points(one.source, other.source, leg):
        frames += len(np.unique(frame))
        count += len(frame)
        totals += [lengths(a[frame, u] - b[frame, v]).sum() for a, b in sides]
    means = totals / count if count else np.full(3, np.nan)
    return Across(leg, frames, *means.tolist())


def touching_points(one: Array, other: Array, leg: float) -> Iterator[tuple[Numbers, Numbers, Numbers]]:
    """The points of two sides, (frames, points, 3) each, that touch: block by block the frame of each pair, and the
    number of either point. `leg` is in the unit of the points.
    """
    for block in blocks_of(len(one)):
        frame, u, v = np.nonzero(lengths(one[block][:, :, None] - other[block][:, None]) < TOUCH_DISTANCE * leg)
        yield block.start + frame, u, v


@dataclass(frozen=True, kw_only=True)
class Gaps:
    """The gaps between two parts of a scene that touch in A, over all pairs of joints and frames in which they do.

    All are in leg lengths of A, the mean of both bodies; those of B are in the scale of A's world.

    Attributes:
        between: the numbers of the two; performers are counted before props.
        regions: the region of the body of each, such as "left hand"; empty for a prop.
        frames: in how many frames they touch.
        pairs: how many pairs of joints touch, counted in each frame.
        a, b: the mean gap.
        error: how far a gap in B is off that in A, on average.
        worst_frame: the frame in which a gap is furthest off ...
        joints: ... and the keys of the two joints of A between which it is.
    """

    between: tuple[int, int]
    regions: tuple[str, str]
    frames: int
    pairs: int
    a: float
    b: float
    error: float
    worst_frame: int
    joints: tuple[str, str]


@dataclass(frozen=True, eq=False, kw_only=True)
class Touchable:
    """The joints of a performer or a prop that may touch others.

    Attributes:
        a, b: (frames, joints, 3), where they are in A and in B [file units of each].
        leg: the length of a leg in A [file units]; 0 for a prop.
        regions: (joints,), the number of the region of the body that each is in ...
        names: ... and the names of these; a prop has one without a name.
        keys: of the joints in A.
    """

    a: Array
    b: Array
    leg: float
    regions: NDArray[np.intp]
    names: tuple[str, ...]
    keys: tuple[str, ...]

    @classmethod
    def of_body(cls, performer: Diff, frames: int) -> Touchable:
        """All driven joints of a performer's body."""
        matching = performer.matching
        joints = matching.body_joints
        drivers = matching.drivers[joints]
        return cls(
            a=performer.a.positions[:frames, drivers],
            b=performer.b.positions[:frames, joints],
            leg=matching.leg_lengths[0],
            regions=matching.regions.of_joint[joints],
            names=matching.regions.names,
            keys=tuple(performer.a.skeleton.keys[joint] for joint in drivers),
        )

    @classmethod
    def of_prop(cls, a: Motion, b: Motion) -> Touchable:
        """All joints of a prop."""
        regions = np.zeros(len(a.skeleton), np.intp)
        return cls(a=a.positions, b=b.positions, leg=0.0, regions=regions, names=("",), keys=a.skeleton.keys)


def gaps_between(between: tuple[int, int], one: Touchable, other: Touchable, scale: float) -> Iterator[Gaps]:
    """The gaps between the regions of two that touch in A; `scale` is in units of B per unit of A."""
    legs = [side.leg for side in (one, other) if side.leg]
    leg = sum(legs) / max(len(legs), 1)
    frame, u, v = (np.concatenate(found) for found in zip(*touching_points(one.a, other.a, leg), strict=True))
    a = lengths(one.a[frame, u] - other.a[frame, v]) / leg
    b = lengths(one.b[frame, u] - other.b[frame, v]) / (scale * leg)
    error = np.abs(b - a)
    kinds = one.regions[u] * len(other.names) + other.regions[v]
    for kind in np.unique(kinds).tolist():
        rows = np.flatnonzero(kinds == kind)
        worst = rows[error[rows].argmax()]
        yield Gaps(
            between=between,
            regions=(one.names[kind // len(other.names)], other.names[kind % len(other.names)]),
            frames=len(np.unique(frame[rows])),
            pairs=len(rows),
            a=float(a[rows].mean()),
            b=float(b[rows].mean()),
            error=float(error[rows].mean()),
            worst_frame=int(frame[worst]),
            joints=(one.keys[u[worst]], other.keys[v[worst]]),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneDiff:
    """Scene B measured against scene A.

    Attributes:
        performers: each performer of B measured against that of A.
        props: each prop in A and in B, A in B's world, both with the frames that all share.
        world_scale: units of B per unit of A along the floor.
        gaps: between what touches in A, those that touch longest first.
    """

    performers: tuple[Diff, ...]
    props: tuple[tuple[Motion, Motion], ...]
    world_scale: float
    gaps: tuple[Gaps, ...]

    def __len__(self) -> int:
        return min(map(len, self.performers))

    @cached_property
    def mean_gaps(self) -> tuple[float, float, float] | None:
        """The mean gap in A and in B, and how far it is off on average, over all pairs of joints that touch in A [leg
        lengths]; None where nothing touches.
        """
        if not self.gaps:
            return None
        pairs = [gap.pairs for gap in self.gaps]
        a, b, error = np.average([(gap.a, gap.b, gap.error) for gap in self.gaps], axis=0, weights=pairs)
        return float(a), float(b), float(error)


def diff_scenes(
    performers: Sequence[Diff],
    props: Sequence[tuple[Motion, Motion]] = (),
    *,
    world_scale: float | None = None,
) -> SceneDiff:
    """Measure what touches between the performers and props of two scenes, A and B.

    Args:
        performers: each performer of B measured against that of A, by `diff`.
        props: each prop in A and in B, with the same joints.
        world_scale: units of B per unit of A along the floor; if not given, the scale that `retarget_scene` chooses.

    Raises:
        MotionError: the performers differ in B's frame time or in the axes that point up, or a prop in its joints.
        SettingsError: there is no performer, an argument is of another kind, or the scale is not above 0.
    """
    _check(performers, props, world_scale)
    first, frames = performers[0], min(map(len, performers))
    placed = tuple((_in_world_of(first, a, frames), b[np.minimum(np.arange(frames), len(b) - 1)]) for a, b in props)
    scale = world_scale or _followed(performers)
    bodies = [Touchable.of_body(performer, frames) for performer in performers]
    gaps = [
        gap for i, j in combinations(range(len(bodies)), 2) for gap in gaps_between((i, j), bodies[i], bodies[j], scale)
    ]
    for (i, body), (k, prop) in product(enumerate(bodies), enumerate(placed, len(bodies))):
        gaps += gaps_between((i, k), body, Touchable.of_prop(*prop), _size_ratio(*prop) or scale)
    gaps.sort(key=lambda gap: (-gap.frames, gap.between, gap.regions))
    return SceneDiff(performers=tuple(performers), props=placed, world_scale=scale, gaps=tuple(gaps))


def _check(performers: Sequence[Diff], props: Sequence[tuple[Motion, Motion]], world_scale: float | None) -> None:
    check_kind("performers", performers, Sequence)
    if not performers:
        raise SettingsError("performers is empty; expected a diff for each performer")
    for number, performer in enumerate(performers):
        check_kind(f"performers[{number}]", performer, Diff)
    first = performers[0]
    for number, performer in enumerate(performers[1:], 2):
        if not same_time(first.b.frame_time, performer.b.frame_time):
            raise MotionError(
                f"performer {number} of B has a frame time of {performer.b.frame_time:g} s and performer 1 of "
                f"{first.b.frame_time:g} s; resample one of them"
            )
        if (performer.world.source_up, performer.world.up) != (first.world.source_up, first.world.up):
            raise MotionError(
                f"performer {number} has other axes up ({performer.world.source_up} in A, {performer.world.up} in B) "
                f"than performer 1 ({first.world.source_up}, {first.world.up}); tell `diff` which point up"
            )
    for number, (a, b) in enumerate(props, 1):
        if len(a.skeleton) != len(b.skeleton):
            raise MotionError(
                f"prop {number} has {len(a.skeleton)} joints in A and {len(b.skeleton)} in B; expected the same"
            )
    if world_scale is not None:
        check_number("world_scale", world_scale, SMALLEST, LARGEST)


def _followed(performers: Sequence[Diff]) -> float:
    """The scale of B's world along the floor that `retarget_scene` chooses."""
    matchings = [performer.matching for performer in performers]
    return followed_scale([*map(find_root_scale, matchings)], [*map(longest_strides, matchings)])


def _in_world_of(performer: Diff, prop: Motion, frames: int) -> Motion:
    """A prop of A in B's world, with a frame for each of the performer's."""
    time = performer.b.frame_time_text
    prop = turned(prop, performer.world.source_up, performer.world.up)
    if len(prop) > 1:
        prop = prop.resampled(time)
    return replace(prop[np.minimum(np.arange(frames), len(prop) - 1)], frame_time_text=time)


def _size_ratio(a: Motion, b: Motion) -> float:
    """The size of a prop in B over that in A; 0 for a single point."""
    size = a.rigid_skeleton.path_lengths.max()
    return float(b.rigid_skeleton.path_lengths.max() / size) if size > 0 else 0.0
