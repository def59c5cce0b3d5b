"""Measure the quality of rotation copy, paper and contact on the samples and a folder of real clips.

    python benchmarks/quality.py CORPUS [--markdown FILE] [--clips GLOB] [--methods contact] [--frames N]

CORPUS is a folder with the real clips named in `clips.CLIPS`; the script names and skips those that it lacks.
docs/diff.md and docs/results.md define the metrics.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain, product
from pathlib import Path

import click
import numpy as np
from clips import CLIPS, SAMPLE_CLIPS, corpus_argument, found, markdown_option
from edits import TARGETS, edited, part_of
from numpy.typing import NDArray
from runs import in_processes
from tables import mean_and_largest, publish, several, table

from distretarget import Motion, Options, RetargetResult, read_bvh, retarget
from distretarget.measure.metrics import Variant

COPY = "rotation copy"
NEAR = 0.15  # joints at a smaller distance D count as near each other
SMALL = 0.002  # contact errors up to this [D] do not count
OF_SOLVER = ("not_converged", "pop")  # metrics that a rotation copy has not
NO_CONTACT = ("walk.bvh", "02_01.bvh")  # clips in which the hands touch nothing

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """The metrics of one clip on one target by one method."""

    clip: str
    target: str
    method: str
    metrics: dict[str, float]


def measure(frames: int | None, methods: tuple[str, ...], path: Path, *names: str) -> list[Row]:
    """The rows of a clip, by path and name, on a target: the rotation copy, then each method."""
    source = read_bvh(path)[:frames]
    body = edited(source.rigid_skeleton, TARGETS[names[1]])
    results = [retarget(source, body, Options(objective=method)) for method in methods]
    rows = [Row(*names, COPY, _metrics(results[0], "rotation_copy"))]
    for method, result in zip(methods, results, strict=True):
        metrics = _metrics(result, "result") | {
            "written_stress": result.written_stress.mean(),
            "copy_stress": result.copy_stress.mean(),
            "not_converged": len(result.effort.not_converged),
            "pop": result.metrics["result"]["pop"] or 0.0,
        }
        if result.free_stress is not None:
            metrics["free_stress"] = result.free_stress.mean()
        rows.append(Row(*names, method, metrics))
    return rows


def _metrics(run: RetargetResult, side: Variant) -> dict[str, float]:
    """The metrics of one side of a run, those of its source, and distances of hands."""
    motion = run.motion if side == "result" else run.rotation_copy
    source, drivers, names = run.source, run.drivers, motion.skeleton.names
    wrists = [joint for joint, name in enumerate(names) if part_of(name) == "forearm"]
    heads = [joint for joint, name in enumerate(names) if name.lower() == "head"]
    hips = [leg.hip for leg in run.matching.target.legs or ()]
    metrics = run.metrics[side] | {f"{key}_source": value for key, value in run.metrics["source"].items()}
    return {key: value or 0.0 for key, value in metrics.items() if key not in OF_SOLVER} | {
        "contacts": float(run.comparison.contacts.counts.sum()),
        "hand_hip": _gap(source, motion, drivers, product(wrists, hips)),
        "hand_head": _gap(source, motion, drivers, product(wrists, heads)),
        "wrist_gap": _wrist_gap(source, motion, drivers, wrists),
    }


def _gap(source: Motion, result: Motion, drivers: NDArray[np.intp], pairs: Iterable[tuple[int, int]]) -> float:
    """Mean D of the result over that of the source, over the frames and pairs whose D in the source is below `NEAR`."""
    total, gaps = 0.0, 0.0
    for a, b in pairs:
        D = _distance(source, int(drivers[a]), int(drivers[b]))
        total += D[D < NEAR].sum()
        gaps += _distance(result, a, b)[D < NEAR].sum()
    return gaps / total if total else np.nan


def _distance(motion: Motion, a: int, b: int) -> Array:
    """(frames,), D of two joints: their distance over the length of the bones between."""
    apart = np.linalg.norm(motion.positions[:, a] - motion.positions[:, b], axis=-1)
    return np.asarray(apart / motion.rigid_skeleton.paths_from(a)[b])


def _wrist_gap(source: Motion, result: Motion, drivers: NDArray[np.intp], wrists: list[int]) -> float:
    """Mean distance of the wrists [% of the arm], over the frames in which the source's is within 1.2 of its least."""
    if len(wrists) != 2:
        return np.nan
    apart = []  # of source and result: (frames,), over the mean arm from shoulder to wrist [%]
    for motion, joints in ((source, drivers[wrists]), (result, np.array(wrists))):
        body = motion.rigid_skeleton
        arm = (body.lengths[joints] + body.lengths[body.parents[joints]]).mean()
        apart.append(100 * np.linalg.norm(np.diff(motion.positions[:, joints], axis=1)[:, 0], axis=-1) / arm)
    return float(apart[1][apart[0] < 1.2 * apart[0].min()].mean())


# ---- tables


def _values(rows: Iterable[Row], key: str) -> Array:
    """(rows,), a metric of all rows; nan where it is missing."""
    return np.array([row.metrics.get(key, np.nan) for row in rows])


def summary_lines(rows: list[Row], copies: list[Row]) -> Iterator[tuple[str, str, str]]:
    """The lines of a method's summary: name, value, and the goal of the contact objective or of the paper's."""

    def of(key: str, clips: str | tuple[str, ...] = "", target: str = "") -> Array:
        """A metric of the clips with this ending, on the targets with this beginning."""
        return _values([row for row in rows if row.clip.endswith(clips) and row.target.startswith(target)], key)

    error, copy_error = of("contact_error"), _values(copies, "contact_error")
    yield (
        "contact error, mean over clips, against rotation copy's",
        f"{error.mean() / copy_error.mean():.3f}",
        "<= 0.25",
    )
    worse = str((error > np.maximum(copy_error, SMALL)).sum())
    yield "runs with a contact error over 0.002 and over rotation copy's", worse, "0"
    gap = of("wrist_gap", "clap.bvh", "forearm")
    yield "clap on long forearms, wrist gap, % of arm", mean_and_largest(gap), "<= 6 (source: 4.0)"
    for what, gap in (
        ("hands on hips, gap", of("hand_hip", "hands_on_hips.bvh")),
        ("hand to hip, all clips, gap", of("hand_hip")),
        ("hand to head, all clips, gap", of("hand_head")),
    ):
        yield f"{what} against source's, mean / largest", mean_and_largest(gap), "<= 1.2"
    yield "direction error, mean, degrees", f"{of('direction_error').mean():.2f}", "<= 3.5"
    yield "direction error, 99th percentile, mean / largest", mean_and_largest(of("direction_error_p99")), "<= 25"
    direction = of("direction_error", NO_CONTACT)
    text = f"{direction.mean():.2f}" if direction.size else "-"
    yield "direction error on clips without hand contacts", text, "<= 1.5"
    yield "bone error, largest", f"{of('bone_error').max():.1e}", "<= 1e-6"
    slide, source_slide = of("foot_skate"), of("foot_skate_source")
    text = f"{slide.mean():.4f} ({source_slide.mean():.4f}), ratio {slide.mean() / source_slide.mean():.3f}"
    yield "foot skate, leg lengths/s (source's)", text, "ratio <= 1.05"
    what = "foot height, % of leg, mean / largest"
    yield what, mean_and_largest(of("foot_height")), "<= 0.5"
    what = "hips height, % of leg, mean / largest"
    yield what, mean_and_largest(of("hips_height"), largest=of("hips_height_largest")), "<= 0.5 / 3"
    what = "pitch of resting feet off the target's own, degrees, mean / largest"
    yield what, mean_and_largest(of("foot_pitch")), "<= 3"
    what = "ankles of resting feet off the target's own, % of leg, mean / largest"
    yield what, mean_and_largest(of("ankle_height")), "<= 2"
    yield "runs with pops", _sum(of("pop").clip(max=1)), "0"
    jerk, captured = of("jerk") / _values(copies, "jerk"), np.array(["/" in row.clip for row in rows])
    yield "jerk against rotation copy's, captured clips, mean / largest", mean_and_largest(jerk[captured]), "<= 1.1"
    yield "jerk against rotation copy's, samples, mean / largest", mean_and_largest(jerk[~captured]), "<= 2"
    turn = f"{of('turn').max():.2f}"
    yield "turn, largest, degrees in 1/60 s", turn, "<= 30"
    free, over_copy = of("written_stress") / of("free_stress"), of("written_stress") / of("copy_stress")
    yield "written stress / free stress, mean / largest", mean_and_largest(free), "paper: <= 1.25"
    solved = over_copy[np.isfinite(free)]
    yield "written stress / rotation copy's, largest", f"{solved.max():.2f}" if solved.size else "-", "paper: <= 1"
    yield "frames that did not converge", _sum(of("not_converged")), "0"


def _sum(counts: Array) -> str:
    return f"{counts.sum():.0f}" if np.isfinite(counts).all() else "-"


def summary_table(rows: list[Row]) -> str:
    """The summary of each method as a table, with the goals."""
    methods = dict.fromkeys(row.method for row in rows)
    by_method = {method: [row for row in rows if row.method == method] for method in methods}
    summaries = [summary_lines(own, by_method[COPY]) for own in by_method.values()]
    lines = ([cells[0][0], *(text for _, text, _ in cells), cells[0][2]] for cells in zip(*summaries, strict=True))
    return table(["metric", *methods, "goal"], lines)


def clip_table(rows: list[Row]) -> str:
    """A table with a line for each clip, means over the targets."""
    methods = list(dict.fromkeys(row.method for row in rows))
    others = " / ".join(methods[1:])
    head = (
        f"clip | contact pairs | contact error: {' / '.join(methods)} | direction error, degrees: {others} | "
        f"jerk over the copy's: {others} | paper's written / free stress"
    )
    return table(head, map(_cells, by_clip(rows).values()))


def by_clip(rows: list[Row]) -> dict[str, list[Row]]:
    """The rows of each clip."""
    return {clip: [row for row in rows if row.clip == clip] for clip in dict.fromkeys(row.clip for row in rows)}


def _cells(rows: list[Row]) -> Iterator[str]:
    """The line of a clip, from its rows on all targets by all methods."""
    methods = dict.fromkeys(row.method for row in rows)
    copies, *others = ([row for row in rows if row.method == method] for method in methods)
    yield copies[0].clip.removesuffix(".bvh")
    yield f"{_values(copies, 'contacts').mean():.0f}"
    errors = [_values(each, "contact_error").mean() for each in (copies, *others)]
    yield several(errors, ".4f") if any(errors) else "-"
    yield several((_values(each, "direction_error").mean() for each in others), ".1f")
    yield several(((_values(each, "jerk") / _values(copies, "jerk")).mean() for each in others), ".2f")
    stress = [_values(each, "written_stress") / _values(each, "free_stress") for each in others]
    yield several((each.mean() for each in stress if np.isfinite(each).all()), ".2f")


@click.command(help=__doc__)
@corpus_argument
@markdown_option
@click.option("--clips", default="*", help="Only clips whose names match.")
@click.option("--methods", default="paper,contact", help="paper, contact or both.")
@click.option("--frames", type=int, help="Only the first frames of each clip.")
def main(corpus: Path, page: Path | None, clips: str, methods: str, frames: int | None) -> None:
    """Measure, print, and write the tables if a page is given."""
    paths = found([*SAMPLE_CLIPS, *CLIPS], corpus, clips)
    tasks = [(path, clip, target) for (clip, path), target in product(paths.items(), TARGETS)]
    rows = list(chain.from_iterable(in_processes(partial(measure, frames, tuple(methods.split(","))), tasks)))
    publish({"summary": summary_table(rows), "clips": clip_table(rows)}, page)


if __name__ == "__main__":
    main()
