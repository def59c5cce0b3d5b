"""Retarget real clips to skeletons of four conventions, each in T-pose and A-pose, and in LAFAN1's own rest pose.

    python benchmarks/rigs.py CORPUS [--only GLOB] [--sheet FILE.png]

CORPUS is a folder with the real clips; the script names and skips those that it lacks. Prints a line per run:
verdict, clip, target, then differences between source and result: direction from hips to head (upright), height of the
lowest joint of the feet (floor, % of leg length), direction in which the body faces (facing), direction error and
contact error; then seconds. The exit status is 1 if a run failed. `--sheet` draws a frame of every run; it needs
matplotlib (the extra `docs`).
"""

from __future__ import annotations

import re
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
from clips import corpus_argument, found
from numpy.typing import NDArray
from sample_rigs import CONVENTIONS, POSES, rig
from scipy.spatial.transform import Rotation

from distretarget import Body, Motion, RetargetResult, Skeleton, read_bvh, retarget
from distretarget.body.axes import axis_vector, nearest_axis
from distretarget.body.legs import Leg, Legs, leg_length, tree_legs
from distretarget.measure.figures import clip_figures
from distretarget.measure.metrics import Reference
from distretarget.numerics.vectors import angles_between

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
LEFT = re.compile(r"[Ll]eft|^[lL](?=[A-Z])|[_.][lL]$")  # in names of joints on the left side
# A run fails if a figure is above its limit.
LIMITS = {"upright": (15.0, "°"), "floor": (8.0, "%"), "facing": (15.0, "°"), "direction": (25.0, "°")}


class CheckError(Exception):
    """Says why a result cannot be measured."""


@dataclass(frozen=True)
class Run:
    """A clip retargeted to a target: the line to print, the result, None if retargeting raised an exception, and
    whether it failed by an exception or a figure above its limit.
    """

    target: str
    line: str
    result: RetargetResult | None
    failed: bool


def run(clip: str, source: Motion, name: str, target: Skeleton) -> Run:
    """Retarget a clip and measure the result."""
    started = time.perf_counter()
    result, columns = None, []
    try:
        result = retarget(source, target)
        figures = measure(result)
        columns = [f"{key} {figures[key]:5.1f}{unit}" for key, (_, unit) in LIMITS.items()]
        columns.append(f"contact {figures['contact']:.3f}")
        faults = [f"{key} above {most:g}{unit}" for key, (most, unit) in LIMITS.items() if not figures[key] <= most]
    except Exception as error:
        faults = [f"{type(error).__name__}: {str(error).strip() or '-'}".splitlines()[0]]
    verdict, seconds = "FAILED" if faults else "OK", time.perf_counter() - started
    line = "  ".join([f"{verdict:<6}", f"{clip:<34}{name:<9}", *columns, f"{seconds:5.1f} s", *faults])
    return Run(name, line, result, bool(faults))


def measure(result: RetargetResult) -> dict[str, float]:
    """The figures of a result. Takes the axis that points up by the target's file, whatever the run assumed.

    Raises:
        CheckError: a leg or the head has no driver, or the source does not stand upright in the target's axes.
    """
    motion, source = result.motion, result.source
    driving, legs = paired_legs(result)
    up = axis_vector(motion.skeleton.up or "Y")
    if not np.array_equal(legs_up := up_of_legs(source, driving), up):
        raise CheckError(f"the source's legs point up along {legs_up} in the target's axes, where {up} is up")
    values = clip_figures(Reference(source, result.matching, up).compare(motion).tracks)
    head = next(joint for joint, name in enumerate(motion.skeleton.names) if "head" in name.lower())
    if result.drivers[head] < 0:
        raise CheckError("the head has no driver")
    trunks = trunk(source, driving, int(result.drivers[head])), trunk(motion, legs, head)
    floor = np.abs(lowest(motion, legs, up) - result.root_scale * lowest(source, driving, up)).mean()
    return {
        "upright": float(np.degrees(angles_between(*trunks)).mean()),
        "floor": float(100 * floor / leg_length(motion.skeleton, legs)),
        "facing": float(np.degrees(angles_between(facing(motion, legs, up), facing(source, driving, up))).mean()),
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


def up_of_legs(motion: Motion, legs: Legs) -> Array:
    """(3,), the axis nearest to the direction from ankles to hips."""
    hips, ankles = (motion.positions[:, joints] for joints in zip(*((leg.hip, leg.ankle) for leg in legs), strict=True))
    return axis_vector(nearest_axis((hips - ankles).mean(axis=(0, 1)))[0])


def trunk(motion: Motion, legs: Legs, head: int) -> Array:
    """(frames, 3), the vector from the middle of the hip joints to the head."""
    return np.asarray(motion.positions[:, head] - motion.positions[:, [leg.hip for leg in legs]].mean(axis=1))


def lowest(motion: Motion, legs: Legs, up: Array) -> Array:
    """(frames,), the height of the lowest ankle or toe."""
    feet = [joint for leg in legs for joint in (leg.ankle, leg.toe)]
    return np.asarray((motion.positions[:, feet] @ up).min(axis=1))


def facing(motion: Motion, legs: Legs, up: Array) -> Array:
    """(frames, 3), the horizontal direction in which the hips face, square to the line between the hip joints."""
    left, right = legs
    return np.asarray(np.cross(motion.positions[:, left.hip] - motion.positions[:, right.hip], up))


def draw_sheet(path: Path, sources: dict[str, Motion], runs: dict[str, list[Run]]) -> None:
    """Draw a frame of every clip: a row per clip with the source and then all targets, seen from the same side."""
    import draw

    def cells(motion: Motion, body: Body, turn: Rotation, frame: int) -> list[draw.Cell]:
        return draw.body_cells(motion, body, [frame], turn=turn, size=body.unit)  # in any rest pose

    scenes, titles, labels = [], [], []
    for clip, source in sources.items():
        frame, body = draw.articulated(source), Body.of_motion(source)
        scene = cells(source, body, draw.facing(source, body, frame), frame)
        for result in (run.result for run in runs[clip]):
            if result is None:
                scene.append(replace(scene[0], points=0 * scene[0].points, size=0.0))
                continue
            turn = draw.facing(result.source, result.matching.source, frame)
            scene += cells(result.motion, result.matching.target, turn, frame)
        scenes.append(scene)
        titles.append(f"{clip}, frame {frame}")
        labels.append(["source", *(f"{run.target} FAILED" if run.failed else run.target for run in runs[clip])])
    draw.write_picture(path, scenes, titles, labels, draw.VIEWS["three-quarter"], dpi=75)


@click.command(help=__doc__)
@corpus_argument
@click.option("--only", default="*", help="Only clips whose paths match.")
@click.option("--sheet", type=Path, help="Draw a frame of every run into this picture.")
def main(corpus: Path, only: str, sheet: Path | None) -> None:
    """Print a line for every run, then the counts; exit with 1 if a run failed or there is none."""
    sources = {clip: read_bvh(path) for clip, path in found(CLIPS, corpus, only).items()}
    runs: dict[str, list[Run]] = {clip: [] for clip in sources}
    for clip, source in sources.items():
        for name, target in TARGETS.items():
            runs[clip].append(run(clip, source, name, target))
            print(runs[clip][-1].line, flush=True)
    failed = sum(run.failed for of_clip in runs.values() for run in of_clip)
    count = len(sources) * len(TARGETS)
    print(f"{count - failed} OK + {failed} FAILED = {count} runs")
    if sheet:
        draw_sheet(sheet, sources, runs)
    sys.exit(1 if failed or not count else 0)


if __name__ == "__main__":
    main()
