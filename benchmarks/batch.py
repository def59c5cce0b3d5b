"""What `distretarget batch` does under load, when killed, and what it costs; each measurement is a command of its own.

    python benchmarks/batch.py jobs [--clips 40] [--frames 4000] [--rounds 3]
    python benchmarks/batch.py long [--clip walk] [--frames 30000] [--rounds 3]
    python benchmarks/batch.py kill FOLDER [--times 10]
    python benchmarks/batch.py tiny [--clips 2000]

jobs: clips of one length, with 1 and with 2 processes by turns; the ratio of their times, the time until the first clip
is there, and until workers are ready.
long: the same for one clip, which is cut, and the memory it takes.
kill: a run over FOLDER is killed at random moments, after up to a tenth of the clips, and started again; in the end all
outputs must be those of a run nobody killed, and no clip may have been made twice.
tiny: clips of one frame; the cost of a clip besides its frames, on time, disk and memory.

The exit status is 1 if something is not as it must be.
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
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from distretarget import Motion, read_bvh, write_bvh
from distretarget.batch.plan import MANIFEST
from distretarget.batch.pools import Processes

SAMPLES = Path(__file__).resolve().parents[1] / "sample_bvh"
CLIPS = ("walk", "clap", "wave", "turn", "hands_on_hips")
TARGET = SAMPLES / "rigs" / "mixamo_t.json"
LEAST = 1.7  # the throughput of 2 processes over that of 1


def main() -> None:
    """Run the measurement that is asked for."""
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
    """Throughput of 2 processes against 1."""
    for number in range(arguments.clips):
        write_bvh(folder(scratch / "in") / f"{number}.bvh", repeated(CLIPS[number % len(CLIPS)], arguments.frames))
    ratio, first = by_turns(scratch, arguments.rounds)
    print(f"{arguments.clips} clips of {arguments.frames} frames: 2 jobs have {ratio:.2f} times the throughput of 1")
    print(f"first clip done after {first:.2f} s; {starting()}")
    return ratio < LEAST


def starting() -> str:
    """How long workers take to be ready: the first, with what it is forked from, and one more."""
    pool = Processes(1, "contact")
    seconds = []
    for _ in range(2):
        started = time.perf_counter()
        pool.executor.submit(os.getpid).result()
        seconds.append(time.perf_counter() - started)
        pool.renew()
    return f"the first worker is ready after {seconds[0]:.2f} s, one more after {seconds[1]:.3f} s"


def long(arguments: argparse.Namespace, scratch: Path) -> bool:
    """One clip, cut into pieces for 2 processes, against 1."""
    write_bvh(folder(scratch / "in") / "long.bvh", repeated(arguments.clip, arguments.frames))
    ratio, _ = by_turns(scratch, arguments.rounds)
    print(f"{arguments.clip}, {arguments.frames} frames in one clip: 2 jobs have {ratio:.2f} times the throughput of 1")
    print(f"memory of the largest process: {memory():.0f} MB")
    return not same(scratch / "1", scratch / "2")


def by_turns(scratch: Path, rounds: int) -> tuple[float, float]:
    """How much faster 2 processes are than 1, and the seconds until the first clip is done; medians."""
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
    """Kill a run at random moments, and compare what comes out in the end."""
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
    print(f"{len(outputs)} clips, {twice} made twice, outputs {'the same' if equal else 'DIFFERENT'}")
    return bool(twice) or not equal


def tiny(arguments: argparse.Namespace, scratch: Path) -> bool:
    """What a clip costs that has next to nothing in it."""
    clip = repeated("walk", 1)
    for number in range(arguments.clips):
        write_bvh(folder(scratch / "in") / f"{number}.bvh", clip)
    started = time.perf_counter()
    for what in ("made", "skipped"):
        with run(scratch / "in", scratch / "out") as process:
            status = process.wait()
        seconds = time.perf_counter() - started
        print(f"{arguments.clips} clips {what} in {seconds:.1f} s, {1e3 * seconds / arguments.clips:.1f} ms each")
        started = time.perf_counter()
    size = (scratch / "out" / MANIFEST).stat().st_size / arguments.clips
    print(f"manifest: {size:.0f} bytes a clip; memory of the largest process: {memory():.0f} MB")
    return status != 0 or len(done(scratch / "out")) != arguments.clips


def memory() -> float:
    """The largest memory of a process that has been waited for [MB]."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024


def repeated(name: str, frames: int) -> Motion:
    """A sample to and fro, until it has so many frames."""
    clip = read_bvh(SAMPLES / f"{name}.bvh")
    order = np.concatenate([np.arange(len(clip)), np.arange(len(clip))[::-1]])
    order = np.resize(order, frames)
    return replace(clip, translations=clip.translations[order], rotations=clip.rotations[order])


def folder(path: Path) -> Path:
    """The folder, made if it is not there."""
    path.mkdir(exist_ok=True)
    return path


def run(source: Path, out: Path, *options: Any) -> subprocess.Popen[bytes]:
    """A batch, under way."""
    command = [sys.executable, "-m", "distretarget", "batch", source, TARGET, "-o", out, *options]
    return subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def done(out: Path) -> list[dict[str, Any]]:
    """The lines of clips that are done."""
    return [record for record in records(out / MANIFEST) if record["status"] == "done"]


def records(path: Path) -> Iterator[dict[str, Any]]:
    """The whole lines of a manifest."""
    lines = path.read_text().split("\n")[:-1] if path.exists() else []
    return (json.loads(line) for line in lines if line.endswith("}"))


def same(one: Path, other: Path) -> bool:
    """Whether two folders have the same outputs."""
    trees = [{path.relative_to(out): path.read_bytes() for path in out.rglob("*.bvh")} for out in (one, other)]
    return trees[0] == trees[1]


if __name__ == "__main__":
    main()
