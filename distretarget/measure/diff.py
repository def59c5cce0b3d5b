"""Measure a motion B against a motion A, the reference, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.world import World, find_root_offset, find_world, on_own_soles, with_root_offset
from distretarget.body.body import Body
from distretarget.body.build import capsules_of
from distretarget.checks import check_kind
from distretarget.distances import distance_problem, posture_stress
from distretarget.errors import MotionError, counted
from distretarget.matching.matching import Matching, match
from distretarget.measure.comparison import Comparison, Reference
from distretarget.measure.metrics import NOT_RUN, Track, Tracks, Variant, clip_metrics
from distretarget.measure.skin import find_skin
from distretarget.motion import Motion, check_reach
from distretarget.skeleton import JointMap

Array = NDArray[np.float64]

SAME_TIME = 1e-3  # relative difference of frame times from which motions are resampled ...
LATE = 0.25  # ... or frames by which one lags behind the other in the end


@dataclass(frozen=True, eq=False, kw_only=True)
class Diff:
    """Motion B measured against motion A.

    Attributes:
        a, b: the motions, A in B's world, both with B's frame time and as many frames as the shorter has.
        matching: which joint of A corresponds to each joint of B.
        world: the axes that point up, and the root's OFFSET.
        stress: (frames,), Eq. (2) of B against A's distances, over the squared height of B.
        comparison: what else was measured in each frame.
        notes: what was done before comparing: resampled, cut, turned.
        run_tracks: the pops and frames not converged of B, if B was made here.
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
        """What the metrics of B are taken from."""
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
    _check(a, "A")
    _check(b, "B")
    bodies = Body.of_motion(a), Body.of_motion(b)
    world = find_world(*bodies, source_up=a_up, target_up=b_up)
    notes = list(turned_note(world))
    source, target = world.to_target_axes(bodies[0]), bodies[1].with_up(world.up)
    matching = on_own_soles(match(source, target, joint_map))
    a, b = matching.source_motion, replace(b, skeleton=b.rigid_skeleton)
    if find_root_offset(target, world.up_vector) == "added":
        b = with_root_offset(b)
    apart = abs(a.frame_time - b.frame_time) / b.frame_time
    if apart > SAME_TIME or apart * min(len(a), len(b)) > LATE:
        notes.append(f"A was resampled from {1 / a.frame_time:.6g} to {1 / b.frame_time:.6g} frames/s")
        own, a = a.resampled_frames(b.frame_time_text), a.resampled(b.frame_time_text, len(b))
    else:
        own = len(a)
    if own != len(b):
        frames = min(own, len(b))
        compared = "the first was" if frames == 1 else f"the first {frames} were"
        notes.append(f"A has {counted(own, 'frame')} and B has {len(b)}; {compared} compared")
        a, b = a[:frames], b[:frames]
    problem = distance_problem(source.skeleton, target.skeleton, matching.drivers)
    stress = (problem.body_size / target.height) ** 2 * posture_stress(problem, a.positions, b.positions)
    skins = (find_skin(matching.source, capsules_of(matching.source)), find_skin(target, capsules_of(target)))
    comparison = Reference(a, matching, world.up_vector, skins).compare(b)
    return Diff(a=a, b=b, matching=matching, world=world, stress=stress, comparison=comparison, notes=tuple(notes))


def turned_note(world: World) -> tuple[str, ...]:
    """Notes on how A was turned into the axes of B."""
    notes = []
    if world.source_up != world.up:
        notes.append(f"A was turned: {world.source_up} is up in A, {world.up} in B")
    if world.half_turn:
        notes.append("A was turned round: in one of the files bodies look to -Z, as in VRM 0")
    return tuple(notes)


def _check(motion: Motion, name: str) -> None:
    if not len(motion):
        raise MotionError(f"{name} has no frames; there is nothing to compare")
    check_reach(motion, name)
    if not motion.rigid_skeleton.longest_path > 0:
        raise MotionError(f"no bone of {name} has a length; there is nothing to compare")
