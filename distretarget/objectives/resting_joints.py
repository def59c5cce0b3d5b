"""Joints other than the feet's that rest on the world, their places, and where the root belongs meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.anatomy import TRUNK_REGIONS
from distretarget.body.resting import above_lowest, joint_speeds, still_joints
from distretarget.ik.poses import PoseProblem
from distretarget.matching.matching import Matching
from distretarget.numerics.kinematics import heights_of
from distretarget.numerics.time_series import Shots, by_shot, median_of_three, over_runs, runs_of, widened
from distretarget.numerics.vectors import lengths, level
from distretarget.objectives.settings import ContactSettings
from distretarget.objectives.supports import RESTS, Supports

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

Environment = Literal["body", "scaled"]
LITTLE = 1e-6  # weight of frames that hardly count
INSIDE = 0.25  # a joint inside flesh that rests on the floor is no higher than this [leg lengths]
HEAD = "head"


@dataclass(frozen=True, eq=False)
class _Candidates:
    """The joints that may rest: all of the body but the feet.

    Attributes:
        targets, sources: (joints,), joints of the target and their drivers.
        bases: (joints,), the source joint where the limb of each begins; the joint itself in the trunk.
        regions: (joints,), the region of the target that each belongs to.
    """

    targets: NDArray[np.intp]
    sources: NDArray[np.intp]
    bases: NDArray[np.intp]
    regions: NDArray[np.intp]

    def __getitem__(self, on: NDArray[np.intp]) -> _Candidates:
        return _Candidates(self.targets[on], self.sources[on], self.bases[on], self.regions[on])


@dataclass(frozen=True, eq=False, kw_only=True)
class RestingJoints:
    """Joints other than the feet's that rest on the world.

    Attributes:
        joints: (joints,), of the target.
        regions: (joints,), the region of the body that each belongs to.
        in_trunk: (joints,), whether each is a joint of the trunk.
        rests: (frames, joints), whether each rests.
        places: (frames, joints, 3), where each belongs [target file units].
    """

    joints: NDArray[np.intp]
    regions: NDArray[np.intp]
    in_trunk: Flags
    rests: Flags
    places: Array


def find_resting_joints(
    feet: Supports,
    matching: Matching,
    problem: PoseProblem,
    scale: RootScale,
    shots: Shots,
    environment: Environment,
    settings: ContactSettings,
) -> RestingJoints | None:
    """Return the joints other than those of `feet` that rest on the floor or on something that stands still, if any.

    A joint rests on the floor while it is slow, and about as low as the lowest joint of the body; a joint of trunk or
    head also somewhat higher, if the body lies or sits on it. There it is as high as the source's, scaled. A joint that
    stands still while its limb moves, such as a hand on a rail, rests too, as high as in the rotation copy on average.
    In the plane a joint keeps, over each time it rests, the place of the source's, scaled, plus the mean of what the
    copy is off that: so it does not slide, and nothing draws the body to where its proportions cannot follow. Where a
    region farther out in its limb rests as well, as the foot does in a kneel, the joint is as far from that as in the
    copy. In an `environment` that is "scaled", a joint that rests on something else than the floor has the place of the
    source's, scaled.

    The copy keeps to the path of the root in `problem`; `shots`, (frames,), are those of the clip.
    """
    if matching.legs is None:
        return None
    source, up, length = matching.source_motion, matching.source.up_vector, matching.leg_lengths[0]
    joints = _candidates(matching)
    height = above_lowest(source, joints.sources, up)
    low = (height < settings.rest_height * length) | _lie_on_flesh(matching, joints, height < INSIDE * length, up)
    speeds = joint_speeds(source, joints.sources, shots)
    on_floor = (speeds < settings.rest_speed * length) & low
    still = still_joints(source, joints.sources, joints.bases, speeds, length, shots)
    if still.any():
        still &= ~_stand_on_others(joints, on_floor | still, feet, matching)
    rests = on_floor | still
    rests = median_of_three(rests)  # a single frame unlike both its neighbours is a fault
    on = np.flatnonzero(rests.any(axis=0))
    if not len(on):
        return None
    joints, on_floor, rests = joints[on], on_floor[:, on], rests[:, on]
    places = scale.places(source.positions[:, joints.sources], up)
    shifts = feet.places - problem.copy_on_path(feet.joints)
    held = {int(j): (feet.weights[:, k] >= RESTS, shifts[:, k]) for k, j in enumerate(feet.joints)}
    copied = problem.copy_on_path(joints.targets)
    for column in np.argsort(-joints.targets):  # from the ends of limbs inwards
        joint = int(joints.targets[column])
        carried, shift = _carried([held[each] for each in _farther_out(matching, joint) if each in held], len(source))
        off = copied[:, column] + shift - places[:, column]
        columns = off, rests[:, column], on_floor[:, column], carried
        places[:, column] += by_shot(partial(_offsets, up=up, environment=environment), shots, *columns)
        held[joint] = rests[:, column], places[:, column] - copied[:, column]
    names = np.array(matching.regions.names)[joints.regions]
    return RestingJoints(
        joints=joints.targets,
        regions=joints.regions,
        in_trunk=np.isin(names, TRUNK_REGIONS),
        rests=rests,
        places=places,
    )


def with_resting_joints(
    feet: Supports, resting: RestingJoints, problem: PoseProblem, shots: Shots, settings: ContactSettings
) -> Supports:
    """Return the feet at rest, and other joints, each of which goes to its place over a time that grows with how far
    that is from the copy, whose root keeps to its path in `problem`.
    """
    blend = partial(_blended, frame_time=problem.frame_time, settings=settings)
    far = lengths(resting.places - problem.copy_on_path(resting.joints)) / (0.5 * problem.unit)
    weights = [by_shot(blend, shots, *columns) for columns in zip(resting.rests.T, far.T, strict=True)]
    return feet.with_others(resting.joints, resting.regions, np.stack(weights, axis=1), resting.places)


def _candidates(matching: Matching) -> _Candidates:
    regions, skeleton, drivers = matching.regions, matching.target.skeleton, matching.drivers
    of_joint = regions.of_joint
    trunk = [number for number, name in enumerate(regions.names) if name in TRUNK_REGIONS]
    targets = matching.joints_but_feet
    bases = []
    for joint in targets:
        line = [each for each in skeleton.line(int(joint)) if of_joint[each] in trunk and drivers[each] >= 0]
        bases.append(drivers[line[0] if line else joint])
    return _Candidates(targets, drivers[targets], np.array(bases, np.intp), of_joint[targets])


def _lie_on_flesh(matching: Matching, joints: _Candidates, near_floor: Flags, up: Array) -> Flags:
    """(frames, joints), whether the body lies or sits on each: it is near the floor, inside flesh, in trunk or head,
    and lower than its neighbours in the tree.
    """
    skeleton, positions = matching.source.skeleton, matching.source_motion.positions
    flesh = np.isin(np.array(matching.regions.names)[joints.regions], (*TRUNK_REGIONS, HEAD))
    lies = np.zeros_like(near_floor)
    for column in np.flatnonzero(flesh & near_floor.any(axis=0)):
        joint = int(joints.sources[column])
        around = [skeleton.parents[joint], *skeleton.children[joint]] if joint else skeleton.children[joint]
        around = [each for each in around if skeleton.path_lengths[joint, each] > 0]
        if around:
            high = heights_of(positions, [joint, *around], up)
            lies[:, column] = near_floor[:, column] & (high[:, :1] <= high[:, 1:]).all(axis=1)
    return lies


def _stand_on_others(joints: _Candidates, rests: Flags, feet: Supports, matching: Matching) -> Flags:
    """(frames, joints), whether another region of the same limb rests farther out: a knee over a foot keeps its place
    without a touch.
    """
    resting = np.zeros((len(rests), len(matching.target.skeleton)), bool)
    resting[:, joints.targets] = rests
    resting[:, feet.joints] = feet.weights >= RESTS
    columns = [resting[:, _farther_out(matching, joint)].any(axis=1) for joint in joints.targets.tolist()]
    return np.stack(columns, axis=1)


def _farther_out(matching: Matching, joint: int) -> list[int]:
    """The joints of other regions farther out in the same limb; none for a joint of the trunk."""
    names, of_joint = matching.regions.names, matching.regions.of_joint
    if names[of_joint[joint]] in TRUNK_REGIONS:
        return []
    return [each for each in matching.target.skeleton.subtree(joint) if of_joint[each] not in (-1, of_joint[joint])]


def _carried(held: list[tuple[Flags, Array]], frames: int) -> tuple[Flags, Array]:
    """Whether any of some joints rests, (frames,), and how far those that do are on average from their places to those
    of the copy, (frames, 3); each is given by whether it rests, (frames,), and how far it is, (frames, 3).
    """
    count, total = np.zeros(frames), np.zeros((frames, 3))
    for rests, shift in held:
        count += rests
        total += rests[:, None] * shift
    return count > 0, total / np.maximum(count, 1.0)[:, None]


def _offsets(off: Array, rests: Flags, on_floor: Flags, carried: Flags, up: Array, environment: Environment) -> Array:
    """(frames, 3), the mean of `off`, (frames, 3), over each run of frames in which the joint rests; only over those in
    which it is `carried` by others, (frames,), if there are any. It has no height in a run in which the joint rests on
    the floor, and is zero in the others if the scene is scaled.
    """
    runs = runs_of(rests)
    with_floor = np.isin(runs, np.unique(runs[on_floor]))[:, None]
    off = np.where(with_floor, level(off, up), off if environment == "body" else 0.0)
    counts = carried | ~np.isin(runs, np.unique(runs[carried & rests]))
    return over_runs(off, np.where(rests, np.maximum(counts, LITTLE), 0.0))


def _blended(rests: Flags, far: Array, frame_time: float, settings: ContactSettings) -> Array:
    """(frames,), 1 while a joint rests, blended to 0 over a time that grows with how far its place is, `far`, (frames,)
    [leg lengths].
    """
    runs = runs_of(rests)
    free = np.ones(len(rests))
    for run in range(1, runs.max() + 1):
        on = runs == run
        time = np.clip(far[on].mean() / settings.approach_speed, settings.support_blend, settings.longest_blend)
        free *= 1.0 - widened(on.astype(np.float64)[:, None], time / frame_time)[:, 0]
    return 1.0 - free


SEAT = 10.0  # weight of a region of the trunk that rests, which turns of the joints do not bring to its place
BLEND = 0.2  # the root takes about twice this time from one shift to the next [s]
UNKNOWN = 1e-3  # weight of the nearest known shift in frames in which nothing rests; a region that rests has 1
FEWEST = 5  # frames that a smoothing spline needs


def root_shift(problem: PoseProblem, feet: Supports, resting: RestingJoints, shots: Shots) -> Array:
    """Return how far the root belongs from its path, (frames, 3) [target file units].

    The path is that of the source's hips, times the ratio of leg lengths, which suits a body on its feet. On its hands
    a body moves as arms and trunk are long. So the root is displaced by what the regions of the body that rest are off
    their places in the copy, on average; feet at rest count as in place. A smoothing spline leads from one to the next.
    """
    off = resting.places - problem.copy_on_path(resting.joints)
    sums, count = np.zeros((len(problem), 3)), np.zeros(len(problem))
    for region in np.unique(resting.regions):
        on = resting.rests & (resting.regions == region)
        weight = SEAT if resting.in_trunk[resting.regions == region].all() else 1.0
        sums += weight * (on[..., None] * off).sum(axis=1) / np.maximum(on.sum(axis=1), 1)[:, None]
        count += weight * on.any(axis=1)
    for leg in range(0, feet.feet, 2):
        count += (feet.weights[:, leg : leg + 2] >= RESTS).any(axis=1)
    smooth = partial(_smooth, frame_time=problem.frame_time)
    return by_shot(smooth, shots, sums / np.maximum(count, 1.0)[:, None], count)


def _smooth(values: Array, weights: Array, frame_time: float) -> Array:
    """(frames, 3), a smooth curve through the values, (frames, 3), by their weights, (frames,)."""
    known = np.flatnonzero(weights)
    if not len(known) or not values[known].any():
        return np.zeros_like(values)
    frames = np.arange(len(values))
    filled = np.stack([np.interp(frames, known, column[known]) for column in values.T], axis=1)
    if len(frames) < FEWEST:
        return filled
    # Imported here: scipy.interpolate is slow to import, and most clips rest on nothing but feet.
    from scipy.interpolate import make_smoothing_spline

    stiffness = (BLEND / frame_time) ** 4  # of a spline that bends over `BLEND` where the weights are 1
    return np.asarray(make_smoothing_spline(frames, filled, np.maximum(weights, UNKNOWN), stiffness)(frames))
