"""Measure frames per second of files and a whole conversion; and cores, starting and memory.

    python benchmarks/speed.py CORPUS [--rounds 7] [--markdown PAGE]

CMU 12_01 of CORPUS goes to H of `clips.py`. Runs that are compared alternate, and the tables have medians over the
rounds, with the least and the largest: processor time on one thread, but for the two cores and the first run, which are
timed by the clock. The scoreboard has the speed of `retarget` and of other ways. Needs the extra `bench`, and a system
that counts processor time and memory of processes.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from timeit import Timer

import click
import numpy as np
import pybvh
from clips import HERO, LONG, SAMPLES, TARGETS, back_and_forth, corpus_argument, edited, markdown_option
from runs import alone, alternating
from tables import publish, table

from distretarget import Motion, Skeleton, read_bvh, retarget, write_bvh
from distretarget.numerics.vectors import Array

CLIP = "cmu_mb/12_01.bvh"
SAMPLE, CHILD = SAMPLES / "clap.bvh", SAMPLES / "child.json"
LEAST_SECONDS = 0.5  # processor time for which each run is repeated in a round
PEER = f"pybvh {version('pybvh')}"
COMPARED_WITH = {f"{what}, {PEER}": f"{what}, distretarget" for what in ("reading", "writing")}
VERY_LONG = 50_000  # frames of the clip whose memory is measured
CONVERT = """
import resource, sys
from distretarget import read_bvh, retarget, write_bvh
source = read_bvh(sys.argv[1])
result = retarget(source, read_bvh(sys.argv[2]).skeleton)
result.metrics
write_bvh(sys.argv[3], result.motion)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""

Runs = dict[str, Callable[[], object]]
Line = tuple[str, str, str]


# ---- frames per second


def of_files(clip: Path, source: Motion, body: Skeleton) -> Runs:
    """Reading and writing, metrics, and all that a conversion does."""
    written, result = clip.with_name("written.bvh"), retarget(source, body)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pybvh warns that it guesses the up axis
        peer = pybvh.read_bvh_file(clip)

    def measure_anew() -> None:
        baseline = replace(result.baseline, source=result.source[:], rotation_copy=result.rotation_copy[:])
        replace(result, baseline=baseline, motion=result.motion[:]).metrics  # noqa: B018

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


def rows(runs: Runs, frames: int, rounds: int) -> Iterator[tuple[str, str, str, str]]:
    """For each run: frames per second, and its time relative to that of its counterpart."""
    for run in runs.values():
        run()
    repeats = [int(np.ceil(LEAST_SECONDS / Timer(run).timeit(1))) for run in runs.values()]
    seconds = dict(zip(runs, alternating([*runs.values()], rounds, repeats=repeats).T, strict=True))
    for name, times in seconds.items():
        speed, ratio = frames / times, np.median(times / seconds[COMPARED_WITH.get(name, name)])
        yield name, f"{np.median(speed):,.0f}", f"{speed.min():,.0f} to {speed.max():,.0f}", f"{ratio:.2f}"


# ---- cores, starting and memory


def core_line(source: Motion, body: Skeleton, rounds: int) -> Line:
    """The gain from a second core for one clip."""
    clip = back_and_forth(source, LONG)

    def run(threads: str) -> None:
        os.environ["OMP_NUM_THREADS"] = threads
        retarget(clip, body)

    times = alternating([partial(run, "1"), partial(run, "2")], rounds, time.perf_counter)
    os.environ["OMP_NUM_THREADS"] = "1"
    return _line(f"two cores over one, {LONG:,} frames: frames/s", times[:, 0] / times[:, 1])


def start_lines(clip: Path, folder: Path, rounds: int) -> Iterator[Line]:
    """The cost of starting a process, relative to imports."""
    program, output = [sys.executable, "-m", "distretarget"], str(folder / "out.bvh")
    convert = [*program, str(clip), str(CHILD), "-o", output, "--overwrite"]
    imports = [[sys.executable, "-c", f"import {what}"] for what in ("numpy", "numpy, scipy.spatial.transform")]
    commands = [[*program, "--version"], imports[0], convert, imports[1]]

    def time_of_children() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    times = alternating([partial(_run, command) for command in commands], rounds, time_of_children)
    yield _line("`--version` over `import numpy`, processor time", times[:, 0] / times[:, 1])
    yield _line("524 frames over `import numpy, scipy.spatial.transform`, processor time", times[:, 2] / times[:, 3])
    clap = [*program, str(SAMPLE), str(HERO), "-o", str(folder / "clap.glb"), "--overwrite"]
    seconds = alternating([partial(_run, clap)], rounds, time.perf_counter)[:, 0]
    yield _line("clap onto the hero, a process [s]", seconds)


def memory_line(source: Motion, body: Skeleton, folder: Path) -> Line:
    """The peak memory of a very long clip."""
    clip = back_and_forth(source, VERY_LONG)
    long, target, output = (folder / name for name in ("very_long.bvh", "target.bvh", "very_long_out.bvh"))
    write_bvh(long, clip)
    write_bvh(target, Motion(body, clip.root_positions[:1], clip.rotations[:1], clip.frame_time_text))
    peak = float(_run([sys.executable, "-c", CONVERT, str(long), str(target), str(output)]))
    arrays = VERY_LONG * len(body) * 7 * 8 / 1e6
    what = f"peak memory of {VERY_LONG:,} frames of {len(body)} joints, with 7 numbers each ({arrays:.0f} MB) [MB]"
    return what, f"{peak:.0f}", ""


def _run(command: list[str]) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True, cwd=SAMPLES.parent).stdout


def measured(clip: Path, rounds: int) -> dict[str, str]:
    """The tables."""
    source = read_bvh(clip)
    body = edited(source.rigid_skeleton, TARGETS["H"])
    head = " | frames/s, median | slowest to fastest | time over distretarget's"
    with tempfile.TemporaryDirectory() as name:
        folder, motion = Path(name), back_and_forth(source, LONG)
        write_bvh(folder / "long.bvh", motion)
        lines = [core_line(source, body, rounds), *start_lines(clip, folder, rounds)]
        return {
            "files": table(head, rows(of_files(folder / "long.bvh", motion, body), LONG, rounds)),
            "scaling": table(" | median | least to largest", [*lines, memory_line(source, body, folder)]),
        }


def _line(what: str, values: Array) -> Line:
    return what, f"{np.median(values):.2f}", f"{values.min():.2f} to {values.max():.2f}"


@click.command(help=__doc__)
@corpus_argument
@markdown_option
@click.option("--rounds", default=7, show_default=True)
def main(corpus: Path, page: Path | None, rounds: int) -> None:
    """Measure, print, and write the tables if a page is given."""
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else every process compiles the sources
    publish(alone(measured, (corpus / CLIP).resolve(), rounds), page)


if __name__ == "__main__":
    main()
