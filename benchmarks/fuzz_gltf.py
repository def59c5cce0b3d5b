"""Give the reader and writer of characters mutated glTF files, and count what becomes of them.

    python benchmarks/fuzz_gltf.py COUNT [--seed N] [--of FILE.glb] [--jobs 2] [--keep FOLDER] [--processes]

Each file (`mutated_gltf.py`) is read as a target, gets three frames of a sample, is written with them and read again;
it is read as a motion, and this is written as BVH and read again. Each ends in one of the `OUTCOMES`; the first two are
right, and the exit status is 1 if there is any other. A warning of numpy counts as a traceback. Memory is what the
process holds at most beyond what it held before: ten times the file, and `FREE_MEMORY` for the 1,000,000 poses that
two keys far apart may ask for, some 90 bytes each, in a file of any size. `--processes` gives the files to the command
line instead. The same seeds give the same files.
"""

from __future__ import annotations

import json
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import click
import numpy as np

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tests", "tools")]
import gltf_player
from bodies import SAMPLES
from characters import chunks
from fuzz_outcomes import (
    HANG,
    LIMIT,
    LONGEST_LINE,
    REFUSED,
    RIGHT,
    TRACEBACK,
    UNREADABLE,
    Memory,
    NotReadBackError,
    TooLongError,
    late,
)
from mutated_gltf import mutated

from distretarget import DistretargetError, Motion, load_target, read_bvh, read_motion, retarget, write_motion
from distretarget.io.bvh import MAX_DEPTH, parse_bvh
from distretarget.io.bvh_writer import format_bvh
from distretarget.io.target_file import CharacterTarget

MEMORY = "memory above 10 times the file"
OUTCOMES = (RIGHT, REFUSED, TRACEBACK, HANG, MEMORY, UNREADABLE)
GIVEN_UP = 30  # after which a process that does not even notice its alarm is ended [s]
FREE_MEMORY, PER_BYTE = 128 * 2**20, 10  # [bytes]; [bytes per byte of the file]
ALL_MEMORY = 6 * 2**30  # of a process [bytes]
OFF = 1e-5  # how far joints may be off when they are read back [of the extent of body, path and nodes]


# ---- what is done with a file


def through(path: Path, sample: Motion) -> None:
    """Take a file through the package; what it refuses is a DistretargetError, raised at the end."""
    refused = None
    try:
        _as_target(path, sample)
    except DistretargetError as error:
        refused = error
    try:
        motion = read_motion(path)
    except DistretargetError as error:
        _check_line(error, path)
        refused = refused or (None if "has no animation" in str(error) else error)
    else:
        _finite(motion)
        _as_bvh(motion)
    if refused:
        raise refused


def _as_bvh(motion: Motion) -> None:
    """Write a motion as BVH and read it again, unless it is too deep a tree for BVH."""
    if motion.skeleton.path_sizes(np.arange(len(motion.skeleton)))[0].max() - 1 > MAX_DEPTH:
        return
    try:
        text = format_bvh(motion)
    except DistretargetError as error:
        raise NotReadBackError(f"cannot be BVH: {error}") from error
    again = _read_again(lambda: parse_bvh(text, "out.bvh"))
    motion = motion.turned_round() if motion.skeleton.looks_back else motion  # as it is written
    if not _is_collapsed(motion):
        _close(motion.positions[:, list(motion.skeleton.depth_first)], again.positions, _extent(motion), "BVH")


def _as_target(path: Path, sample: Motion) -> None:
    target = load_target(path)
    if not isinstance(target, CharacterTarget):
        raise NotReadBackError(f"no character: {target!r}")
    try:
        motion = retarget(sample, target).motion
    except DistretargetError as error:
        _check_line(error)
        return  # joints that do not match are no fault of the file
    _finite(motion)
    out = path.with_name(f"out{path.suffix.replace('.vrma', '.glb')}")
    write_motion(out, motion, path, name="the new one", overwrite=True)
    again = _read_again(lambda: read_motion(out, clip="the new one"))
    extent = _extent(motion) + float(np.abs(target.character.shown.translations).max())
    _close(motion.positions, again.positions, extent, "the animation written")
    if not target.character.warnings and len(target.character.nodes) < 300 and out.suffix != ".gltf":
        document, buffer = chunks(out.read_bytes())
        times = sample.frame_time * np.arange(len(motion))
        nodes = target.character.joint_nodes
        placed = gltf_player.worlds(document, buffer, "the new one", times.astype("f4"))[:, nodes]
        _close(motion.positions, placed[..., :3, 3], extent, "the animation played")


def _is_collapsed(motion: Motion) -> bool:
    """Whether bones have shrunk to nothing, which is noise to the reader of BVH; see `bvh.add_offsets`."""
    if motion.moving is None:
        return False
    joints = motion.moving.joints
    sizes = np.linalg.norm(motion.moving.translations, axis=2).max(axis=0)
    return bool((sizes < 0.02 * motion.skeleton.lengths[joints]).any())


def _finite(motion: Motion) -> None:
    if not np.isfinite(motion.positions).all() or not np.isfinite(motion.skeleton.offsets).all():
        raise NotReadBackError("positions are not finite")


def _extent(motion: Motion) -> float:
    return float(np.abs(motion.positions).max(initial=0.0) + np.abs(motion.skeleton.offsets).max(initial=0.0))


def _read_again(reading: Callable[[], Motion]) -> Motion:
    try:
        return reading()
    except DistretargetError as error:
        raise NotReadBackError(str(error)) from error


def _close(values: np.ndarray, again: np.ndarray, extent: float, what: str) -> None:
    if values.shape != again.shape:
        raise NotReadBackError(f"{what}: {again.shape} of {values.shape}")
    off = np.abs(values - again).max(initial=0.0)
    if not off <= OFF * extent + 2e-6:
        raise NotReadBackError(f"{what} is off by {off:g} of {extent:g}")


def _check_line(error: DistretargetError, path: Path | None = None) -> None:
    line = str(error)
    if "\n" in line or not line.isprintable() or len(line) > LONGEST_LINE + len(str(path)):
        raise RuntimeError(f"no line for a user, {len(line)} characters: {line[:300]!r}")
    if path and path.parent.name not in line:
        raise RuntimeError(f"does not name the file: {line[:300]!r}")


def run_program(path: Path) -> str:
    """Give the file to the command line, and return the outcome."""
    out = path.with_name("out.glb")
    for arguments in (
        [str(SAMPLES / "clap.bvh"), str(path), "-o", str(out)],
        [str(path), str(SAMPLES / "clap.bvh"), "-o", str(out.with_suffix(".bvh"))],
    ):
        command = [sys.executable, "-m", "distretarget", *arguments]
        done = subprocess.run(command, capture_output=True, timeout=60, stdin=subprocess.DEVNULL, check=False)
        errors = done.stderr.decode("utf-8", "replace")
        written = Path(arguments[-1]).exists()
        if "Traceback" in errors or "RuntimeWarning" in errors or done.returncode not in (0, 1):
            raise RuntimeError(f"status {done.returncode}: {errors[-600:]}")
        if done.returncode and (written or errors.count("\n") != 1 or not errors.startswith("distretarget: ")):
            raise RuntimeError(f"status {done.returncode}, written: {written}: {errors[-600:]}")
        if not done.returncode and not written:
            raise NotReadBackError("nothing written")
    return REFUSED if done.returncode else RIGHT


# ---- how it ends


def outcome_of(seed: int, of: str | None, sample: Motion, folder: Path, processes: bool) -> tuple[str, str]:
    """The outcome of a file, and the details of a failure."""
    suffix, content = mutated(seed, of)
    path = folder / f"hero{suffix}"
    for old in folder.iterdir():
        old.unlink()
    path.write_bytes(content)
    size, memory = len(content), Memory()
    del content
    signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, 0 if processes else LIMIT)
    outcome, known = RIGHT, ""
    try:
        if processes:
            outcome = run_program(path)
        else:
            through(path, sample)
    except DistretargetError as error:
        outcome = REFUSED
        try:
            _check_line(error, path)
        except RuntimeError as fault:
            outcome, known = TRACEBACK, str(fault)
    except TooLongError as error:
        outcome, known = HANG, "".join(traceback.format_exception(error)[-6:])
    except MemoryError as error:
        outcome, known = MEMORY, "".join(traceback.format_exception(error)[-4:])
    except NotReadBackError as error:
        outcome, known = UNREADABLE, str(error)
    except Exception as error:
        outcome, known = TRACEBACK, "".join(traceback.format_exception(error)[-4:])
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    if not processes and outcome in (RIGHT, REFUSED) and memory.peak() > FREE_MEMORY + PER_BYTE * size:
        outcome, known = MEMORY, f"{memory.peak() / 2**20:.0f} MB for a file of {size} bytes; {outcome}"
    return outcome, known


def work(seeds: range, of: str | None, processes: bool) -> None:
    """Try files, and print a line of JSON for each."""
    resource.setrlimit(resource.RLIMIT_AS, (ALL_MEMORY, ALL_MEMORY))
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", UserWarning)
    sample = read_bvh(SAMPLES / "clap.bvh")[:3]
    retarget(sample, sample.skeleton)
    with tempfile.TemporaryDirectory() as name:
        for seed in seeds:
            started = time.perf_counter()
            outcome, known = outcome_of(seed, of, sample, Path(name), processes)
            print(json.dumps([seed, outcome, known, round(time.perf_counter() - started, 2)]), flush=True)


def _results(seeds: list[range], of: str | None, processes: bool) -> Iterator[tuple[int, str, str, float]]:
    """What workers print, one for each range of seeds at a time; a worker that hangs is ended and replaced."""
    environment = os.environ | {"MALLOC_MMAP_THRESHOLD_": "131072", "MALLOC_TRIM_THRESHOLD_": "131072"}

    def start(part: range) -> subprocess.Popen[bytes]:
        command = [sys.executable, __file__, "--work", f"{part.start}:{part.stop}", *(["--of", of] if of else [])]
        command += ["--processes"] if processes else []
        return subprocess.Popen(command, stdout=subprocess.PIPE, env=environment)

    workers = {(worker := start(part)).stdout.fileno(): [worker, part, time.monotonic()] for part in seeds if part}
    while workers:
        ready = select.select(list(workers), [], [], 1.0)[0]
        for number, (worker, part, last) in list(workers.items()):
            line = worker.stdout.readline() if number in ready else b""
            if line:
                seed, outcome, known, taken = json.loads(line)
                workers[number] = [worker, range(seed + 1, part.stop), time.monotonic()]
                yield seed, outcome, known, taken
            elif number in ready or time.monotonic() - last > 4 * GIVEN_UP:
                del workers[number]
                worker.kill()
                worker.wait()
                if part:
                    yield part.start, HANG if number not in ready else TRACEBACK, "the process ended", 0.0
                    if rest := range(part.start + 1, part.stop):
                        new = start(rest)
                        workers[new.stdout.fileno()] = [new, rest, time.monotonic()]


@click.command(help=__doc__)
@click.argument("count", type=int, default=0)
@click.option("--seed", "first_seed", default=0)
@click.option("--of", type=click.Path(exists=True))
@click.option("--jobs", default=2)
@click.option("--keep", type=Path)
@click.option("--processes", is_flag=True)
@click.option("--work", "part", hidden=True)
def main(
    count: int, first_seed: int, of: str | None, jobs: int, keep: Path | None, processes: bool, part: str | None
) -> None:
    """Try as many files as asked for, and print the outcomes."""
    if part:
        work(range(*map(int, part.split(":"))), of, processes)
        return
    started, counts, slowest = time.perf_counter(), Counter(), 0.0
    bounds = np.linspace(first_seed, first_seed + count, jobs + 1).astype(int).tolist()
    parts = [range(first, last) for first, last in pairwise(bounds)]
    for seed, outcome, known, taken in _results(parts, of, processes):
        counts[outcome] += 1
        slowest = max(slowest, taken)
        if outcome not in (RIGHT, REFUSED):
            print(f"--- seed {seed}, {outcome}, {taken} s: {known}", flush=True)
            if keep:
                keep.mkdir(parents=True, exist_ok=True)
                suffix, content = mutated(seed, of)
                (keep / f"{seed}{suffix}").write_bytes(content)
    ends = ", ".join(f"{counts[outcome]:,} {outcome}" for outcome in OUTCOMES)
    print(f"{counts.total():,} files in {time.perf_counter() - started:.0f} s, {slowest} s at most: {ends}")
    sys.exit(counts.total() > counts[RIGHT] + counts[REFUSED])


if __name__ == "__main__":
    main()
