"""Measure a motion against the motion that it was made from, with code that shares nothing with the solvers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.distances import differences_of_distances
from distretarget.matching.matching import Matching
from distretarget.measure.contacts import Contacts, find_contacts
from distretarget.measure.directions import direction_error, expected_directions, shared_bones
from distretarget.measure.feet import Feet, find_feet
from distretarget.measure.figures import Track, Tracks
from distretarget.measure.supports import SupportsMeasured, find_supports
from distretarget.motion import Motion
from distretarget.numerics.kinematics import steps_along
from distretarget.numerics.parallel import in_blocks
from distretarget.numerics.time_series import find_shots
from distretarget.numerics.vectors import lengths
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]
Joints = NDArray[np.intp]

INSTANT = 1 / 60  # the time over which turns and snaps are measured [s]
SNAP = 4.0  # a joint snaps if it moves farther than this ...
CALM = 1.5  # ... while it moves less than this in the rotation copy [both % of leg length in INSTANT]


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison:
    """What was measured of a result and its source in each frame.

    Attributes:
        contacts: the self-contacts of the source, and how well the result keeps them.
        feet: when feet rest, how fast they slide then, and how far feet and hips are from where they should be.
        supports: the other joints that rest on the world, how fast they slide, and how far off their height is.
        skeleton: that of the result.
        distance_error: (frames,), mean |D_source - D_result| over all pairs of joints.
        bones: (bones,), the lower joints of the bones that both bodies have.
        direction_error: (frames, bones), angle between bones and their expected directions [degrees].
        bone_error: (frames,), the largest relative error of a bone's length against the target.
        jerk_source, jerk: (frames - 3,), mean norm of the third difference of positions over joints
            [body sizes / s^3].
        turned: (turned joints,), the joints that both bodies have.
        turn: (frames - 1, turned joints), how much more these turn to the next frame than in the source [degrees in
            1/60 s].
    """

    contacts: Contacts
    feet: Feet
    supports: SupportsMeasured
    skeleton: Skeleton
    distance_error: Array
    bones: Joints
    direction_error: Array
    bone_error: Array
    jerk_source: Array
    jerk: Array
    turned: Joints
    turn: Array

    @property
    def tracks(self) -> Tracks:
        """The values of the result's figures, without stress, snaps and unsolved frames, which only a run knows."""
        feet, supports = self.feet, self.supports
        return {
            "contact_error": Track(self.contacts.error_of_frames, self.contacts.counts > 0),
            "direction_error": self._track(self.direction_error, self.skeleton.parents[self.bones]),
            "hips_height": self._of_feet(feet.hips_height),
            "foot_pitch": self._of_feet(feet.foot_pitch),
            "ankle_height": self._of_feet(feet.ankle_height),
            "foot_height": self._of_feet(feet.foot_height),
            "slide": self._track(feet.slide, feet.joints, feet.stance),
            "support_slide": self._track(supports.slide, supports.joints, supports.rest),
            "support_height": self._track(supports.height, supports.joints, supports.on_floor),
            "distance_error": Track(self.distance_error),
            "jerk": Track(self.jerk),
            "turn": self._track(self.turn, self.turned),
            "bone_error": Track(self.bone_error),
        }

    def _track(self, values: Array, joints: Joints, counts: NDArray[np.bool_] | None = None) -> Track:
        return Track(values, counts, tuple(self.skeleton.keys[joint] for joint in joints))

    def _of_feet(self, values: Array) -> Track:
        """The track of values (frames, legs), nan where nothing was measured, named by the ankles."""
        return self._track(values, self.feet.joints[::2], np.isfinite(values))

    @property
    def source_tracks(self) -> Tracks:
        """What the figures of the source are taken from."""
        return {
            "slide": Track(self.feet.slide_source, self.feet.stance),
            "support_slide": Track(self.supports.slide_source, self.supports.rest),
            "jerk": Track(self.jerk_source),
        }


class Reference:
    """A source that results on a target are measured against; what concerns the source alone is measured once."""

    def __init__(self, source: Motion, matching: Matching, up: Array) -> None:
        """Measure the source; `up`, (3,), is the unit vector up in source and results."""
        self.source, self.matching = source, matching
        self._feet = find_feet(source, matching, up)
        self._contacts = find_contacts(source, matching, self._feet.stance)
        self._supports = find_supports(source, matching, up)
        self._bones = shared_bones(matching)
        self._directions = expected_directions(source, matching, self._bones)
        self._turned = np.flatnonzero(matching.drivers >= 0)
        self._turns = _turns(source, matching.drivers[self._turned])
        self._jerk = _jerk(source, matching.source)

    def compare(self, result: Motion) -> Comparison:
        """Measure a result with the same number of frames."""
        supports = self._supports.in_result(result)
        further = np.degrees(_turns(result, self._turned) - self._turns)
        further *= INSTANT / result.frame_time
        return Comparison(
            contacts=self._contacts.in_result(result),
            feet=self._feet.in_result(result, supports.carry(result.frame_time)),
            supports=supports,
            skeleton=result.skeleton,
            distance_error=self._distance_error(result),
            bones=self._bones,
            direction_error=direction_error(self._directions, result, self._bones),
            bone_error=_bone_error(result, self.matching.target),
            jerk_source=self._jerk,
            jerk=_jerk(result, self.matching.target),
            turned=self._turned,
            turn=further,
        )

    def _distance_error(self, result: Motion) -> Array:
        """(frames,), mean |D_source - D_result| over all pairs of points with a path length in both."""
        points = self._contacts.candidates.points
        drivers = self.matching.drivers[points]
        tau = result.rigid_skeleton.path_lengths[np.ix_(points, points)]
        tau_source = self.source.rigid_skeleton.path_lengths[np.ix_(drivers, drivers)]
        share = ((tau > 0) & (tau_source > 0)).astype(np.float64)
        share /= max(np.triu(share, 1).sum(), 1.0)
        of_source = self.source.positions, drivers, np.where(share > 0, tau_source, 1.0)
        of_result = result.positions, points, np.where(share > 0, tau, 1.0)
        return differences_of_distances(of_source, of_result, share, 1)


def find_snaps(copy: Motion, result: Motion, body: Body) -> Array:
    """(frames - 1, joints), how far each joint of a result jumps to the next frame while it hardly moves in the
    rotation copy [% of leg length in `INSTANT`]; 0 where it does not jump.

    Joints outside the body, such as a root on the floor, do not snap, and no joint snaps at a cut.
    """
    of_body = body.regions.of_joint >= 0
    steps, calm = _steps(result, body), _steps(copy, body) < CALM
    calm[np.diff(find_shots(copy.positions, np.flatnonzero(of_body), 0.5 * body.unit)) > 0] = False
    steps[~(of_body & calm & (steps > SNAP))] = 0.0
    return steps


def _steps(motion: Motion, body: Body) -> Array:
    """(frames - 1, joints), how far each joint moves to the next frame [% of leg length in `INSTANT`]."""
    steps = steps_along(motion.positions)
    steps *= 100 * INSTANT / (0.5 * body.unit * motion.frame_time)
    return steps


def _bone_error(result: Motion, body: Body) -> Array:
    """(frames,), the largest relative error of the length of a bone of the body."""
    skeleton, of_body = result.skeleton, body.regions.of_joint >= 0
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


def _turns(motion: Motion, joints: Joints) -> Array:
    """(frames - 1, joints), the angle from each frame's world rotation to the next [rad].

    The distance of two unit quaternions is 2 sin(angle / 4); q and -q are the same rotation.
    """

    def turns(block: slice) -> Array:
        rotations = motion.world_rotations_in(slice(block.start, block.stop + 1))[:, joints]
        apart = np.minimum(lengths(rotations[1:] - rotations[:-1]), lengths(rotations[1:] + rotations[:-1]))
        return np.asarray(4.0 * np.arcsin(np.minimum(apart / 2.0, 1.0)))

    return in_blocks(turns, max(len(motion) - 1, 0))
