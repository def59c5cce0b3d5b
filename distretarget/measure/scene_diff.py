"""Two scenes against each other: each performer, and what touches between performers and things."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product

import numpy as np

from distretarget.alignment import resampled, same_time
from distretarget.arguments import check_kind, check_number
from distretarget.baseline.root import find_root_scale
from distretarget.baseline.strides import followed_scale, longest_strides
from distretarget.baseline.world import turned
from distretarget.errors import MotionError, SettingsError
from distretarget.measure.diff import Diff
from distretarget.measure.gaps import Gaps, Touchable, gaps_between
from distretarget.motion import Motion
from distretarget.skeleton import LARGEST, SMALLEST


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneDiff:
    """Scene B measured against scene A.

    Attributes:
        performers: each performer of B measured against that of A.
        things: each thing in A and in B, A in B's world, both with the frames that all share.
        world_scale: units of B per unit of A along the floor.
        gaps: between what touches in A, those that touch longest first.
    """

    performers: tuple[Diff, ...]
    things: tuple[tuple[Motion, Motion], ...]
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
    things: Sequence[tuple[Motion, Motion]] = (),
    *,
    world_scale: float | None = None,
) -> SceneDiff:
    """Measure what touches between the performers and things of two scenes, A and B.

    Args:
        performers: each performer of B measured against that of A, by `diff`.
        things: each thing in A and in B, with the same joints.
        world_scale: units of B per unit of A along the floor; if not given, the scale that `retarget_scene` chooses.

    Raises:
        MotionError: the performers differ in B's frame time or in the axes that point up, or a thing in its joints.
        SettingsError: there is no performer, an argument is of another kind, or the scale is not above 0.
    """
    _check(performers, things, world_scale)
    first, frames = performers[0], min(map(len, performers))
    placed = tuple((_in_world_of(first, a, frames), b[np.minimum(np.arange(frames), len(b) - 1)]) for a, b in things)
    scale = world_scale or _followed(performers)
    bodies = [Touchable.of_body(performer, frames) for performer in performers]
    gaps = [
        gap for i, j in combinations(range(len(bodies)), 2) for gap in gaps_between((i, j), bodies[i], bodies[j], scale)
    ]
    for (i, body), (k, thing) in product(enumerate(bodies), enumerate(placed, len(bodies))):
        gaps += gaps_between((i, k), body, Touchable.of_thing(*thing), _size_ratio(*thing) or scale)
    gaps.sort(key=lambda gap: (-gap.frames, gap.between, gap.regions))
    return SceneDiff(performers=tuple(performers), things=placed, world_scale=scale, gaps=tuple(gaps))


def _check(performers: Sequence[Diff], things: Sequence[tuple[Motion, Motion]], world_scale: float | None) -> None:
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
    for number, (a, b) in enumerate(things, 1):
        if len(a.skeleton) != len(b.skeleton):
            raise MotionError(
                f"thing {number} has {len(a.skeleton)} joints in A and {len(b.skeleton)} in B; expected the same"
            )
    if world_scale is not None:
        check_number("world_scale", world_scale, SMALLEST, LARGEST)


def _followed(performers: Sequence[Diff]) -> float:
    """The scale of B's world along the floor that `retarget_scene` chooses."""
    matchings = [performer.matching for performer in performers]
    return followed_scale([*map(find_root_scale, matchings)], [*map(longest_strides, matchings)])


def _in_world_of(performer: Diff, thing: Motion, frames: int) -> Motion:
    """A thing of A in B's world, with a frame for each of the performer's."""
    time = performer.b.frame_time_text
    thing = turned(thing, performer.world.source_up, performer.world.up)
    if len(thing) > 1:
        thing = resampled(thing, time)
    return replace(thing[np.minimum(np.arange(frames), len(thing) - 1)], frame_time_text=time)


def _size_ratio(a: Motion, b: Motion) -> float:
    """The size of a thing in B over that in A; 0 for a single point."""
    size = a.rigid_skeleton.path_lengths.max()
    return float(b.rigid_skeleton.path_lengths.max() / size) if size > 0 else 0.0
