"""Measure a motion against its source and the rotation copy, with code that shares nothing with the solvers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import rest_alignment
from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.contact_entries import DroppedContact
from distretarget.matching.matching import Matching, cached_by_soles
from distretarget.measure.contacts import Contacts, find_region_contacts
from distretarget.measure.metrics import Track, Tracks
from distretarget.measure.posture import errors_of, find_posture
from distretarget.measure.skin import Skin, Surface, find_skin
from distretarget.measure.skin_depths import LIMBS
from distretarget.measure.skin_touches import find_source_skin
from distretarget.measure.supports import find_feet, find_supports
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import angles_to_bones, thirds_along, turns_along, write_directions
from distretarget.numerics.moving import largest
from distretarget.numerics.parallel import blocks_of, in_blocks
from distretarget.numerics.time_series import Shots, usual_steps
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths
from distretarget.rig import rig_cached
from distretarget.skin.capsules import no_capsules

INSTANT = 1 / 60  # the time over which turns, shaking and pops are measured [s]
STEADY = 1 / 30  # the step of the differences that give the acceleration of the hips, above the time of noise [s]
# Roles whose bones point differently in every body: of trunk, collar bones, hands, head and feet.
BUILT_DIFFERENTLY = ("hips", "spine", "chest", "upperChest", "neck", "head", "Shoulder", "Hand", "Foot", "Toes")
NOT_TURNED = ("head", "upperChest", "chest", "leftHand", "rightHand")  # roles whose rotations contacts need not change
SINKS = 2.0  # a copied arm needs no change if it sinks in by less than this [% of height]
AROUND = 0.75  # an arm may turn for this long before and after frames in which it needs to [s]
LASTS = 0.1  # shaking is a median over this time before and after [s]
FAR = 4.0  # a joint pops if its step relative to the copy is larger than this [% of leg length in INSTANT] ...
SUDDEN = 3.0  # ... and than this many times the usual step
JUMP = 2.0  # a step of the source larger than `FAR` and than this many times the usual one is an error of the data

Expected = Callable[[slice], Array]  # directions of bones in a block of frames, (frames, bones, 3), of any length


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison:
    """The measurements of a result against its source.

    Attributes:
        contacts: the self-contacts of the source, and how well the result keeps them.
        stance: (frames, foot joints), whether ankle and toe of each leg rest in the source.
        others_rest: (frames, joints), whether other joints rest in the source; joints that never rest are left out.
        source_tracks: the tracks of the source's metrics.
        tracks: the tracks of the result's metrics, except those that need a run: stress, pops, frames not converged.
    """

    contacts: Contacts
    stance: Flags
    others_rest: Flags
    source_tracks: Tracks
    tracks: Tracks


class Reference:
    """A source against which results on a target are measured; the source itself is measured once."""

    def __init__(
        self,
        source: Motion,
        matching: Matching,
        up: Array,
        skins: tuple[Skin, Skin] | None = None,
        surface: Surface | None = None,
    ) -> None:
        """Measure the source; `up`, (3,), is the unit vector up, `skins` those of both bodies, if known."""
        self.matching = matching
        skins = skins or (find_skin(matching.source, no_capsules()), find_skin(matching.target, no_capsules()))
        self._skin = find_source_skin(source, matching.source, *skins)
        self._feet = find_feet(source, matching, up, surface)
        self._contacts = find_region_contacts(source, matching, self._feet.stance)
        self._supports = find_supports(source, matching, up, surface, self._feet.thickness)
        self._posture = find_posture(source, matching, up, self._feet.stance)
        self._directions = expected_directions(source, matching)
        self._turned = np.flatnonzero(matching.drivers >= 0)
        self._turns = turns_along(source.skeleton.parents, source.rotations, matching.drivers[self._turned])
        self._cuts = np.diff(matching.source.shots_of(source)) > 0
        self._tracks = {
            "foot_skate": Track(self._feet.paths.skate, self._feet.stance),
            "support_skate": Track(self._supports.skate, self._supports.rest),
            "jerk": _jerk(source, matching.source),
            "hips_acceleration": self._acceleration_of_hips(source, 0),
        }

    def without(self, drops: Sequence[DroppedContact], of_joint: Numbers) -> Reference:
        """Return the reference without the contacts that a user drops; arguments as `SourceSkin.without`."""
        other = copy(self)
        other._skin, other._contacts = self._skin.without(drops, of_joint), self._contacts.without(drops)
        return other

    def compare(self, result: Motion) -> Comparison:
        """Measure a result with the same number of frames."""
        bones, skeleton = shared_bones(self.matching), result.skeleton
        contacts, supports = self._contacts.in_result(result), self._supports.in_result(result)
        further = turns_along(skeleton.parents, result.rotations, self._turned)
        further -= self._turns
        further *= np.degrees(INSTANT / result.frame_time)
        further[self._cuts] = 0.0
        off = direction_error(self._directions, result, bones)
        tracks = {
            "contact_error": contacts.track,
            **self._skin.in_result(result),
            "direction_error": Track(off, parts=skeleton.keys_of(skeleton.parents[bones])),
            **self._feet.in_result(result, supports),
            "support_skate": Track(supports.skate, supports.rest, skeleton.keys_of(supports.joints)),
            "support_height": Track(supports.height, supports.on_floor, skeleton.keys_of(supports.joints)),
            **{key: errors_of(directions, result) for key, directions in self._posture.items()},
            "jerk": _jerk(result, self.matching.target),
            "turn": Track(further, parts=skeleton.keys_of(self._turned)),
            "hips_acceleration": self._acceleration_of_hips(result, 1),
        }
        return Comparison(
            contacts=contacts,
            stance=self._feet.stance,
            others_rest=supports.rest,
            source_tracks=self._tracks,
            tracks=tracks,
        )

    def _acceleration_of_hips(self, motion: Motion, of: Literal[0, 1]) -> Track:
        """(frames - a few,), of the middle between the hip joints of source, 0, or target, 1 [leg lengths / s^2]."""
        lag = max(round(STEADY / motion.frame_time), 1)
        if self.matching.legs is None or len(motion) <= 2 * lag:
            return Track(np.zeros(0))
        hips = motion.positions[:, [leg.hip for leg in self.matching.legs[of]]].mean(axis=1)
        bends = lengths(hips[2 * lag :] - 2.0 * hips[lag:-lag] + hips[: -2 * lag])
        cut = np.append(0, np.cumsum(self._cuts))
        bends[cut[2 * lag :] != cut[: -2 * lag]] = 0.0
        return Track(np.asarray(bends / (self.matching.leg_lengths[of] * (lag * motion.frame_time) ** 2)))


def _jerk(motion: Motion, body: Body) -> Track:
    """(frames - 3,), the mean norm of the third difference of the positions of the body's joints [body sizes / s^3]."""
    size = body.skeleton.longest_path * motion.frame_time**3
    return Track(np.asarray(thirds_along(motion.positions, np.flatnonzero(body.regions.of_joint >= 0)) / size))


@rig_cached
def shared_bones(matching: Matching) -> Numbers:
    """(bones,), the lower joints of the target's bones that both bodies have, with a length on both."""
    source, skeleton, drivers = matching.source.skeleton, matching.target.skeleton, matching.drivers
    upper = skeleton.parents
    shared = (drivers >= 0) & (drivers[upper] >= 0) & (skeleton.lengths > 0)
    shared[0] = False
    lower = np.flatnonzero(shared)
    return np.asarray(lower[source.coincident[drivers[lower]] != source.coincident[drivers[upper[lower]]]])


def direction_error(expected: Expected, result: Motion, lower: Numbers) -> Array:
    """(frames, bones), the angle of the bones above the joints `lower` to their `expected` directions [degrees]."""
    upper = result.skeleton.parents[lower]

    def angles(block: slice) -> Array:
        return np.degrees(angles_to_bones(expected(block), result.positions[block], upper, lower))

    return in_blocks(angles, len(result))


def expected_directions(source: Motion, matching: Matching) -> Expected:
    """Return the directions that the `shared_bones` of the target should have: those of the source's bones, but for
    trunk, collar bones, hands, head and feet, which differ in every body, those of the target's own bones turned by the
    source's rotations relative to the rest poses.
    """
    drivers, lower, turns = matching.drivers, shared_bones(matching), _turned_bones(matching)
    upper = matching.target.skeleton.parents[lower]

    def directions(block: slice) -> Array:
        world = source.world_rotations_in(block)
        expected = np.empty((len(world), len(lower), 3))
        write_directions(source.positions[block], drivers[upper], drivers[lower], world, *turns, expected)
        return expected

    return directions


@cached_by_soles
def _turned_bones(matching: Matching) -> tuple[Numbers, Array, Array]:
    """For `shared_bones`, two source joints that turn each, -1 for none, their blend, and the bone in their axes."""
    lower, skeleton, alignment = shared_bones(matching), matching.target.skeleton, rest_alignment(matching)
    upper, bones = skeleton.parents[lower], skeleton.offsets[lower]
    turned = np.isin(upper, _built_differently(matching))
    aligned = np.stack([Rotation.from_quat(alignment[upper, k]).apply(bones) for k in (0, 1)], axis=1)
    return np.where(turned[:, None], matching.rotation_sources[upper], -1), matching.blend[upper], aligned


def _built_differently(matching: Matching) -> list[int]:
    """The target's joints whose bones point differently in every body; none unless both bodies have an anatomy."""
    anatomy = matching.target.anatomy
    if anatomy is None or matching.source.anatomy is None:
        return []
    joints = [joint for role, joint in anatomy.roles.items() if role.endswith(BUILT_DIFFERENTLY)]
    return [*joints, *anatomy.spine, *anatomy.neck, *matching.target.above_hips]


def find_turned(copy: Motion, result: Motion, body: Body) -> Track:
    """The angles of head, chest and hands to the rotation copy, (frames, parts) [degrees]."""
    joints = body.anatomy.joints(*NOT_TURNED) if body.anatomy else []
    angles = [_angles(copy, result, joint) for joint in joints]
    return Track(_columns(angles, len(result)), parts=result.skeleton.keys_of(joints))


def find_pops(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 1, joints), the step of each joint relative to the copy where it is a pop [% of leg length in
    `INSTANT`]; else 0, as outside the body, at a cut between `shots`, (frames,), and where the source itself jumps.
    """
    pops, same_shot = np.zeros((max(len(result) - 1, 0), len(result.skeleton))), np.diff(shots) == 0
    joints, scale = np.flatnonzero(body.regions.of_joint >= 0), 100 * INSTANT / (body.leg * result.frame_time)
    for block in blocks_of(len(pops)):
        first = max(block.start - 2, 0)
        frames, rows = slice(first, block.stop + 3), slice(block.start - first, block.stop - first)
        of_copy, of_result = (np.diff(each.positions_in(frames)[:, joints], axis=0) for each in (copy, result))
        copied, added = scale * lengths(of_copy), scale * lengths(of_result - of_copy)
        counts = same_shot[block] & ~_sudden(copied, JUMP)[rows].any(axis=1)
        pops[block, joints] = np.where(_sudden(added, SUDDEN)[rows] & counts[:, None], added[rows], 0.0)
    return pops


def _sudden(steps: Array, times: float) -> Flags:
    """(frames, joints), whether steps are larger than `FAR` and than so many times the usual step."""
    return np.asarray((steps > FAR) & (steps > times * usual_steps(steps)))


def find_arm_deviation(
    copy: Motion, result: Motion, body: Body, of_copy: Comparison, of_result: Comparison, free: Flags | bool = False
) -> Track:
    """The angles of upper arms to the rotation copy, or to the source's directions if larger, (frames, arms) [degrees].
    They count while the arm touches nothing in the source, only feet rest there, and the copied forearm and hand do not
    sink in; and not in frames that are `free`, (frames,), where the user changed contacts.
    """
    sides = [side for side in SIDES if f"{side}UpperArm" in body.roles]
    joints = body.anatomy.joints(*(f"{side}UpperArm" for side in sides)) if body.anatomy else []
    keys = result.skeleton.keys_of(joints)
    off = of_result.tracks["direction_error"]
    errors = [off.values[:, np.array(off.parts) == key].max(axis=1, initial=0.0) for key in keys]
    angles = [np.maximum(_angles(copy, result, joint), each) for joint, each in zip(joints, errors, strict=True)]
    counts = _columns([~_may_turn(of_copy, side, result.frame_time, free) for side in sides], len(result)) > 0
    return Track(_columns(angles, len(result)), counts, keys)


def find_shaking(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 2, joints), how much farther than in the copy each joint is from the midpoint of the frames around [%
    of leg length]: the median over `LASTS`, since a single jump is no shaking. For frame times above `INSTANT` it is
    scaled as the distance of a smooth path is; 0 outside the body and at a cut between `shots`, (frames,).
    """
    joints, off = np.flatnonzero(body.regions.of_joint >= 0), np.zeros((max(len(result) - 2, 0), len(result.skeleton)))
    for block in blocks_of(len(off)):
        frames = slice(block.start, block.stop + 2)
        paths = (motion.positions_in(frames)[:, joints] for motion in (result, copy))
        result_off, copy_off = (lengths(x[1:-1] - 0.5 * (x[:-2] + x[2:])) for x in paths)
        off[block, joints] = np.maximum(result_off - copy_off, 0.0)
    cuts = np.diff(shots) != 0
    off[cuts[:-1] | cuts[1:]] = 0.0
    span = 2 * round(LASTS / result.frame_time) + 1
    percent = 100.0 * min(INSTANT / result.frame_time, 1.0) ** 2 / body.leg
    for joint in joints:  # one by one, for which scipy has a faster filter
        off[:, joint] = percent * median_filter(off[:, joint], span, mode="nearest")
    return off


def _columns(values: list[Array] | list[Flags], frames: int) -> Array:
    """(frames, n), values of (frames,) each as columns."""
    return np.stack(values, axis=1).astype(np.float64) if values else np.zeros((frames, 0))


def _angles(copy: Motion, result: Motion, joint: int) -> Array:
    """(frames,), the angles between the world rotations of a joint [degrees]."""
    cosine = np.abs((copy.world_rotations_of(joint) * result.world_rotations_of(joint)).sum(axis=1))
    return np.asarray(np.degrees(2.0 * np.arccos(np.minimum(cosine, 1.0))))


def _may_turn(of_copy: Comparison, side: str, frame_time: float, free: Flags | bool) -> Flags:
    """(frames,), whether an arm may turn: within `AROUND` of frames in which it has a reason to."""
    reason, own = _touching(of_copy.contacts, side), [limb.startswith(side) for limb in LIMBS]
    reason |= of_copy.others_rest.any(axis=1) | free
    depths, touches = (of_copy.tracks[key] for key in ("skin_depth", "skin_gap"))
    if len(depths.values):
        reason |= (depths.values[:, own].max(axis=1) >= SINKS) | touches.weights[:, own].any(axis=1)
    reach = int(min(AROUND / frame_time, len(reason)))
    return np.asarray(largest(reason.astype(np.float64)[:, None], reach)[:, 0] > 0.0)


def _touching(contacts: Contacts, side: str) -> Flags:
    """(frames,), whether an arm is in a self-contact of the source."""
    names = contacts.candidates.names
    arms = [
        any(part.startswith(side) and part.endswith(("hand", "arm")) for part in name.split(" - ")) for name in names
    ]
    touching = np.zeros(len(contacts.strides), bool)
    touching[contacts.frame[np.array(arms, bool)[contacts.regions]]] = True
    return touching
