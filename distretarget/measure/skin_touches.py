"""How far hands and forearms sink into a body, and how well the gaps between skins that touch are kept. Arms that hang
and hands that pass by touch nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.body.limbs import Arm
from distretarget.contact_entries import DroppedContact
from distretarget.measure.metrics import Track, Tracks
from distretarget.measure.part_frames import PART_OF, difference
from distretarget.measure.skin import OWN_ARM, Skin, are_parts
from distretarget.measure.skin_depths import LIMBS, PARTS, PLACE_OF, find_depths
from distretarget.motion import Motion
from distretarget.numerics.kinematics import world_rotations
from distretarget.numerics.parallel import blocks_of, mapper_for, over_blocks
from distretarget.numerics.time_series import opening, spans_of
from distretarget.numerics.vectors import Array, Flags, Numbers, angles_between, cross, lengths, normalised
from distretarget.skin.capsules import SEGMENTS

TOUCHING = 1.0  # skins nearer than this in the source touch [% of height]
GRAZING = 0.1  # points that are less deep than this lie on the skin [% of height]
BESIDE_POINTS = 0.5  # where a point is nearer than this, its neighbours may be inside [% of height]
FARTHEST = 10.0  # what touches in the source and is farther off than this in the result is so far off [% of height]
RATE = 30.0  # skin is measured about as often [1/s]
SPEED_SPAN = 0.1  # speeds are those between so long before and after a frame, in which a hand that claps comes back [s]
PASSES_BY = 50.0  # what is faster than this, on average while it touches, passes by [% of the height/s]
HANGS = np.radians(60)  # an arm hangs while the angles of shoulder and elbow add up to no more than this [rad]
ASIDE = np.radians(45)  # what is farther than this round the trunk from straight before or behind it is beside it [rad]
LASTS = 1.0  # hands of arms that hang are in front of the trunk for less than this while they swing [s]
VISIBLE = 1.0  # in frames with more than this inside, skin is inside [% of the vertices]
BESIDE_ARM = ("chest", "belly", "pelvis", "thigh", "shin")  # a hanging arm is near these, which is no contact
# (limbs, segments), those beside an arm that hangs
BESIDE = np.array([are_parts(limb.split()[0], BESIDE_ARM) for limb in LIMBS])
OF_AN_ARM = np.array([name.endswith(OWN_ARM) for name in SEGMENTS])  # (segments,)
# (limbs,), the hand of each: what a forearm touches in the source, its hand may touch in the result, since the two meet
# at the wrist, which is not at the same place of every mesh.
HAND = np.array([LIMBS.index(f"{limb.split()[0]} hand") for limb in LIMBS])


@dataclass(frozen=True, eq=False, kw_only=True)
class SkinMeasured:
    """The skin of hands and forearms of a result. Arrays have no frames where its thickness is not known."""

    deepest: Array  # (frames, limbs), how deep each is inside other parts of the body [% of height]
    deepest_parts: Array  # (frames, other parts), how deep upper arms, legs and head are inside others [% of height]
    inside: Array  # (frames,), how much of hands and forearms is [% of the vertices]
    # (frames, limbs), the mean error of its gaps to what it touches in the source, in proportion to the heights; what
    # overlaps there may just touch; a forearm's gap is the least of forearm and hand [% of height]
    gap_error: Array
    touching: Numbers  # (frames, limbs), the number of parts of the body that it touches there
    # (frames, limbs), the mean distance of the places where it touches others from those of the source, along and round
    # what is touched [half widths], and the number of these places
    place_error: Array
    placed: Numbers

    @property
    def tracks(self) -> Tracks:
        """The values of the metrics of skin."""
        return {
            "skin_depth": Track(self.deepest, parts=LIMBS),
            "part_depth": Track(self.deepest_parts, parts=PARTS[len(LIMBS) :]),
            "skin_frames": Track(np.where(self.inside > VISIBLE, 100.0, 0.0)),
            "skin_gap": Track(self.gap_error, self.touching > 0, LIMBS),
            "touch_missed": Track(np.where(self.gap_error > TOUCHING, 100.0, 0.0), self.touching, LIMBS),
            "touch_place": Track(self.place_error, self.placed, LIMBS),
        }


@dataclass(frozen=True, eq=False)
class SourceSkin:
    """What touches in a source, which the skin of results is measured against."""

    target: Skin  # the skin of results
    seen: Numbers  # (some frames,), those that are measured; each holds up to the next
    touches: Numbers  # (3, contacts), which of these, limb and segment, by frames
    gaps: Array  # (contacts,), how far apart they are, negative where they overlap [% of height]
    spots: Array  # (contacts, 3), where on the segment, as `PartFrames.coordinates`

    def without(self, drops: Sequence[DroppedContact], of_joint: Numbers) -> SourceSkin:
        """Return it without touches that a user drops, of hands with those of their forearms; the target's joints
        belong to segments `of_joint`, (joints,).
        """
        frame, limb, segment = self.touches
        kept = np.ones(len(self.gaps), bool)
        for drop in drops:
            one, other = (np.unique(of_joint[part[of_joint[part] >= 0]]) for part in drop.parts)
            for a, b in ((one, other), (other, one)):
                on = (np.isin(limb, a) | np.isin(HAND[limb], a)) & np.isin(PLACE_OF[segment], PLACE_OF[b])
                kept &= ~(on & drop.frames[self.seen[frame]])
        return replace(self, touches=self.touches[:, kept], gaps=self.gaps[kept], spots=self.spots[kept])

    def in_result(self, result: Motion) -> SkinMeasured:
        """The skin of a result with the same number of frames."""
        skin, to_percent = self.target, 100.0 / self.target.height
        frames = len(self.seen) if skin.can_touch.any() else 0
        deepest, vertices = np.zeros((frames, len(PARTS))), np.zeros(frames)
        gaps, spots = np.zeros(len(self.gaps)), np.full((len(self.gaps), 3), np.nan)

        def look(block: slice) -> None:
            rows = slice(*np.searchsorted(self.touches[0], (block.start, block.stop)))
            frame, limb, segment = self.touches[:, rows] - np.array([[block.start], [0], [0]])
            reach, alone = self._reach(block.stop - block.start, frame, limb, segment)
            depths, places, vertices[block] = _depths(skin, result, self.seen[block], _of_first(reach), alone)
            deepest[block] = to_percent * np.maximum(depths, 0.0).max(axis=2)
            gaps[rows], spots[rows] = _touch(skin, depths, places, frame, limb, segment)

        if frames:
            over_blocks(look, frames, len(skin.patches.counts))
        # off those of the source, or off touching where the source overlaps
        off = np.maximum(to_percent * gaps - np.maximum(self.gaps, 0.0), self.gaps - to_percent * gaps)
        gap_error, counts = self._means(np.maximum(off, 0.0), frames)
        place_error, placed = self._means(difference(self.spots, spots), frames)
        last = np.searchsorted(self.seen, np.arange(len(result) if frames else 0), side="right") - 1
        of_limbs = skin.patches.patches[skin.patches.parts[len(LIMBS)], 1]
        return SkinMeasured(
            deepest=deepest[last, : len(LIMBS)],
            deepest_parts=deepest[last, len(LIMBS) :],
            inside=100.0 * vertices[last] / max(skin.patches.counts[:of_limbs].sum(), 1.0),
            gap_error=gap_error[last],
            touching=counts[last],
            place_error=place_error[last],
            placed=placed[last],
        )

    def _reach(self, frames: int, frame: Numbers, limb: Numbers, segment: Numbers) -> tuple[Array, Flags]:
        """How far from each segment to look for each part in some frames, (frames, parts, segments), and for which of
        these to look apart from others of its place; by what is touched in the source, (touches,) each.
        """
        reach = np.tile(np.where(self.target.can_touch, 0.0, -np.inf), (frames, 1, 1))
        alone = np.zeros(reach.shape, bool)
        there, of_part = (of[segment][:, None] == of for of in (PLACE_OF, PART_OF))
        for part, either in product(range(len(SEGMENTS)), (limb, HAND[limb])):
            reach[frame[there[:, part]], either[there[:, part]], part] = FARTHEST / 100.0 * self.target.height
            alone[frame[of_part[:, part]], either[of_part[:, part]], part] = True
        return reach, alone

    def _means(self, values: Array, frames: int) -> tuple[Array, Numbers]:
        """The means of what was measured of contacts, (seen frames, limbs), and how many have a value there."""
        known, shape = np.isfinite(values), (frames, len(LIMBS))
        cell = (self.touches[0] * len(LIMBS) + self.touches[1])[known]
        counts = np.bincount(cell, minlength=frames * len(LIMBS))
        sums = np.bincount(cell, values[known], minlength=frames * len(LIMBS))
        means = np.asarray(sums / np.maximum(counts, 1), float)
        return means.reshape(shape), counts.reshape(shape)


def find_source_skin(source: Motion, body: Body, skin: Skin, target: Skin) -> SourceSkin:
    """Find what touches in a source; `skin` is that of its `body`. About `RATE` frames a second are looked at, and
    all around the first and the last of each touch.
    """
    both = (skin.can_touch & target.can_touch)[: len(LIMBS)]
    seen = _spread(np.arange(len(source)), 1.0 / (RATE * source.frame_time))
    if not both.any():
        return SourceSkin(target, seen, np.zeros((3, 0), np.intp), np.zeros(0), np.zeros((0, 3)))
    hanging = _hanging(source, body)
    reach = np.where(skin.can_touch, TOUCHING / 100.0 * skin.height, -np.inf)[None]
    reach[:, len(LIMBS) :] = -np.inf

    def touch(frames: Numbers) -> Array:
        """Frame, limb and segment of what touches in some frames, its gap and its spot, (touches, 7)."""
        depths, places, _ = _depths(skin, source, frames, reach)
        of_limbs = depths[:, : len(LIMBS)]
        touching = (of_limbs > -reach[:, : len(LIMBS)]) & both & ~(hanging[frames, :, None] & BESIDE)
        for place in np.unique(PLACE_OF):  # where a limb touches several parts of one place, the nearest counts
            on = np.flatnonzero(place == PLACE_OF)
            some = np.where(touching[:, :, on], of_limbs[:, :, on], -np.inf)
            touching[:, :, on] &= np.arange(len(on)) == some.argmax(axis=2)[:, :, None]
        frame, limb, segment = np.nonzero(touching)
        gaps, spots = _touch(skin, depths, places, frame, limb, segment)
        return np.column_stack([frames[frame], limb, segment, 100.0 / skin.height * gaps, spots])

    def touches_in(frames: Numbers) -> Array:
        blocks = [frames[block] for block in blocks_of(len(frames))]
        return np.concatenate([*mapper_for(len(frames), len(skin.patches.counts))(touch, blocks)])

    found = touches_in(seen)
    if len(between := _around_changes(seen, found[:, :3].astype(np.intp))):
        found, seen = np.concatenate([found, touches_in(between)]), np.union1d(seen, between)
        found = found[np.argsort(found[:, 0], kind="stable")]
    found = found[~_passing(source, body, skin, seen, *found[:, :3].T.astype(np.intp))]
    touches = found[:, :3].T.astype(np.intp)
    touches[0] = np.searchsorted(seen, touches[0])
    return SourceSkin(target, seen, touches, found[:, 3], found[:, 4:])


def _passing(
    source: Motion, body: Body, skin: Skin, seen: Numbers, frame: Numbers, limb: Numbers, segment: Numbers
) -> Flags:
    """(contacts,), whether the hand of what touches passes by; arms that meet never do."""
    wrists = np.array([body.roles.get(f"{name.split()[0]}Hand", -1) for name in LIMBS])[limb]
    known, speed = (wrists >= 0) & ~OF_AN_ARM[segment], np.zeros(len(frame))
    speed[known] = speeds(source, frame[known], wrists[known], skin.frames.joints[segment[known]])
    of_place = limb * len(SEGMENTS) + PLACE_OF[segment]
    return passing(speed, np.searchsorted(seen, frame), of_place, skin.height)


def _touch(
    skin: Skin, depths: Array, places: Array, frame: Numbers, limb: Numbers, segment: Numbers
) -> tuple[Array, Array]:
    """Return how far limbs, or the hands of their arms, are off the places of the segments that they touch, (n,) each
    [file units], and where they are nearest to the same part, (n, 3), as `PartFrames.coordinates`.
    """
    of_arm = np.maximum(depths[frame, limb], depths[frame, HAND[limb]])
    of_place = np.where(PLACE_OF[segment][:, None] == PLACE_OF, of_arm, -np.inf)
    segment = np.where(PART_OF[segment][:, None] == PART_OF, of_arm, -np.inf).argmax(axis=1)
    limb = np.where(depths[frame, HAND[limb], segment] > depths[frame, limb, segment], HAND[limb], limb)
    return -of_place.max(axis=1, initial=-np.inf), skin.frames.coordinates(segment, places[frame, limb, segment])


def _spread(frames: Numbers, step: float) -> Numbers:
    """Every so many of the frames, rounded, and the last."""
    return np.union1d(frames[:: max(round(step), 1)], frames[-1:])


def _around_changes(seen: Numbers, touches: Numbers) -> Numbers:
    """The frames between two of those that were `seen` in which not the same parts touch."""
    touching = np.zeros((len(seen), len(LIMBS), len(SEGMENTS)), bool)
    touching[np.searchsorted(seen, touches[:, 0]), touches[:, 1], touches[:, 2]] = True
    changes = np.flatnonzero((touching[1:] != touching[:-1]).any(axis=(1, 2)))
    spans = [np.arange(seen[change] + 1, seen[change + 1]) for change in changes]
    return np.concatenate([np.zeros(0, np.intp), *spans])


def _depths(
    skin: Skin, motion: Motion, frames: Numbers, reach: Array, alone: Flags | None = None
) -> tuple[Array, Array, Array]:
    """`find_depths` in some frames, where two parts meet those of the first of the two."""
    posed = motion.positions[frames], world_rotations(motion.skeleton.parents, motion.rotations[frames])
    reach = np.where(reach >= 0.0, np.maximum(reach, BESIDE_POINTS / 100.0 * skin.height), reach)
    depths, places, inside = find_depths(skin.patches, skin.solids, posed, reach, GRAZING / 100.0 * skin.height, alone)
    return _of_first(depths), places, inside


def _of_first(of_parts: Array) -> Array:
    """Values of parts and segments, (frames, parts, segments), those of two limbs being the larger of both ways."""
    between = of_parts[:, : len(LIMBS), : len(LIMBS)]  # the first parts, and the first segments, are the limbs
    between[:] = np.maximum(between, between.transpose(0, 2, 1))
    return of_parts


def _hanging(motion: Motion, body: Body) -> Flags:
    """(frames, limbs), whether each hand and forearm hangs, as `hanging_parts`."""
    hanging = np.zeros((len(motion), len(LIMBS)), bool)
    for side, arm in product(SIDES, body.arms):
        if body.roles.get(f"{side}Hand") == arm.wrist:
            hand, forearm = (LIMBS.index(f"{side} {part}") for part in ("hand", "forearm"))
            hanging[:, hand], hanging[:, forearm] = hanging_parts(body, motion, arm)
    return hanging


def speeds(motion: Motion, frames: Numbers, joints: Numbers, on: Numbers) -> Array:
    """Return how fast joints move as seen from the joints that they are `on`, (n,), in some frames, each (n,)
    [file units/s].
    """
    reach = max(round(SPEED_SPAN / motion.frame_time), 1)
    ends = np.maximum(frames - reach, 0), np.minimum(frames + reach, len(motion) - 1)
    before, after = (_seen_from(motion, at, joints, on) for at in ends)
    return np.asarray(lengths(after - before) / (np.maximum(ends[1] - ends[0], 1) * motion.frame_time))


def passing(speed: Array, rows: Numbers, of: Numbers, height: float) -> Flags:
    """Return whether touches pass by, (n,), by their `speed`, (n,) [file units/s]; each is of a row of frames and of
    something, (n,) each, such as a limb and a place, and lasts while that has touches in consecutive rows.
    """
    passes = np.zeros(len(speed), bool)
    for one in np.unique(of):
        own = np.flatnonzero(of == one)
        touched = np.zeros(rows[own].max() + 1, bool)
        touched[rows[own]] = True
        for first, end in spans_of(touched):
            span = own[(rows[own] >= first) & (rows[own] < end)]
            passes[span] = speed[span].mean() > PASSES_BY / 100.0 * height
    return passes


def _seen_from(motion: Motion, frames: Numbers, joints: Numbers, on: Numbers) -> Array:
    """(n, 3), where joints are in the axes of others."""
    result = np.zeros((len(frames), 3))
    for joint in np.unique(on).tolist():
        own = np.flatnonzero(on == joint)
        at = frames[own]
        off = motion.positions[at, joints[own]] - motion.positions[at, joint]
        result[own] = Rotation.from_quat(motion.world_rotations_of(joint)[at]).apply(off, inverse=True)
    return result


def hanging_gaps(body: Body, u: Numbers, v: Numbers) -> Array:
    """How far joints u and v, (pairs,) each, are apart while the body stands and its arms hang, (pairs,) [file units];
    infinite where it is not known which joints are its arms.
    """
    if not body.anatomy:
        return np.full(len(u), np.inf)
    places, down = np.array(body.reference.positions), -body.reference.axes[:, 1]
    for arm in body.arms:
        along = body.skeleton.paths_from(arm.shoulder)
        for joint in body.skeleton.subtree(arm.shoulder):
            places[joint] = places[arm.shoulder] + along[joint] * down
    return np.asarray(lengths(places[u] - places[v]))


def hanging_parts(body: Body, motion: Motion, arm: Arm) -> tuple[Flags, Flags]:
    """Return whether a hand hangs beside the body, or swings past it, and whether the forearm of its arm is beside the
    trunk, where it is as well while the elbow is bent, (frames,) each.
    """
    positions, low = motion.positions, _hangs(body, motion.positions, arm)
    if not _hips(body) or len(body.arms) < 2:
        return low, low
    parts = [*body.skeleton.subtree(arm.wrist)], [arm.elbow, arm.wrist]
    apart = [~_beside(body, positions, joints) for joints in parts]
    of_hand, of_forearm = (opening(flags.astype(float), LASTS / motion.frame_time) > 0.0 for flags in apart)
    return low & ~of_hand, ~np.where(low, of_forearm, apart[1])


def _hangs(body: Body, positions: Array, arm: Arm) -> Flags:
    """(frames,), whether an arm of a body hangs, along gravity or, where hip joints are known, along the trunk.
    `positions`, (frames, joints, 3), are those of the body.
    """
    shoulder, elbow, wrist = (positions[:, joint] for joint in (arm.shoulder, arm.elbow, arm.wrist))
    off, hips = angles_between(elbow - shoulder, np.broadcast_to(-body.up_vector, elbow.shape)), _hips(body)
    if hips:
        off = np.minimum(off, angles_between(elbow - shoulder, positions[:, hips].mean(axis=1) - shoulder))
    return np.asarray(off + angles_between(elbow - shoulder, wrist - elbow) <= HANGS)


def _beside(body: Body, positions: Array, joints: list[int]) -> Flags:
    """(frames,), whether the middle of joints is beside the trunk, and not in front of it or behind it; `positions` as
    for `_hangs`, of a body with hips and two arms.
    """
    left, right = (positions[:, each.shoulder] for each in body.arms)
    pelvis = positions[:, _hips(body)].mean(axis=1)
    off = positions[:, joints].mean(axis=1) - pelvis
    trunk = normalised(0.5 * (left + right) - pelvis)
    across = normalised(left - right)
    forwards = cross(across, trunk)
    aside, forward = (np.abs((off * axis).sum(axis=1)) for axis in (across, forwards))
    return np.asarray(aside >= np.tan(ASIDE) * forward)


def _hips(body: Body) -> list[int]:
    return [leg.hip for leg in body.legs or ()]
