"""Measure how the time of `retarget` grows with joints and falls with cores, and what starting and memory take.

    python benchmarks/scaling.py CORPUS [--rounds 9] [--markdown PAGE]

Contestants of a line run alternately; a line has the median over the rounds of their ratio, and the least and the
largest. The first run and the two cores are timed by the clock, all else by processor time on one thread. Needs a
system that counts the processor time and the memory of processes.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import click
import numpy as np
from clips import LONG, SAMPLES, back_and_forth, corpus_argument, markdown_option
from edits import TARGETS, edited
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from skeleton_edits import on_skeleton, with_chain
from tables import publish, table
from timing import alternating

from distretarget import Motion, Skeleton, read_bvh, retarget, write_bvh
from distretarget.skeleton import POSITION_CHANNELS, USUAL_ROTATIONS

SAMPLE, CHILD = SAMPLES / "clap.bvh", SAMPLES / "child.json"
HERO = SAMPLES.parent / "sample_characters" / "hero.glb"
HANDS = ("LeftWrist", "RightWrist")  # of the sample, which clap
CHAINS = (0, 5, 15, 35)  # added to each of two joints
CHAIN_JOINTS = 3
LIMBS = (500, 1000, 3000)
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

Line = tuple[str, str, str]
Array = NDArray[np.float64]


def with_chains(clip: Motion, count: int, joints: tuple[str, ...]) -> Motion:
    """The clip on a body with `count` more chains of `CHAIN_JOINTS` joints, which do not bend, on some joints."""
    body, draw = clip.skeleton, np.random.default_rng(1)
    for name in joints:
        number = clip.skeleton.index(name)
        bone = clip.skeleton.offsets[clip.skeleton.children[number][0]]
        for chain in range(count):
            first = 0.4 * bone + 0.2 * np.linalg.norm(bone) * draw.normal(size=3)
            offsets = [first, *[0.25 * bone] * (CHAIN_JOINTS - 1)]
            chain_names = [f"{name}Chain{chain}Joint{link}" for link in range(CHAIN_JOINTS)]
            body = with_chain(body, number, dict(zip(chain_names, offsets, strict=True)))
    return on_skeleton(clip, body)


def joint_lines(corpus: Path, rounds: int) -> Iterator[Line]:
    """The cost of joints: of fingers, and exponents in the number of joints, from bodies with more and more chains."""
    clips = [read_bvh(corpus / name) for name in ("cmu_daz/14_04.bvh", "cmu_mb/12_01.bvh")]
    runs = [partial(retarget, clip, edited(clip.rigid_skeleton, TARGETS["H"])) for clip in clips]
    times = alternating(runs, rounds) / [len(clip) for clip in clips]
    fingers, none = (len(clip.skeleton) for clip in clips)
    what = f"{fingers} joints, fingers and hands together, over {none}: frames/s"
    yield _line(what, times[:, 1] / times[:, 0])
    for what, joints in (("chains without contacts", ("Head", "Hips")), ("hands full of chains meet", HANDS)):
        clips = [with_chains(read_bvh(SAMPLE), count, joints) for count in CHAINS]
        runs = []
        for clip in clips:
            long_forearms = clip.skeleton.lengths * np.where(np.isin(clip.skeleton.names, HANDS), 1.3, 1.0)
            runs.append(partial(retarget, clip, clip.skeleton.with_lengths(long_forearms)))
        times = alternating(runs, rounds)
        for a, b in ((0, -1), (-2, -1)):
            before, after = len(clips[a].skeleton), len(clips[b].skeleton)
            exponents = np.log(times[:, b] / times[:, a]) / np.log(after / before)
            yield _line(f"exponent in joints, {what}, {before} to {after}", exponents)


def star(limbs: int) -> Motion:
    """Two frames of a root with so many limbs of a joint and an End Site each, of all lengths and directions."""
    draw, count = np.random.default_rng(limbs), 1 + 2 * limbs
    parents = np.array([-1, *[0, -1] * limbs])
    parents[2::2] = np.arange(1, count, 2)
    channels = [(*POSITION_CHANNELS, *USUAL_ROTATIONS), *[USUAL_ROTATIONS, ()] * limbs]
    ends = np.arange(count) % 2 == 0
    ends[0] = False
    body = Skeleton(
        names=("root", *(f"{what}{limb}" for limb in range(limbs) for what in ("limb", "end"))),
        parents=parents,
        offsets=draw.normal(size=(count, 3)),
        channels=tuple(channels),
        end_sites=ends,
    )
    rotations = Rotation.from_euler("ZXY", draw.normal(size=(2 * count, 3)), degrees=True).as_quat()
    rotations[np.tile(ends, 2)] = [0.0, 0.0, 0.0, 1.0]
    return Motion(body, np.zeros((2, 3)), rotations.reshape(2, count, 4), "0.01")


def limb_lines() -> Iterator[Line]:
    """The seconds that a body with very many limbs takes."""

    def run(limbs: int) -> None:
        source = star(limbs)
        retarget(source, source.skeleton.with_lengths(1.1 * source.skeleton.lengths)).metrics  # noqa: B018

    for limbs in LIMBS:
        yield _line(f"two frames of a root with {limbs:,} limbs [s]", alternating([partial(run, limbs)], 3)[:, 0])


def core_line(corpus: Path, rounds: int) -> Line:
    """The gain from a second core for one clip."""
    clip = back_and_forth(read_bvh(corpus / "cmu_mb" / "12_01.bvh"), LONG)
    body = edited(clip.rigid_skeleton, TARGETS["H"])

    def run(threads: str) -> None:
        os.environ["OMP_NUM_THREADS"] = threads
        retarget(clip, body)

    times = alternating([partial(run, "1"), partial(run, "2")], rounds, time.perf_counter)
    os.environ["OMP_NUM_THREADS"] = "1"
    return _line(f"two cores over one, {LONG:,} frames: frames/s", times[:, 0] / times[:, 1])


def start_lines(corpus: Path, folder: Path, rounds: int) -> Iterator[Line]:
    """The cost of starting a process, relative to imports."""
    program, output = [sys.executable, "-m", "distretarget"], str(folder / "out.bvh")
    convert = [*program, str(corpus / "cmu_mb" / "12_01.bvh"), str(CHILD), "-o", output, "--overwrite"]
    imports = [[sys.executable, "-c", f"import {what}"] for what in ("numpy", "numpy, scipy.spatial.transform")]
    commands = [[*program, "--version"], imports[0], convert, imports[1]]
    times = alternating([partial(_run, command) for command in commands], rounds, _time_of_children)
    yield _line("`--version` over `import numpy`, processor time", times[:, 0] / times[:, 1])
    yield _line("524 frames over `import numpy, scipy.spatial.transform`, processor time", times[:, 2] / times[:, 3])
    clap = [*program, str(SAMPLES / "clap.bvh"), str(HERO), "-o", str(folder / "clap.glb"), "--overwrite"]
    yield _line(
        "clap onto the hero, a process [s]", alternating([partial(_run, clap)], rounds, time.perf_counter)[:, 0]
    )


def memory_line(corpus: Path, folder: Path) -> Line:
    """The peak memory of a very long clip."""
    clip = back_and_forth(read_bvh(corpus / "cmu_mb" / "12_01.bvh"), VERY_LONG)
    body = edited(clip.rigid_skeleton, TARGETS["H"])
    long, target, output = (folder / name for name in ("long.bvh", "target.bvh", "long_out.bvh"))
    write_bvh(long, clip)
    write_bvh(target, Motion(body, clip.root_positions[:1], clip.rotations[:1], clip.frame_time_text))
    peak = float(_run([sys.executable, "-c", CONVERT, str(long), str(target), str(output)]))
    arrays = VERY_LONG * len(body) * 7 * 8 / 1e6
    what = f"peak memory of {VERY_LONG:,} frames of {len(body)} joints, with 7 numbers each ({arrays:.0f} MB) [MB]"
    return what, f"{peak:.0f}", ""


def _run(command: list[str]) -> str:
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=SAMPLES.parent)
    return done.stdout


def _time_of_children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _line(what: str, values: Array) -> Line:
    return what, f"{np.median(values):.2f}", f"{values.min():.2f} to {values.max():.2f}"


@click.command(help=__doc__)
@corpus_argument
@markdown_option
@click.option("--rounds", default=9, show_default=True)
def main(corpus: Path, page: Path | None, rounds: int) -> None:
    """Measure, print, and write the table if a page is given."""
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else every process compiles the sources
    corpus = corpus.resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lines = [*joint_lines(corpus, rounds), *limb_lines(), core_line(corpus, rounds)]
        lines += [*start_lines(corpus, folder, rounds), memory_line(corpus, folder)]
    publish({"scaling": table(" | median | least to largest", lines)}, page)


if __name__ == "__main__":
    main()
