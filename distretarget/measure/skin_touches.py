"""The skin of a result: how deep parts of a body sink into others, and how well it keeps the gaps where skins touch in
the source; arms that hang beside the body there, and hands that pass by, do not count as touching.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.contact_entries import DroppedContact
from distretarget.measure.metrics import Track, Tracks
from distretarget.measure.skin import OWN_ARM, Skin, are_parts, difference
from distretarget.measure.skin_depths import LIMBS, PARTS, PLACE_OF, find_depths
from distretarget.motion import Motion
from distretarget.numerics.kinematics import world_rotations
from distretarget.numerics.parallel import blocks_of, mapper_for, over_blocks
from distretarget.numerics.time_series import opening, spans_of
from distretarget.numerics.vectors import Array, Flags, Numbers, angles_between, cross, lengths, normalised
from distretarget.skin.capsules import SEGMENTS
from distretarget.skin.limbs import Limb

TOUCHING = 1.0  # skins nearer than this in the source touch [% of height]
GRAZING = 0.1  # points that are less deep than this lie on the skin [% of height]
BESIDE_POINTS = 0.5  # neighbours of a point nearer than this may be inside [% of height]
FARTHEST = 10.0  # gaps in the result count as no larger than this [% of height]
RATE = 30.0  # skin is measured about as often [1/s]
SPEED_SPAN = 0.1  # speeds are over this time before and after a frame, in which a clapping hand comes back [s]
PASSES_BY = 50.0  # a touch with a mean relative speed above this is one of a part that passes by [% of the height/s]
HANGS = np.radians(60)  # an arm hangs while the angles of shoulder and elbow add up to no more than this [rad]
ASIDE = np.radians(45)  # a part farther than this round the trunk from its front or back is beside it [rad]
LASTS = 1.0  # a hanging hand that swings is in front of the trunk for less than this [s]
VISIBLE = 1.0  # frames with more vertices inside than this count as frames with skin inside [% of the vertices]
BESIDE_ARM = ("chest", "belly", "pelvis", "thigh", "shin")  # a hanging arm does not touch these
# (limbs, segments), whether a segment is beside a hanging arm
BESIDE = np.array([are_parts(limb.split()[0], BESIDE_ARM) for limb in LIMBS])
OF_AN_ARM = np.array([name.endswith(OWN_ARM) for name in SEGMENTS])  # (segments,)
# (limbs,), the hand of each limb. In the result, a hand may touch what its forearm touches in the source: the two meet
# at the wrist, which is not at the same place of every mesh.
HAND = np.array([LIMBS.index(f"{limb.split()[0]} hand") for limb in LIMBS])


@dataclass(frozen=True, eq=False)
class SourceSkin:
    """The touches in a source, against which the skin of results is measured."""

    target: Skin  # the skin of results
    sampled: Numbers  # (samples,), the frames that are measured; each stands for those up to the next
    touches: Numbers  # (3, touches), sample, limb and segment of each, in order of samples
    gaps: Array  # (touches,), negative where the source overlaps [% of height]
    coordinates: Array  # (touches, 3), of the middle of the limb, as `PartFrames.coordinates`

    def without(self, drops: Sequence[DroppedContact], of_joint: Numbers) -> SourceSkin:
        """Return it without touches that a user drops; those of a forearm go with its hand's. `of_joint` has the
        segment of each joint of the target, or -1.
        """
        sample, limb, segment = self.touches
        is_left = np.ones(len(self.gaps), bool)
        for drop in drops:
            for one, other in drop.orders:
                limbs, others = of_joint[one], of_joint[other]
                on = np.isin(limb, limbs) | np.isin(HAND[limb], limbs)
                on &= np.isin(PLACE_OF[segment], PLACE_OF[others[others >= 0]])
                is_left &= ~(on & drop.frames[self.sampled[sample]])
        left = self.touches[:, is_left], self.gaps[is_left], self.coordinates[is_left]
        return SourceSkin(self.target, self.sampled, *left)

    def in_result(self, result: Motion) -> Tracks:
        """Measure the skin of a result with the same number of frames; tracks have none if no skin can touch another.
        Where the source overlaps, no gap from its own to 0 is an error. Places are compared in half widths.
        """
        skin, to_percent = self.target, 100.0 / self.target.height
        samples = len(self.sampled) if skin.can_touch.any() else 0
        deepest, vertices = np.zeros((samples, len(PARTS))), np.zeros(samples)
        gaps = np.zeros(len(self.gaps))

        def measure(block: slice) -> None:
            rows = slice(*np.searchsorted(self.touches[0], (block.start, block.stop)))
            sample, limb, segment = self.touches[:, rows] - np.array([[block.start], [0], [0]])
            reach = _larger_of_both_orders(self._reach(block.stop - block.start, sample, limb, segment))
            depths, vertices[block] = _depths(skin, result, self.sampled[block], reach)
            deepest[block] = to_percent * np.maximum(depths, 0.0).max(axis=2)
            gaps[rows] = _gaps(depths, sample, limb, segment)

        if samples:
            over_blocks(measure, samples, len(skin.patches.counts))
        # too far apart, where the source overlaps than touching; or deeper than in the source
        off = np.maximum(to_percent * gaps - np.maximum(self.gaps, 0.0), self.gaps - to_percent * gaps)
        gap_error, counts = self._means(np.maximum(off, 0.0), samples)
        coordinates = _coordinates(skin, result, self.sampled[self.touches[0]], *self.touches[1:])
        place_error, placed = self._means(difference(self.coordinates, coordinates), samples)
        last = np.searchsorted(self.sampled, np.arange(len(result) if samples else 0), side="right") - 1
        of_limbs = skin.patches.patches[skin.patches.parts[len(LIMBS)], 1]
        inside = 100.0 * vertices[last] / max(skin.patches.counts[:of_limbs].sum(), 1.0)
        deepest, gap_error, counts = deepest[last], gap_error[last], counts[last]
        return {
            "skin_depth": Track(deepest[:, : len(LIMBS)], parts=LIMBS),
            "part_depth": Track(deepest[:, len(LIMBS) :], parts=PARTS[len(LIMBS) :]),
            "skin_frames": Track(np.where(inside > VISIBLE, 100.0, 0.0)),
            "skin_gap": Track(gap_error, counts > 0, LIMBS),
            "touch_missed": Track(np.where(gap_error > TOUCHING, 100.0, 0.0), counts, LIMBS),
            "touch_place": Track(place_error[last], placed[last], LIMBS),
        }

    def _reach(self, samples: int, sample: Numbers, limb: Numbers, segment: Numbers) -> Array:
        """The argument `reach` of `find_depths` for touches of the source, (touches,) each."""
        reach, same_place = np.tile(np.where(self.target.can_touch, 0.0, -np.inf), (samples, 1, 1)), PLACE_OF[segment]
        for each, either in product(range(len(SEGMENTS)), (limb, HAND[limb])):
            on = same_place == PLACE_OF[each]
            reach[sample[on], either[on], each] = FARTHEST / 100.0 * self.target.height
        return reach

    def _means(self, values: Array, samples: int) -> tuple[Array, Numbers]:
        """The means of values of touches, (samples, limbs), and the numbers of those that are finite."""
        known, shape = np.isfinite(values), (samples, len(LIMBS))
        cell = (self.touches[0] * len(LIMBS) + self.touches[1])[known]
        counts = np.bincount(cell, minlength=samples * len(LIMBS))
        sums = np.bincount(cell, values[known], minlength=samples * len(LIMBS))
        means = np.asarray(sums / np.maximum(counts, 1), float)
        return means.reshape(shape), counts.reshape(shape)


def find_source_skin(source: Motion, body: Body, skin: Skin, target: Skin) -> SourceSkin:
    """Find the touches in a source, `RATE` times a second, and in all frames between two samples that differ."""
    both = (skin.can_touch & target.can_touch)[: len(LIMBS)]
    all_frames, step = np.arange(len(source)), max(round(1.0 / (RATE * source.frame_time)), 1)
    sampled = np.union1d(all_frames[::step], all_frames[-1:])
    if not both.any():
        return SourceSkin(target, sampled, np.zeros((3, 0), np.intp), np.zeros(0), np.zeros((0, 3)))
    hanging = _hanging(source, body)
    reach = np.where(skin.can_touch, TOUCHING / 100.0 * skin.height, -np.inf)[None]
    reach[:, len(LIMBS) :] = -np.inf

    def touch(frames: Numbers) -> Array:
        """(touches, 4), frame, limb and segment of the touches in some frames, and their gaps."""
        depths, _ = _depths(skin, source, frames, reach)
        of_limbs = depths[:, : len(LIMBS)]
        touching = (of_limbs > -reach[:, : len(LIMBS)]) & both & ~(hanging[frames, :, None] & BESIDE)
        for place in np.unique(PLACE_OF):  # of several segments of one place the nearest counts
            on = np.flatnonzero(place == PLACE_OF)
            some = np.where(touching[:, :, on], of_limbs[:, :, on], -np.inf)
            touching[:, :, on] &= np.arange(len(on)) == some.argmax(axis=2)[:, :, None]
        frame, limb, segment = np.nonzero(touching)
        gaps = _gaps(depths, frame, limb, segment)
        return np.column_stack([frames[frame], limb, segment, 100.0 / skin.height * gaps])

    def touches_in(frames: Numbers) -> Array:
        blocks = [frames[block] for block in blocks_of(len(frames))]
        return np.concatenate([*mapper_for(len(frames), len(skin.patches.counts))(touch, blocks)])

    found = touches_in(sampled)
    if len(between := _around_changes(sampled, found[:, :3].astype(np.intp))):
        found, sampled = np.concatenate([found, touches_in(between)]), np.union1d(sampled, between)
        found = found[np.argsort(found[:, 0], kind="stable")]
    found = found[~_passing(source, body, skin, sampled, *found[:, :3].T.astype(np.intp))]
    touches = found[:, :3].T.astype(np.intp)
    coordinates = _coordinates(skin, source, *touches)
    touches[0] = np.searchsorted(sampled, touches[0])
    return SourceSkin(target, sampled, touches, found[:, 3], coordinates)


def _passing(
    source: Motion, body: Body, skin: Skin, sampled: Numbers, frame: Numbers, limb: Numbers, segment: Numbers
) -> Flags:
    """(touches,), whether each is one of a hand that passes by; two arms never pass by each other."""
    wrists = np.array([body.roles.get(f"{name.split()[0]}Hand", -1) for name in LIMBS])[limb]
    known, speed = (wrists >= 0) & ~OF_AN_ARM[segment], np.zeros(len(frame))
    speed[known] = relative_speeds(source, frame[known], wrists[known], skin.frames.joints[segment[known]])
    of_place = limb * len(SEGMENTS) + PLACE_OF[segment]
    return passing(speed, np.searchsorted(sampled, frame), of_place, skin.height)


def _gaps(depths: Array, frame: Numbers, limb: Numbers, segment: Numbers) -> Array:
    """The gaps of limbs, or their hands, to segments' places, (n,) [file units]."""
    of_arm = np.maximum(depths[frame, limb], depths[frame, HAND[limb]])
    of_place = np.where(PLACE_OF[segment][:, None] == PLACE_OF, of_arm, -np.inf)
    return np.asarray(-of_place.max(axis=1, initial=-np.inf))


def _coordinates(skin: Skin, motion: Motion, frames: Numbers, limbs: Numbers, segments: Numbers) -> Array:
    """The coordinates of the middles of limbs on the parts of segments in frames, (n, 3), as `PartFrames.coordinates`.
    The nearest points of limbs would not do: where a hand lies flat, they jump by its width.
    """
    joints, on = skin.frames.joints[limbs], skin.frames.joints[segments]
    off = _seen_from(motion, frames, joints, on, skin.middles[limbs])
    return skin.frames.coordinates(segments, skin.frames.rest[segments] + off)


def _around_changes(sampled: Numbers, touches: Numbers) -> Numbers:
    """The frames between two of the `sampled` ones that differ in what touches."""
    touching = np.zeros((len(sampled), len(LIMBS), len(SEGMENTS)), bool)
    touching[np.searchsorted(sampled, touches[:, 0]), touches[:, 1], touches[:, 2]] = True
    changes = np.flatnonzero((touching[1:] != touching[:-1]).any(axis=(1, 2)))
    spans = [np.arange(sampled[change] + 1, sampled[change + 1]) for change in changes]
    return np.concatenate([np.zeros(0, np.intp), *spans])


def _depths(skin: Skin, motion: Motion, frames: Numbers, reach: Array) -> tuple[Array, Array]:
    """`find_depths` in some frames; of two limbs, the depths of either in the other are both the larger one."""
    posed = motion.positions[frames], world_rotations(motion.skeleton.parents, motion.rotations[frames])
    reach = np.where(reach >= 0.0, np.maximum(reach, BESIDE_POINTS / 100.0 * skin.height), reach)
    grazing = GRAZING / 100.0 * skin.height
    depths, inside = find_depths(skin.patches, skin.solids, posed, reach, grazing)
    return _larger_of_both_orders(depths), inside


def _larger_of_both_orders(values: Array) -> Array:
    """Write the larger of two values, (frames, parts, segments), to both: of one limb against another, and of this
    against the first.
    """
    between = values[:, : len(LIMBS), : len(LIMBS)]  # the first parts, and the first segments, are the limbs
    between[:] = np.maximum(between, between.transpose(0, 2, 1))
    return values


def _hanging(motion: Motion, body: Body) -> Flags:
    """(frames, limbs), whether each hand and forearm hangs, as `hanging_parts`."""
    hanging = np.zeros((len(motion), len(LIMBS)), bool)
    for side, arm in product(SIDES, body.arms):
        if body.roles.get(f"{side}Hand") == arm.end:
            hand, forearm = (LIMBS.index(f"{side} {part}") for part in ("hand", "forearm"))
            hanging[:, hand], hanging[:, forearm] = hanging_parts(body, motion, arm)
    return hanging


def relative_speeds(motion: Motion, frames: Numbers, joints: Numbers, on: Numbers) -> Array:
    """Return the speeds of joints in the axes of the joints that they are `on`, in frames, (n,) each [file units/s]."""
    reach = max(round(SPEED_SPAN / motion.frame_time), 1)
    ends = np.maximum(frames - reach, 0), np.minimum(frames + reach, len(motion) - 1)
    before, after = (_seen_from(motion, at, joints, on, np.zeros((len(on), 3))) for at in ends)
    return np.asarray(lengths(after - before) / (np.maximum(ends[1] - ends[0], 1) * motion.frame_time))


def passing(speed: Array, rows: Numbers, pairs: Numbers, height: float) -> Flags:
    """Return whether touches are of parts that pass by, (n,), by their `speed`, (n,) [file units/s]. A touch lasts over
    consecutive `rows`, (n,), with the same number of a pair, such as a limb and a place, in `pairs`, (n,).
    """
    passes = np.zeros(len(speed), bool)
    for pair in np.unique(pairs):
        own = np.flatnonzero(pairs == pair)
        touched = np.zeros(rows[own].max() + 1, bool)
        touched[rows[own]] = True
        for first, end in spans_of(touched):
            span = own[(rows[own] >= first) & (rows[own] < end)]
            passes[span] = speed[span].mean() > PASSES_BY / 100.0 * height
    return passes


def _seen_from(motion: Motion, frames: Numbers, joints: Numbers, on: Numbers, offsets: Array) -> Array:
    """(n, 3), points in frames, seen from the joints `on`. Each point is fixed to one of `joints`, at one of `offsets`,
    (n, 3), in the axes of that joint.
    """
    seen = motion.positions[frames, joints] - motion.positions[frames, on]
    for joint in np.unique(joints[offsets.any(axis=1)]).tolist():
        own = np.flatnonzero(joints == joint)
        seen[own] += Rotation.from_quat(motion.world_rotations_of(joint)[frames[own]]).apply(offsets[own])
    for joint in np.unique(on).tolist():
        own = np.flatnonzero(on == joint)
        seen[own] = Rotation.from_quat(motion.world_rotations_of(joint)[frames[own]]).apply(seen[own], inverse=True)
    return np.asarray(seen)


def hanging_gaps(body: Body, u: Numbers, v: Numbers) -> Array:
    """The distances of joints u and v, (pairs,), while arms hang [file units]; infinite if the arms are not known."""
    if not body.anatomy:
        return np.full(len(u), np.inf)
    places, down = np.array(body.reference.positions), -body.reference.axes[:, 1]
    for arm in body.arms:
        along = body.skeleton.paths_from(arm.top)
        for joint in body.skeleton.subtree(arm.top):
            places[joint] = places[arm.top] + along[joint] * down
    return np.asarray(lengths(places[u] - places[v]))


def hanging_parts(body: Body, motion: Motion, arm: Limb) -> tuple[Flags, Flags]:
    """Whether a hand hangs or swings beside the body, and whether its forearm is beside the trunk, (frames,) each."""
    positions, hangs = motion.positions, _hangs(body, motion.positions, arm)
    if not _hips(body) or len(body.arms) < 2:
        return hangs, hangs
    parts = [*body.skeleton.subtree(arm.end)], [arm.middle, arm.end]
    in_front = [~_beside(body, positions, joints) for joints in parts]  # or behind
    hand_lasts, forearm_lasts = (opening(each.astype(float), LASTS / motion.frame_time) > 0.0 for each in in_front)
    return hangs & ~hand_lasts, ~np.where(hangs, forearm_lasts, in_front[1])


def _hangs(body: Body, positions: Array, arm: Limb) -> Flags:
    """(frames,), whether an arm hangs, along gravity or the trunk; `positions` are (frames, joints, 3)."""
    shoulder, elbow, wrist = (positions[:, joint] for joint in (arm.top, arm.middle, arm.end))
    off, hips = angles_between(elbow - shoulder, np.broadcast_to(-body.up_vector, elbow.shape)), _hips(body)
    if hips:
        off = np.minimum(off, angles_between(elbow - shoulder, positions[:, hips].mean(axis=1) - shoulder))
    return np.asarray(off + angles_between(elbow - shoulder, wrist - elbow) <= HANGS)


def _beside(body: Body, positions: Array, joints: list[int]) -> Flags:
    """(frames,), whether the middle of joints is beside the trunk, and not in front of it or behind it."""
    left, right = (positions[:, each.top] for each in body.arms)
    pelvis = positions[:, _hips(body)].mean(axis=1)
    off = positions[:, joints].mean(axis=1) - pelvis
    trunk = normalised(0.5 * (left + right) - pelvis)
    across = normalised(left - right)
    forwards = cross(across, trunk)
    aside, forward = (np.abs((off * axis).sum(axis=1)) for axis in (across, forwards))
    return np.asarray(aside >= np.tan(ASIDE) * forward)


def _hips(body: Body) -> list[int]:
    return [leg.hip for leg in body.legs or ()]
