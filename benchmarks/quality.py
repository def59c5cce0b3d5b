"""Measure the quality of rotation copy, paper and contact on the samples and a folder of real clips.

    python benchmarks/quality.py CORPUS [--markdown FILE] [--clips GLOB] [--methods contact] [--frames N]

CORPUS is a folder with the real clips named in `clips.CLIPS`; the script names and skips those that it lacks.
docs/results.md defines the figures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import click
import numpy as np
from clips import CLIPS, PROCESSES, SAMPLES, corpus_argument, found, markdown_option
from edits import TARGETS, edited, part_of
from numpy.typing import NDArray
from tables import mean_and_largest, publish, several, table

from distretarget import Motion, Options, RetargetResult, read_bvh, retarget
from distretarget.measure.figures import clip_figures
from distretarget.measure.metrics import Reference

METHODS = ("rotation copy", "paper", "contact")
NEAR = 0.15  # joints at a smaller distance D count as near each other
SMALL = 0.002  # contact errors up to this [D] do not count
NAMED = 3  # of the runs that a row counts, at most this many are named
NO_CONTACT = ("walk.bvh", "02_01.bvh")  # clips in which the hands touch nothing

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """The figures of one clip on one target by one method."""

    clip: str
    target: str
    method: str
    figures: dict[str, float]


def measure(task: tuple[str, str], path: Path, methods: tuple[str, ...], frames: int | None) -> list[Row]:
    """The rows of a clip on a target: the rotation copy, then each method."""
    source = read_bvh(path)[:frames]
    body = edited(source.rigid_skeleton, TARGETS[task[1]])
    rows = []
    for method in methods:
        result = retarget(source, body, Options(objective="paper" if method == "paper" else "contact"))
        if not rows:
            rows.append(Row(*task, "rotation copy", _figures(result, result.rotation_copy)))
        figures = _figures(result, result.motion) | {
            "written_stress": result.written_stress.mean(),
            "copy_stress": result.copy_stress.mean(),
            "unsolved": len(result.effort.unsolved),
            "snap": result.figures["result"]["snap"] or 0.0,
        }
        if result.free_stress is not None:
            figures["free_stress"] = result.free_stress.mean()
        rows.append(Row(*task, method, figures))
    return rows


def _figures(run: RetargetResult, result: Motion) -> dict[str, float]:
    """The figures of one motion of a run, compared with its source."""
    source, drivers, names = run.source, run.drivers, result.skeleton.names
    comparison = Reference(source, run.matching, run.world.up_vector).compare(result)
    of_source = {f"{key}_source": value for key, value in clip_figures(comparison.source_tracks).items()}
    figures = {key: value or 0.0 for key, value in (clip_figures(comparison.tracks) | of_source).items()}
    wrists = [joint for joint, name in enumerate(names) if part_of(name) == "forearm"]
    heads = [joint for joint, name in enumerate(names) if name.lower() == "head"]
    hips = [leg.hip for leg in run.matching.target.legs or ()]
    return figures | {
        "contacts": float(comparison.contacts.counts.sum()),
        "hand_hip": _gap(source, result, drivers, wrists, hips),
        "hand_head": _gap(source, result, drivers, wrists, heads),
        "wrist_gap": _wrist_gap(source, result, drivers, wrists),
    }


def _gap(
    source: Motion, result: Motion, drivers: NDArray[np.intp], ones: Iterable[int], others: Iterable[int]
) -> float:
    """Mean D of the result over mean D of the source, over the frames and pairs whose D in the source is below `NEAR`;
    nan if there are none.
    """
    near_source, near_result = [np.zeros(0)], [np.zeros(0)]
    for a, b in product(ones, others):
        D = _distance(source, int(drivers[a]), int(drivers[b]))
        near_source.append(D[D < NEAR])
        near_result.append(_distance(result, a, b)[D < NEAR])
    total = np.concatenate(near_source).sum()
    return float(np.concatenate(near_result).sum() / total) if total else np.nan


def _distance(motion: Motion, a: int, b: int) -> Array:
    """(frames,), D of two joints: their distance over the length of the bones between."""
    apart = np.linalg.norm(motion.positions[:, a] - motion.positions[:, b], axis=-1)
    return np.asarray(apart / motion.rigid_skeleton.path_lengths[a, b])


def _wrist_gap(source: Motion, result: Motion, drivers: NDArray[np.intp], wrists: list[int]) -> float:
    """Mean distance of the wrists [% of the arm], over the frames in which the source's is within 1.2 of its least."""
    if len(wrists) != 2:
        return np.nan
    together = _wrist_distance(source, drivers[wrists])
    return float(_wrist_distance(result, np.array(wrists))[together < 1.2 * together.min()].mean())


def _wrist_distance(motion: Motion, wrists: NDArray[np.intp]) -> Array:
    """(frames,), the distance of the wrists [% of the arm from shoulder to wrist]."""
    skeleton = motion.rigid_skeleton
    arm = skeleton.lengths[wrists].sum() / 2 + skeleton.lengths[skeleton.parents[wrists]].sum() / 2
    return np.asarray(100 * np.linalg.norm(np.diff(motion.positions[:, wrists], axis=1)[:, 0], axis=-1) / arm)


# ---- tables


@dataclass(frozen=True)
class Summary:
    """The figures of one method over all clips and targets, and those of the rotation copy."""

    rows: list[Row]
    copies: list[Row]

    def __getitem__(self, key: str) -> Array:
        """(rows,), a figure of all rows; nan where a row does not have it."""
        return _values(self.rows, key)

    def over_copy(self, key: str) -> Array:
        """(rows,), a figure over the rotation copy's."""
        return self[key] / _values(self.copies, key)

    def of(self, key: str, clips: str | tuple[str, ...], target: str = "") -> Array:
        """A figure of some clips, by the ends of their names, on some targets, by the beginnings of theirs."""
        return _values([row for row in self.rows if row.clip.endswith(clips) and row.target.startswith(target)], key)

    def captured(self) -> NDArray[np.bool_]:
        """(rows,), whether the clip is of a real person."""
        return np.array(["/" in row.clip for row in self.rows])

    def worse(self) -> str:
        """The number and the first names of the runs with a contact error over the rotation copy's."""
        errors = zip(self.rows, self["contact_error"], _values(self.copies, "contact_error"), strict=True)
        worse = [f"{row.clip} on {row.target}" for row, result, copy in errors if result > max(copy, SMALL)]
        return ": ".join([str(len(worse)), *filter(None, ["; ".join(worse[:NAMED])])])

    def largest_turn(self) -> str:
        return f"{self['turn'].max():.2f}"

    def contact_error(self) -> str:
        return f"{self['contact_error'].mean() / _values(self.copies, 'contact_error').mean():.3f}"

    def wrist_gap(self) -> str:
        return mean_and_largest(self.of("wrist_gap", "clap.bvh", "forearm"))

    def hips_height(self) -> str:
        return mean_and_largest(self["hips_height"], largest=self["hips_height_largest"])

    def direction_error_without_contacts(self) -> str:
        values = self.of("direction_error", NO_CONTACT)
        return f"{values.mean():.2f}" if values.size else "-"

    def largest_stress(self) -> str:
        stress = (self["written_stress"] / self["copy_stress"])[np.isfinite(self["free_stress"])]
        return f"{stress.max():.2f}" if stress.size else "-"

    def slide(self) -> str:
        result, source = self["slide"].mean(), self["slide_source"].mean()
        return f"{result:.4f} ({source:.4f}), ratio {result / source:.3f}"


def _values(rows: list[Row], key: str) -> Array:
    return np.array([row.figures.get(key, np.nan) for row in rows])


# What is summarised; the goal of the contact objective, or of the paper's where it says so; and the value as text, or
# the values whose mean and largest are shown.
LINES: tuple[tuple[str, str, Callable[[Summary], str | Array]], ...] = (
    ("contact error, mean over clips, against rotation copy's", "<= 0.25", Summary.contact_error),
    ("runs with a contact error over 0.002 and over rotation copy's", "0", Summary.worse),
    ("clap on long forearms, wrist gap, % of arm", "<= 6 (source: 4.0)", Summary.wrist_gap),
    ("hands on hips, gap against source's", "<= 1.2", lambda s: s.of("hand_hip", "hands_on_hips.bvh")),
    ("hand to hip, all clips, gap against source's", "<= 1.2", lambda s: s["hand_hip"]),
    ("hand to head, all clips, gap against source's", "<= 1.2", lambda s: s["hand_head"]),
    ("direction error, mean, degrees", "<= 3.5", lambda s: f"{s['direction_error'].mean():.2f}"),
    ("direction error, 99th percentile", "<= 25", lambda s: s["direction_error_p99"]),
    ("direction error on clips without hand contacts", "<= 1.5", Summary.direction_error_without_contacts),
    ("bone error, largest", "<= 1e-6", lambda s: f"{s['bone_error'].max():.1e}"),
    ("slide in stance, leg lengths/s (source's)", "ratio <= 1.05", Summary.slide),
    ("foot height in stance, off the scaled source's, % of leg", "<= 0.5", lambda s: s["foot_height"]),
    ("hips over resting ankles, off the scaled source's, % of leg, mean / largest", "<= 0.5 / 3", Summary.hips_height),
    ("resting feet off the target's own, foot pitch, degrees", "<= 3", lambda s: s["foot_pitch"]),
    ("resting feet off the target's own, height of the ankle, % of leg", "<= 2", lambda s: s["ankle_height"]),
    ("runs with snaps", "0", lambda s: _number(s["snap"].clip(max=1))),
    ("jerk against rotation copy's, captured clips", "<= 1.1", lambda s: s.over_copy("jerk")[s.captured()]),
    ("jerk against rotation copy's, samples", "<= 2", lambda s: s.over_copy("jerk")[~s.captured()]),
    ("turn beyond source's from frame to frame at 60 fps, largest, degrees", "<= 30", Summary.largest_turn),
    ("written stress / free stress", "paper: <= 1.25", lambda s: s["written_stress"] / s["free_stress"]),
    ("written stress / rotation copy's, largest", "paper: <= 1", Summary.largest_stress),
    ("frames that did not converge", "0", lambda s: _number(s["unsolved"])),
)


def _number(counts: Array) -> str:
    return f"{counts.sum():.0f}" if np.isfinite(counts).all() else "-"


def summary_table(rows: list[Row]) -> str:
    """The summary of each method as a table, with the goals."""
    by_method = {method: [row for row in rows if row.method == method] for method in METHODS}
    summaries = {method: Summary(own, by_method["rotation copy"]) for method, own in by_method.items() if own}
    lines = []
    for name, goal, measure in LINES:
        values = [measure(summary) for summary in summaries.values()]
        texts = [value if isinstance(value, str) else mean_and_largest(value) for value in values]
        lines.append([name if isinstance(values[0], str) else f"{name}, mean / largest", *texts, goal])
    return table(["figure", *summaries, "goal"], lines)


def clip_table(rows: list[Row]) -> str:
    """A table with a line for each clip and target."""
    methods = list(dict.fromkeys(row.method for row in rows))
    groups = [rows[first : first + len(methods)] for first in range(0, len(rows), len(methods))]
    head = (
        "clip",
        "target",
        "contact pairs",
        "contact error",
        "direction error",
        "jerk against rotation copy's",
        "paper's written / free stress",
    )
    note = f"Contact error (D), direction error (degrees) and jerk are those of {' / '.join(methods)}."
    return f"{note}\n\n{table(head, map(_cells, groups))}"


def _cells(group: list[Row]) -> list[str]:
    copy = group[0]
    stress = _values(group, "written_stress") / _values(group, "free_stress")
    return [
        copy.clip,
        copy.target,
        f"{copy.figures['contacts']:.0f}",
        several(_values(group, "contact_error"), ".4f"),
        several(_values(group, "direction_error"), ".1f"),
        several(_values(group, "jerk") / copy.figures["jerk"], ".2f"),
        several(stress[np.isfinite(stress)], ".2f"),
    ]


@click.command(help=__doc__)
@corpus_argument
@markdown_option
@click.option("--clips", default="*", help="Only clips whose names match.")
@click.option("--methods", default="paper,contact", help="paper, contact or both.")
@click.option("--frames", type=int, help="Only the first frames of each clip.")
def main(corpus: Path, page: Path | None, clips: str, methods: str, frames: int | None) -> None:
    """Measure, print, and write the tables if a page is given."""
    paths = found([*sorted(path.name for path in SAMPLES.glob("*.bvh")), *CLIPS], corpus, clips)
    tasks = list(product(paths, TARGETS))
    with ProcessPoolExecutor(PROCESSES) as pool:
        runs = [pool.submit(measure, task, paths[task[0]], tuple(methods.split(",")), frames) for task in tasks]
        rows = [row for run in runs for row in run.result()]
    publish({"summary": summary_table(rows), "clips": clip_table(rows)}, page)


if __name__ == "__main__":
    main()
