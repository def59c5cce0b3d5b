"""Measure the quality of results over the zoo of bodies, with the samples and real clips.

    python benchmarks/zoo_quality.py CORPUS [DUETS] [--members GLOB] [--clips GLOB] [--frames N] [--runs]
                                     [--markdown FILE] [--sheet FOLDER]

CORPUS is a folder with the real clips named in `CLIPS`, DUETS one with further clips; the script names and skips those
that are missing. Each clip is retargeted to a third of the members. Prints every figure of quality of result, copied
rotations and source, mean / largest over the runs, with the worst run; then what must not occur, such as runs that are
worse than copied rotations. `--runs` lists the runs. `--sheet` draws a picture for each member; it needs matplotlib
(the extra `docs`).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from clips import SAMPLES
from numpy.typing import NDArray
from quality import CLIPS
from tables import insert
from zoo_runs import OwnBody, Run, clip_name, members_like, own_bodies, run_all

from distretarget.measure.figures import FIGURES, Figure, Variant

FRAMES = 300  # of each clip, if the command line gives no other number
SIDES: tuple[Variant, ...] = ("result", "rotation_copy", "source")
FEW_JOINTS = 40  # bodies with more joints have fingers or many helpers
NAMED = 3  # of the runs that a row counts, so many are named
OWN_BODY = 0.1  # a clip on its own body may be off by this [% of the body's height]
# A run is worse than copied rotations if the result is farther from the source by more than this [unit of the figure].
WORSE = {"slide": 0.01, "contact_error": 0.002, "foot_height": 0.1}


@dataclass(frozen=True)
class Row:
    """A line of a table: what was measured, its values, and the worst runs."""

    name: str
    values: tuple[str, ...]
    worst: str = ""


def figure_rows(runs: Sequence[Run]) -> Iterator[Row]:
    """Each figure of quality, mean / largest of result, copy and source, with the worst run."""
    for figure in FIGURES:
        values = [np.array([run.figure(figure.key, side) for run in runs]) for side in SIDES]
        judged = [
            figure.judgement(*(_measured(run, figure.key, side) for side in ("result", "source"))) for run in runs
        ]
        worst = np.array([np.nan if value is None else value for value in judged])
        if np.isfinite(worst).any():
            unit = f" [{figure.unit}]" if figure.unit else ""
            named = runs[int(np.nanargmax(worst))].name if np.nanmax(worst) > 0 else ""
            yield Row(figure.label + unit, tuple(map(_mean_and_largest, values)), named)


def _measured(run: Run, key: str, side: Variant) -> float | None:
    return run.figures[side].get(key)


def fault_rows(runs: Sequence[Run], own: Sequence[OwnBody]) -> Iterator[Row]:
    """What must not occur, or stay small, with the worst runs."""
    yield _count("runs with snaps", runs, lambda run: run.figure("snap"))
    frames = sum(run.unsolved for run in runs)
    yield _count(f"runs with unconverged frames ({frames} frames)", runs, lambda run: run.unsolved)
    for figure in FIGURES:
        if figure.key in WORSE:
            limit = f"{WORSE[figure.key]:g} {figure.unit}".rstrip()
            yield _count(f"runs worse than the copy by {limit}: {figure.label}", runs, _excess(figure))
    yield _spread("jerk / copy's", runs, lambda run: run.figure("jerk") / run.figure("jerk", "rotation_copy"))
    few = [run for run in runs if run.joints <= FEW_JOINTS]
    many = [run for run in runs if run.joints > FEW_JOINTS]
    for name, some in ((f"up to {FEW_JOINTS} joints", few), (f"over {FEW_JOINTS} joints", many)):
        if some:
            yield _spread(f"iterations per frame, {name}", some, lambda run: run.iterations / run.frames)
    largest = max(own, key=lambda one: one.deviation)
    off = sum(one.deviation > OWN_BODY for one in own)
    yield Row(
        f"clips on their own bodies that are off by more than {OWN_BODY} % of the height; largest [%]",
        (f"{off} of {len(own)}; {largest.deviation:.4f}",),
        largest.clip,
    )


def _excess(figure: Figure) -> Callable[[Run], float]:
    """How much farther from the source than the copy a result is, beyond what counts as worse."""

    def excess(run: Run) -> float:
        result, copy, source = (run.figure(figure.key, side) for side in SIDES)
        if figure.judged == "value":
            return result - copy - WORSE[figure.key]
        off = (abs(result - source), abs(copy - source))
        if figure.judged == "ratio":
            off = (result - source, max(copy - source, 0.0))
        return off[0] - off[1] - WORSE[figure.key]

    return excess


def _count(name: str, runs: Sequence[Run], excess: Callable[[Run], float]) -> Row:
    """How many runs exceed 0, and the worst of them."""
    over = sorted(((value, run.name) for run in runs if (value := excess(run)) > 0), reverse=True)
    return Row(name, (f"{len(over)} of {len(runs)}",), "; ".join(named for _, named in over[:NAMED]))


def _spread(name: str, runs: Sequence[Run], value: Callable[[Run], float]) -> Row:
    """Mean / largest over runs, and the runs with the largest."""
    values = np.array([value(run) for run in runs])
    worst = np.argsort(-np.nan_to_num(values, nan=-np.inf))[:NAMED]
    return Row(name, (_mean_and_largest(values),), "; ".join(runs[number].name for number in worst))


def _mean_and_largest(values: NDArray[np.float64]) -> str:
    values = values[np.isfinite(values)]
    return f"{values.mean():.3g} / {values.max():.3g}" if values.size else "-"


def table(columns: Sequence[str], rows: Sequence[Row]) -> str:
    """The rows as a Markdown table."""
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    lines += [f"| {' | '.join((row.name, *row.values, row.worst))} |" for row in rows]
    return "\n".join(lines) + "\n"


def run_table(runs: Sequence[Run]) -> str:
    """A line for each run, with the figures of the result."""
    columns = ["run", "frames", "unconverged", "iterations", "s", *(figure.label for figure in FIGURES)]
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for run in sorted(runs, key=lambda run: run.member):
        figures = [f"{run.figure(figure.key):.3g}" for figure in FIGURES]
        effort = [str(run.frames), str(run.unsolved), f"{run.iterations / run.frames:.1f}", f"{run.seconds:.1f}"]
        lines.append(f"| {' | '.join([run.name, *effort, *figures])} |")
    return "\n".join(lines) + "\n"


def found_clips(corpus: Path, duets: Path | None, pattern: str) -> list[Path]:
    """The clips that match a pattern; prints the names of those that are missing."""
    wanted = [*sorted(SAMPLES.glob("*.bvh")), *(corpus / clip for clip in (*CLIPS, "pybvh/bvh_test3.bvh"))]
    wanted += sorted(duets.glob("*.bvh")) if duets else []
    wanted = [clip for clip in wanted if fnmatch(clip_name(clip), pattern)]
    if absent := [clip_name(clip) for clip in wanted if not clip.is_file()]:
        print("skipped, missing:", *absent)
    return [clip for clip in wanted if clip.is_file()]


def main() -> None:
    """Measure, print, and write tables and pictures where the command line says so."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path, metavar="CORPUS")
    parser.add_argument("duets", type=Path, nargs="?", metavar="DUETS")
    parser.add_argument("--members", default="*", metavar="GLOB", help="only members whose names match")
    parser.add_argument("--clips", default="*", metavar="GLOB", help="only clips whose names, FOLDER/NAME, match")
    parser.add_argument("--frames", type=int, default=FRAMES, help="of each clip [%(default)s]")
    parser.add_argument("--runs", action="store_true", help="print a line for each run, too")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="write the tables into this page")
    parser.add_argument("--sheet", type=Path, metavar="FOLDER", help="draw a picture for each member")
    arguments = parser.parse_args()
    clips = found_clips(arguments.corpus, arguments.duets, arguments.clips)
    members = members_like(arguments.members)
    runs = run_all(clips, members, arguments.frames)
    own = own_bodies([*clips, *sorted(arguments.corpus.rglob("*.bvh"))], members, arguments.frames)
    tables = {
        "figures": table(["figure, mean / largest", "result", "copy", "source", "worst run"], list(figure_rows(runs))),
        "faults": table(["over all runs", "value", "worst"], list(fault_rows(runs, own))),
    }
    if arguments.runs:
        tables["runs"] = run_table(runs)
    print(f"{len(runs)} runs of {len(clips)} clips on {len(members)} members\n")
    print("\n".join(tables.values()))
    if arguments.markdown:
        insert(arguments.markdown, tables)
    if arguments.sheet:
        from zoo_sheet import draw_sheets

        draw_sheets(arguments.sheet, clips, members, arguments.frames)


if __name__ == "__main__":
    main()
