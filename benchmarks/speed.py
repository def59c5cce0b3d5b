"""Measure frames per second: of `retarget` and of mink's inverse kinematics on the same body; of reading and writing.

    python benchmarks/speed.py CLIP.bvh [--target H] [--rounds 7] [--markdown PAGE]

Each contestant runs in a separate process with one thread. Processor time is measured there, so that neither more cores
nor other programs matter; compiling is not counted. The contestants run alternately, and the tables have medians over
the rounds. With a page, its tables are written, and a picture of them beside it. Needs the extra `bench`.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pybvh
from clips import LONG, back_and_forth
from edits import TARGETS, edited
from inverse_kinematics import SOLVER, Gmr, InverseKinematics
from numpy.typing import NDArray
from speed_picture import Bar, draw_bars
from tables import insert

from distretarget import Motion, Options, read_bvh, retarget, write_bvh
from distretarget.pipeline.options import OBJECTIVES
from distretarget.skeleton import Skeleton

LEAST_SECONDS = 0.5  # of processor time, for which each contestant runs in each round
GMR = f"mink {version('mink')} with {SOLVER}, the recipe of GMR"
STEPS = {f"mink {version('mink')} with {SOLVER}, {n} step{'s' * (n > 1)} a frame": n for n in (1, 3)}
OBJECTIVE_OF = {f"`retarget`, {objective}": objective for objective in OBJECTIVES}
READING, WRITING = "reading, distretarget", "writing, distretarget"
READING_PEER, WRITING_PEER = (f"{what}, pybvh {version('pybvh')}" for what in ("reading", "writing"))
ALL = "a whole conversion: reading, retargeting, figures, writing"
CLIP = (*OBJECTIVE_OF, *STEPS, GMR)  # contestants that pose the frames of the clip
LONG_CLIP = (READING, READING_PEER, WRITING, WRITING_PEER, ALL)  # contestants that get the long clip
COMPARED_WITH = {READING_PEER: READING, WRITING_PEER: WRITING}
PEERS = {*STEPS, GMR, *COMPARED_WITH}
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # set to 1 before numpy is imported


class Contestant(NamedTuple):
    """A way of doing something with all frames of a clip.

    Attributes:
        run: does it.
        miss: from what `run` returns, how far the ends are from their given places [% of leg length]; None if the
            contestant is given no places.
    """

    run: Callable[[], object]
    miss: Callable[[NDArray[np.float64]], float] | None = None


_worker: dict[str, Contestant] = {}  # the one contestant of this process, by its name


def contestant(clip: Path, target: str, name: str) -> Contestant:
    """The contestant with this name, one of `CLIP` or `LONG_CLIP`, ready to run."""
    source = read_bvh(clip)
    body = edited(source.rigid_skeleton, TARGETS[target])
    if name in LONG_CLIP:
        return Contestant(_file_runs(clip, source, body)[name])
    if name in OBJECTIVE_OF:
        return Contestant(lambda: retarget(source, body, Options(objective=OBJECTIVE_OF[name])).motion.positions)
    result = retarget(source, body)
    if name == GMR:
        gmr = Gmr(result)
        return Contestant(gmr.solve, gmr.miss)
    peer = InverseKinematics(result)
    return Contestant(lambda: peer.solve(STEPS[name]), peer.miss)


def _file_runs(clip: Path, source: Motion, body: Skeleton) -> dict[str, Callable[[], object]]:
    """What each of `LONG_CLIP` does."""
    written = clip.with_suffix(f".{os.getpid()}.bvh")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pybvh warns that it guesses the up axis
        peer = pybvh.read_bvh_file(clip)

    def convert() -> None:
        result = retarget(read_bvh(clip), body)
        result.figures  # noqa: B018 - they are computed when they are asked for
        write_bvh(written, result.motion, overwrite=True)

    return {
        READING: lambda: read_bvh(clip),
        READING_PEER: lambda: pybvh.read_bvh_file(clip, world_up="+y"),
        WRITING: lambda: write_bvh(written, source, overwrite=True),
        WRITING_PEER: lambda: pybvh.write_bvh_file(peer, written),
        ALL: convert,
    }


def _prepare(clip: Path, target: str, name: str) -> None:
    """Prepare a contestant in its process."""
    _worker[name] = contestant(clip, target, name)


def _seconds(name: str) -> float:
    """Processor seconds of a run, the mean over runs that follow each other."""
    _worker[name].run()
    started, runs, spent = time.process_time(), 0, 0.0
    while spent < LEAST_SECONDS:
        _worker[name].run()
        runs, spent = runs + 1, time.process_time() - started
    return spent / runs


def _miss(name: str) -> str:
    contestant = _worker[name]
    return f"{contestant.miss(contestant.run()):.2f}" if contestant.miss else ""


def measure(
    clip: Path, target: str, rounds: int, names: Sequence[str]
) -> tuple[dict[str, NDArray[np.float64]], dict[str, str]]:
    """For each contestant, processor seconds of each round, and the mean miss of its ends.

    Each runs in a separate process: in a shared one, each run slows the next.
    """
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    context = get_context("spawn")
    with ExitStack() as stack:
        workers = {
            name: stack.enter_context(ProcessPoolExecutor(1, context, _prepare, (clip, target, name))) for name in names
        }
        misses = {name: worker.submit(_miss, name).result() for name, worker in workers.items()}
        seconds = [[workers[name].submit(_seconds, name).result() for name in names] for _ in range(rounds)]
    return dict(zip(names, np.transpose(seconds), strict=True)), misses


def clip_table(frames: int, seconds: dict[str, NDArray[np.float64]], misses: dict[str, str]) -> str:
    """The table of those that pose the frames of the clip, in Markdown."""
    lines = [
        "| | frames/s, median | slowest to fastest | time over contact's | miss of hands, feet and hips, % of leg |",
        "|---|---|---|---|---|",
    ]
    contact = seconds[CLIP[0]]
    lines += [f"{_cells(name, frames, seconds[name], contact)} {misses[name]} |" for name in seconds]
    return "\n".join(lines) + "\n"


def files_table(frames: int, seconds: dict[str, NDArray[np.float64]]) -> str:
    """The table of those that get the long clip, in Markdown."""
    lines = ["| | frames/s, median | slowest to fastest | time over distretarget's |", "|---|---|---|---|"]
    lines += [_cells(name, frames, times, seconds[COMPARED_WITH.get(name, name)]) for name, times in seconds.items()]
    return "\n".join(lines) + "\n"


def _cells(name: str, frames: int, times: NDArray[np.float64], others: NDArray[np.float64]) -> str:
    """The first cells of a line: frames per second, and the time over that of another contestant."""
    speed = frames / times
    ratio = np.median(times / others)
    return f"| {name} | {np.median(speed):,.0f} | {speed.min():,.0f} to {speed.max():,.0f} | {ratio:.2f} |"


def main() -> None:
    """Measure, print, and write tables and picture if a page is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clip", type=Path, metavar="CLIP.bvh")
    parser.add_argument("--target", choices=TARGETS, default="H")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--markdown", type=Path, metavar="PAGE", help="write the tables into this page")
    arguments = parser.parse_args()
    source = read_bvh(arguments.clip)
    seconds, misses = measure(arguments.clip, arguments.target, arguments.rounds, CLIP)
    with tempfile.TemporaryDirectory() as folder:
        long = Path(folder) / "long.bvh"
        write_bvh(long, back_and_forth(source, LONG))
        of_files, _ = measure(long, arguments.target, arguments.rounds, LONG_CLIP)
    tables = {"speed": clip_table(len(source), seconds, misses), "files": files_table(LONG, of_files)}
    print(f"{arguments.clip.name} on {arguments.target}, {len(source)} frames, {len(source.skeleton)} joints\n")
    print("\n".join(tables.values()))
    if arguments.markdown:
        insert(arguments.markdown, tables)
        bars = [
            Bar(name.replace("`", ""), float(np.median(frames / times)), name not in PEERS)
            for frames, group in ((len(source), seconds), (LONG, of_files))
            for name, times in group.items()
        ]
        draw_bars(bars, "frames per second on one core", arguments.markdown.parent / "pictures" / "speed.png")


if __name__ == "__main__":
    main()
