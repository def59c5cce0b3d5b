"""Measure the quality of rotation copy, paper and contact on the samples and a folder of real clips.

    python benchmarks/quality.py CORPUS [--markdown FILE] [--clips GLOB] [--methods contact] [--frames N]

CORPUS is a folder with the real clips named in `CLIPS`; the script names and skips those that it lacks.
docs/results.md defines the figures.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from clips import SAMPLES
from edits import TARGETS, edited, part_of
from numpy.typing import NDArray
from tables import insert

from distretarget import Motion, Options, RetargetResult, read_bvh, retarget
from distretarget.measure.figures import clip_figures
from distretarget.measure.metrics import Reference

CLIPS = [
    *(f"cmu_mb/{clip}.bvh" for clip in ("02_01", "02_05", "02_10", "05_03", "05_12", "12_01")),
    *(f"cmu_daz/{clip}.bvh" for clip in ("05_03", "13_11", "14_04", "14_30")),
    *(f"animated_drawings/{clip}.bvh" for clip in ("jesse_dance", "zombie")),
]
METHODS = ("rotation copy", "paper", "contact")
NEAR = 0.15  # joints at a smaller distance D count as near each other
SMALL = 0.002  # contact errors up to this [D] do not count
NAMED = 3  # of the runs that a row counts, so many are named
NO_CONTACT = ("walk.bvh", "02_01.bvh")  # clips in which the hands touch nothing
PROCESSES = 2

GOALS = {  # by the name of the figure: the goal of the contact objective, or of the paper's where it says so
    "contact error, mean over clips, against rotation copy's": "<= 0.25",
    "runs with a contact error over 0.002 and over rotation copy's": "0",
    "clap on long forearms, wrist gap, % of arm": "<= 6 (source: 4.0)",
    "hands on hips, gap against source's, mean / largest": "<= 1.2",
    "hand to hip, all clips, gap against source's, mean / largest": "<= 1.2",
    "hand to head, all clips, gap against source's, mean / largest": "<= 1.2",
    "direction error, mean, degrees": "<= 3.5",
    "direction error, 99th percentile, mean / largest": "<= 25",
    "direction error on clips without hand contacts": "<= 1.5",
    "bone error, largest": "<= 1e-6",
    "slide in stance, leg lengths/s (source's)": "ratio <= 1.05",
    "foot height in stance, off the scaled source's, % of leg, mean / largest": "<= 0.5",
    "hips over resting ankles, off the scaled source's, % of leg, mean / largest": "<= 0.5 / 3",
    "resting feet off the target's own, foot pitch, degrees, mean / largest": "<= 3",
    "resting feet off the target's own, height of the ankle, % of leg, mean / largest": "<= 2",
    "runs with snaps": "0",
    "jerk against rotation copy's, captured clips, mean / largest": "<= 1.1",
    "jerk against rotation copy's, samples, mean / largest": "<= 2",
    "turn beyond source's from frame to frame at 60 fps, largest, degrees": "<= 30",
    "written stress / free stress, mean / largest": "paper: <= 1.25",
    "written stress / rotation copy's, largest": "paper: <= 1",
    "frames that did not converge": "0",
}


@dataclass(frozen=True)
class Row:
    """The figures of one clip on one target by one method."""

    clip: str
    target: str
    method: str
    figures: dict[str, float]

    @property
    def captured(self) -> bool:
        """Whether the clip is of a real person."""
        return "/" in self.clip


def measure(folder: Path, clip: str, target: str, methods: tuple[str, ...], frames: int | None) -> list[Row]:
    """The rows of a clip on a target: the rotation copy, then each method."""
    source = read_bvh((folder if "/" in clip else SAMPLES) / clip)[:frames]
    body = edited(source.rigid_skeleton, TARGETS[target])
    rows = []
    for method in methods:
        result = retarget(source, body, Options(objective="paper" if method == "paper" else "contact"))
        if not rows:
            rows.append(Row(clip, target, "rotation copy", _figures(result, result.rotation_copy)))
        figures = _figures(result, result.motion)
        figures["written_stress"] = float(result.written_stress.mean())
        figures["copy_stress"] = float(result.copy_stress.mean())
        if result.free_stress is not None:
            figures["free_stress"] = float(result.free_stress.mean())
        figures["unsolved"] = float(len(result.effort.unsolved))
        figures["snap"] = result.figures["result"]["snap"] or 0.0
        rows.append(Row(clip, target, method, figures))
    return rows


def _figures(run: RetargetResult, result: Motion) -> dict[str, float]:
    """The figures of one motion of a run, compared with its source."""
    source, drivers = run.source, run.drivers
    comparison = Reference(source, run.matching, run.world.up_vector).compare(result)
    values = {
        **clip_figures(comparison.tracks),
        **{f"{key}_source": value for key, value in clip_figures(comparison.source_tracks).items()},
    }
    figures = {key: value or 0.0 for key, value in values.items()}
    figures["contacts"] = float(comparison.contacts.counts.sum())
    wrists = [j for j, name in enumerate(result.skeleton.names) if part_of(name) == "forearm"]
    hips = [leg.hip for leg in run.matching.target.legs or ()]
    heads = [j for j, name in enumerate(result.skeleton.names) if name.lower() == "head"]
    figures["hand_hip"] = _gap(source, result, drivers, wrists, hips)
    figures["hand_head"] = _gap(source, result, drivers, wrists, heads)
    figures["wrist_gap"] = _wrist_gap(source, result, drivers, wrists)
    return figures


def _gap(
    source: Motion, result: Motion, drivers: NDArray[np.intp], ones: Iterable[int], others: Iterable[int]
) -> float:
    """Mean D of the result over mean D of the source, over the frames and pairs whose D in the source is below `NEAR`.

    nan if there are none.
    """
    near_source, near_result = [], []
    for a, b in product(ones, others):
        D = _distance(source, int(drivers[a]), int(drivers[b]))
        near_source.append(D[D < NEAR])
        near_result.append(_distance(result, a, b)[D < NEAR])
    total = np.concatenate(near_source).sum() if near_source else 0.0
    return float(np.concatenate(near_result).sum() / total) if total else float("nan")


def _distance(motion: Motion, a: int, b: int) -> NDArray[np.float64]:
    """(frames,), D of two joints: their distance over the length of the bones between."""
    apart = np.linalg.norm(motion.positions[:, a] - motion.positions[:, b], axis=-1)
    return np.asarray(apart / motion.rigid_skeleton.path_lengths[a, b])


def _wrist_gap(source: Motion, result: Motion, drivers: NDArray[np.intp], wrists: list[int]) -> float:
    """Mean distance of the wrists [% of the arm], over the frames in which the source's is within 1.2 of its least."""
    if len(wrists) != 2:
        return float("nan")
    together = _wrist_distance(source, drivers[wrists])
    return float(_wrist_distance(result, np.array(wrists))[together < 1.2 * together.min()].mean())


def _wrist_distance(motion: Motion, wrists: NDArray[np.intp]) -> NDArray[np.float64]:
    """(frames,), the distance of the wrists [% of the arm from shoulder to wrist]."""
    skeleton = motion.rigid_skeleton
    arm = skeleton.lengths[wrists].sum() / 2 + skeleton.lengths[skeleton.parents[wrists]].sum() / 2
    return np.asarray(100 * np.linalg.norm(np.diff(motion.positions[:, wrists], axis=1)[:, 0], axis=-1) / arm)


def run(folder: Path, clips: list[str], methods: tuple[str, ...], frames: int | None) -> list[Row]:
    """The rows of all clips on all targets, measured in `PROCESSES` processes."""
    tasks = list(product(clips, TARGETS))
    measure_task = partial(_measure_task, folder, methods, frames)
    with ProcessPoolExecutor(PROCESSES) as pool:
        return [row for rows in pool.map(measure_task, tasks) for row in rows]


def _measure_task(folder: Path, methods: tuple[str, ...], frames: int | None, task: tuple[str, str]) -> list[Row]:
    return measure(folder, *task, methods, frames)


@dataclass(frozen=True)
class Summary:
    """The figures of one method over all clips and targets."""

    rows: list[Row]
    copies: list[Row]

    def all(self, name: str, rows: list[Row] | None = None) -> NDArray[np.float64]:
        """(rows,), a figure of all rows; nan where a row does not have it."""
        return np.array([row.figures.get(name, np.nan) for row in (self.rows if rows is None else rows)])

    def lines(self) -> Iterator[tuple[str, str]]:
        """Names and values of the figures, as text."""
        error, copy_error = self.all("contact_error"), self.all("contact_error", self.copies)
        worse = [
            f"{row.clip} on {row.target}"
            for row, of_result, of_copy in zip(self.rows, error, copy_error, strict=True)
            if of_result > max(of_copy, SMALL)
        ]
        yield "contact error, mean over clips, against rotation copy's", f"{error.mean() / copy_error.mean():.3f}"
        yield (
            "runs with a contact error over 0.002 and over rotation copy's",
            ": ".join([str(len(worse)), *filter(None, ["; ".join(worse[:NAMED])])]),
        )
        yield (
            "clap on long forearms, wrist gap, % of arm",
            _mean_and_largest(self._pick("wrist_gap", "clap.bvh", "forearm")),
        )
        yield (
            "hands on hips, gap against source's, mean / largest",
            _mean_and_largest(self._pick("hand_hip", "hands_on_hips.bvh")),
        )
        yield "hand to hip, all clips, gap against source's, mean / largest", _mean_and_largest(self.all("hand_hip"))
        yield "hand to head, all clips, gap against source's, mean / largest", _mean_and_largest(self.all("hand_head"))
        yield "direction error, mean, degrees", _two_digits(self.all("direction_error").mean())
        yield "direction error, 99th percentile, mean / largest", _mean_and_largest(self.all("direction_error_p99"))
        free = [row for row in self.rows if row.clip.endswith(NO_CONTACT)]
        if free:
            value = self.all("direction_error", free).mean()
            yield "direction error on clips without hand contacts", _two_digits(value)
        yield "bone error, largest", f"{self.all('bone_error').max():.1e}"
        slide, source = self.all("slide").mean(), self.all("slide_source").mean()
        yield ("slide in stance, leg lengths/s (source's)", f"{slide:.4f} ({source:.4f}), ratio {slide / source:.3f}")
        height = self.all("foot_height")
        yield "foot height in stance, off the scaled source's, % of leg, mean / largest", _mean_and_largest(height)
        hips = self.all("hips_height"), self.all("hips_height_largest")
        yield "hips over resting ankles, off the scaled source's, % of leg, mean / largest", _mean_and_largest(*hips)
        for key, name in (("foot_pitch", "foot pitch, degrees"), ("ankle_height", "height of the ankle, % of leg")):
            yield f"resting feet off the target's own, {name}, mean / largest", _mean_and_largest(self.all(key))
        if "snap" in self.rows[0].figures:
            yield "runs with snaps", f"{(self.all('snap') > 0).sum()}"
        jerk = self.all("jerk") / self.all("jerk", self.copies)
        captured = np.array([row.captured for row in self.rows])
        for name, rows in (("captured clips", captured), ("samples", ~captured)):
            if rows.any():
                yield f"jerk against rotation copy's, {name}, mean / largest", _mean_and_largest(jerk[rows])
        yield (
            "turn beyond source's from frame to frame at 60 fps, largest, degrees",
            _two_digits(self.all("turn").max()),
        )
        if "free_stress" in self.rows[0].figures:
            ratio = self.all("written_stress") / self.all("free_stress")
            yield "written stress / free stress, mean / largest", _mean_and_largest(ratio)
            yield (
                "written stress / rotation copy's, largest",
                _two_digits((self.all("written_stress") / self.all("copy_stress")).max()),
            )
        if "unsolved" in self.rows[0].figures:
            yield "frames that did not converge", f"{self.all('unsolved').sum():.0f}"

    def _pick(self, name: str, clip: str, target: str = "") -> NDArray[np.float64]:
        return self.all(name, [row for row in self.rows if row.clip == clip and row.target.startswith(target)])


def _two_digits(value: float) -> str:
    return f"{value:.2f}"


def _mean_and_largest(values: NDArray[np.float64], largest: NDArray[np.float64] | None = None) -> str:
    values, largest = (each[np.isfinite(each)] for each in (values, values if largest is None else largest))
    if not values.size:
        return "-"
    return f"{values.mean():.2f} / {largest.max():.2f}"


def summaries(rows: list[Row]) -> dict[str, Summary]:
    """A summary for each method."""
    by_method = {method: [row for row in rows if row.method == method] for method in METHODS}
    return {method: Summary(own, by_method["rotation copy"]) for method, own in by_method.items() if own}


def summary_table(rows: list[Row]) -> str:
    """The summary of each method as a table, with the goals."""
    columns = {method: dict(summary.lines()) for method, summary in summaries(rows).items()}
    names = list(dict.fromkeys(name for column in columns.values() for name in column))
    lines = [f"| figure | {' | '.join(columns)} | goal |", "|---" * (len(columns) + 2) + "|"]
    for name in names:
        values = [column.get(name, "-") for column in columns.values()]
        lines.append(f"| {name} | {' | '.join(values)} | {GOALS.get(name, '')} |")
    return "\n".join(lines) + "\n"


def clip_table(rows: list[Row]) -> str:
    """A table with a line for each clip and target."""
    methods = list(dict.fromkeys(row.method for row in rows))
    lines = [
        f"Contact error (D), direction error (degrees) and jerk are those of {' / '.join(methods)}.",
        "",
        "| clip | target | contact pairs | contact error | direction error | jerk against rotation copy's "
        "| paper's written / free stress |",
        "|---|---|---|---|---|---|---|",
    ]
    groups = range(0, len(rows), len(methods))
    return "\n".join([*lines, *(_line(rows[first : first + len(methods)]) for first in groups)]) + "\n"


def _line(group: list[Row]) -> str:
    def cells(name: str, digits: int) -> str:
        return " / ".join(f"{row.figures[name]:.{digits}f}" for row in group)

    copy = group[0]
    jerk = " / ".join(f"{row.figures['jerk'] / copy.figures['jerk']:.2f}" for row in group)
    errors = f"{copy.figures['contacts']:.0f} | {cells('contact_error', 4)} | {cells('direction_error', 1)}"
    free = [row.figures for row in group if "free_stress" in row.figures]
    stress = "".join(f"{figures['written_stress'] / figures['free_stress']:.2f}" for figures in free)
    return f"| {copy.clip} | {copy.target} | {errors} | {jerk} | {stress} |"


def main() -> None:
    """Measure, print, and write the tables if a page is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--markdown", type=Path, help="write the tables into this page")
    parser.add_argument("--clips", default="*", help="only clips whose names match")
    parser.add_argument("--methods", default="paper,contact", help="paper, contact or both")
    parser.add_argument("--frames", type=int, help="only the first frames of each clip")
    arguments = parser.parse_args()
    clips = [
        clip for clip in [*sorted(p.name for p in SAMPLES.glob("*.bvh")), *CLIPS] if fnmatch(clip, arguments.clips)
    ]
    absent = [clip for clip in clips if "/" in clip and not (arguments.corpus / clip).is_file()]
    if absent:
        print("skipped, not in the corpus:", *absent)
    rows = run(
        arguments.corpus,
        [clip for clip in clips if clip not in absent],
        tuple(arguments.methods.split(",")),
        arguments.frames,
    )
    for method, summary in summaries(rows).items():
        print(f"\n{method}")
        for name, value in summary.lines():
            print(f"  {name:74s} {value}")
    if arguments.markdown:
        insert(arguments.markdown, {"summary": summary_table(rows), "clips": clip_table(rows)})


if __name__ == "__main__":
    main()
