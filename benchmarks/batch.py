"""Measure `distretarget batch` under load, after kills, and per clip; each measurement is a command.

    python benchmarks/batch.py jobs [--clips 40] [--frames 4000] [--rounds 3]
    python benchmarks/batch.py long [--clip walk] [--frames 30000] [--rounds 3]
    python benchmarks/batch.py kill FOLDER [--times 10]
    python benchmarks/batch.py tiny [--clips 2000]

jobs: converts clips of one length with 1 process and with 2, alternately; prints the ratio of the times, and the time
until the first clip is done and until workers are ready.
long: does the same with one long clip, which is cut into pieces, and prints the memory it takes.
kill: kills a run over FOLDER at random moments, each time after up to a tenth of the clips, and starts it again. All
outputs must be equal to those of an undisturbed run, and no clip may be converted twice.
tiny: converts clips of one frame; prints the time, disk space and memory that a clip takes besides its frames.

The exit status is 1 if 2 processes are too slow, or outputs are wrong or missing.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from clips import SAMPLES, back_and_forth

from distretarget import Motion, read_bvh, write_bvh
from distretarget.batch.plan import MANIFEST
from distretarget.batch.workers import Processes

CLIPS = ("walk", "clap", "wave", "turn", "hands_on_hips")
TARGET = SAMPLES / "rigs" / "mixamo_t.json"
LEAST_RATIO = 1.7  # least throughput of 2 processes over that of 1


def main() -> None:
    """Run the measurement named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    which = parser.add_subparsers(required=True)
    for name, measure, options in (
        ("jobs", jobs, {"--clips": 40, "--frames": 4000, "--rounds": 3}),
        ("long", long, {"--frames": 30_000, "--rounds": 3}),
        ("kill", kill, {"--times": 10}),
        ("tiny", tiny, {"--clips": 2000}),
    ):
        command = which.add_parser(name)
        command.set_defaults(measure=measure)
        for option, default in options.items():
            command.add_argument(option, type=int, default=default)
        if measure is long:
            command.add_argument("--clip", choices=CLIPS, default=CLIPS[0])
        if measure is kill:
            command.add_argument("folder", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        failed = arguments.measure(arguments, Path(scratch))
    sys.exit(int(failed))


def jobs(arguments: argparse.Namespace, scratch: Path) -> bool:
    """Convert many clips of one length: throughput of 2 processes relative to 1."""
    for number in range(arguments.clips):
        write_bvh(folder(scratch / "in") / f"{number}.bvh", sample(CLIPS[number % len(CLIPS)], arguments.frames))
    ratio, first = alternately(scratch, arguments.rounds)
    print(f"{arguments.clips} clips of {arguments.frames} frames: 2 jobs have {ratio:.2f} times the throughput of 1")
    print(f"first clip done after {first:.2f} s; {start_times()}")
    return ratio < LEAST_RATIO


def start_times() -> str:
    """How long workers take to be ready: the first, including the process it is forked from, and a second one."""
    pool = Processes(1, "contact")
    seconds = []
    for _ in range(2):
        started = time.perf_counter()
        pool.executor.submit(os.getpid).result()
        seconds.append(time.perf_counter() - started)
        pool.close()
    return f"the first worker is ready after {seconds[0]:.2f} s, another one after {seconds[1]:.3f} s"


def long(arguments: argparse.Namespace, scratch: Path) -> bool:
    """Convert one clip, cut into pieces: throughput of 2 processes relative to 1."""
    write_bvh(folder(scratch / "in") / "long.bvh", sample(arguments.clip, arguments.frames))
    ratio, _ = alternately(scratch, arguments.rounds)
    print(f"{arguments.clip}, {arguments.frames} frames in one clip: 2 jobs have {ratio:.2f} times the throughput of 1")
    print(f"memory of the largest process: {memory():.0f} MB")
    return not same(scratch / "1", scratch / "2")


def alternately(scratch: Path, rounds: int) -> tuple[float, float]:
    """Run with 1 process and with 2, alternately; the ratio of their times, and the seconds until the first clip is
    done with 2 processes; medians over the rounds.
    """
    ratios, firsts = [], []
    for _ in range(rounds):
        seconds = {}
        for count in (1, 2):
            out = scratch / str(count)
            started = time.perf_counter()
            with run(scratch / "in", out, "--jobs", count, "--overwrite") as process:
                while count == 2 and process.poll() is None and not done(out):
                    time.sleep(0.005)
                firsts += [time.perf_counter() - started] if count == 2 else []
                assert process.wait() == 0
            seconds[count] = time.perf_counter() - started
            if len(ratios) + 1 < rounds:
                (out / MANIFEST).unlink()
        ratios.append(seconds[1] / seconds[2])
        print(f"  1 job {seconds[1]:.2f} s, 2 jobs {seconds[2]:.2f} s", flush=True)
    return statistics.median(ratios), statistics.median(firsts)


def kill(arguments: argparse.Namespace, scratch: Path) -> bool:
    """Kill and restart a run at random moments; compare its outputs with those of an undisturbed run."""
    with run(arguments.folder, scratch / "whole") as process:
        process.wait()
    share = len(done(scratch / "whole")) // arguments.times
    for _ in range(arguments.times):
        goal = len(done(scratch / "killed")) + random.randint(0, share)
        with run(arguments.folder, scratch / "killed") as process:
            while process.poll() is None and len(done(scratch / "killed")) < goal:
                time.sleep(0.01)
            time.sleep(random.uniform(0.0, 0.2))
            process.send_signal(signal.SIGKILL)
        print(f"  killed with {len(done(scratch / 'killed'))} clips done", flush=True)
    with run(arguments.folder, scratch / "killed") as process:
        process.wait()
    outputs = Counter(record["output"] for record in done(scratch / "killed"))
    twice = sum(count > 1 for count in outputs.values())
    equal = same(scratch / "killed", scratch / "whole")
    print(f"{len(outputs)} clips, {twice} converted twice, outputs {'the same' if equal else 'DIFFERENT'}")
    return bool(twice) or not equal


def tiny(arguments: argparse.Namespace, scratch: Path) -> bool:
    """Time, disk space and memory of a clip of one frame."""
    clip = sample("walk", 1)
    for number in range(arguments.clips):
        write_bvh(folder(scratch / "in") / f"{number}.bvh", clip)
    started = time.perf_counter()
    for outcome in ("converted", "skipped"):
        with run(scratch / "in", scratch / "out") as process:
            status = process.wait()
        seconds = time.perf_counter() - started
        print(f"{arguments.clips} clips {outcome} in {seconds:.1f} s, {1e3 * seconds / arguments.clips:.1f} ms each")
        started = time.perf_counter()
    size = (scratch / "out" / MANIFEST).stat().st_size / arguments.clips
    print(f"manifest: {size:.0f} bytes a clip; memory of the largest process: {memory():.0f} MB")
    return status != 0 or len(done(scratch / "out")) != arguments.clips


def memory() -> float:
    """The largest memory that any finished process took [MB]."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024


def sample(name: str, frames: int) -> Motion:
    """A sample clip played forwards and backwards until it has this many frames."""
    return back_and_forth(read_bvh(SAMPLES / f"{name}.bvh"), frames)


def folder(path: Path) -> Path:
    """Create the folder if it does not exist."""
    path.mkdir(exist_ok=True)
    return path


def run(source: Path, out: Path, *options: Any) -> subprocess.Popen[bytes]:
    """Start a batch."""
    command = [sys.executable, "-m", "distretarget", "batch", source, TARGET, "-o", out, *options]
    return subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def done(out: Path) -> list[dict[str, Any]]:
    """The manifest's records of clips that are done."""
    return [record for record in records(out / MANIFEST) if record["status"] == "done"]


def records(path: Path) -> Iterator[dict[str, Any]]:
    """The records of a manifest, without a last line that is incomplete."""
    lines = path.read_text().split("\n")[:-1] if path.exists() else []
    return (json.loads(line) for line in lines if line.endswith("}"))


def same(one: Path, other: Path) -> bool:
    """Whether two folders have the same BVH files, byte for byte."""
    trees = [{path.relative_to(out): path.read_bytes() for path in out.rglob("*.bvh")} for out in (one, other)]
    return trees[0] == trees[1]


if __name__ == "__main__":
    main()
