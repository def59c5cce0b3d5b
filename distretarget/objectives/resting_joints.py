"""Hands, knees, hips and other joints that rest on the world: when, where, and how the root moves for them.

A joint rests on the floor while it is slow and about as low as the body's lowest joint; a joint of trunk or head may be
somewhat higher if the body lies or sits on it. It then has the source's height, scaled. Where the skin is known, the
joint is raised until its skin is on the floor, or lowered until its skin is no higher than the source's, so that thick
knees do not sink in and thin ones do not hover. A joint that stands still while its limb moves, such as a hand on a
rail, rests too, at its mean height in the rotation copy.

Along the floor, a joint keeps the source's path, scaled, during each rest, shifted by the mean difference to the
rotation copy: it does not slide, and is not pulled to a place that the body's proportions do not allow. If a region
farther out in the limb rests too, such as the foot in a kneel, the joint keeps its offset from that region as in the
copy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import takewhile
from typing import Literal

import numpy as np

from distretarget.body.anatomy import TRUNK_REGIONS, WITHOUT_SIDE
from distretarget.body.axes import perpendicular
from distretarget.body.resting import REST_HEIGHT, REST_SPEED, joint_speeds, still_joints
from distretarget.body.soles import points_down
from distretarget.matching.undersides import Undersides
from distretarget.numerics.joint_paths import heights_of
from distretarget.numerics.time_series import by_shot, median_of_three, run_means, runs_of, smoothed, spans_of, widened
from distretarget.numerics.vectors import Array, Flags, Numbers, angles_between, lengths, level, normalised
from distretarget.objectives.clip import Clip
from distretarget.objectives.supports import BLEND, RESTS, ROOT_BLEND, Supports

Environment = Literal["body", "scaled"]

LEAST_WEIGHT = 1e-6  # of frames in a mean, where others count
LOW_FOOT = 0.05  # a foot on the floor is no higher than this above the lowest joint of the body [leg lengths]
INSIDE = 0.25  # a joint of trunk or head that the body lies on is no higher than this [leg lengths]
APPROACH_SPEED = 0.5  # a joint moves from the rotation copy to a distant place at about this speed [leg lengths/s] ...
LONGEST_BLEND = 0.6  # ... but takes no longer than twice this time [s]

LEANS = np.radians(20.0)  # a seated trunk leans by up to this towards the place of a resting hand [rad] ...
SHORT = 0.1  # ... less if the hand is still too far off then, and not at all if by this or more [leg lengths]
SEAT = 10.0  # weight of a resting region of the trunk in the shift of the root, which alone can move it to its place


@dataclass(frozen=True, eq=False, kw_only=True)
class RestingJoints:
    """Joints other than the feet's that rest on the world."""

    joints: Numbers  # (joints,), of the target
    rests: Flags  # (frames, joints), whether each rests
    places: Array  # (frames, joints, 3), the place of each while it rests [target file units]


def find_resting_joints(
    clip: Clip, feet: Supports, environment: Environment, undersides: Undersides | None = None
) -> RestingJoints | None:
    """Return the joints other than those of `feet` that rest on the floor or on something that stands still, if any. In
    the environment "scaled", a joint that rests on anything but the floor has the source's place, scaled.
    """
    if not clip.legs:
        return None
    source, length, targets = clip.source, clip.leg_lengths[0], clip.limb_joints
    sources = clip.drivers[targets]
    height = heights_of(source.positions, sources, clip.up) - clip.source_floor[:, None]
    low = (height < REST_HEIGHT * length) | _lie_on_flesh(clip, height < INSIDE * length)
    speeds = joint_speeds(source, sources, clip.shots)
    on_floor = (speeds < REST_SPEED * length) & low
    still = still_joints(source, sources, _limb_bases(clip), speeds, length, clip.shots)
    if still.any():
        still &= ~_carried_by_others(clip, on_floor | still, feet)
    rests = median_of_three(on_floor | still)  # ignores a single faulty frame
    on = np.flatnonzero(rests.any(axis=0))
    if not len(on):
        return None
    targets, on_floor, rests = targets[on], on_floor[:, on], rests[:, on]
    rises = None if undersides is None else _rises(clip, feet, undersides, targets, on_floor, rests)
    places = _resting_places(clip, feet, targets, on_floor, rests, environment, rises)
    return RestingJoints(joints=targets, rests=rests, places=places)


def with_resting_joints(clip: Clip, feet: Supports, resting: RestingJoints) -> Supports:
    """Return the supports of feet and other resting joints. A joint blends to its place over a time that grows with its
    distance from there in the rotation copy on the root's path.
    """
    blend = partial(_blended, frame_time=clip.frame_time)
    far = lengths(resting.places - clip.copy_on_path(resting.joints)) / clip.leg
    weights = [by_shot(blend, clip.shots, *columns) for columns in zip(resting.rests.T, far.T, strict=True)]
    regions = clip.regions.of_joint[resting.joints]
    return feet.with_joints(resting.joints, regions, np.stack(weights, axis=1), resting.places)


def root_shift(clip: Clip, feet: Supports, resting: RestingJoints) -> Array:
    """Return the displacement of the root from its path, (frames, 3) [target file units].

    The path is that of the source's hips times the ratio of leg lengths, which suits a body on its feet; a body on its
    hands moves in proportion to its arms and trunk. So the root is displaced by the mean offset of the resting regions
    from the rotation copy, smoothed; resting feet count with an offset of zero.
    """
    off = resting.places - clip.copy_on_path(resting.joints)
    sums, count, regions = np.zeros((len(clip), 3)), np.zeros(len(clip)), clip.regions.of_joint[resting.joints]
    for region in np.unique(regions):
        on = resting.rests & (regions == region)
        weight = SEAT if clip.regions.names[region] in TRUNK_REGIONS else 1.0
        sums += weight * (on[..., None] * off).sum(axis=1) / np.maximum(on.sum(axis=1), 1)[:, None]
        count += weight * on.any(axis=1)
    for leg in range(0, feet.feet, 2):
        count += (feet.weights[:, leg : leg + 2] >= RESTS).any(axis=1)
    smooth = partial(smoothed, frames=ROOT_BLEND / clip.frame_time)
    return by_shot(smooth, clip.shots, sums / np.maximum(count, 1.0)[:, None], count)


def within_reach(clip: Clip, supports: Supports) -> Supports:
    """Return the supports with the places of the hands of a body that sits or lies moved within reach of its arms,
    while its trunk leans by up to `LEANS`: a body whose arms are too short for the floor sits upright. A body that does
    not sit goes down to its hands, and its supports do not change.
    """
    if len(supports.joints) == supports.feet:
        return supports
    in_trunk = clip.regions.inside(*TRUNK_REGIONS)
    seat = supports.weights[:, in_trunk[supports.joints]].max(axis=1, initial=0.0)
    places, short = supports.places.copy(), SHORT * clip.leg
    for column in range(supports.feet, len(supports.joints) if seat.any() else 0):
        joint = int(supports.joints[column])
        *_, top = joint, *takewhile(lambda each: not in_trunk[each], clip.skeleton.to_root(joint))
        if top == joint:
            continue
        pelvis, shoulder = clip.copy_on_path(np.array([clip.pelvis, top])).transpose(1, 0, 2)
        trunk, goal, reach = shoulder - pelvis, places[:, column] - pelvis, clip.skeleton.paths_from(top)[joint]
        lean = np.minimum(angles_between(trunk, goal), LEANS)
        missing = np.maximum(lengths(goal - _turned(trunk, goal, lean)) - reach, 0.0)
        arm = goal - _turned(trunk, goal, lean * np.maximum(1.0 - missing / short, 0.0))
        beyond = np.maximum(lengths(arm) - reach, 0.0)[:, None] * normalised(arm)
        for first, end in spans_of(supports.weights[:, column] > 0.0):
            places[first:end, column] -= seat[first:end].max() * beyond[first:end]
    return replace(supports, places=places)


def _turned(vectors: Array, goals: Array, angles: Array) -> Array:
    """Vectors, (frames, 3), rotated towards `goals`, (frames, 3), by angles, (frames,)."""
    aside = lengths(vectors)[:, None] * normalised(perpendicular(goals, normalised(vectors)))
    return np.asarray(np.cos(angles)[:, None] * vectors + np.sin(angles)[:, None] * aside)


def _limb_bases(clip: Clip) -> Numbers:
    """(joints,), for each of `clip.limb_joints` the source joint where its limb begins; in the trunk its own driver."""
    trunk = clip.regions.inside(*TRUNK_REGIONS) & (clip.drivers >= 0)
    joints = clip.limb_joints.tolist()
    bases = [next((each for each in clip.skeleton.to_root(joint) if trunk[each]), joint) for joint in joints]
    return clip.drivers[bases]


def _lie_on_flesh(clip: Clip, near_floor: Flags) -> Flags:
    """(frames, joints), whether the body lies or sits on each joint: the joint belongs to trunk or head, is near the
    floor, and is lower than its neighbours in the tree.
    """
    skeleton, sources = clip.source_skeleton, clip.drivers[clip.limb_joints]
    lies, inside = np.zeros_like(near_floor), clip.regions.inside(*WITHOUT_SIDE)[clip.limb_joints]
    for column in np.flatnonzero(inside & near_floor.any(axis=0)):
        joint = int(sources[column])
        around = [skeleton.parents[joint], *skeleton.children[joint]] if joint else skeleton.children[joint]
        around = [each for each in around if skeleton.paths_from(joint)[each] > 0]
        if around:
            high = heights_of(clip.source.positions, [joint, *around], clip.up)
            lies[:, column] = near_floor[:, column] & (high[:, :1] <= high[:, 1:]).all(axis=1)
    return lies


def _carried_by_others(clip: Clip, rests: Flags, feet: Supports) -> Flags:
    """(frames, joints), whether another region farther out in the limb rests, as the foot below a still knee."""
    resting = np.zeros((len(rests), len(clip.skeleton)), bool)
    resting[:, clip.limb_joints] = rests
    resting[:, feet.joints] = feet.weights >= RESTS
    columns = [resting[:, _farther_out(clip, joint)].any(axis=1) for joint in clip.limb_joints.tolist()]
    return np.stack(columns, axis=1)


def _farther_out(clip: Clip, joint: int) -> list[int]:
    """The joints of other regions farther out in the same limb; none for a joint of the trunk."""
    of_joint = clip.regions.of_joint
    if clip.regions.names[of_joint[joint]] in TRUNK_REGIONS:
        return []
    return [each for each in clip.skeleton.subtree(joint) if of_joint[each] not in (-1, of_joint[joint])]


def _resting_places(
    clip: Clip,
    feet: Supports,
    targets: Numbers,
    on_floor: Flags,
    rests: Flags,
    environment: Environment,
    rises: Array | None,
) -> Array:
    """(frames, joints, 3), the places of resting joints [target file units], raised by `rises`, (frames, joints)."""
    places = clip.scale.places(clip.source.positions[:, clip.drivers[targets]], clip.up)
    if rises is not None:
        places += rises[..., None] * clip.up
    resting = np.zeros((len(clip), len(clip.skeleton)), bool)
    shifts = np.zeros((*resting.shape, 3))  # from the rotation copy
    resting[:, feet.joints] = feet.weights >= RESTS
    shifts[:, feet.joints] = feet.places - clip.copy_on_path(feet.joints)
    copied = clip.copy_on_path(targets)
    offsets = partial(_offsets, up=clip.up, environment=environment)
    for column in np.argsort(-targets):  # from the ends of limbs inwards
        joint = int(targets[column])
        out = _farther_out(clip, joint)
        count = resting[:, out].sum(axis=1)
        shift = (resting[:, out, None] * shifts[:, out]).sum(axis=1) / np.maximum(count, 1)[:, None]
        off = copied[:, column] + shift - places[:, column]
        places[:, column] += by_shot(offsets, clip.shots, off, rests[:, column], on_floor[:, column], count > 0)
        resting[:, joint], shifts[:, joint] = rests[:, column], places[:, column] - copied[:, column]
    return places


def _rises(
    clip: Clip, feet: Supports, undersides: Undersides, targets: Numbers, on_floor: Flags, rests: Flags
) -> Array:
    """(frames, joints), how much higher than the source's, scaled, joints rest on the floor [target file units], so
    that their skin, on average over a rest, is not in the floor, nor higher over it than the source's.
    """
    scale, up, sources = clip.scale.height, clip.up, clip.drivers[targets]
    sole, own_sole = undersides.soles
    heights = heights_of(clip.source.positions, sources, up)
    below = undersides.source.below(clip.source, sources, up)
    floor = _skin_floor(clip, feet, sole, heights - below, rests)
    gaps = np.maximum(scale * (heights - below - floor), 0.0)
    own_floor = scale * (floor + sole) - own_sole
    own_gaps = scale * heights - undersides.target.below(clip.copy, targets, up) - own_floor
    rises = np.zeros_like(gaps)
    for column in range(len(targets)):
        counts = rests[:, column].astype(float)
        runs = runs_of(rests[:, column])
        on = np.isin(runs, runs[on_floor[:, column]])
        means = by_shot(run_means, clip.shots, np.stack([gaps[:, column], own_gaps[:, column], on], axis=1), counts)
        gap, own_gap, on = means.T
        rises[:, column] = on * (np.clip(own_gap, 0.0, gap) - own_gap)
    return rises


def _skin_floor(clip: Clip, feet: Supports, sole: float, skin: Array, rests: Flags) -> Array:
    """(frames, 1), the height of the floor below the source's skin [source file units]: that of resting feet less the
    thickness of the `sole`; in a shot without these, that of the lowest resting `skin`, (frames, joints). Feet that are
    still in the air, as on a rung or above an elbow that carries the body, are not on the floor.
    """
    soles = [heights_of(clip.source.positions, pair.source_sole.joints, clip.up).min(axis=1) for pair in clip.legs]
    heights, stands = np.stack(soles, axis=1), feet.weights.reshape(len(clip), -1, 2).max(axis=2) >= RESTS
    stands &= heights - clip.source_floor[:, None] < LOW_FOOT * clip.leg_lengths[0]
    stands &= np.stack([points_down(clip.source, pair.source_sole, clip.up) for pair in clip.legs], axis=1)
    low = np.where(stands, heights - sole, np.inf).min(axis=1)

    def of_shot(low: Array, skin: Array, rests: Flags) -> Array:
        stands = np.isfinite(low)
        if stands.any():
            return run_means(np.where(stands, low, 0.0)[:, None], stands.astype(float))
        lowest = np.where(rests, skin, np.inf).min(axis=1)
        found = lowest[np.isfinite(lowest)]
        return np.full((len(low), 1), np.median(found) if len(found) else 0.0)

    return by_shot(of_shot, clip.shots, low, skin, rests)


def _offsets(off: Array, rests: Flags, on_floor: Flags, carried: Flags, up: Array, environment: Environment) -> Array:
    """(frames, 3), the mean of offsets, `off`, (frames, 3), over each rest of a joint; if there are frames in which the
    joint is `carried` by others, over these. The mean is level in a rest on the floor; in other rests it is zero if the
    environment is scaled.
    """
    runs = runs_of(rests)
    with_floor = np.isin(runs, runs[on_floor])[:, None]
    off = np.where(with_floor, level(off, up), off if environment == "body" else 0.0)
    counts = carried | ~np.isin(runs, runs[carried & rests])
    return run_means(off, np.where(rests, np.maximum(counts, LEAST_WEIGHT), 0.0))


def _blended(rests: Flags, far: Array, frame_time: float) -> Array:
    """(frames,), 1 while a joint rests, blended to 0 over a time that grows with its offset `far` [leg lengths]."""
    free = np.ones(len(rests))
    for first, end in spans_of(rests):
        frames = np.clip(far[first:end].mean() / APPROACH_SPEED, BLEND, LONGEST_BLEND) / frame_time
        around = 2 * round(frames) + 1  # frames that `widened` reaches beyond the rest
        near = slice(max(first - around, 0), end + around)
        rest = np.zeros((len(free[near]), 1))
        rest[first - near.start : end - near.start] = 1.0
        free[near] *= 1.0 - widened(rest, frames)[:, 0]
    return 1.0 - free
