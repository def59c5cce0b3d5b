"""Measure `distretarget batch` under load, after kills, and per clip; each measurement is a command.

    python benchmarks/batch.py together [--runs 2] [--clips 24] [--frames 200] [--rounds 10] [--kills 4]
    python benchmarks/batch.py tiny [--clips 400] [--frames 2] [--rounds 3]

The exit status is 1 if outputs are wrong or missing.
"""

from __future__ import annotations

import random
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import click
from clips import SAMPLES, back_and_forth

from distretarget import read_bvh, write_bvh
from distretarget.batch.plan import DATABASE, METRICS
from distretarget.batch.results import BatchRecord, Database

CLIPS = ("walk", "clap", "wave", "turn", "hands_on_hips")
TARGET = SAMPLES / "rigs" / "mixamo_t.json"


@click.group(help=__doc__)
@click.pass_context
def main(context: click.Context) -> None:
    """Run the measurement named on the command line in a folder that is removed afterwards."""
    context.obj = Path(context.with_resource(tempfile.TemporaryDirectory()))


@main.command()
@click.option("--runs", default=2)
@click.option("--clips", default=24)
@click.option("--frames", default=200)
@click.option("--rounds", default=10)
@click.option("--kills", default=4)
@click.pass_obj
def together(scratch: Path, runs: int, clips: int, frames: int, rounds: int, kills: int) -> None:
    """Let several runs convert the same clips into one folder, of which one is killed at random moments; outputs must
    be those of an undisturbed run, and only metrics and database may lie beside them.
    """
    write_samples(scratch, clips, frames)
    whole, wrong = scratch / "whole", 0
    run(scratch / "in", whole, "--jobs", 2).wait()
    for number in range(rounds):
        out = scratch / f"together {number}"
        processes = [run(scratch / "in", out, "--jobs", 1) for _ in range(runs)]
        for _ in range(kills):
            time.sleep(random.uniform(0.0, 3.0))
            victim = random.randrange(runs)
            processes[victim].kill()
            processes[victim].wait()
            processes[victim] = run(scratch / "in", out, "--jobs", 1)
        statuses = {process.wait() for process in processes}
        beside = {path.name for path in out.iterdir()} - {path.name for path in outputs(out)}
        same = outputs(out) == outputs(whole) and (out / METRICS).read_bytes() == (whole / METRICS).read_bytes()
        is_right = same and statuses == {0} and beside == {DATABASE, METRICS} and len(done(out)) == clips
        wrong += not is_right
        print(f"  round {number}: {'right' if is_right else f'WRONG: {statuses}, {beside}, {same}'}", flush=True)
    print(f"{runs} runs over {clips} clips, {kills} killed: {wrong} of {rounds} rounds wrong")
    sys.exit(bool(wrong))


@main.command()
@click.option("--clips", default=400)
@click.option("--frames", default=2)
@click.option("--rounds", default=3)
@click.pass_obj
def tiny(scratch: Path, clips: int, frames: int, rounds: int) -> None:
    """Convert very short clips with 1 process and with 2, and skip them; print time, disk space and memory per clip."""
    write_samples(scratch, clips, frames)
    run(scratch / "in", scratch / "first").wait()  # which compiles
    for what, jobs in (("1 job", 1), ("2 jobs", 2), ("done before", 1)):
        seconds = []
        for turn in range(rounds):
            started, out = time.perf_counter(), scratch / f"{jobs} {turn}"
            assert run(scratch / "in", out, "--jobs", jobs).wait() == 0
            seconds.append(1e3 * (time.perf_counter() - started) / clips)
        print(f"{clips} clips, {what}: {statistics.median(seconds):.1f} ms each", flush=True)
    sizes = {name: (out / name).stat().st_size / clips for name in (DATABASE, METRICS)}
    print(", ".join(f"{name}: {size:.0f} bytes a clip" for name, size in sizes.items()))
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"memory of the largest process: {memory:.0f} MB")
    sys.exit(len(done(out)) != clips)


def write_samples(scratch: Path, clips: int, frames: int) -> None:
    """Write the inputs of the batch: sample clips in turn, played forwards and backwards for so many frames."""
    (scratch / "in").mkdir()
    for number in range(clips):
        sample = read_bvh(SAMPLES / f"{CLIPS[number % len(CLIPS)]}.bvh")
        write_bvh(scratch / "in" / f"{number}.bvh", back_and_forth(sample, frames))


def run(source: Path, out: Path, *options: Any) -> subprocess.Popen[bytes]:
    """Start a batch."""
    command = [sys.executable, "-m", "distretarget", "batch", source, TARGET, "-o", out, *options]
    return subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def done(out: Path) -> list[BatchRecord]:
    """The records of converted clips."""
    with closing(Database(out, read_only=True)) as database:
        return [record for record in database.latest() if record["status"] == "done"]


def outputs(out: Path) -> dict[Path, bytes]:
    """The contents of the BVH files in a folder, by relative path."""
    return {path.relative_to(out): path.read_bytes() for path in out.rglob("*.bvh")}


if __name__ == "__main__":
    main()
