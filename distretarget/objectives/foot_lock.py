"""Foot lock: when feet rest on the floor, and where the target's feet are locked.

A foot rests while it is slow and low. It keeps the rotation of the rotation copy. Its place relative to its hip joint
and the height of its sole are the source's, scaled:

    toe = scale source toe + steadied (longer + wider) + a (longer - its average over 0.05 s), along the floor
        + (how far the copied sole is below the toe - scale the source's) up
    longer = scale source foot - copied foot
    wider = (copied hip joint - middle of the copied hips) - scale (the same of the source), along the floor
    ankle = toe + copied foot

"Steadied" is the mean over the time for which the source's foot stands still; the mean changes only as far as the
source's foot slides. Legs are therefore spread as the source's on average, and feet do not skate. a is 0 while the foot
rolls about its toe, and 1 while it turns about its ankle, which then stays in place. Feet beside each other under
narrow hips keep at least a foot's width apart. Legs of animals have more bones, which decide where feet stand: there
"longer + wider" is the copied toe less the source's, scaled.

While a foot of the source rests, its sole does not rise or sink, and on a level floor all soles are equally high
(`level_on_floor`). The height of a sole computed from joints drifts, so it is smoothed within each rest. From one rest
to the next the offset of the sole from its level is interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import SINK
from distretarget.body.limbs import Leg
from distretarget.body.resting import REST_SPEED, feet_resting
from distretarget.body.soles import Sole, floor_height, level_on_floor, sole_height
from distretarget.matching.undersides import Undersides
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of, lowest_heights
from distretarget.numerics.moving import averaged
from distretarget.numerics.parallel import mapper_for
from distretarget.numerics.time_series import by_shot, median_of_three, smoothed, smoothed_steps, smoothstep, spans_of
from distretarget.numerics.vectors import Array, Flags, lengths, level, normalised
from distretarget.objectives.clip import Clip, LegPair
from distretarget.objectives.supports import BLEND, RESTS, ROOT_BLEND, Supports, no_supports

REST_BLEND = 0.06  # smoothing time of the height of the hips between rests, of feet that stand on their mesh [s]
FOOT_WIDTH = 0.11  # 0.055 of the body's height, of which legs are 0.49 (Winter, metric 4.1) [leg lengths]
ROLL = 0.05  # height over which the lowest point of the sole rolls from heel to toe [leg lengths]
PATH_SPAN = 0.1  # the place of a sliding foot is averaged over about this length of its path [leg lengths]
STILL = 1e-5  # the least step per frame of a foot that is divided by [leg lengths]
SPEED_SPAN = 0.05  # speeds of feet are averaged over this time before and after [s]
LEAST_WEIGHT = 1e-3  # added to the weights of feet, so that means exist where no foot rests


@dataclass(frozen=True, eq=False)
class Foot:
    """A foot over the frames of a motion."""

    hip: Array  # (frames, 3), the places of the leg's hip joint [file units]
    toe: Array  # (frames, 3), its places [file units]
    bone: Array  # (frames, 3), from toe to ankle [file units]
    # (frames,), how far the lowest point of the sole is below the toe; it rolls smoothly from heel to toe [file units]
    below: Array

    @classmethod
    def of(cls, motion: Motion, leg: Leg, sole: Sole, up: Array, length: float) -> Foot:
        """Return the foot of a leg in a motion; `length` is the leg length [file units]."""
        positions = motion.positions
        toe = positions[:, leg.toe]
        bone = positions[:, leg.ankle] - toe
        normal = Rotation.from_quat(motion.world_rotations_of(leg.ankle)).apply(sole.normal) @ up
        under = np.outer(np.maximum(normal, 0.0), sole.heights) - (
            heights_of(positions, sole.joints, up) - (toe @ up)[:, None]
        )
        heel, others = under[:, 0], under[:, 1:]
        front = others.max(axis=1) if others.shape[1] else heel
        below = (heel + front + np.hypot(heel - front, ROLL * length)) / 2.0
        return cls(positions[:, leg.hip], toe, bone, below)


def find_foot_lock(clip: Clip, undersides: Undersides | None = None) -> Supports:
    """Return the supports of feet: when the source's rest, and the places of the target's, by their mesh if known."""
    if not clip.legs:
        return no_supports(len(clip))
    length = clip.leg_lengths[0]

    def foot(pair: LegPair) -> tuple[Array, Array, Foot, Foot]:
        """How much ankle and toe rest, and that widened, (frames, 2) each; the foot in source and rotation copy."""
        rests = feet_resting(clip.source, pair.source, clip.up, length, clip.shots)
        weights = clip.widened(rests, BLEND)
        source = Foot.of(clip.source, pair.source, pair.source_sole, clip.up, length)
        copy = Foot.of(clip.copy, pair.target, pair.target_sole, clip.up, clip.scale.height * length)
        return rests, weights, source, copy

    side_by_side = mapper_for(len(clip), len(clip.skeleton))
    rests, weights, sources, copies = map(list, zip(*side_by_side(foot, clip.legs), strict=True))
    if undersides is not None and undersides.feet_on_mesh:
        copies = _on_mesh(clip, undersides, rests, sources, copies)
    asides = _asides(clip, weights, sources, copies)
    places = [
        _places(clip, source, copy, of_foot.max(axis=1), aside)
        for source, copy, of_foot, aside in zip(sources, copies, weights, asides, strict=True)
    ]
    joints = np.array([joint for pair in clip.legs for joint in (pair.target.ankle, pair.target.toe)])
    regions, of_feet = clip.regions.of_joint[joints], np.hstack(places)
    feet = no_supports(len(clip)).with_joints(joints, regions, np.hstack(weights), of_feet)
    return replace(feet, feet=len(joints))


def _asides(clip: Clip, weights: Sequence[Array], sources: Sequence[Foot], copies: Sequence[Foot]) -> Sequence[Array]:
    """The offset along the floor of each foot from the source's place, scaled, (frames, 3) each [target file units]:
    the widening of a person's stance; on other bodies that of the copied ankle.
    """
    if clip.is_person:
        widening = _widening(clip, weights, sources, copies)
        return widening, -widening
    to_path, feet = clip.root - clip.copy.root_positions, zip(sources, copies, strict=True)
    ankles = ((clip.scale.places(foot.toe + foot.bone, clip.up), own.toe + own.bone) for foot, own in feet)
    return [level(own + to_path - scaled, clip.up) for scaled, own in ankles]


def _widening(clip: Clip, weights: Sequence[Array], sources: Sequence[Foot], copies: Sequence[Foot]) -> Array:
    """(frames, 3), the offset along the floor of the left foot from the source's place, scaled, for the width of the
    target's hips [target file units]; the right foot has the opposite offset.

    While both feet rest it is reduced, so that they stay apart by at least `FOOT_WIDTH`, or by their present distance
    if that is less. With the feet apart by r along the unit vector e, and moved apart by d, it is the largest share
    s <= 1 of d with (r + s d) . e >= min(|r|, width). Feet at different heights pass over each other.
    """
    scale, up, width = clip.scale, clip.up, FOOT_WIDTH * clip.leg_lengths[1]
    hips, ankles = (foot.hip for foot in sources), (scale.places(foot.toe + foot.bone, up) for foot in sources)
    r = np.subtract(*ankles)
    d = level(np.subtract(*(foot.hip for foot in copies)) - scale.level * np.subtract(*hips), up)
    apart = lengths(r)
    nearer = np.divide(-(r * d).sum(axis=1), apart, out=np.zeros(len(r)), where=apart > 0.0)
    room = np.maximum(apart - width, 0.0)
    share = np.divide(room, nearer, out=np.ones(len(r)), where=nearer > room)
    both = np.min([each.max(axis=1) for each in weights], axis=0)
    return np.asarray((1.0 - both * (1.0 - share))[:, None] * d / 2.0)


def hips_rise(clip: Clip, feet: Supports, undersides: Undersides | None = None) -> Array:
    """Return how far to raise the hips above the source's height, scaled, because the target's ankles are higher,
    (frames,) [target file units]: by the mean over the resting ankles, smoothed. A foot that stands flat counts more
    than one on its toes, or that is higher than the other. A shot in which no foot rests takes the difference of the
    soles' ankle heights.

    On one leg the pelvis tilts, and the hip joint of that leg is lower in wide hips than in narrow ones; the hips rise
    by that, too. Feet that stand on their mesh are raised by another amount in each rest, so feet that have left the
    floor do not count, and hips change faster between rests.
    """
    if not clip.legs:
        return np.zeros(len(clip))
    places = feet.places[:, ::2]
    higher = _over_source(clip, places, [pair.source.ankle for pair in clip.legs])
    lifts = np.abs([heel_lift(clip.source, pair.source_sole, clip.up) for pair in clip.legs]).T
    lowest = [lowest_heights(clip.source.positions, clip.up, pair.source_sole.joints) for pair in clip.legs]
    rests, soles = feet.weights[:, ::2], np.stack(lowest, axis=1)
    above = np.maximum(soles - np.where(rests > 0.0, soles, np.inf).min(axis=1, keepdims=True), 0.0)
    flat = 1.0 / (1.0 + (lifts + above) / (ROLL * clip.leg_lengths[0]))
    usual = np.mean([pair.target_sole.ankle - clip.scale.height * pair.source_sole.ankle for pair in clip.legs])
    on_mesh = undersides is not None and undersides.feet_on_mesh
    rests, blend = (np.where(rests >= RESTS, rests, 0.0), REST_BLEND) if on_mesh else (rests, ROOT_BLEND)

    def rise(higher: Array, rests: Array, flat: Array) -> Array:
        total, weights = rests.sum(axis=1), rests * flat + LEAST_WEIGHT
        mean = np.where(total > 0.0, (weights * higher).sum(axis=1) / weights.sum(axis=1), usual)
        return smoothed(mean[:, None], total, blend / clip.frame_time)[:, 0]

    return by_shot(rise, clip.shots, higher, rests, flat) + _rise_on_one_leg(clip, feet.weights[:, ::2])


def _rise_on_one_leg(clip: Clip, rests: Array) -> Array:
    """(frames,), how far the hip joints of standing legs are below the source's, scaled [target file units]; 0 while no
    foot rests. `rests`, (frames, legs), are the weights of the feet.
    """
    hips = clip.copy_on_path(np.array([pair.target.hip for pair in clip.legs]))
    higher = _over_source(clip, hips, [pair.source.hip for pair in clip.legs])
    mean = (rests * higher).sum(axis=1) / np.maximum(rests.sum(axis=1), 1.0)
    return -clip.averaged(mean, BLEND)


def feet_within_reach(clip: Clip, supports: Supports) -> Supports:
    """Return the supports with the places of feet within reach of the legs while other parts carry the body as well: a
    place that is too far from the hips' final path moves to the nearest point that the straight leg reaches, by a share
    that grows with how much more the leg is too short than in the median frame of the same rest, up to 1 from `SINK`
    on. Otherwise short legs would pull down a body that stands on its hands, and let it go with a jolt. Legs that are
    too short throughout a rest, as in a push-up, are only stretched. On feet alone, places stay: a leg is too short
    there where wide hips tilt, and the pelvis turns.
    """
    if not clip.legs:
        return supports
    hips, length = clip.copy_on_path(np.array([pair.target.hip for pair in clip.legs])), clip.leg_lengths[1]
    legs = hips - supports.places[:, : supports.feet : 2]
    beyond = np.maximum(lengths(legs) - length, 0.0)
    rests = supports.weights[:, : supports.feet].reshape(len(clip), -1, 2).max(axis=2) > 0.0
    short = np.where(rests & (supports.beside_feet > 0.0)[:, None], beyond, 0.0) / length
    share = clip.widened(smoothstep(by_shot(_over_medians, clip.shots, short, rests) / SINK), BLEND)
    places = supports.places.copy()
    places[:, : supports.feet] += np.repeat((share * beyond)[..., None] * normalised(legs), 2, axis=1)
    return replace(supports, places=places)


def _over_medians(values: Array, rests: Flags) -> Array:
    """Values, (frames, legs), less their median over each rest."""
    over = values.copy()
    for of_leg, resting in zip(over.T, rests.T, strict=True):
        for first, end in spans_of(resting):
            of_leg[first:end] -= np.median(of_leg[first:end])
    return over


def _over_source(clip: Clip, places: Array, joints: Sequence[int]) -> Array:
    """(frames, joints), how much higher places, (frames, joints, 3), are than the scaled joints of the source."""
    return np.asarray((places - clip.scale.places(clip.source.positions[:, joints], clip.up)) @ clip.up)


def heel_lift(motion: Motion, sole: Sole, up: Array) -> Array:
    """(frames,), height of the ankle over the lowest joint of its foot, less that over a flat sole [file units]."""
    heights = heights_of(motion.positions, sole.joints, up)
    return np.asarray(heights[:, 0] - heights.min(axis=1) - sole.ankle)


def _places(clip: Clip, source: Foot, copy: Foot, weights: Array, wider: Array) -> Array:
    """The places of ankle and toe, (frames, 2, 3) [target file units]; `weights`, (frames,), are 1 at rest, and
    `wider`, (frames, 3), is one of `_asides`.
    """
    scale, up, reach = clip.scale, clip.up, round(SPEED_SPAN / clip.frame_time)
    paths = np.stack([source.toe, source.toe + source.bone], axis=1) / clip.leg_lengths[0]

    def offset(longer: Array, wider: Array, weights: Array, paths: Array) -> Array:
        mean = _steadied_offset(longer + wider, weights, level(paths, up), reach)
        return mean + _about_ankle(paths, clip.frame_time, reach) * (longer - averaged(longer, reach))

    longer = level(scale.height * source.bone - copy.bone, up)
    toe = scale.places(source.toe, up) + by_shot(offset, clip.shots, longer, wider, weights, paths)
    toe += (copy.below - scale.height * source.below)[:, None] * up
    return np.stack([toe + copy.bone, toe], axis=1)


def _about_ankle(paths: Array, frame_time: float, reach: int) -> Array:
    """(frames, 1), 1 where a foot turns about its ankle, 0 where about its toe: the share of the toe in the sum of
    their mean squared speeds. `paths`, (frames, 2, 3), are those of toe and ankle [leg lengths].
    """
    steps = np.diff(paths, axis=0, append=2.0 * paths[-1:] - paths[-2:][:1]) / frame_time  # the last step is repeated
    toe, ankle = averaged((steps**2).sum(axis=2), reach).T
    return np.asarray(toe / (toe + ankle + REST_SPEED**2))[:, None]


def _on_mesh(
    clip: Clip, undersides: Undersides, rests: Sequence[Array], sources: Sequence[Foot], copies: Sequence[Foot]
) -> list[Foot]:
    """The feet of the rotation copy with `below` such that `_places` brings the lowest point of their mesh to the level
    of the source's sole. The change is averaged over `SPEED_SPAN`, as a sole may have edges.

    `rests`, (frames, 2) each, is how much ankle and toe of the source rest; `sources` and `copies` are feet by joints.
    """
    scale, up, feet = clip.scale.height, clip.up, []
    for height, pair, source, copy in zip(sole_levels(clip, rests).T, clip.legs, sources, copies, strict=True):
        own = lowest_of_foot(clip.copy, pair.target.ankle, pair.target_sole, up, undersides) + undersides.soles[1]
        rise = scale * (height - source.toe @ up) + copy.toe @ up - own
        feet.append(replace(copy, below=scale * source.below + clip.averaged(rise, SPEED_SPAN)))
    return feet


def lowest_of_foot(motion: Motion, ankle: int, sole: Sole, up: Array, undersides: Undersides) -> Array:
    """(frames,), the height of the lowest point of a foot of the target [file units]. A foot without a heel, which
    stands on its toes, counts as having one below the ankle, level with the sole: otherwise hips and ankle would drop
    at each step as the toes lift.
    """
    lowest = undersides.target.lowest_of_foot(motion, ankle, up)
    if undersides.target.has_heel(ankle, sole):
        return lowest
    upwards = Rotation.from_quat(motion.world_rotations_of(ankle)).apply(sole.normal) @ up
    heel = motion.positions[:, ankle] @ up - np.maximum(upwards, 0.0) * (sole.ankle + undersides.soles[1])
    return np.minimum(lowest, heel)


def sole_levels(clip: Clip, rests: Sequence[Array]) -> Array:
    """(frames, legs), heights of the source's soles without their drift [source file units]; `rests` as `_on_mesh`."""
    heights, steady_heights, length = [], [], clip.leg_lengths[0]
    steady = partial(_steadied_offset, reach=round(SPEED_SPAN / clip.frame_time))
    for pair, resting in zip(clip.legs, rests, strict=True):
        heights.append(sole_height(clip.source, pair.source_sole, clip.up))
        paths = clip.source.positions[:, [pair.source.ankle, pair.source.toe]] / length
        found = by_shot(steady, clip.shots, heights[-1][:, None], resting.max(axis=1), paths)
        steady_heights.append(found[:, 0])
    rest = np.stack([each.max(axis=1) == 1.0 for each in rests], axis=1)
    on_floor = partial(_on_floor, length=length)
    return by_shot(on_floor, clip.shots, np.stack(heights, axis=1), np.stack(steady_heights, axis=1), rest)


def _on_floor(heights: Array, steady_heights: Array, rests: Flags, length: float) -> Array:
    """(frames, legs), the corrected heights of soles in one shot, from their heights, the steadied heights, and a mask
    of rests, (frames, legs) each; `length` is the leg length.
    """
    if not rests.any():
        return heights
    rises = level_on_floor(steady_heights, floor_height(heights, rests), rests, length) - heights
    levels = heights.copy()
    for leg, resting in enumerate(rests.T):
        frames = np.flatnonzero(resting)
        if len(frames):
            levels[:, leg] += np.interp(np.arange(len(levels)), frames, rises[frames, leg])
    return levels


def _steadied_offset(offset: Array, weights: Array, paths: Array, reach: int) -> Array:
    """An offset, (frames, n), as `time_series.steadied`: the stiffness between two frames is (`PATH_SPAN` / step)^2,
    with the lesser step of ankle and toe on their `paths`, (frames, 2, 3) [leg lengths], averaged over `reach` frames.
    """
    paths = averaged(median_of_three(paths), reach)  # the median ignores a single faulty frame
    steps = lengths(np.diff(paths, axis=0, append=paths[-1:])).min(axis=1)
    return smoothed_steps(median_of_three(offset), weights + LEAST_WEIGHT, (PATH_SPAN / np.maximum(steps, STILL)) ** 2)
