"""Measure the quality of results on clips' own bodies with some bones scaled, and on the bodies of the zoo.

    python benchmarks/quality.py CORPUS [DUETS] [--clips GLOB] [--frames N] [--markdown FILE]

CORPUS is a folder with the real clips named in `clips.CLIPS`, DUETS one with further clips; the script names and skips
missing ones. Each clip is retargeted to the bodies of `clips.py` by both objectives, and to a third of the members of
the zoo by the default one; and each member is the source for two others. The tables have every metric, mean / largest
over the runs; and faults that must not occur, such as runs that are worse than the rotation copy. The samples with
supports are retargeted to two of the scaled bodies, with a line each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import partial
from itertools import product
from pathlib import Path

import click
import numpy as np
from clips import CLIPS, SAMPLE_CLIPS, SAMPLES, TARGETS, corpus_argument, edited, found, markdown_option
from runs import clip_name, in_processes
from tables import mean_and_largest, publish, several, table
from zoo import MEMBERS, member, on_member

from distretarget import DistretargetError, Options, RetargetResult, read_bvh, retarget
from distretarget.measure.metrics import METRICS, Metric, Variant
from distretarget.pipeline.options import OBJECTIVES

SIDES: tuple[Variant, ...] = ("result", "rotation_copy", "source")
SHARE = 3  # each clip is retargeted to one in three members, the next clip to the members after these
APART = (7, 16)  # a member is the source for the members at these distances after it in the table
FEW_JOINTS = 40  # bodies with more joints have fingers or many helpers
HIDDEN = {"stress"}  # of the paper's objective: docs/paper.md has them
DECIMALS = 6  # of metrics; further digits are rounding errors
SUPPORTED = ("child", "H")  # the bodies of the samples with supports
OWN_BODY = 0.1  # tolerance of joint positions of a clip on its own body [% of the body's height]
# A run is worse than the rotation copy if the result is farther from the source by more than this [unit of the metric].
WORSE = {"foot_skate": 0.01, "contact_error": 0.002, "foot_height": 0.1}

Row = tuple[str, ...]  # of a table: a measure, its values, and the worst run
Task = tuple[Path, str, str]  # a clip; the zoo's members that are the source's body ("" for its own) and the target


@dataclass(frozen=True)
class Run:
    """A clip on a body: frames; joints without End Sites; solver iterations; metrics of source, copy and result."""

    name: str
    frames: int
    joints: int
    iterations: int
    metrics: Mapping[Variant, Mapping[str, float | None]]

    @classmethod
    def of(cls, name: str, result: RetargetResult) -> Run:
        """The run of a result, under a name."""
        counts = len(result.motion), len(result.motion.skeleton.joints), int(result.effort.iterations.sum())
        return cls(name, *counts, result.metrics)

    def metric(self, key: str, side: Variant = "result") -> float:
        """A metric of one side; nan where nothing was measured."""
        value = self.metrics[side].get(key)
        return np.nan if value is None else value


def on_scaled_body(frames: int, clip: Path, target: str) -> list[Run]:
    """A clip on its own body with some bones scaled, by each objective."""
    source = read_bvh(clip)[:frames]
    body = edited(source.rigid_skeleton, TARGETS[target])
    results = (retarget(source, body, Options(objective=objective)) for objective in OBJECTIVES)
    return [Run.of(f"{clip_name(clip)} on {target}", result) for result in results]


def on_zoo(frames: int, clip: Path, source: str, target: str) -> Run:
    """A clip, perhaps put on a member of the zoo, on another member."""
    name = f"{clip_name(clip)}{f' of {source}' if source else ''} on {target}"
    return Run.of(name, retargeted(frames, clip, source, target))


def retargeted(frames: int, clip: Path, source: str, target: str) -> RetargetResult:
    """The first frames of a clip, perhaps put on a member of the zoo, on another member."""
    motion = read_bvh(clip)[:frames]
    return retarget(on_member(source, motion) if source else motion, member(target))


def plan(clips: Sequence[Path]) -> Iterator[Task]:
    """Each clip with one in `SHARE` members."""
    for number, clip in enumerate(clips):
        for name in [*MEMBERS][number % SHARE :: SHARE]:
            yield clip, "", name


def pairs(clips: Sequence[Path]) -> Iterator[Task]:
    """Each member as the source of two others, with a clip in turn."""
    members = [*MEMBERS]
    for (number, source), apart in product(enumerate(members), APART):
        yield clips[(number + apart) % len(clips)], source, members[(number + apart) % len(members)]


def own_body(frames: int, clip: Path, member: str) -> tuple[float, str] | None:
    """Retarget a clip, or that of a member, to its own body; the largest error [% of height], and name; or None."""
    try:
        motion = retargeted(frames, clip, "", member).motion if member else read_bvh(clip)[:frames]
        result = retarget(motion, motion)
    except DistretargetError:
        return None
    body = result.matching.target
    away = np.linalg.norm(result.motion.positions - result.source.positions, axis=-1)[:, body.regions.of_joint >= 0]
    return float(100 * away.max() / body.height), f"{clip_name(clip)}{f' of {member}' if member else ''}"


# ---- tables


def metric_rows(columns: Sequence[tuple[Sequence[Run], Variant]]) -> Iterator[Row]:
    """Metrics, mean / largest over runs; each column is for some runs and a side."""
    for metric in METRICS:
        spreads = [
            mean_and_largest(np.round([run.metric(metric.key, side) for run in runs], DECIMALS), ".3g")
            for runs, side in columns
        ]
        if metric.key not in HIDDEN and any(spread != "-" for spread in spreads):
            yield metric.label + (f" [{metric.unit}]" if metric.unit else ""), *spreads


def fault_rows(runs: Sequence[Run], own: Sequence[tuple[float, str]]) -> Iterator[Row]:
    """Faults, which should not occur or should stay small, with the worst runs."""
    within = []
    for metric in METRICS:
        if metric.limit:
            over = _count(f"runs over the limit: {metric.label}", runs, partial(_over_limit, metric))
            if over[-1]:
                yield over
            elif any(np.isfinite(run.metric(metric.key)) for run in runs):
                within.append(metric.label)
    yield f"runs over the limit: {', '.join(within)}", "0", ""
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


def _over_limit(metric: Metric, run: Run) -> float:
    """1 where a run exceeds the limit of a metric, else 0; nan where nothing was measured."""
    value = run.metric(metric.key)
    return value if np.isnan(value) else float(metric.over_limit(run.metrics)) * value


def _excess(metric: Metric, run: Run) -> float:
    """The amount by which a run exceeds the limit for being worse than the rotation copy."""
    result, copy, source = (run.metric(metric.key, side) for side in SIDES)
    if metric.judged == "value":
        return result - copy - WORSE[metric.key]
    return result - source - max(copy - source, 0.0) - WORSE[metric.key]


def _count(name: str, runs: Sequence[Run], excess: Callable[[Run], float]) -> Row:
    """The number of runs with an excess over 0, and the worst of them."""
    values = [(value, run.name) for run in runs if np.isfinite(value := excess(run))]
    over = [each for each in values if each[0] > 0]
    return name, f"{len(over)} of {len(values)}", max(over)[1] if over else ""


def _spread(name: str, runs: Sequence[Run], value: Callable[[Run], float]) -> Row:
    """Mean / largest over runs, and the run with the largest value."""
    values = np.array([value(run) for run in runs])
    return name, mean_and_largest(values, ".3g"), runs[int(np.nanargmax(values))].name


SUPPORTS_HEAD = (
    "run | height of supports, % of leg: copy / contact | skate of supports, legs/s: source / copy / contact | "
    "direction error, degrees | jerk over the copy's | turn, degrees"
)


def support_row(run: Run) -> Row:
    """A line for a run in which other parts than feet rest; the height is a dash if none of them is on the floor."""
    source, copy, result = (run.metrics[side] for side in ("source", "rotation_copy", "result"))
    heights = several([each.get("support_height") for each in (copy, result)], ".2f")
    skates = several([each.get("support_skate") for each in (source, copy, result)], ".3f")
    jerk = f"{run.metric('jerk') / run.metric('jerk', 'rotation_copy'):.2f}"
    return run.name, heights, skates, f"{run.metric('direction_error'):.1f}", jerk, f"{run.metric('turn'):.1f}"


@click.command(help=__doc__)
@corpus_argument
@click.argument("duets", type=Path, required=False)
@markdown_option
@click.option("--clips", "pattern", default="*", help="Only clips whose names match.")
@click.option("--frames", default=600, show_default=True, help="Of each clip.")
def main(corpus: Path, duets: Path | None, page: Path | None, pattern: str, frames: int) -> None:
    """Measure, print, and write the tables if a page is given."""
    clips = list(found([*SAMPLE_CLIPS, *CLIPS, "pybvh/bvh_test3.bvh"], corpus, pattern).values())
    clips += [clip for clip in sorted(duets.glob("*.bvh")) if fnmatch(clip.name, pattern)] if duets else []
    scaled = in_processes(partial(on_scaled_body, frames), product(clips, TARGETS))
    by_objective = dict(zip(OBJECTIVES, map(list, zip(*scaled, strict=True)), strict=True))
    paper, contact = by_objective["paper"], by_objective["contact"]
    floor_work = product(sorted((SAMPLES / "supports").glob("*.bvh")), SUPPORTED)
    supports = [contact for contact, _ in in_processes(partial(on_scaled_body, frames), floor_work)]
    zoo = in_processes(partial(on_zoo, frames), [*plan(clips), *pairs(clips)])
    every = [*clips, *sorted(corpus.rglob("*.bvh"))]
    first = {member: (clip, member) for clip, _, member in reversed(list(plan(every)))}
    alone = [*product(every, [""]), *first.values()]
    own = [*filter(None, in_processes(partial(own_body, frames), alone))]
    columns = {
        "source": (contact, "source"),
        "copy": (contact, "rotation_copy"),
        "paper": (paper, "result"),
        "contact": (contact, "result"),
        "zoo: copy": (zoo, "rotation_copy"),
        "zoo: contact": (zoo, "result"),
    }
    tables = {
        "summary": table(["metric, mean / largest", *columns], metric_rows([*columns.values()])),
        "faults": table(["contact, over all runs", "value", "worst"], fault_rows([*contact, *zoo], own)),
        "supports": table(SUPPORTS_HEAD, map(support_row, supports)),
    }
    print(f"{len(contact)} runs on scaled bodies by each objective, {len(zoo)} in the zoo, {len(clips)} clips\n")
    publish(tables, page)


if __name__ == "__main__":
    main()
