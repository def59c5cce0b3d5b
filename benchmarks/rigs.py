"""Retarget real clips to the sample rigs: four conventions in T-pose and A-pose, and LAFAN1's own rest pose.

    python benchmarks/rigs.py CORPUS [--only GLOB] [--sheet FILE.png]

CORPUS is a folder with the real clips; the script names and skips those that it lacks. Prints a line per run:
verdict, clip, target, then differences between source and result: direction from hips to head (upright), height of the
lowest joint of the feet (floor, % of leg length), direction in which the body faces (facing), direction error and
contact error; then seconds. The exit status is 1 if a run failed. `--sheet` draws a frame of every run; it needs
matplotlib (the extra `docs`).
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
from clips import corpus_argument, found
from numpy.typing import NDArray
from sample_rigs import CONVENTIONS, POSES, rig
from scipy.spatial.transform import Rotation

from distretarget import Body, Motion, RetargetResult, read_bvh, retarget
from distretarget.body.axes import Directions, axis_vector, nearest_axis
from distretarget.measure.comparison import Reference
from distretarget.measure.metrics import clip_metrics
from distretarget.numerics.vectors import angles_between, level

Array = NDArray[np.float64]
Runs = dict[str, tuple[RetargetResult | None, bool]]  # by target

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
# A run fails if a metric is above its limit.
LIMITS = {"upright": (15.0, "°"), "floor": (8.0, "%"), "facing": (15.0, "°"), "direction": (25.0, "°")}


def run(clip: str, source: Motion, name: str) -> tuple[RetargetResult | None, bool]:
    """Retarget a clip to a target, measure the result and print the line. Return the result, None after an exception,
    and whether the run failed: by an exception, or by a metric above its limit.
    """
    started = time.perf_counter()
    result, columns = None, []
    try:
        result = retarget(source, TARGETS[name])
        metrics = measure(result)
        columns = [f"{key} {metrics[key]:5.1f}{unit}" for key, (_, unit) in LIMITS.items()]
        columns.append(f"contact {metrics['contact']:.3f}")
        faults = [f"{key} above {most:g}{unit}" for key, (most, unit) in LIMITS.items() if not metrics[key] <= most]
    except Exception as error:
        faults = [f"{type(error).__name__}: {str(error).strip() or '-'}".splitlines()[0]]
    verdict, seconds = "FAILED" if faults else "OK", time.perf_counter() - started
    line = [f"{verdict:<6}", f"{clip:<34}{name:<9}", *columns, f"{seconds:5.1f} s", *faults]
    print("  ".join(line), flush=True)
    return result, bool(faults)


def measure(result: RetargetResult) -> dict[str, float]:
    """The metrics of a result. Takes the axis that points up from the target's file, whatever the run assumed."""
    sides = (result.source, result.matching.source), (result.motion, result.matching.target)
    source, target = (Directions(body.anatomy, motion.positions) for motion, body in sides)
    up = axis_vector(result.motion.skeleton.up or "Y")
    standing = nearest_axis(-source.legs.mean(axis=0))[0]
    if not np.array_equal(axis_vector(standing), up):
        raise ValueError(f"the source's legs point up along {standing} in the target's axes")
    upright = angles_between(*(each.bone("hips", "head") for each in (source, target)))
    facing = angles_between(*(level(each.across("UpperLeg"), up) for each in (source, target)))
    low, floor = (lowest(motion, body, up) for motion, body in sides)
    values = clip_metrics(Reference(result.source, result.matching, up).compare(result.motion).tracks)
    return {
        "upright": float(np.degrees(upright).mean()),
        "floor": float(100 * np.abs(floor - result.root_scale * low).mean() / result.matching.target.leg_length),
        "facing": float(np.degrees(facing).mean()),
        "direction": values["direction_error"] or 0.0,
        "contact": values["contact_error"] or 0.0,
    }


def lowest(motion: Motion, body: Body, up: Array) -> Array:
    """(frames,), the height of the lowest ankle or toe."""
    feet = [joint for leg in body.legs or () for joint in (leg.ankle, leg.toe)]
    return np.asarray((motion.positions[:, feet] @ up).min(axis=1))


def draw_sheet(path: Path, sources: dict[str, Motion], runs: dict[str, Runs]) -> None:
    """Draw a frame of every clip: a row per clip with the source and then all targets, seen from the same side."""
    import draw

    def cells(motion: Motion, body: Body, turn: Rotation, frame: int) -> list[draw.Cell]:
        return draw.body_cells(motion, body, [frame], turn=turn, size=body.unit)  # in any rest pose

    scenes, titles, labels = [], [], []
    for clip, source in sources.items():
        frame, body = draw.articulated(source), Body.of_motion(source)
        scene = cells(source, body, draw.facing(source, body, frame), frame)
        for result, _ in runs[clip].values():
            if result is None:
                scene.append(replace(scene[0], points=0 * scene[0].points, size=0.0))
                continue
            turn = draw.facing(result.source, result.matching.source, frame)
            scene += cells(result.motion, result.matching.target, turn, frame)
        scenes.append(scene)
        titles.append(f"{clip}, frame {frame}")
        labels.append(["source", *(f"{name} FAILED" if failed else name for name, (_, failed) in runs[clip].items())])
    draw.write_picture(path, scenes, titles, labels, draw.VIEWS["three-quarter"], dpi=75)


@click.command(help=__doc__)
@corpus_argument
@click.option("--only", default="*", help="Only clips whose paths match.")
@click.option("--sheet", type=Path, help="Draw a frame of every run into this picture.")
def main(corpus: Path, only: str, sheet: Path | None) -> None:
    """Print a line for every run, then the counts; exit with 1 if a run failed or there is none."""
    sources = {clip: read_bvh(path) for clip, path in found(CLIPS, corpus, only).items()}
    runs = {clip: {name: run(clip, source, name) for name in TARGETS} for clip, source in sources.items()}
    failed = sum(failed for of_clip in runs.values() for _, failed in of_clip.values())
    count = len(sources) * len(TARGETS)
    print(f"{count - failed} OK + {failed} FAILED = {count} runs")
    if sheet:
        draw_sheet(sheet, sources, runs)
    sys.exit(1 if failed or not count else 0)


if __name__ == "__main__":
    main()
