"""Retarget real clips to skeletons of four conventions, each in T-pose and A-pose, and in LAFAN1's own rest pose.

    python benchmarks/rigs.py CORPUS [--only GLOB] [--sheet FILE.png]

CORPUS is a folder with the real clips; the script names and skips those that it lacks. Prints a line per run:
verdict, clip, target, then differences between source and result: direction from hips to head (upright), height of the
lowest joint of the feet (floor, % of leg length), direction in which the body faces (facing), direction error and
contact error; then seconds. The exit status is 1 if a run failed. `--sheet` draws a frame of every run; it needs
matplotlib (the extra `docs`).
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from angles import angles
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget import Motion, RetargetResult, Skeleton, read_bvh, retarget
from distretarget.body.axes import axis_vector, nearest_axis
from distretarget.body.legs import Leg, Legs, leg_length, tree_legs
from distretarget.measure.figures import clip_figures
from distretarget.measure.metrics import Reference

sys.path.append(str(Path(__file__).resolve().parents[1] / "tools"))
from make_rigs import CONVENTIONS, POSES, rig

Array = NDArray[np.float64]

CLIPS = (
    "animated_drawings/dab.bvh",
    "animated_drawings/jesse_dance.bvh",
    "bvhio/example.bvh",
    "cmu_daz/05_03.bvh",
    "cmu_mb/05_03.bvh",
    "makehuman/tpose.bvh",
    "makehuman/walk1.bvh",
    "makehuman_old/12_03.bvh",
    "pybvh/bvh_test2.bvh",
    "pybvh/bvh_test3.bvh",
    "synthetic_odd/odd_plain.bvh",
)
TARGETS = {
    **{f"{convention}_{pose.lower()}": rig(convention, pose) for convention in CONVENTIONS for pose in POSES},
    "lafan1_x": rig("lafan1", "X"),
}
# Joints that only help to animate a body and are not drawn: IK targets, twist joints, ends of ends.
HELPERS = re.compile(r"^ik_|_twist_|_End_End$")
# Names of joints on the left side.
LEFT = re.compile(r"[Ll]eft|^[lL](?=[A-Z])|[_.][lL]$")
# A run fails if a figure is above its limit.
LIMITS = {"upright": 15.0, "floor": 8.0, "facing": 15.0, "direction": 25.0}
UNITS = {"upright": "°", "floor": "%", "facing": "°", "direction": "°"}


class CheckError(Exception):
    """Says why a result cannot be measured."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """A clip retargeted to a target, and the verdict.

    Attributes:
        line: to print.
        result: None if retargeting raised an exception.
        failed: whether an exception was raised, or a figure is above its limit.
    """

    clip: str
    target: str
    line: str
    result: RetargetResult | None
    failed: bool


def run(clip: str, source: Motion, name: str, target: Skeleton) -> Run:
    """Retarget a clip and measure the result."""
    started = time.perf_counter()
    result, figures = None, dict[str, float]()
    try:
        result = retarget(source, target)
        figures = measure(result)
        faults = [f"{key} above {limit:g}{UNITS[key]}" for key, limit in LIMITS.items() if not figures[key] <= limit]
    except Exception as error:
        faults = [f"{type(error).__name__}: {str(error).strip() or '-'}".splitlines()[0]]
    seconds = time.perf_counter() - started
    parts = [
        f"{'FAILED' if faults else 'OK':<6}",
        f"{clip:<34}{name:<9}",
        *columns(figures),
        f"{seconds:5.1f} s",
        *faults,
    ]
    return Run(clip=clip, target=name, line="  ".join(parts), result=result, failed=bool(faults))


def columns(figures: dict[str, float]) -> list[str]:
    """The figures as they stand in the line of a run; empty if nothing was measured."""
    if not figures:
        return []
    return [*(f"{key} {figures[key]:5.1f}{unit}" for key, unit in UNITS.items()), f"contact {figures['contact']:.3f}"]


def measure(result: RetargetResult) -> dict[str, float]:
    """The figures of a result.

    Raises:
        CheckError: a leg or the head has no driver, or the source does not stand upright in the target's axes.
    """
    motion, source = result.motion, result.source
    driving, legs = paired_legs(result)
    up = target_up(result)
    check_upright(source, driving, up)
    values = clip_figures(Reference(source, result.matching, up).compare(motion).tracks)
    head = head_of(motion.skeleton)
    if result.drivers[head] < 0:
        raise CheckError("the head has no driver")
    source_trunk, target_trunk = trunk(source, driving, int(result.drivers[head])), trunk(motion, legs, head)
    return {
        "upright": float(angles(source_trunk, target_trunk).mean()),
        "floor": floor_error(result, legs, driving, up),
        "facing": float(angles(facing(motion, legs, up), facing(source, driving, up)).mean()),
        "direction": values["direction_error"] or 0.0,
        "contact": values["contact_error"] or 0.0,
    }


def paired_legs(result: RetargetResult) -> tuple[Legs, Legs]:
    """The legs of the source that drive those of the target, and the target's legs; each left before right, by name. A
    toe without a driver is replaced by its ankle.
    """
    target, drivers = result.motion.skeleton, result.drivers
    if (target_legs := tree_legs(target)) is None:
        raise CheckError("the target has no legs")
    a, b = (replace(leg, toe=leg.toe if drivers[leg.toe] >= 0 else leg.ankle) for leg in target_legs)
    c, d = (Leg(*(int(drivers[joint]) for joint in leg.joints)) for leg in (a, b))
    if min(c.hip, c.ankle, d.hip, d.ankle) < 0:
        raise CheckError("a leg has no driver")
    return left_first(result.source.skeleton, (c, d)), left_first(target, (a, b))


def left_first(skeleton: Skeleton, legs: Legs) -> Legs:
    """The legs left before right, by the names of their ankles; unchanged if the names have no side."""
    return legs[::-1] if LEFT.search(skeleton.names[legs[1].ankle]) else legs


def target_up(result: RetargetResult) -> Array:
    """(3,), the axis that points up by the target's file, whatever the run assumed."""
    return axis_vector(result.motion.skeleton.up or "Y")


def up_of_legs(motion: Motion, legs: Legs) -> Array:
    """(3,), the axis nearest to the direction from ankles to hips."""
    hips, ankles = (motion.positions[:, joints] for joints in zip(*((leg.hip, leg.ankle) for leg in legs), strict=True))
    return axis_vector(nearest_axis((hips - ankles).mean(axis=(0, 1)))[0])


def check_upright(source: Motion, legs: Legs, up: Array) -> None:
    """Raise `CheckError` unless the source stands upright in the target's axes."""
    if not np.array_equal(legs_up := up_of_legs(source, legs), up):
        raise CheckError(f"the source's legs point up along {legs_up} in the target's axes, where {up} is up")


def head_of(skeleton: Skeleton) -> int:
    """The first joint with "head" in its name."""
    return next(joint for joint, name in enumerate(skeleton.names) if "head" in name.lower())


def trunk(motion: Motion, legs: Legs, head: int) -> Array:
    """(frames, 3), the vector from the middle of the hip joints to the head."""
    return np.asarray(motion.positions[:, head] - motion.positions[:, [leg.hip for leg in legs]].mean(axis=1))


def floor_error(result: RetargetResult, legs: Legs, driving: Legs, up: Array) -> float:
    """How far the height of the lowest foot joint is from the source's, times the root scale; mean over the frames
    [% of leg length].
    """
    actual, expected = lowest(result.motion, legs, up), result.root_scale * lowest(result.source, driving, up)
    return float(100 * np.abs(actual - expected).mean() / leg_length(result.motion.skeleton, legs))


def lowest(motion: Motion, legs: Legs, up: Array) -> Array:
    """(frames,), the height of the lowest ankle or toe."""
    feet = [joint for leg in legs for joint in (leg.ankle, leg.toe)]
    return np.asarray((motion.positions[:, feet] @ up).min(axis=1))


def facing(motion: Motion, legs: Legs, up: Array) -> Array:
    """(frames, 3), the horizontal direction in which the hips face, square to the line between the hip joints."""
    left, right = legs
    return np.asarray(np.cross(motion.positions[:, left.hip] - motion.positions[:, right.hip], up))


def draw_sheet(path: Path, sources: dict[str, Motion], runs: list[Run]) -> None:
    """Draw a frame of every clip: a row per clip with the source and then all targets, seen from the same side."""
    from draw import VIEWS, Camera, Cell, cells, write_picture

    no_body = Skeleton(
        names=("none",), parents=np.array([-1]), offsets=np.zeros((1, 3)), channels=((),), end_sites=np.array([False])
    )
    empty = Cell(no_body, np.zeros((1, 3)), np.zeros(3), 1.0)
    scenes, titles, labels = [], [], []
    for clip, source in sources.items():
        frame, clip_runs = articulated(source), [run for run in runs if run.clip == clip]
        scene = cells(figure(source, source_turn(source, frame)), [frame], "Y", None)
        for result in (run.result for run in clip_runs):
            turned = result and figure(result.motion, result_turn(result, frame))
            scene += cells(turned, [frame], "Y", None) if turned else [empty]
        scenes.append(scene)
        titles.append(f"{clip}, frame {frame}")
        labels.append(["source", *(f"{run.target} FAILED" if run.failed else run.target for run in clip_runs)])
    write_picture(scenes, titles, labels, path, camera=Camera(*VIEWS["three-quarter"]), dpi=75)


def articulated(motion: Motion) -> int:
    """The frame whose posture differs most from the mean; not in the first tenth, which may show a rest pose."""
    axes = Rotation.from_quat(motion.world_rotations[:, 0]).as_matrix()
    postures = (motion.positions - motion.positions[:, :1]) @ axes
    first = len(motion) // 10
    return first + int(np.argmax(np.linalg.norm(postures - postures.mean(axis=0), axis=(1, 2))[first:]))


def source_turn(source: Motion, frame: int) -> Rotation:
    """The rotation after which a source has Y up and faces +Z in a frame."""
    skeleton = source.rigid_skeleton
    legs = tree_legs(skeleton)
    if legs is None:
        return Rotation.identity()
    return standing(source, left_first(skeleton, legs), up_of_legs(source, legs), frame)


def result_turn(result: RetargetResult, frame: int) -> Rotation:
    """The same rotation for a result, found from its source, which is in the target's axes."""
    try:
        legs = paired_legs(result)[0]
    except CheckError:
        legs = None
    return standing(result.source, legs, target_up(result), frame)


def standing(motion: Motion, legs: Legs | None, up: Array, frame: int) -> Rotation:
    """The rotation that turns `up` to +Y and, if there are legs, the direction the hips face in a frame to +Z."""
    ahead = facing(motion, legs, up)[frame] if legs else np.roll(up, 1)
    ahead = ahead / np.linalg.norm(ahead)
    return Rotation.from_matrix(np.stack([np.cross(up, ahead), up, ahead]))


def figure(motion: Motion, turn: Rotation) -> Motion:
    """The motion turned, with only the joints to draw, their names such that the drawing tells left from right."""
    skeleton = motion.skeleton
    shown = body_joints(skeleton)
    number = {joint: k for k, joint in enumerate(shown)}
    parents = np.array([number.get(int(skeleton.parents[joint]), -1) for joint in shown])
    points = motion.positions[:, shown] @ turn.as_matrix().T
    translations = points - np.where(parents[:, None] >= 0, points[:, parents], 0.0)
    body = Skeleton(
        names=tuple(re.sub(r"^([lrLR])(?=[A-Z])", r"\1_", skeleton.names[joint]) for joint in shown),
        parents=parents,
        offsets=translations[0],
        channels=((),) * len(shown),
        end_sites=~np.isin(np.arange(len(shown)), parents),
    )
    return Motion.of_translations(
        body, translations, np.tile([0.0, 0, 0, 1], (*points.shape[:2], 1)), motion.frame_time_text
    )


def body_joints(skeleton: Skeleton) -> list[int]:
    """The joints to draw, parents first: from the first joint with several children down, without `HELPERS`."""
    drawn = [not HELPERS.search(name) for name in skeleton.names]
    children = [[child for child in below if drawn[child]] for below in skeleton.children]
    joints = [next(joint for joint, below in enumerate(children) if len(below) > 1)]
    for joint in joints:
        joints.extend(children[joint])
    return sorted(joints)


def main() -> int:
    """Print a line for every run, then the counts; return 1 if a run failed or there is none."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path, metavar="CORPUS")
    parser.add_argument("--only", default="*", metavar="GLOB", help="only clips whose paths match")
    parser.add_argument("--sheet", type=Path, metavar="FILE.png", help="draw a frame of every run")
    arguments = parser.parse_args()
    sources, runs = dict[str, Motion](), list[Run]()
    for clip in CLIPS:
        if not fnmatch(clip, arguments.only):
            continue
        if not (arguments.corpus / clip).is_file():
            print("skipped, not in the corpus:", clip)
            continue
        sources[clip] = read_bvh(arguments.corpus / clip)
        for name, target in TARGETS.items():
            runs.append(run(clip, sources[clip], name, target))
            print(runs[-1].line, flush=True)
    failed = sum(run.failed for run in runs)
    print(f"{len(runs) - failed} OK + {failed} FAILED = {len(runs)} runs")
    if arguments.sheet:
        draw_sheet(arguments.sheet, sources, runs)
    return 1 if failed or not runs else 0


if __name__ == "__main__":
    sys.exit(main())
