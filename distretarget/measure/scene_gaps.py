"""Gaps between joints that touch, of two performers of a scene or of a performer and a prop; and diffs of scenes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.rotation_copy import find_root_scale, followed_scale, longest_strides
from distretarget.baseline.world import World
from distretarget.checks import check_kind, check_number
from distretarget.errors import MotionError, SettingsError
from distretarget.matching.matching import Matching
from distretarget.measure.diff import Diff
from distretarget.motion import Motion, same_time
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.vectors import extent, lengths
from distretarget.skeleton import LARGEST, SMALLEST

Array = NDArray[np.float64]

TOUCH_DISTANCE = 0.07  # joints touch where they are nearer than this in the source, or in scene A [leg lengths]


@dataclass(frozen=True, eq=False, kw_only=True)
class ScenePart:
    """A body, a region of a body, or a prop in two scenes, A and B; gaps are those between their joints."""

    a: Array  # (frames, joints, 3), positions in A [file units]
    b: Array  # (frames, joints, 3), positions in B [file units]
    keys: tuple[str, ...]  # of the joints in A
    leg: float = 0.0  # the length of the performer's leg in A [file units]; 0 for a prop
    region: str = ""  # its name; empty for a body or a prop


def body_part(matching: Matching, a: Array, b: Array, region: int | None = None) -> ScenePart:
    """Return the driven joints of a body, or of one of its regions; `a` and `b`, (frames, joints, 3), are the positions
    of source and target.
    """
    joints, regions = matching.body_joints, matching.regions
    if region is not None:
        joints = joints[regions.of_joint[joints] == region]
    drivers = matching.drivers[joints]
    keys = tuple(matching.source.skeleton.keys[joint] for joint in drivers)
    name = "" if region is None else regions.names[region]
    return ScenePart(a=a[:, drivers], b=b[:, joints], keys=keys, leg=matching.leg_lengths[0], region=name)


@dataclass(frozen=True, kw_only=True)
class Gap:
    """The gap between two parts that touch in scene A, over all pairs of joints and frames in which they touch.

    Gaps are in leg lengths of A, the mean of both performers; those of B are scaled to A's world.

    Attributes:
        between: the numbers of two performers, or of a performer and a prop; performers are counted before props.
        regions: the region of the body of each, such as "left hand"; empty for a whole body or a prop.
        frames: the number of frames in which they touch.
        pairs: the number of pairs of joints that touch, summed over frames.
        a, b: the mean gap in A and in B.
        worst: the gap in B that 1 in 100 exceeds.
        error: the mean |gap in B - gap in A|.
        worst_frame: the frame with the largest difference.
        joints: the keys of the two joints of A with the largest difference.
    """

    between: tuple[int, int]
    regions: tuple[str, str]
    frames: int
    pairs: int
    a: float
    b: float
    worst: float
    error: float
    worst_frame: int
    joints: tuple[str, str]


def measure_gap(between: tuple[int, int], one: ScenePart, other: ScenePart, scale: float) -> Gap | None:
    """Measure the gap between two parts; None if they do not touch in A. `scale` is in units of B per unit of A."""
    legs = [part.leg for part in (one, other) if part.leg]
    leg = sum(legs) / max(len(legs), 1)
    touching = []
    for block in blocks_of(len(one.a)):
        frames, u, v = np.nonzero(lengths(one.a[block][:, :, None] - other.a[block][:, None]) < TOUCH_DISTANCE * leg)
        touching.append((block.start + frames, u, v))
    frames, u, v = (np.concatenate(values) for values in zip(*touching, strict=True))
    if not len(frames):
        return None
    a = lengths(one.a[frames, u] - other.a[frames, v]) / leg
    b = lengths(one.b[frames, u] - other.b[frames, v]) / (scale * leg)
    error = np.abs(b - a)
    farthest = error.argmax()
    return Gap(
        between=between,
        regions=(one.region, other.region),
        frames=len(np.unique(frames)),
        pairs=len(frames),
        a=float(a.mean()),
        b=float(b.mean()),
        worst=float(np.percentile(b, 99)),
        error=float(error.mean()),
        worst_frame=int(frames[farthest]),
        joints=(one.keys[u[farthest]], other.keys[v[farthest]]),
    )


def measure_gaps(
    bodies: Sequence[Sequence[ScenePart]], props: Sequence[tuple[ScenePart, float]], scale: float
) -> Iterator[tuple[tuple[int, int], Gap | None]]:
    """Measure the gaps between each two bodies, and between each body and each prop, with the numbers of the two.

    `bodies` are given as their parts, `props` with scales of their own; bodies are counted before props.
    """
    pairs = [((i, j), one, other, scale) for (i, one), (j, other) in combinations(enumerate(bodies), 2)]
    for (i, body), (k, (prop, own)) in product(enumerate(bodies), enumerate(props, len(bodies))):
        pairs.append(((i, k), body, [prop], own))
    for between, ones, others, each in pairs:
        for one, other in product(ones, others):
            yield between, measure_gap(between, one, other, each)


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneDiff:
    """Scene B measured against scene A.

    Attributes:
        performers: each performer of B measured against the same performer of A.
        props: each prop in A and in B, A in B's world, both with as many frames as the shortest clip.
        world_scale: units of B per unit of A along the floor.
        gaps: between regions that touch in A, the longest contact first.
    """

    performers: tuple[Diff, ...]
    props: tuple[tuple[Motion, Motion], ...]
    world_scale: float
    gaps: tuple[Gap, ...]

    def __len__(self) -> int:
        return min(map(len, self.performers))

    @cached_property
    def mean_gaps(self) -> tuple[float, float, float] | None:
        """The mean gap in A, in B, and the mean difference [leg lengths], over all pairs of joints that touch in A;
        None if nothing touches.
        """
        if not self.gaps:
            return None
        pairs = [gap.pairs for gap in self.gaps]
        a, b, error = np.average([(gap.a, gap.b, gap.error) for gap in self.gaps], axis=0, weights=pairs)
        return float(a), float(b), float(error)


def diff_scenes(
    performers: Sequence[Diff], props: Sequence[tuple[Motion, Motion]] = (), *, world_scale: float | None = None
) -> SceneDiff:
    """Measure the gaps between the performers and props of two scenes, A and B.

    Args:
        performers: each performer of B measured against the same performer of A, by `diff`.
        props: each prop in A and in B, with the same joints.
        world_scale: units of B per unit of A along the floor; if not given, the scale that `retarget_scene` chooses.

    Raises:
        MotionError: performers differ in B's frame time or in the axes that point up; or a prop has different joints in
            A and B, no frames, or positions too large to compute with.
        SettingsError: there is no performer, an argument has the wrong type, or the scale is not above 0.
    """
    _check(performers, props, world_scale)
    first, matchings, frames = performers[0], [each.matching for each in performers], min(map(len, performers))
    scale = world_scale or followed_scale([*map(find_root_scale, matchings)], [*map(longest_strides, matchings)])
    placed = tuple(
        (prop_in_world(a, first.world, frames, first.b.frame_time_text), b[np.minimum(np.arange(frames), len(b) - 1)])
        for a, b in props
    )
    bodies = []
    for each in performers:
        a, b, regions = each.a.positions[:frames], each.b.positions[:frames], range(len(each.matching.regions.names))
        bodies.append([body_part(each.matching, a, b, region) for region in regions])
    parts = [ScenePart(a=a.positions, b=b.positions, keys=a.skeleton.keys) for a, b in placed]
    sizes = [_size_ratio(a, b) or scale for a, b in placed]
    found = [gap for _, gap in measure_gaps(bodies, [*zip(parts, sizes, strict=True)], scale)]
    gaps = sorted(filter(None, found), key=lambda gap: (-gap.frames, gap.between, gap.regions))
    return SceneDiff(performers=tuple(performers), props=placed, world_scale=scale, gaps=tuple(gaps))


def prop_in_world(prop: Motion, world: World, frames: int, frame_time_text: str) -> Motion:
    """Return a prop of the source in the target's axes, resampled to `frames` frames; it stands still after its own."""
    prop = world.turned(prop)
    if len(prop) > 1:
        prop = prop.resampled(frame_time_text, frames)
    return replace(prop[np.minimum(np.arange(frames), len(prop) - 1)], frame_time_text=frame_time_text)


def _check(performers: Sequence[Diff], props: Sequence[tuple[Motion, Motion]], world_scale: float | None) -> None:
    check_kind("performers", performers, Sequence)
    if not performers:
        raise SettingsError("performers is empty; expected a diff for each performer")
    for number, performer in enumerate(performers, 1):
        check_kind(f"performers[{number - 1}]", performer, Diff)
        one, time = performers[0].b.frame_time, performer.b.frame_time
        if not same_time(one, time):
            raise MotionError(
                f"performer {number} of B has a frame time of {time:g} s and performer 1 of {one:g} s; resample one"
            )
        (a, b), ups = ((each.world.source_up, each.world.up) for each in (performers[0], performer))
        if ups != (a, b):
            raise MotionError(
                f"performer {number} has other axes up ({ups[0]} in A, {ups[1]} in B) than performer 1 ({a}, {b}); "
                "tell `diff` which point up"
            )
    check_kind("props", props, Sequence)
    for number, pair in enumerate(props, 1):
        check_kind(f"prop {number}", pair, tuple)
        for motion in pair:
            check_kind(f"a motion of prop {number}", motion, Motion)
            if not len(motion) or not extent(motion.positions) <= LARGEST:
                raise MotionError(f"prop {number} has no frames, or positions beyond {LARGEST:g}; check its file")
        in_a, in_b = (len(motion.skeleton) for motion in pair)
        if in_a != in_b:
            raise MotionError(f"prop {number} has {in_a} joints in A and {in_b} in B; expected the same")
    if world_scale is not None:
        check_number("world_scale", world_scale, SMALLEST, LARGEST)


def _size_ratio(a: Motion, b: Motion) -> float:
    """The size of a prop in B over that in A; 0 for a single point."""
    size = a.rigid_skeleton.longest_path
    return float(b.rigid_skeleton.longest_path / size) if size > 0 else 0.0
