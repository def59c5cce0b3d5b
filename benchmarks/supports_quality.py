"""Measure supports: hands, knees and all else that rests on the world, apart from the feet.

    python benchmarks/supports_quality.py CORPUS [--markdown docs/results.md] [--sheet FOLDER]

Retargets the samples with supports (`sample_bvh/supports`) and the real clips of CORPUS to two bodies, H and child,
once with supports and once with the feet alone. Prints a line for each sample and body, and what holds over all runs.
`--sheet` draws source, rotation copy and result of each sample; it needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from clips import PROCESSES, SAMPLES, corpus_argument, markdown_option
from edits import TARGETS, edited
from tables import mean_and_largest, publish, several, table

from distretarget import DistretargetError, Options, RetargetResult, read_bvh, retarget
from distretarget.measure.figures import Variant

BODIES = ("child", "H")
FRAMES = 1500  # of each clip
PICTURES = 8  # frames of a picture
TURNS = 30.0  # a joint that turns by this much more than the source's between two frames at 60 fps [degrees]
COLUMNS = (
    "run; rotation copy / feet alone / supports",
    "height of supports, % of leg (largest)",
    "slide of supports, legs/s (source)",
    "slide of feet (source)",
    "foot height",
    "direction error, degrees",
    "jerk / copy's",
    "turn, degrees",
)


@dataclass(frozen=True)
class Run:
    """A clip on a body: with supports (`held`), and with the feet alone (`feet`), and how long each took [s]."""

    clip: Path
    body: str
    held: RetargetResult
    feet: RetargetResult
    seconds: list[float]

    @property
    def name(self) -> str:
        return f"{self.clip.stem} on {self.body}"

    @property
    def floor_work(self) -> bool:
        """Whether anything but a foot rests."""
        return len(self.held.supports.joints) > self.held.supports.feet

    @property
    def same(self) -> bool:
        """Whether both results are the same, digit for digit."""
        one, other = self.held.motion, self.feet.motion
        return bool((one.rotations == other.rotations).all() and (one.translations == other.translations).all())

    @property
    def highest(self) -> float:
        """How far a joint that rests on the floor is at most off its height [% of leg length]."""
        supports = self.held.comparison.supports
        return float(np.where(supports.on_floor, supports.height, 0.0).max(initial=0.0))

    def sides(self, key: str, form: str) -> str:
        """A figure of rotation copy, feet alone and supports."""
        values = [self.held.figures["rotation_copy"][key], *(_figure(each, key) for each in (self.feet, self.held))]
        return several(values, form)


def measured(clip: Path, body: str) -> Run | None:
    """Retarget a clip to a body; None where it cannot be."""
    warnings.simplefilter("ignore")
    try:
        motion = read_bvh(clip)[:FRAMES]
        target = edited(motion.rigid_skeleton, TARGETS[body])
        results, seconds = [], []
        for supports in ("hold", "feet"):
            began = time.perf_counter()
            results.append(retarget(motion, target, Options(supports=supports)))
            seconds.append(time.perf_counter() - began)
    except DistretargetError:
        return None
    return Run(clip, body, *results, seconds)


def _figure(result: RetargetResult, key: str, side: Variant = "result") -> float | None:
    return result.figures[side][key]


def _jerk(result: RetargetResult) -> float:
    return (_figure(result, "jerk") or 0.0) / (_figure(result, "jerk", "rotation_copy") or 1.0)


def cells(run: Run) -> list[str]:
    """The row of a run."""
    of_source = [several([_figure(run.held, key, "source")], ".3f") for key in ("support_slide", "slide")]
    return [
        run.name,
        f"{run.sides('support_height', '.2f')} ({run.highest:.2f})",
        f"{run.sides('support_slide', '.3f')} ({of_source[0]})",
        f"{run.sides('slide', '.3f')} ({of_source[1]})",
        run.sides("foot_height", ".2f"),
        run.sides("direction_error", ".1f"),
        several([_jerk(run.feet), _jerk(run.held)], ".2f"),
        several([_figure(run.held, "turn")], ".1f"),
    ]


def over_all(runs: list[Run]) -> Iterator[tuple[str, str]]:
    """What holds over all runs, a line each."""
    floor, others = ([run for run in runs if run.floor_work == on] for on in (True, False))
    yield "runs in which something else than feet rests", f"{len(floor)} of {len(runs)}"
    heights = [height for run in floor if (height := _figure(run.held, "support_height")) is not None]
    spread = mean_and_largest(heights, largest=[run.highest for run in floor])
    yield "height of resting joints other than feet, mean / largest, % of leg", spread
    slide, slide_source = (
        np.mean([_figure(run.held, "support_slide", side) or 0.0 for run in floor]) for side in ("result", "source")
    )
    yield "their slide against the source's", f"{slide / slide_source:.2f}"
    rise = [np.subtract(*(_figure(each, "direction_error") or 0.0 for each in (run.held, run.feet))) for run in floor]
    yield "direction error over that with feet alone, mean / largest, degrees", mean_and_largest(rise)
    yield "jerk against the copy's, mean / largest", mean_and_largest([_jerk(run.held) for run in floor])
    turning = [run.name for run in runs if (_figure(run.held, "turn") or 0.0) > TURNS]
    named = "; ".join([str(len(turning)), *turning])
    yield f"runs in which a joint turns {TURNS:.0f} degrees more than the source's", named
    same = sum(run.same for run in others)
    yield "other runs, equal to those with feet alone digit for digit", f"{same} of {len(others)}"
    floor_only = sum(not run.same and len(run.held.supports.floor.joints) > 0 for run in others)
    yield "of the rest, those in which a joint is kept from going under the floor", str(floor_only)
    ratio = np.median([run.seconds[0] / run.seconds[1] for run in others])
    yield "their time against that with feet alone, median", f"{ratio:.2f}"


def draw(run: Run, folder: Path) -> None:
    """Draw source, rotation copy and result."""
    from draw import write_strip

    motions = [("source", run.held.source), ("rotation copy", run.held.rotation_copy), ("result", run.held.motion)]
    frames = np.linspace(0, len(run.held.motion) - 1, PICTURES).astype(int).tolist()
    view = "front" if run.clip.stem == "cartwheel" else "side"
    write_strip(folder / f"{run.clip.stem}_{run.body}.png", motions, frames, view=view)


@click.command(help=__doc__)
@corpus_argument
@markdown_option
@click.option("--sheet", type=Path, help="Draw a picture of each sample on each body into this folder.")
def main(corpus: Path, page: Path | None, sheet: Path | None) -> None:
    """Measure, print, and write tables and pictures where the command line says so."""
    samples = sorted((SAMPLES / "supports").glob("*.bvh"))
    clips = [*samples, *sorted(SAMPLES.glob("*.bvh")), *sorted(corpus.rglob("*.bvh"))]
    pairs = [(clip, body) for clip in clips for body in BODIES]
    with ProcessPoolExecutor(PROCESSES) as pool:
        runs = [run for run in pool.map(measured, *zip(*pairs, strict=True)) if run]
    of_samples = [run for run in runs if run.clip in samples]
    publish(
        {"supports": table(COLUMNS, map(cells, of_samples)), "supports over all": table(["", ""], over_all(runs))}, page
    )
    for run in of_samples if sheet else []:
        draw(run, sheet)


if __name__ == "__main__":
    main()
