"""Measure how the time of `retarget` grows with joints and falls with cores, and what starting and memory take.

    python benchmarks/scaling.py CORPUS [--rounds 9] [--markdown PAGE]

Contestants of a line run alternately; a line has the median over the rounds of their ratio, and the least and the
largest. The first run and the two cores are timed by the clock, all else by processor time on one thread. Needs a
system that counts the processor time and the memory of processes.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from clips import LONG, SAMPLES, back_and_forth
from edits import TARGETS, edited
from numpy.typing import NDArray
from tables import insert

from distretarget import Motion, Skeleton, read_bvh, retarget, write_bvh

SAMPLE, CHILD = SAMPLES / "clap.bvh", SAMPLES / "child.json"
HANDS = ("LeftWrist", "RightWrist")  # of the sample, which clap
CHAINS = (0, 5, 15, 35)  # added to each of two joints
CHAIN_JOINTS = 3
FIRST_RUNS = 5
VERY_LONG = 50_000  # frames of the clip whose memory is measured
CONVERT = """
import resource, sys
from distretarget import read_bvh, retarget, write_bvh
source = read_bvh(sys.argv[1])
result = retarget(source, read_bvh(sys.argv[2]).skeleton)
result.figures
write_bvh(sys.argv[3], result.motion)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""

Line = tuple[str, str, str]


def with_chains(clip: Motion, count: int, joints: tuple[str, ...]) -> Motion:
    """The clip on a body with so many chains of `CHAIN_JOINTS` joints more on each of some joints, which do not turn
    against these.
    """
    body, draw = clip.skeleton, np.random.default_rng(1)
    names, parents, offsets = list(body.names), body.parents.tolist(), list(body.offsets)
    for joint in joints:
        number = body.names.index(joint)
        bone = body.offsets[body.children[number][0]]
        length = np.linalg.norm(bone)
        for chain in range(count):
            parent = number
            for link in range(CHAIN_JOINTS):
                names.append(f"{joint}Chain{chain}Joint{link}")
                parents.append(parent)
                offsets.append(0.4 * bone + 0.2 * length * draw.normal(size=3) if link == 0 else 0.25 * bone)
                parent = len(names) - 1
    added = len(names) - len(body)
    skeleton = Skeleton(
        names=tuple(names),
        parents=np.array(parents),
        offsets=np.array(offsets),
        channels=(*body.channels, *(("Zrotation", "Xrotation", "Yrotation"),) * added),
        end_sites=np.append(body.end_sites, np.zeros(added, bool)),
    )
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(clip), added, 1))
    return Motion(skeleton, clip.root_positions, np.concatenate([clip.rotations, still], axis=1), clip.frame_time_text)


def exponents(joints: tuple[str, ...], rounds: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """The joints of the bodies with chains, and for each round the exponents in them from one body to the next, and
    from the first to the last.
    """
    clips = [with_chains(read_bvh(SAMPLE), count, joints) for count in CHAINS]
    bodies = [_with_long_forearms(clip.skeleton) for clip in clips]
    count = np.array([len(clip.skeleton) for clip in clips])
    times = _alternating([lambda c=c, b=b: retarget(c, b) for c, b in zip(clips, bodies, strict=True)], rounds)
    steps = np.diff(np.log(times), axis=1) / np.diff(np.log(count))
    whole = np.log(times[:, -1:] / times[:, :1]) / np.log(count[-1] / count[0])
    return count, np.concatenate([steps, whole], axis=1)


def _with_long_forearms(body: Skeleton) -> Skeleton:
    return body.with_lengths(body.lengths * np.where(np.isin(body.names, HANDS), 1.3, 1.0))


def _alternating(
    runs: list[Callable[[], object]], rounds: int, clock: Callable[[], float] = time.process_time
) -> NDArray[np.float64]:
    """(rounds, runs), the seconds that each takes, after a run that is not counted."""
    for run in runs:
        run()

    def seconds(run: Callable[[], object]) -> float:
        started = clock()
        run()
        return clock() - started

    return np.array([[seconds(run) for run in runs] for _ in range(rounds)])


def joint_lines(corpus: Path, rounds: int) -> list[Line]:
    """What joints cost."""
    lines = []
    clips = [read_bvh(corpus / name) for name in ("cmu_daz/14_04.bvh", "cmu_mb/12_01.bvh")]
    bodies = [edited(clip.rigid_skeleton, TARGETS["H"]) for clip in clips]
    runs = [lambda c=c, b=b: retarget(c, b) for c, b in zip(clips, bodies, strict=True)]
    times = _alternating(runs, rounds) / [len(clip) for clip in clips]
    fingers, none = (len(clip.skeleton) for clip in clips)
    lines.append(
        _line(f"{fingers} joints, fingers and hands together, over {none}: frames/s", times[:, 1] / times[:, 0])
    )
    for what, joints in (("chains that nothing touches", ("Head", "Hips")), ("hands full of chains meet", HANDS)):
        count, found = exponents(joints, rounds)
        for step, values in zip([*pairwise(count), (count[0], count[-1])], found.T, strict=True):
            lines.append(_line(f"exponent in joints, {what}, {step[0]} to {step[1]}", values))
    return lines


def core_line(corpus: Path, rounds: int) -> Line:
    """What a second core gains for one clip."""
    clip = back_and_forth(read_bvh(corpus / "cmu_mb" / "12_01.bvh"), LONG)
    body = edited(clip.rigid_skeleton, TARGETS["H"])

    def run(threads: str) -> None:
        os.environ["OMP_NUM_THREADS"] = threads
        retarget(clip, body)

    times = _alternating([lambda: run("1"), lambda: run("2")], rounds, time.perf_counter)
    os.environ["OMP_NUM_THREADS"] = "1"
    return _line(f"two cores over one, {LONG:,} frames: frames/s", times[:, 0] / times[:, 1])


def start_lines(corpus: Path, folder: Path, rounds: int) -> list[Line]:
    """What processes take to start: processor time over that of imports, and the first run, which compiles."""
    program, output = [sys.executable, "-m", "distretarget"], str(folder / "out.bvh")
    convert = [*program, str(corpus / "cmu_mb" / "12_01.bvh"), str(CHILD), "-o", output, "--overwrite"]
    imports = [[sys.executable, "-c", f"import {what}"] for what in ("numpy", "numba, scipy.spatial.transform")]
    commands = [[*program, "--version"], imports[0], convert, imports[1]]
    times = _alternating([lambda c=c: _run(c) for c in commands], rounds, _time_of_children)

    def first_run(threads: str) -> None:
        with tempfile.TemporaryDirectory(dir=folder) as code:
            _run(convert, NUMBA_CACHE_DIR=code, OMP_NUM_THREADS=threads)

    firsts = _alternating([lambda: first_run("1"), lambda: first_run("2")], FIRST_RUNS, time.perf_counter)
    return [
        _line("`--version` over `import numpy`, processor time", times[:, 0] / times[:, 1]),
        _line("524 frames over `import numba, scipy.spatial.transform`, processor time", times[:, 2] / times[:, 3]),
        _line("first run, which compiles, one core [s]", firsts[:, 0]),
        _line("first run, which compiles, two cores [s]", firsts[:, 1]),
    ]


def memory_line(corpus: Path, folder: Path) -> Line:
    """What a very long clip takes at its peak."""
    clip = back_and_forth(read_bvh(corpus / "cmu_mb" / "12_01.bvh"), VERY_LONG)
    body = edited(clip.rigid_skeleton, TARGETS["H"])
    long, target, output = (folder / name for name in ("long.bvh", "target.bvh", "long_out.bvh"))
    write_bvh(long, clip)
    write_bvh(target, Motion(body, clip.root_positions[:1], clip.rotations[:1], clip.frame_time_text))
    peak = float(_run([sys.executable, "-c", CONVERT, str(long), str(target), str(output)]))
    arrays = VERY_LONG * len(body) * 7 * 8 / 1e6
    what = f"peak memory of {VERY_LONG:,} frames of {len(body)} joints, with 7 numbers each ({arrays:.0f} MB) [MB]"
    return what, f"{peak:.0f}", ""


def _run(command: list[str], **environment: str) -> str:
    done = subprocess.run(
        command, check=True, capture_output=True, text=True, cwd=SAMPLES.parent, env=os.environ | environment
    )
    return done.stdout


def _time_of_children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _line(what: str, values: NDArray[np.float64]) -> Line:
    return what, f"{np.median(values):.2f}", f"{values.min():.2f} to {values.max():.2f}"


def main() -> None:
    """Measure, print, and write the table if a page is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path, metavar="CORPUS")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--markdown", type=Path, metavar="PAGE", help="write the table into this page")
    arguments = parser.parse_args()
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else every process compiles the sources
    corpus, rounds = arguments.corpus.resolve(), arguments.rounds
    with tempfile.TemporaryDirectory() as name:
        lines = [
            *joint_lines(corpus, rounds),
            core_line(corpus, rounds),
            *start_lines(corpus, Path(name), rounds),
            memory_line(corpus, Path(name)),
        ]
    table = "\n".join(
        ["| | median | least to largest |", "|---|---|---|", *(f"| {' | '.join(line)} |" for line in lines)]
    )
    print(table)
    if arguments.markdown:
        insert(arguments.markdown, {"scaling": table + "\n"})


if __name__ == "__main__":
    main()
