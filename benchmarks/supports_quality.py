"""Measure supports: hands, knees and other parts of the body that rest on the world, apart from the feet.

    python benchmarks/supports_quality.py CORPUS [--markdown docs/results.md]

Retargets the samples with supports (`sample_bvh/supports`) and the real clips of CORPUS to two bodies, H and child,
once with supports and once with the feet alone. Prints a line for each sample and body, and what holds over all runs.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import click
import numpy as np
from clips import SAMPLES, corpus_argument, markdown_option
from edits import TARGETS, edited
from runs import in_processes
from tables import mean_and_largest, publish, several, table

from distretarget import DistretargetError, Options, RetargetResult, read_bvh, retarget

BODIES = ("child", "H")
FRAMES = 1500  # of each clip
TURNS = 30.0  # a joint that turns by this much more than the source's between two frames at 60 fps [degrees]
COLUMNS = (
    "run | height of supports, % of leg (largest) | skate of supports, legs/s (source) | "
    "direction error, degrees: feet / supports | jerk / copy's: feet / supports | turn, degrees"
)


@dataclass(frozen=True)
class Run:
    """A clip on a body, retargeted with supports (`held`) and with the feet alone (`feet`)."""

    clip: Path
    body: str
    held: RetargetResult
    feet: RetargetResult

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

    def metrics(self, key: str) -> list[float | None]:
        """A metric of source, rotation copy, feet alone and supports."""
        held, feet = self.held.metrics, self.feet.metrics
        return [each.get(key) for each in (held["source"], held["rotation_copy"], feet["result"], held["result"])]

    @property
    def jerk(self) -> list[float]:
        """The jerk with the feet alone and with supports, over the rotation copy's."""
        _, copy, feet, held = (value or 0.0 for value in self.metrics("jerk"))
        return [feet / (copy or 1.0), held / (copy or 1.0)]

    def cells(self) -> Iterator[str]:
        """The row of the run."""
        yield self.name
        yield f"{several(self.metrics('support_height')[1:], '.2f')} ({self.highest:.2f})"
        source, *others = self.metrics("support_skate")
        yield f"{several(others, '.3f')} ({several([source], '.3f')})"
        yield several(self.metrics("direction_error")[2:], ".1f")
        yield several(self.jerk, ".2f")
        yield several(self.metrics("turn")[-1:], ".1f")


def measured(clip: Path, body: str) -> Run | None:
    """Retarget a clip to a body; None if it is refused."""
    warnings.simplefilter("ignore")
    try:
        motion = read_bvh(clip)[:FRAMES]
        target = edited(motion.rigid_skeleton, TARGETS[body])
        return Run(clip, body, *(retarget(motion, target, Options(supports=each)) for each in ("hold", "feet")))
    except DistretargetError:
        return None


def over_all(runs: list[Run]) -> Iterator[tuple[str, str]]:
    """The lines of the summary over all runs."""
    floor, others = ([run for run in runs if run.floor_work == on] for on in (True, False))
    yield "runs in which something else than feet rests", f"{len(floor)} of {len(runs)}"
    heights = [height for run in floor if (height := run.metrics("support_height")[-1]) is not None]
    spread = mean_and_largest(heights, largest=[run.highest for run in floor])
    yield "height of resting joints other than feet, mean / largest, % of leg", spread
    slides = np.array([run.metrics("support_skate") for run in floor], float)[:, [0, -1]]
    source, result = np.nan_to_num(slides).mean(axis=0)
    yield "their skate against the source's", f"{result / source:.2f}"
    feet = np.nan_to_num(np.array([run.metrics("foot_skate") for run in floor], float))
    yield "foot skate off the source's, largest, legs/s", f"{abs(feet[:, -1] - feet[:, 0]).max():.3f}"
    feet = np.nan_to_num(np.array([run.metrics("foot_height")[-1] for run in floor], float))
    yield "foot height, largest, % of leg", f"{feet.max():.2f}"
    errors = np.nan_to_num(np.array([run.metrics("direction_error")[2:] for run in floor], float))
    rise = mean_and_largest(errors[:, 1] - errors[:, 0])
    yield "direction error over that with feet alone, mean / largest, degrees", rise
    yield "jerk against the copy's, mean / largest", mean_and_largest([run.jerk[1] for run in floor])
    turning = [run.name for run in runs if (run.metrics("turn")[-1] or 0.0) > TURNS]
    named = "; ".join([str(len(turning)), *turning])
    yield f"runs in which a joint turns {TURNS:.0f} degrees more than the source's", named
    same = sum(run.same for run in others)
    yield "other runs, equal to those with feet alone digit for digit", f"{same} of {len(others)}"
    floor_only = sum(not run.same and len(run.held.supports.floor.joints) > 0 for run in others)
    yield "of the rest, those in which a joint is kept from going under the floor", str(floor_only)


@click.command(help=__doc__)
@corpus_argument
@markdown_option
def main(corpus: Path, page: Path | None) -> None:
    """Measure, print, and write the tables if a page is given."""
    samples = sorted((SAMPLES / "supports").glob("*.bvh"))
    clips = [*samples, *sorted(SAMPLES.glob("*.bvh")), *sorted(corpus.rglob("*.bvh"))]
    runs = [*filter(None, in_processes(measured, product(clips, BODIES)))]
    lines = (run.cells() for run in runs if run.clip in samples)
    publish({"supports": table(COLUMNS, lines), "supports over all": table(["", ""], over_all(runs))}, page)


if __name__ == "__main__":
    main()
