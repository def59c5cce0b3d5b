"""Measure frames per second of `retarget`, of mink's inverse kinematics on the same body, and of reading and writing.

    python benchmarks/speed.py CLIP.bvh [--target H] [--rounds 7] [--markdown PAGE]

Each contestant runs in a separate process with one thread. Processor time is measured there, so that neither more cores
nor other programs matter; compiling is not counted. The contestants run alternately, and the tables have medians over
the rounds. With a page, its tables are written, and a picture of them beside it. Needs the extra `bench`.
"""

from __future__ import annotations

import os
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
import pybvh
from clips import LONG, back_and_forth, markdown_option
from edits import TARGETS, edited
from inverse_kinematics import SOLVER, Gmr, InverseKinematics
from matplotlib.figure import Figure
from numpy.typing import NDArray
from tables import publish, table

from distretarget import Motion, Options, Skeleton, read_bvh, retarget, write_bvh
from distretarget.pipeline.options import OBJECTIVES

LEAST_SECONDS = 0.5  # of processor time, for which each contestant runs in each round
GMR = f"mink {version('mink')} with {SOLVER}, the recipe of GMR"
STEPS = {f"mink {version('mink')} with {SOLVER}, {n} step{'s' * (n > 1)} a frame": n for n in (1, 3)}
OBJECTIVE_OF = {f"`retarget`, {objective}": objective for objective in OBJECTIVES}
READING, WRITING = "reading, distretarget", "writing, distretarget"
READING_PEER, WRITING_PEER = (f"{what}, pybvh {version('pybvh')}" for what in ("reading", "writing"))
METRICS = "metrics"
ALL = "a whole conversion: reading, retargeting, metrics, writing"
CLIP = (*OBJECTIVE_OF, *STEPS, GMR)  # contestants that pose the frames of the clip
LONG_CLIP = (READING, READING_PEER, WRITING, WRITING_PEER, METRICS, ALL)  # contestants that get the long clip
COMPARED_WITH = dict.fromkeys(CLIP, CLIP[0]) | {READING_PEER: READING, WRITING_PEER: WRITING}
PEERS = {*STEPS, GMR, READING_PEER, WRITING_PEER}
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # set to 1 before numpy is imported
OWN, OTHER, LABEL, GRID = "#2a7f9e", "#b8c0ca", "#3b4252", "#dfe3e8"  # colours of the picture

Times = Mapping[str, NDArray[np.float64]]
"""Processor seconds of each round, by contestant."""


class Contestant(NamedTuple):
    """A way of doing something with all frames of a clip: `run` does it; `miss` says, from what `run` returns, how far
    the ends are from their given places [% of leg length], None if the contestant is given no places.
    """

    run: Callable[[], object]
    miss: Callable[[NDArray[np.float64]], float] | None = None


_worker: dict[str, Contestant] = {}  # the one contestant of this process, by its name


def contestant(clip: Path, target: str, name: str) -> Contestant:
    """The contestant with this name, one of `CLIP` or `LONG_CLIP`."""
    source = read_bvh(clip)
    body = edited(source.rigid_skeleton, TARGETS[target])
    if name in LONG_CLIP:
        return Contestant(_file_runs(clip, source, body)[name])
    if name in OBJECTIVE_OF:
        return Contestant(lambda: retarget(source, body, Options(objective=OBJECTIVE_OF[name])).motion.positions)
    peer = (Gmr if name == GMR else InverseKinematics)(retarget(source, body))
    return Contestant(lambda: peer.solve(STEPS.get(name, 0)), peer.miss)


def _file_runs(clip: Path, source: Motion, body: Skeleton) -> dict[str, Callable[[], object]]:
    """The functions that `LONG_CLIP` names."""
    written = clip.with_suffix(f".{os.getpid()}.bvh")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pybvh warns that it guesses the up axis
        peer = pybvh.read_bvh_file(clip)

    result = retarget(source, body)
    motions = {"source": result.source, "rotation_copy": result.rotation_copy, "motion": result.motion}

    def measure_anew() -> None:
        replace(result, **{name: motion[:] for name, motion in motions.items()}).metrics  # noqa: B018

    def convert() -> None:
        result = retarget(read_bvh(clip), body)
        result.metrics  # noqa: B018 - they are computed when they are asked for
        write_bvh(written, result.motion, overwrite=True)

    return {
        READING: lambda: read_bvh(clip),
        READING_PEER: lambda: pybvh.read_bvh_file(clip, world_up="+y"),
        WRITING: lambda: write_bvh(written, source, overwrite=True),
        WRITING_PEER: lambda: pybvh.write_bvh_file(peer, written),
        METRICS: measure_anew,
        ALL: convert,
    }


def _prepared(clip: Path, target: str, name: str) -> str:
    """Prepare a contestant in its process and run it once; return its miss."""
    run, miss = _worker[name] = contestant(clip, target, name)
    return f"{miss(run()):.2f}" if miss else ""


def _seconds(name: str) -> float:
    """Processor seconds of a run, the mean over several."""
    run = _worker[name].run
    run()
    started, runs, spent = time.process_time(), 0, 0.0
    while spent < LEAST_SECONDS:
        run()
        runs, spent = runs + 1, time.process_time() - started
    return spent / runs


def measure(clip: Path, target: str, rounds: int, names: Sequence[str]) -> tuple[Times, dict[str, str]]:
    """For each contestant, processor seconds of each round, and the mean miss of its ends.

    Each runs in a separate process: in a shared one, each run slows the next.
    """
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    with ExitStack() as stack:
        pools = {name: stack.enter_context(ProcessPoolExecutor(1, get_context("spawn"))) for name in names}
        misses = {name: pool.submit(_prepared, clip, target, name).result() for name, pool in pools.items()}
        seconds = [[pool.submit(_seconds, name).result() for name, pool in pools.items()] for _ in range(rounds)]
    return dict(zip(names, np.transpose(seconds), strict=True)), misses


def rows(frames: int, seconds: Times) -> Iterator[list[str]]:
    """For each contestant: frames per second, and its time relative to that of the one it is compared with."""
    for name, times in seconds.items():
        speed, ratio = frames / times, np.median(times / seconds[COMPARED_WITH.get(name, name)])
        yield [name, f"{np.median(speed):,.0f}", f"{speed.min():,.0f} to {speed.max():,.0f}", f"{ratio:.2f}"]


def draw_bars(path: Path, speeds: Mapping[str, float]) -> None:
    """Draw a bar for each speed, from top to bottom, on a logarithmic scale."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure = Figure((9.0, 0.34 * (len(speeds) + 2)), dpi=120, layout="constrained")
    ax = figure.add_subplot()
    colours = [OTHER if name in PEERS else OWN for name in speeds]
    bars = ax.barh([name.replace("`", "") for name in speeds], list(speeds.values()), color=colours, height=0.72)
    ax.bar_label(bars, fmt="{:,.0f}", padding=4, color=LABEL)
    ax.invert_yaxis()
    ax.set(xscale="log", xlim=(min(speeds.values()) / 3.0, max(speeds.values()) * 3.0))
    ax.grid(axis="x", color=GRID)
    ax.set_axisbelow(True)
    ax.spines[:].set_visible(False)
    ax.tick_params(length=0, which="both", labelcolor=LABEL)
    ax.set_title("frames per second on one core", loc="left", color=LABEL, fontsize=11)
    figure.savefig(path, facecolor="white")


@click.command(help=__doc__)
@click.argument("clip", type=Path)
@markdown_option
@click.option("--target", type=click.Choice(list(TARGETS)), default="H")
@click.option("--rounds", default=7, show_default=True)
def main(clip: Path, page: Path | None, target: str, rounds: int) -> None:
    """Measure, print, and write tables and picture if a page is given."""
    source = read_bvh(clip)
    seconds, misses = measure(clip, target, rounds, CLIP)
    with tempfile.TemporaryDirectory() as folder:
        long = Path(folder) / "long.bvh"
        write_bvh(long, back_and_forth(source, LONG))
        of_files, _ = measure(long, target, rounds, LONG_CLIP)
    print(f"{clip.name} on {target}, {len(source)} frames, {len(source.skeleton)} joints\n")
    head = " | frames/s, median | slowest to fastest"
    clip_rows = ([*cells, misses[cells[0]]] for cells in rows(len(source), seconds))
    tables = {
        "speed": table(f"{head} | time over contact's | hands, feet and hips off their goals, % of leg", clip_rows),
        "files": table(f"{head} | time over distretarget's", rows(LONG, of_files)),
    }
    publish(tables, page)
    if page:
        speeds = {name: np.median(len(source) / times) for name, times in seconds.items()}
        speeds |= {name: np.median(LONG / times) for name, times in of_files.items()}
        draw_bars(page.parent / "pictures" / "speed.png", speeds)


if __name__ == "__main__":
    main()
