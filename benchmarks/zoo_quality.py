"""Measure the quality of results over the zoo of bodies, with the samples and real clips.

    python benchmarks/zoo_quality.py CORPUS [DUETS] [--members GLOB] [--clips GLOB] [--frames N] [--runs]
                                     [--markdown FILE]

CORPUS is a folder with the real clips named in `clips.CLIPS`, DUETS one with further clips; the script names and skips
those that are missing. Each clip is retargeted to a third of the members, and from each member to two others. Prints
every metric of result, rotation copy and source, mean / largest over the runs, with the worst run; then what
must not occur, such as runs that are worse than the rotation copy. `--runs` lists the runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatch
from functools import partial
from itertools import product
from pathlib import Path

import click
import numpy as np
from clips import CLIPS, SAMPLE_CLIPS, corpus_argument, found, markdown_option
from runs import Run, clip_name, in_processes, pairs, plan, retargeted, run_of
from tables import mean_and_largest, publish, table
from zoo import MEMBERS

from distretarget import DistretargetError, RetargetResult, read_bvh, retarget
from distretarget.measure.metrics import METRICS, Metric, Variant

SIDES: tuple[Variant, ...] = ("result", "rotation_copy", "source")
FEW_JOINTS = 40  # bodies with more joints have fingers or many helpers
NAMED = 1  # of the runs that a row counts, at most this many are named
SHOWN = {  # the metrics of the table; eye.py has those that are found from gravity, and counts pops
    *("contact_error", "contact_gap", "direction_error", "direction_error_p99", "foot_skate", "foot_height"),
    *("foot_pitch", "ankle_height", "hips_height", "hips_height_largest", "jerk", "turn", "bone_error"),
}
OWN_BODY = 0.1  # a clip on its own body may be off by this [% of the body's height]
# A run is worse than the rotation copy if the result is farther from the source by more than this [unit of the metric].
WORSE = {"foot_skate": 0.01, "contact_error": 0.002, "foot_height": 0.1}

Row = tuple[str, ...]
"""A line of a table: what was measured, its values, and the worst runs."""


def own_body(frames: int, clip: Path, member: str) -> tuple[float, str] | None:
    """Retarget a clip, or the motion of a member after it, to its own body; return the largest error [% of the body's
    height] and the name; None if it is refused.
    """
    try:
        motion = retargeted(frames, clip, "", member).motion if member else read_bvh(clip)[:frames]
        return _deviation(retarget(motion, motion)), f"{clip_name(clip)}{f' of {member}' if member else ''}"
    except DistretargetError:
        return None


def _deviation(result: RetargetResult) -> float:
    """How far a joint of the body is from the source's at most [% of the body's height]."""
    body = result.matching.target
    joints = body.regions.of_joint >= 0
    away = np.linalg.norm(result.motion.positions - result.source.positions, axis=-1)[:, joints]
    return float(100 * away.max() / body.height)


# ---- tables


def metric_rows(runs: Sequence[Run]) -> Iterator[Row]:
    """Metrics, mean / largest of result, copy and source."""
    for metric in METRICS:
        if metric.key in SHOWN:
            unit = f" [{metric.unit}]" if metric.unit else ""
            spread = (mean_and_largest([run.metric(metric.key, side) for run in runs], ".3g") for side in SIDES)
            yield metric.label + unit, *spread


def fault_rows(runs: Sequence[Run], own: Sequence[tuple[float, str]]) -> Iterator[Row]:
    """Faults, which should not occur or should stay small, with the worst runs."""
    yield _count("runs with pops", runs, lambda run: run.metric("pop"))
    frames = sum(run.not_converged for run in runs)
    yield _count(f"runs with frames that did not converge ({frames} frames)", runs, lambda run: run.not_converged)
    for metric in METRICS:
        if metric.key in WORSE:
            limit = f"{WORSE[metric.key]:g} {metric.unit}".rstrip()
            yield _count(f"runs worse than the copy by {limit}: {metric.label}", runs, partial(_excess, metric))
    yield _spread("jerk / copy's", runs, lambda run: run.metric("jerk") / run.metric("jerk", "rotation_copy"))
    for name, many in ((f"up to {FEW_JOINTS} joints", False), (f"over {FEW_JOINTS} joints", True)):
        if some := [run for run in runs if (run.joints > FEW_JOINTS) == many]:
            yield _spread(f"iterations per frame, {name}", some, lambda run: run.iterations / run.frames)
    largest, name = max(own)
    off = sum(deviation > OWN_BODY for deviation, _ in own)
    what = f"clips on their own bodies that are off by more than {OWN_BODY} % of the height; largest [%]"
    yield what, f"{off} of {len(own)}; {largest:.4f}", name


def _excess(metric: Metric, run: Run) -> float:
    """How far a run exceeds the limit for being worse than the rotation copy."""
    result, copy, source = (run.metric(metric.key, side) for side in SIDES)
    if metric.judged == "value":
        return result - copy - WORSE[metric.key]
    if metric.judged == "ratio":
        return result - source - max(copy - source, 0.0) - WORSE[metric.key]
    return abs(result - source) - abs(copy - source) - WORSE[metric.key]


def _count(name: str, runs: Sequence[Run], excess: Callable[[Run], float]) -> Row:
    """The number of runs with an excess over 0, and the worst of them."""
    over = sorted(((value, run.name) for run in runs if (value := excess(run)) > 0), reverse=True)
    return name, f"{len(over)} of {len(runs)}", "; ".join(named for _, named in over[:NAMED])


def _spread(name: str, runs: Sequence[Run], value: Callable[[Run], float]) -> Row:
    """Mean / largest over runs, and the runs with the largest values."""
    values = np.array([value(run) for run in runs])
    worst = np.argsort(-np.nan_to_num(values, nan=-np.inf))[:NAMED]
    return name, mean_and_largest(values, ".3g"), "; ".join(runs[number].name for number in worst)


def run_rows(runs: Sequence[Run]) -> Iterator[Row]:
    """A line for each run, with the metrics of the result."""
    for run in runs:
        effort = str(run.frames), str(run.not_converged), f"{run.iterations / run.frames:.1f}"
        yield run.name, *effort, *(f"{run.metric(metric.key):.3g}" for metric in METRICS)


@click.command(help=__doc__)
@corpus_argument
@click.argument("duets", type=Path, required=False)
@markdown_option
@click.option("--members", "pattern", default="*", help="Only members whose names match.")
@click.option("--clips", "clip_pattern", default="*", help="Only clips whose names match.")
@click.option("--frames", default=300, show_default=True, help="Of each clip.")
@click.option("--runs", "listed", is_flag=True, help="Print a line for each run, too.")
def main(
    corpus: Path, duets: Path | None, page: Path | None, pattern: str, clip_pattern: str, frames: int, listed: bool
) -> None:
    """Measure, print, and write the tables if a page is given."""
    clips = list(found([*SAMPLE_CLIPS, *CLIPS, "pybvh/bvh_test3.bvh"], corpus, clip_pattern).values())
    clips += [clip for clip in sorted(duets.glob("*.bvh")) if fnmatch(clip.name, clip_pattern)] if duets else []
    members = [name for name in MEMBERS if fnmatch(name, pattern)]
    every = [*clips, *sorted(corpus.rglob("*.bvh"))]
    first = {member: (clip, member) for clip, _, member in reversed(list(plan(every, members)))}
    runs = in_processes(partial(run_of, frames), [*plan(clips, members), *pairs(clips, members)])
    alone = [*product(every, [""]), *first.values()]
    own = [*filter(None, in_processes(partial(own_body, frames), alone))]
    tables = {
        "metrics": table(["metric, mean / largest", "result", "copy", "source"], metric_rows(runs)),
        "faults": table(["over all runs", "value", "worst"], fault_rows(runs, own)),
    }
    if listed:
        columns = ("run", "frames", "unconverged", "iterations", *(metric.label for metric in METRICS))
        tables["runs"] = table(columns, run_rows(runs))
    print(f"{len(runs)} runs of {len(clips)} clips on {len(members)} members\n")
    publish(tables, page)


if __name__ == "__main__":
    main()
