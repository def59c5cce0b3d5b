"""Measure a motion against the motion it was made from, by code that shares nothing with the solvers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.matching.matching import Matching
from distretarget.measure.contacts import Contacts, find_contacts, points_of
from distretarget.measure.directions import bones_of, direction_error, expected_directions
from distretarget.measure.feet import Feet, SourceFeet, find_feet
from distretarget.measure.figures import Track, Tracks
from distretarget.measure.snaps import INSTANT
from distretarget.measure.supports import SourceSupports, SupportsMeasured, find_supports
from distretarget.motion import Motion
from distretarget.numerics.compiled import compiled
from distretarget.numerics.parallel import in_blocks
from distretarget.numerics.vectors import lengths
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison:
    """What was measured of a result and its source, per frame; `figures` makes the figures of it.

    Attributes:
        contacts: the regions of the body that touch in the source, and how well the result keeps that.
        feet: the feet at rest, whether they slide, and whether they and the hips are in place.
        supports: the other joints that rest on the world, whether they slide, and whether they keep their height.
        skeleton: that of the result.
        distance_error: (frames,), mean |D_source - D_result| over all pairs of joints.
        bones: (bones,), the lower joints of the bones that both bodies have.
        direction_error: (frames, bones), angle between bones and their expected directions [degrees].
        bone_error: (frames,), the largest relative error of the length of a bone of the body against the target.
        jerk_source, jerk: (frames - 3,), mean norm of the third difference of positions over joints
            [body sizes / s^3].
        turned: (turned joints,), the joints that both bodies have.
        turn: (frames - 1, turned joints), how much more these turn from one frame to the next than in the source
            [degrees in 1/60 s].
    """

    contacts: Contacts
    feet: Feet
    supports: SupportsMeasured
    skeleton: Skeleton
    distance_error: Array
    bones: NDArray[np.intp]
    direction_error: Array
    bone_error: Array
    jerk_source: Array
    jerk: Array
    turned: NDArray[np.intp]
    turn: Array

    @property
    def tracks(self) -> Tracks:
        """What the figures of the result are taken from; stress, snaps and what was not solved are known to whoever
        made the result.
        """
        feet, supports = self.feet, self.supports
        return {
            "contact_error": Track(self.contacts.error_of_frames, self.contacts.counts > 0),
            "direction_error": Track(self.direction_error, parts=self._names_of(self.skeleton.parents[self.bones])),
            "hips_height": self._of_feet(feet.hips_height),
            "foot_pitch": self._of_feet(feet.foot_pitch),
            "ankle_height": self._of_feet(feet.ankle_height),
            "foot_height": self._of_feet(feet.foot_height),
            "slide": Track(feet.slide, feet.stance, self._names_of(feet.joints)),
            "support_slide": Track(supports.slide, supports.rest, self._names_of(supports.joints)),
            "support_height": Track(supports.height, supports.on_floor, self._names_of(supports.joints)),
            "distance_error": Track(self.distance_error),
            "jerk": Track(self.jerk),
            "turn": Track(self.turn, parts=self._names_of(self.turned)),
            "bone_error": Track(self.bone_error),
        }

    def _names_of(self, joints: NDArray[np.intp]) -> tuple[str, ...]:
        return tuple(self.skeleton.keys[joint] for joint in joints)

    def _of_feet(self, values: Array) -> Track:
        """What was measured of each foot, (frames, legs), nan where nothing was; feet have the names of ankles."""
        return Track(values, np.isfinite(values), self._names_of(self.feet.joints[::2]))

    @property
    def source_tracks(self) -> Tracks:
        """What the figures of the source are taken from."""
        return {
            "slide": Track(self.feet.slide_source, self.feet.stance),
            "support_slide": Track(self.supports.slide_source, self.supports.rest),
            "jerk": Track(self.jerk_source),
        }


@dataclass(frozen=True, eq=False)
class Reference:
    """A source, for measuring results on a target against it. What is measured of the source alone is measured once.

    Attributes:
        source: the motion.
        matching: that of its body and the target.
        up: (3,), points up in source and results.
    """

    source: Motion
    matching: Matching
    up: Array

    @cached_property
    def _feet(self) -> SourceFeet:
        return find_feet(self.source, self.matching, self.up)

    @cached_property
    def _contacts(self) -> Contacts:
        return find_contacts(self.source, self.matching, self._feet.stance)

    @cached_property
    def _supports(self) -> SourceSupports:
        return find_supports(self.source, self.matching, self.up)

    @cached_property
    def _directions(self) -> Array:
        return expected_directions(self.source, self.matching)

    @cached_property
    def _jerk(self) -> Array:
        return _jerk(self.source, self.matching.source)

    @cached_property
    def _steps(self) -> Array:
        return _steps(self.source, self.matching.drivers[self._turned])

    @property
    def _turned(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.matching.drivers >= 0)

    def compare(self, result: Motion) -> Comparison:
        """Measure a result with the same number of frames."""
        supports, bones, turned = self._supports.in_result(result), bones_of(self.matching), self._turned
        return Comparison(
            contacts=self._contacts.in_result(result),
            feet=self._feet.in_result(result).standing_alone(supports.carry(result.frame_time)),
            supports=supports,
            skeleton=result.skeleton,
            distance_error=_distance_error(self.source, result, self.matching),
            bones=bones,
            direction_error=direction_error(self._directions, result, bones),
            bone_error=_bone_error(result, self.matching),
            jerk_source=self._jerk,
            jerk=_jerk(result, self.matching.target),
            turned=turned,
            turn=self._turn_of(result),
        )

    def _turn_of(self, result: Motion) -> Array:
        """(frames - 1, joints), how much further the joints turn to the next frame than the source's [degrees in
        `INSTANT`].
        """
        further = _steps(result, self._turned)
        further -= self._steps
        np.degrees(further, out=further)
        further *= INSTANT
        further /= result.frame_time
        return further


def _distance_error(source: Motion, result: Motion, matching: Matching) -> Array:
    joints = points_of(matching)
    drivers = matching.drivers[joints]
    tau = result.rigid_skeleton.path_lengths[np.ix_(joints, joints)]
    tau_source = source.rigid_skeleton.path_lengths[np.ix_(drivers, drivers)]
    share = ((tau > 0) & (tau_source > 0)).astype(np.float64)
    share /= max(np.triu(share, 1).sum(), 1.0)
    of_source = source.positions, drivers, np.where(share > 0, tau_source, 1.0)
    of_result = result.positions, joints, np.where(share > 0, tau, 1.0)
    scratch, means = np.empty((2, 3, len(joints))), np.empty(len(result))
    _write_mean_difference(*of_source, *of_result, share, scratch, means)
    return means


@compiled(fastmath=True)
def _write_mean_difference(x, of_x, tau_x, y, of_y, tau_y, share, scratch, means):  # type: ignore[no-untyped-def]
    """Write the means, (frames,), over all pairs of points of the differences of their distances in x over tau_x, and
    in y over tau_y, (points, points); `of_x` and `of_y`, (points,), are the joints of x and y at the points, and
    `share`, (points, points), is what each pair counts in the mean.
    """
    points, p, q = len(of_x), scratch[0], scratch[1]
    for frame in range(len(x)):
        for point in range(points):
            for i in range(3):
                p[i, point], q[i, point] = x[frame, of_x[point], i], y[frame, of_y[point], i]
        total = 0.0
        for u in range(points):
            for v in range(u):
                one = np.sqrt((p[0, u] - p[0, v]) ** 2 + (p[1, u] - p[1, v]) ** 2 + (p[2, u] - p[2, v]) ** 2)
                other = np.sqrt((q[0, u] - q[0, v]) ** 2 + (q[1, u] - q[1, v]) ** 2 + (q[2, u] - q[2, v]) ** 2)
                total += share[u, v] * abs(one / tau_x[u, v] - other / tau_y[u, v])
        means[frame] = total


def _bone_error(result: Motion, matching: Matching) -> Array:
    skeleton, of_body = result.skeleton, matching.target.regions.of_joint >= 0
    lower = np.flatnonzero((skeleton.lengths > 0) & of_body & of_body[skeleton.parents])

    def error(block: slice) -> Array:
        positions = result.positions[block]
        bones = lengths(positions[:, lower] - positions[:, skeleton.parents[lower]])
        return np.asarray(np.abs(bones / skeleton.lengths[lower] - 1).max(axis=1, initial=0.0))

    return in_blocks(error, len(result))


def _jerk(motion: Motion, body: Body) -> Array:
    """(frames - 3,), the mean norm of the third difference of the positions of the body's joints [body sizes / s^3]."""
    size = body.skeleton.path_lengths.max() * motion.frame_time**3

    def jerk(block: slice) -> Array:
        positions = motion.positions[block.start : block.stop + 3, body.regions.of_joint >= 0]
        return np.asarray(lengths(np.diff(positions, 3, axis=0) / size).mean(axis=1))

    return in_blocks(jerk, max(len(motion) - 3, 0))


def _steps(motion: Motion, joints: NDArray[np.intp]) -> Array:
    """(frames - 1, joints), the angle from each frame's rotation to the next [rad]: that of unit quaternions apart by
    2 sin(angle / 4), of which q and -q are the same.
    """

    def steps(block: slice) -> Array:
        rotations = motion.world_rotations_in(slice(block.start, block.stop + 1))[:, joints]
        apart = np.minimum(lengths(rotations[1:] - rotations[:-1]), lengths(rotations[1:] + rotations[:-1]))
        return np.asarray(4.0 * np.arcsin(np.minimum(apart / 2.0, 1.0)))

    return in_blocks(steps, max(len(motion) - 1, 0))
