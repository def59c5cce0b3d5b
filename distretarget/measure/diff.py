"""Measure a motion B against a motion A, the reference, frame by frame; and a scene B against a scene A."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from distretarget.baseline.rotation_copy import common_level_scale, find_root_scale, longest_strides
from distretarget.baseline.world import World, find_root_offset, find_world, raised_onto_soles, with_root_offset
from distretarget.body.body import Body
from distretarget.body.build import capsules_of
from distretarget.checks import check_kind, check_number
from distretarget.distances import distance_problem, posture_stress
from distretarget.errors import MotionError, SettingsError, counted
from distretarget.matching.matching import Matching, match
from distretarget.measure.comparison import Comparison, Reference
from distretarget.measure.gaps import Gap, ScenePart, body_part, measure_gaps
from distretarget.measure.metrics import NOT_RUN, Track, Tracks, Variant, clip_metrics
from distretarget.measure.skin import find_skin
from distretarget.motion import Motion, check_usable, same_time
from distretarget.numerics.vectors import Array, extent
from distretarget.skeleton import LARGEST, SMALLEST, JointMap

SAME_TIME = 1e-3  # relative difference of frame times above which motions are resampled ...
LATE = 0.25  # ... or lag of one behind the other at the end above which they are [frames]


@dataclass(frozen=True, eq=False, kw_only=True)
class Diff:
    """Motion B measured against motion A.

    Attributes:
        a, b: the motions, A in B's world, both with B's frame time and the number of frames of the shorter.
        matching: which joint of A corresponds to each joint of B.
        world: the axes that point up, and the root's OFFSET.
        stress: (frames,), Eq. (2) of B against A's distances, over the squared height of B.
        comparison: all other measurements of the frames.
        notes: what was done before comparing: resampled, cut, turned.
        run_tracks: the tracks that only a run has, such as pops, if B was made here.
    """

    a: Motion
    b: Motion
    matching: Matching
    world: World
    stress: Array
    comparison: Comparison
    notes: tuple[str, ...]
    run_tracks: Tracks = field(default_factory=lambda: NOT_RUN)

    def __len__(self) -> int:
        return len(self.b)

    @property
    def up(self) -> Array:
        """(3,), the unit vector up in both."""
        return self.world.up_vector

    @property
    def tracks(self) -> Tracks:
        """The tracks of the metrics of B."""
        return {**self.comparison.tracks, "stress": Track(self.stress), **self.run_tracks}

    @cached_property
    def metrics(self) -> dict[Variant, dict[str, float | None]]:
        """The metrics of the whole clip by key, with A as source and B as result; None where nothing was measured."""
        return {"source": clip_metrics(self.comparison.source_tracks), "result": clip_metrics(self.tracks)}


def diff(
    a: Motion, b: Motion, joint_map: JointMap | None = None, *, a_up: str | None = None, b_up: str | None = None
) -> Diff:
    """Measure a motion B against a motion A, on the same skeleton or another.

    A is resampled at B's frame time and turned so that the same axis points up. The longer motion is cut.

    Args:
        a: the reference.
        b: what is measured.
        joint_map: the joint of A for joints of B, None to leave a joint out; others are matched by names or shape.
        a_up: the axis that points up in A, such as "Z"; if not given, it is detected.
        b_up: the same in B.

    Raises:
        MatchingError: the two bodies cannot be matched.
        MapError: `joint_map` names joints that are not there.
        MotionError: a motion has no frames, positions too large to compute with, or no bone with a length.
        SettingsError: an argument has the wrong type, or there is no such axis.
    """
    check_kind("a", a, Motion)
    check_kind("b", b, Motion)
    check_usable(a, "A")
    check_usable(b, "B")
    bodies = Body.of_motion(a), Body.of_motion(b)
    world = find_world(*bodies, source_up=a_up, target_up=b_up)
    notes = list(turned_note(world))
    source, target = world.to_target_axes(bodies[0]), bodies[1].with_up(world.up)
    matching = raised_onto_soles(match(source, target, joint_map))
    a, b = matching.source_motion, replace(b, skeleton=b.rigid_skeleton)
    if find_root_offset(target, world.up_vector) == "added":
        b = with_root_offset(b)
    apart = abs(a.frame_time - b.frame_time) / b.frame_time
    if apart > SAME_TIME or apart * min(len(a), len(b)) > LATE:
        notes.append(f"A was resampled from {1 / a.frame_time:.6g} to {1 / b.frame_time:.6g} frames/s")
        count, a = a.resampled_frames(b.frame_time_text), a.resampled(b.frame_time_text, len(b))
    else:
        count = len(a)
    if count != len(b):
        frames = min(count, len(b))
        compared = "the first was" if frames == 1 else f"the first {frames} were"
        notes.append(f"A has {counted(count, 'frame')} and B has {len(b)}; {compared} compared")
        a, b = a[:frames], b[:frames]
    problem = distance_problem(source.skeleton, target.skeleton, matching.drivers)
    stress = (problem.body_size / target.height) ** 2 * posture_stress(problem, a.positions, b.positions)
    skins = (find_skin(matching.source, capsules_of(matching.source)), find_skin(target, capsules_of(target)))
    comparison = Reference(a, matching, world.up_vector, skins).compare(b)
    return Diff(a=a, b=b, matching=matching, world=world, stress=stress, comparison=comparison, notes=tuple(notes))


def turned_note(world: World) -> tuple[str, ...]:
    """Return notes on how A was turned into the axes of B."""
    turned = world.source_up != world.up, f"A was turned: {world.source_up} is up in A, {world.up} in B"
    half = world.half_turn, "A was turned round: in one of the files bodies look to -Z, as in VRM 0"
    return tuple(note for is_so, note in (turned, half) if is_so)


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
        """The mean gap in A, in B, and their mean difference [leg lengths], where joints touch in A; or None."""
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
    _check_scenes(performers, props, world_scale)
    first, matchings, frames = performers[0], [each.matching for each in performers], min(map(len, performers))
    scale = world_scale or common_level_scale([*map(find_root_scale, matchings)], [*map(longest_strides, matchings)])
    placed = tuple(
        (prop_in_world(a, first.world, frames, first.b.frame_time_text), b[np.minimum(np.arange(frames), len(b) - 1)])
        for a, b in props
    )
    bodies = []
    for each in performers:
        a, b, regions = each.a.positions[:frames], each.b.positions[:frames], range(len(each.matching.regions.names))
        bodies.append([body_part(each.matching, a, b, region) for region in regions])
    parts = []
    for in_a, in_b in placed:
        size, own_size = (motion.rigid_skeleton.longest_path for motion in (in_a, in_b))
        own_scale = float(own_size / size) if size > 0.0 and own_size > 0.0 else scale  # a point has no size
        parts.append((ScenePart(a=in_a.positions, b=in_b.positions, keys=in_a.skeleton.keys), own_scale))
    found = [gap for _, gap in measure_gaps(bodies, parts, scale)]
    gaps = sorted(filter(None, found), key=lambda gap: (-gap.frames, gap.between, gap.regions))
    return SceneDiff(performers=tuple(performers), props=placed, world_scale=scale, gaps=tuple(gaps))


def prop_in_world(prop: Motion, world: World, frames: int, frame_time_text: str) -> Motion:
    """Return a prop of the source in the target's axes, with `frames` frames; after its own the last is repeated."""
    prop = world.turned(prop)
    if len(prop) > 1:
        prop = prop.resampled(frame_time_text, frames)
    return replace(prop[np.minimum(np.arange(frames), len(prop) - 1)], frame_time_text=frame_time_text)


def _check_scenes(
    performers: Sequence[Diff], props: Sequence[tuple[Motion, Motion]], world_scale: float | None
) -> None:
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
