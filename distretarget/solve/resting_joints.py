"""Joints other than the feet's that rest on the world, and where they belong on the target."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label, median_filter

from distretarget.body.resting import low_joints, slow_joints, still_joints
from distretarget.matching.matching import Matching
from distretarget.numerics.shots import Shots, by_shot
from distretarget.numerics.smoothing import over_runs, widened
from distretarget.solve.poses import PoseProblem
from distretarget.solve.settings import ContactSettings
from distretarget.solve.supports import RESTS, Supports

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

Scene = Literal["body", "scaled"]
TRUNK = ("trunk", "hips")  # the regions that limbs branch off


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
        rests: (frames, joints), whether each rests.
        places: (frames, joints, 3), where each belongs [target file units].
    """

    joints: NDArray[np.intp]
    regions: NDArray[np.intp]
    rests: Flags
    places: Array


def find_resting_joints(
    feet: Supports,
    matching: Matching,
    problem: PoseProblem,
    scale: float,
    shots: Shots,
    scene: Scene,
    settings: ContactSettings,
) -> RestingJoints | None:
    """Return the joints other than those of `feet` that rest on the floor or on something that stands still, if any.

    A joint rests on the floor while it is slow, and about as low as the lowest joint of the body. There it is as high
    as the source's, times `scale`. A joint that stands still while its limb moves, such as a hand on a rail, rests
    too, as high as in the rotation copy on average. In the plane a joint keeps, over each time it rests, the place of
    the source's, times `scale`, plus the mean of what the copy is off that: so it does not slide, and nothing draws
    the body to where its proportions cannot follow. In a `scene` that is "scaled", a joint that rests on something else
    than the floor has the place of the source's, times `scale`.

    The copy keeps to the path of the root in `problem`; `shots`, (frames,), are those of the clip.
    """
    if matching.legs is None:
        return None
    source, up, length = matching.source_motion, matching.source.up_vector, matching.leg_lengths[0]
    joints = _candidates(matching)
    on_floor = slow_joints(source, joints.sources, settings.rest_speed * length, shots)
    on_floor &= low_joints(source, joints.sources, up, settings.rest_height * length)
    still = still_joints(source, joints.sources, joints.bases, length, shots)
    rests = on_floor | still & ~_stand_on_others(joints, on_floor | still, feet, matching)
    rests = median_filter(rests, (3, 1), mode="nearest")  # a single frame unlike both its neighbours is a fault
    on = np.flatnonzero(rests.any(axis=0))
    if not len(on):
        return None
    joints, on_floor, rests = joints[on], on_floor[:, on], rests[:, on]
    places = scale * source.positions[:, joints.sources]
    off = problem.copy_on_path[:, joints.targets] - places
    offsets = partial(_offsets, up=up, scene=scene)
    for column in range(len(on)):
        places[:, column] += by_shot(offsets, shots, off[:, column], rests[:, column], on_floor[:, column])
    return RestingJoints(joints=joints.targets, regions=joints.regions, rests=rests, places=places)


def with_resting_joints(
    feet: Supports, resting: RestingJoints, problem: PoseProblem, shots: Shots, settings: ContactSettings
) -> Supports:
    """Return the feet at rest, and other joints, each of which goes to its place over a time that grows with how far
    that is from the copy, whose root keeps to its path in `problem`.
    """
    blend = partial(_blended, frame_time=problem.frame_time, settings=settings)
    far = np.linalg.norm(resting.places - problem.copy_on_path[:, resting.joints], axis=-1) / (0.5 * problem.unit)
    weights = [by_shot(blend, shots, *columns) for columns in zip(resting.rests.T, far.T, strict=True)]
    return feet.with_others(resting.joints, resting.regions, np.stack(weights, axis=1), resting.places)


def _candidates(matching: Matching) -> _Candidates:
    regions, skeleton, drivers = matching.regions, matching.target.skeleton, matching.drivers
    of_joint = regions.of_joint
    trunk = [number for number, name in enumerate(regions.names) if name in TRUNK]
    targets = joints_but_feet(matching)
    bases = []
    for joint in targets:
        line = [each for each in skeleton.line(int(joint)) if of_joint[each] in trunk and drivers[each] >= 0]
        bases.append(drivers[line[0] if line else joint])
    return _Candidates(targets, drivers[targets], np.array(bases, np.intp), of_joint[targets])


def joints_but_feet(matching: Matching) -> NDArray[np.intp]:
    """Return the target's joints that are part of its body and have drivers, but for those of its feet."""
    of_joint = matching.regions.of_joint
    feet = [of_joint[leg.ankle] for leg in (matching.legs or ((), ()))[1]]
    return np.flatnonzero((matching.drivers >= 0) & (of_joint >= 0) & ~np.isin(of_joint, feet))


def _stand_on_others(joints: _Candidates, rests: Flags, feet: Supports, matching: Matching) -> Flags:
    """(frames, joints), whether another region of the same limb rests farther out: a knee over a foot keeps its place
    without a touch.
    """
    skeleton, of_joint = matching.target.skeleton, matching.regions.of_joint
    resting = np.zeros((len(rests), len(skeleton)), bool)
    resting[:, joints.targets] = rests
    resting[:, feet.joints] = feet.weights > RESTS
    columns = []
    for joint in joints.targets.tolist():
        below = [each for each in skeleton.subtree(joint) if of_joint[each] not in (-1, of_joint[joint])]
        columns.append(resting[:, below].any(axis=1))
    return np.stack(columns, axis=1)


def _offsets(off: Array, rests: Flags, on_floor: Flags, up: Array, scene: Scene) -> Array:
    """(frames, 3), the mean of `off`, (frames, 3), over each run of frames in which the joint rests. It has no height
    in a run in which the joint rests on the floor, and is zero in the others if the scene is scaled.
    """
    runs = label(rests)[0]
    with_floor = np.isin(runs, np.unique(runs[on_floor]))[:, None]
    level = off - (off @ up)[:, None] * up
    return over_runs(np.where(with_floor, level, off if scene == "body" else 0.0), rests.astype(np.float64))


def _blended(rests: Flags, far: Array, frame_time: float, settings: ContactSettings) -> Array:
    """(frames,), 1 while a joint rests, blended to 0 over a time that grows with how far its place is, `far`, (frames,)
    [leg lengths].
    """
    runs, count = label(rests)
    free = np.ones(len(rests))
    for run in range(1, count + 1):
        on = runs == run
        time = np.clip(far[on].mean() / settings.approach_speed, settings.support_blend, settings.longest_blend)
        free *= 1.0 - widened(on.astype(np.float64)[:, None], time / frame_time)[:, 0]
    return 1.0 - free
