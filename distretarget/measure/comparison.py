"""Measure a motion against the motion that it was made from, with code that shares nothing with the solvers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from distretarget.distances import differences_of_distances
from distretarget.matching.matching import Matching
from distretarget.measure.contacts import Contacts, find_candidates, find_region_contacts
from distretarget.measure.metrics import Track, Tracks
from distretarget.measure.movement import (
    bone_error,
    direction_error,
    expected_directions,
    jerk,
    shared_bones,
    turns,
)
from distretarget.measure.pops import INSTANT
from distretarget.measure.posture import errors_of, find_posture
from distretarget.measure.skin import Skin, find_skin
from distretarget.measure.skin_touches import SkinMeasured, find_source_skin
from distretarget.measure.supports import Feet, SupportsMeasured, find_feet, find_supports
from distretarget.measure.surface import Surface
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths
from distretarget.rig import found_once
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import no_capsules

STEADY = 1 / 30  # the acceleration of the hips is that between frames so far apart: noise is faster [s]
OF_FEET = ("hips_height", "foot_pitch", "ankle_height", "foot_height")  # errors of `Feet` that are metrics


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison:
    """What was measured of a result and its source in each frame.

    Attributes:
        contacts: the self-contacts of the source, and how well the result keeps them.
        contact_gap: (frames,), how much farther apart the joints of a contact are than in the source, the largest of
            each frame [% of leg length].
        skin: how far hands and forearms sink in, and how well the gaps between skins are kept.
        feet: when feet rest, how fast they slide then, and how far feet and hips are from where they should be.
        supports: the other joints that rest on the world, how fast they slide, and how far off their height is.
        floor: (frames,), how far the lowest point of the body is from the floor on which it belongs [% of leg length].
        on_floor: (frames,), whether anything rests on the floor in the source.
        hips_acceleration_source, hips_acceleration: (frames but the last few,), of the middle between the hip joints;
            none without legs [leg lengths / s^2].
        posture: how head, palms and feet are held and legs spread, by the key of the metric: the joints that name the
            parts, and errors (frames, parts) [degrees].
        skeleton: that of the result.
        distance_error: (frames,), mean |D_source - D_result| over all pairs of joints.
        bones: (bones,), the lower joints of the bones that both bodies have.
        direction_error: (frames, bones), angle between bones and their expected directions [degrees].
        bone_error: (frames,), the largest relative error of a bone's length against the target.
        jerk_source, jerk: (frames - 3,), mean norm of the third difference of positions over joints
            [body sizes / s^3].
        turned: (turned joints,), the joints that both bodies have.
        turn: (frames - 1, turned joints), how much more these turn to the next frame than in the source; 0 at cuts
            [degrees in 1/60 s].
    """

    contacts: Contacts
    contact_gap: Array
    skin: SkinMeasured
    feet: Feet
    supports: SupportsMeasured
    floor: Array
    on_floor: Flags
    hips_acceleration_source: Array
    hips_acceleration: Array
    posture: Mapping[str, tuple[Numbers, Array]]
    skeleton: Skeleton
    distance_error: Array
    bones: Numbers
    direction_error: Array
    bone_error: Array
    jerk_source: Array
    jerk: Array
    turned: Numbers
    turn: Array

    @property
    def tracks(self) -> Tracks:
        """The values of the result's metrics, without those that only a run has: stress, pops, frames not converged."""
        feet, supports, ankles = self.feet, self.supports, self.feet.joints[::2]
        return {
            "contact_error": Track(self.contacts.error_of_frames, self.contacts.counts > 0),
            "contact_gap": Track(self.contact_gap, self.contacts.counts > 0),
            **self.skin.tracks,
            "direction_error": self._track(self.direction_error, self.skeleton.parents[self.bones]),
            **{key: self._track(getattr(feet, key), ankles, np.isfinite(getattr(feet, key))) for key in OF_FEET},
            "foot_skate": self._track(feet.skate, feet.joints, feet.stance),
            "floor": Track(self.floor, self.on_floor),
            "hips_acceleration": Track(self.hips_acceleration),
            "support_skate": self._track(supports.skate, supports.joints, supports.rest),
            "support_height": self._track(supports.height, supports.joints, supports.on_floor),
            **{key: self._track(error, joints, np.isfinite(error)) for key, (joints, error) in self.posture.items()},
            "distance_error": Track(self.distance_error),
            "jerk": Track(self.jerk),
            "turn": self._track(self.turn, self.turned),
            "bone_error": Track(self.bone_error),
        }

    def _track(self, values: Array, joints: Numbers, counts: Flags | None = None) -> Track:
        return Track(values, counts, tuple(self.skeleton.keys[joint] for joint in joints))

    @property
    def source_tracks(self) -> Tracks:
        """What the metrics of the source are taken from."""
        return {
            "foot_skate": Track(self.feet.skate_source, self.feet.stance),
            "support_skate": Track(self.supports.skate_source, self.supports.rest),
            "jerk": Track(self.jerk_source),
            "hips_acceleration": Track(self.hips_acceleration_source),
        }


class Reference:
    """A source that results on a target are measured against; what concerns the source alone is measured once."""

    def __init__(
        self,
        source: Motion,
        matching: Matching,
        up: Array,
        skins: tuple[Skin, Skin] | None = None,
        surface: Surface | None = None,
    ) -> None:
        """Measure the source; `up`, (3,), is the unit vector up in source and results, `skins` those of both bodies if
        their thickness is known, `surface` the target's.
        """
        self.source, self.matching = source, matching
        skins = skins or (find_skin(matching.source, no_capsules()), find_skin(matching.target, no_capsules()))
        self._skin = find_source_skin(source, matching.source, *skins)
        self._feet = find_feet(source, matching, up, surface)
        self._contacts = find_region_contacts(source, matching, self._feet.stance)
        self._supports = find_supports(source, matching, up, surface, self._feet.thickness)
        self._posture = find_posture(source, matching, up, self._feet.stance)
        self._bones = shared_bones(matching)
        self._directions = expected_directions(source, matching)
        self._turned = np.flatnonzero(matching.drivers >= 0)
        self._turns = turns(source, matching.drivers[self._turned])
        self._cuts = np.diff(matching.source.shots_of(source)) > 0
        self._hips_acceleration = self._acceleration_of_hips(source, 0)
        self._jerk = jerk(source, matching.source)

    def compare(self, result: Motion) -> Comparison:
        """Measure a result with the same number of frames."""
        contacts, supports = self._contacts.in_result(result), self._supports.in_result(result)
        feet = self._feet.in_result(result, supports.carry(result.frame_time))
        off, on_floor = self._feet.off_floor(feet, supports)
        further = turns(result, self._turned)
        further -= self._turns
        further *= np.degrees(INSTANT / result.frame_time)
        further[self._cuts] = 0.0
        return Comparison(
            contacts=contacts,
            contact_gap=contacts.largest_gaps(self.matching.source.leg, self.matching.target.leg),
            skin=self._skin.in_result(result),
            feet=feet,
            supports=supports,
            floor=off,
            on_floor=on_floor,
            hips_acceleration_source=self._hips_acceleration,
            hips_acceleration=self._acceleration_of_hips(result, 1),
            posture={key: errors_of(held, result) for key, held in self._posture.items()},
            skeleton=result.skeleton,
            distance_error=self._distance_error(result),
            bones=self._bones,
            direction_error=direction_error(self._directions, result, self._bones),
            bone_error=bone_error(result, self.matching.target),
            jerk_source=self._jerk,
            jerk=jerk(result, self.matching.target),
            turned=self._turned,
            turn=further,
        )

    def _acceleration_of_hips(self, motion: Motion, of: Literal[0, 1]) -> Array:
        """`Comparison.hips_acceleration` of a motion of source, 0, or target, 1."""
        lag = max(round(STEADY / motion.frame_time), 1)
        if self.matching.legs is None or len(motion) <= 2 * lag:
            return np.zeros(0)
        hips = motion.positions[:, [leg.hip for leg in self.matching.legs[of]]].mean(axis=1)
        bends = lengths(hips[2 * lag :] - 2.0 * hips[lag:-lag] + hips[: -2 * lag])
        cut = np.append(0, np.cumsum(self._cuts))
        bends[cut[2 * lag :] != cut[: -2 * lag]] = 0.0
        return np.asarray(bends / (self.matching.leg_lengths[of] * (lag * motion.frame_time) ** 2))

    def _distance_error(self, result: Motion) -> Array:
        """(frames,), mean |D_source - D_result| over all pairs of points with a path length in both."""
        points = self._contacts.candidates.points
        tau_source, tau, share = _path_lengths(self.matching, self.source.rigid_skeleton, result.rigid_skeleton)
        of_source = self.source.positions, self.matching.drivers[points], tau_source
        return differences_of_distances(of_source, (result.positions, points, tau), share, 1)


@found_once
def _path_lengths(matching: Matching, source: Skeleton, result: Skeleton) -> tuple[Array, Array, Array]:
    """(points, points) each, the lengths of paths in source and result, and how much each pair of points counts: the
    same, but nothing where either length is 0, which is given as 1.
    """
    points = find_candidates(matching).points
    tau_source, tau = source.paths_among(matching.drivers[points]), result.paths_among(points)
    share = ((tau > 0) & (tau_source > 0)).astype(np.float64)
    share /= max(np.triu(share, 1).sum(), 1.0)
    return np.where(share > 0, tau_source, 1.0), np.where(share > 0, tau, 1.0), share
