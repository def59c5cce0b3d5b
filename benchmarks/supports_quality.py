"""Measure supports: hands, knees and all else that rests on the world, apart from the feet.

    python benchmarks/supports_quality.py CORPUS [--markdown docs/results.md] [--sheet FOLDER]

Retargets the samples with supports (`sample_bvh/supports`) and the real clips of CORPUS to two bodies, H and child,
once with supports and once with the feet alone. Prints a line for each sample and body, and what holds over all runs.
`--sheet` draws source, rotation copy and result of each sample; it needs matplotlib (the extra `docs`).
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from clips import SAMPLES
from edits import TARGETS, edited
from tables import insert

from distretarget import DistretargetError, Options, RetargetResult, read_bvh, retarget
from distretarget.measure.figures import Variant

BODIES = ("child", "H")
FRAMES = 1500  # of each clip
PICTURES = 8  # frames of a picture
TURNS = 30.0  # a joint that turns by this much more than the source's between two frames at 60 fps [degrees]


@dataclass(frozen=True)
class Run:
    """A clip on a body: with supports (`held`), and with the feet alone (`feet`)."""

    clip: Path
    body: str
    held: RetargetResult
    feet: RetargetResult
    seconds: tuple[float, float]

    @property
    def floor_work(self) -> bool:
        """Whether anything but a foot rests."""
        return len(self.held.supports.joints) > self.held.supports.feet

    @property
    def same(self) -> bool:
        """Whether both results are the same, digit for digit."""
        one, other = (result.motion for result in (self.held, self.feet))
        return bool((one.rotations == other.rotations).all() and (one.translations == other.translations).all())

    @property
    def highest(self) -> float:
        """How far a joint that rests on the floor is at most off its height [% of leg length]."""
        supports = self.held.comparison.supports
        return float(np.where(supports.on_floor, supports.height, 0.0).max(initial=0.0))


def measured(clip: Path, body: str) -> Run | None:
    """Retarget a clip to a body; None where it cannot be."""
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
    return Run(clip, body, results[0], results[1], (seconds[0], seconds[1]))


def line(run: Run) -> str:
    """The figures of a run as a row of a table: rotation copy / feet alone / supports."""
    return " | ".join(
        [
            f"{run.clip.stem} on {run.body}",
            f"{_three(run, 'support_height', 2)} ({run.highest:.2f})",
            f"{_three(run, 'support_slide', 3)} ({_number(run.held, 'support_slide', 3, 'source')})",
            f"{_three(run, 'slide', 3)} ({_number(run.held, 'slide', 3, 'source')})",
            _three(run, "foot_height", 2),
            _three(run, "direction_error", 1),
            f"{_jerk(run.feet):.2f} / {_jerk(run.held):.2f}",
            _number(run.held, "turn", 1),
        ]
    )


def over_all(runs: list[Run]) -> Iterator[str]:
    """What holds over all runs, a line each."""
    floor, others = ([run for run in runs if run.floor_work == on] for on in (True, False))
    yield f"| runs in which something else than feet rests | {len(floor)} of {len(runs)} |"
    heights = [height for run in floor if (height := run.held.figures["result"]["support_height"]) is not None]
    spread = f"{np.mean(heights):.2f} / {max(run.highest for run in floor):.2f}"
    yield f"| height of resting joints other than feet, mean / largest, % of leg | {spread} |"
    slide, slide_source = (
        np.mean([run.held.figures[side]["support_slide"] or 0.0 for run in floor]) for side in ("result", "source")
    )
    yield f"| their slide against the source's | {slide / slide_source:.2f} |"
    rise = [_direction(run.held) - _direction(run.feet) for run in floor]
    more = f"{np.mean(rise):.2f} / {max(rise):.2f}"
    yield f"| direction error over that with feet alone, mean / largest, degrees | {more} |"
    jerks = [_jerk(run.held) for run in floor]
    yield f"| jerk against the copy's, mean / largest | {np.mean(jerks):.2f} / {max(jerks):.2f} |"
    turning = [run for run in runs if (run.held.figures["result"]["turn"] or 0.0) > TURNS]
    named = "".join(f"; {run.clip.stem} on {run.body}" for run in turning)
    yield f"| runs in which a joint turns {TURNS:.0f} degrees more than the source's | {len(turning)}{named} |"
    same = sum(run.same for run in others)
    yield f"| other runs, equal to those with feet alone digit for digit | {same} of {len(others)} |"
    floor_only = sum(not run.same and len(run.held.supports.floor.joints) > 0 for run in others)
    yield f"| of the rest, those in which a joint is kept from going under the floor | {floor_only} |"
    ratio = np.median([run.seconds[0] / run.seconds[1] for run in others])
    yield f"| their time against that with feet alone, median | {ratio:.2f} |"


def _three(run: Run, key: str, decimals: int) -> str:
    sides = (
        _number(run.held, key, decimals, "rotation_copy"),
        *(_number(r, key, decimals) for r in (run.feet, run.held)),
    )
    return " / ".join(sides)


def _number(result: RetargetResult, key: str, decimals: int, side: Variant = "result") -> str:
    value = result.figures[side][key]
    return "-" if value is None else f"{value:.{decimals}f}"


def _direction(result: RetargetResult) -> float:
    return result.figures["result"]["direction_error"] or 0.0


def _jerk(result: RetargetResult) -> float:
    figures = result.figures
    return (figures["result"]["jerk"] or 0.0) / (figures["rotation_copy"]["jerk"] or 1.0)


def draw(run: Run, folder: Path) -> None:
    """Draw source, rotation copy and result."""
    from draw import draw_strip

    motions = [("source", run.held.source), ("rotation copy", run.held.rotation_copy), ("result", run.held.motion)]
    frames = np.linspace(0, len(run.held.motion) - 1, PICTURES).astype(int).tolist()
    view = "front" if run.clip.stem == "cartwheel" else "side"
    draw_strip(motions, frames, folder / f"{run.clip.stem}_{run.body}.png", view=view)


def main() -> None:
    """Measure, print, and write tables and pictures where the command line says so."""
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path, metavar="CORPUS")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="write the tables into this page")
    parser.add_argument("--sheet", type=Path, metavar="FOLDER", help="draw a picture of each sample on each body")
    arguments = parser.parse_args()
    samples = sorted((SAMPLES / "supports").glob("*.bvh"))
    clips = [*samples, *sorted(SAMPLES.glob("*.bvh")), *sorted(arguments.corpus.rglob("*.bvh"))]
    pairs = [(clip, body) for clip in clips for body in BODIES]
    with ProcessPoolExecutor(2) as pool:
        runs = [run for run in pool.map(measured, *zip(*pairs, strict=True)) if run]
    columns = [
        "run; rotation copy / feet alone / supports",
        "height of supports, % of leg (largest)",
        "slide of supports, legs/s (source)",
        "slide of feet (source)",
        "foot height",
        "direction error, degrees",
        "jerk / copy's",
        "turn, degrees",
    ]
    head = f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|\n"
    tables = {
        "supports": head + "".join(f"| {line(run)} |\n" for run in runs if run.clip in samples),
        "supports over all": "| | |\n|---|---|\n" + "".join(f"{row}\n" for row in over_all(runs)),
    }
    print("\n".join(tables.values()))
    if arguments.markdown:
        insert(arguments.markdown, tables)
    for run in runs:
        if arguments.sheet and run.clip in samples:
            draw(run, arguments.sheet)


if __name__ == "__main__":
    main()
