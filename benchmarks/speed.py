"""Measure frames per second of `retarget`, of reading and writing beside pybvh's, and of a whole conversion.

    python benchmarks/speed.py CLIP.bvh [--target H] [--rounds 7] [--markdown PAGE]

Processor time on one thread; compiling is not counted. The runs alternate, and the tables have medians over the rounds.
The scoreboard has the speed of other ways of retargeting. Needs the extra `bench`.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from timeit import Timer

import click
import numpy as np
import pybvh
from clips import LONG, back_and_forth, markdown_option
from edits import TARGETS, edited
from tables import publish, table
from timing import alone, alternating

from distretarget import Motion, Options, Skeleton, read_bvh, retarget, write_bvh
from distretarget.pipeline.options import OBJECTIVES

LEAST_SECONDS = 0.5  # of processor time, for which each run is repeated in a round
PEER = f"pybvh {version('pybvh')}"
FASTEST = f"`retarget`, {OBJECTIVES[0]}"
COMPARED_WITH = {f"{what}, {PEER}": f"{what}, distretarget" for what in ("reading", "writing")}

Runs = dict[str, Callable[[], object]]


def of_clip(source: Motion, body: Skeleton) -> Runs:
    """Retargeting by each objective."""

    def by(objective: str) -> Callable[[], object]:
        return lambda: retarget(source, body, Options(objective=objective))

    return {f"`retarget`, {objective}": by(objective) for objective in OBJECTIVES}


def of_files(clip: Path, source: Motion, body: Skeleton) -> Runs:
    """Reading and writing, metrics, and all that a conversion does."""
    written, result = clip.with_name("written.bvh"), retarget(source, body)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pybvh warns that it guesses the up axis
        peer = pybvh.read_bvh_file(clip)
    motions = {"source": result.source, "rotation_copy": result.rotation_copy, "motion": result.motion}

    def measure_anew() -> None:
        replace(result, **{name: motion[:] for name, motion in motions.items()}).metrics  # noqa: B018

    def convert() -> None:
        result = retarget(read_bvh(clip), body)
        result.metrics  # noqa: B018 - they are computed when they are asked for
        write_bvh(written, result.motion, overwrite=True)

    return {
        "reading, distretarget": lambda: read_bvh(clip),
        f"reading, {PEER}": lambda: pybvh.read_bvh_file(clip, world_up="+y"),
        "writing, distretarget": lambda: write_bvh(written, source, overwrite=True),
        f"writing, {PEER}": lambda: pybvh.write_bvh_file(peer, written),
        "metrics": measure_anew,
        "a whole conversion: reading, retargeting, metrics, writing": convert,
    }


def rows(runs: Runs, frames: int, rounds: int) -> list[list[str]]:
    """For each run: frames per second, and its time relative to that of the one it is compared with."""
    for run in runs.values():
        run()
    repeats = [int(np.ceil(LEAST_SECONDS / Timer(run).timeit(1))) for run in runs.values()]
    seconds = dict(zip(runs, alternating([*runs.values()], rounds, repeats=repeats).T, strict=True))
    return [[name, *_cells(frames / times, times / seconds[_other(name, runs)])] for name, times in seconds.items()]


def _other(name: str, runs: Runs) -> str:
    return FASTEST if FASTEST in runs else COMPARED_WITH.get(name, name)


def _cells(speed: np.ndarray, ratio: np.ndarray) -> Iterator[str]:
    yield f"{np.median(speed):,.0f}"
    yield f"{speed.min():,.0f} to {speed.max():,.0f}"
    yield f"{np.median(ratio):.2f}"


def measured(clip: Path, target: str, rounds: int) -> dict[str, str]:
    """The tables."""
    source = read_bvh(clip)
    body, head = edited(source.rigid_skeleton, TARGETS[target]), " | frames/s, median | slowest to fastest | time over"
    with tempfile.TemporaryDirectory() as folder:
        long, motion = Path(folder) / "long.bvh", back_and_forth(source, LONG)
        write_bvh(long, motion)
        return {
            "speed": table(f"{head} contact's", rows(of_clip(source, body), len(source), rounds)),
            "files": table(f"{head} distretarget's", rows(of_files(long, motion, body), LONG, rounds)),
        }


@click.command(help=__doc__)
@click.argument("clip", type=Path)
@markdown_option
@click.option("--target", type=click.Choice(list(TARGETS)), default="H")
@click.option("--rounds", default=7, show_default=True)
def main(clip: Path, page: Path | None, target: str, rounds: int) -> None:
    """Measure, print, and write the tables if a page is given."""
    publish(alone(measured, clip, target, rounds), page)


if __name__ == "__main__":
    main()
