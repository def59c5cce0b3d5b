"""Give the program generated inputs, valid and broken, and count what becomes of them.

    python benchmarks/fuzz.py [--readers N] [--pipeline N] [--scenes N] [--contacts N] [--commands N] [--processes N]
                              [--seconds N] [--seed N] [--keep FOLDER]

Readers: N texts are read as clips, skeleton files, maps or records, written, and read again. Pipeline: N clips are
retargeted with targets, maps and options, and the results read again, by pybvh too. Scenes, contacts, commands: N
folders of generated files, pipes, devices and links among them, are given to one command. Processes: N runs of the
command line, some with closed streams. `--seconds` goes through all parts for about so long, instead of counts. Each
input ends in one of the `OUTCOMES`; the first two are right, and the exit status is 1 if there is any other. `--keep`
writes the inputs of all others to a folder. The same seed gives the same inputs. Ctrl-C ends a part early.
"""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
import pybvh
from fuzz_folders import asked, commands, run_in_folder, scenes
from fuzz_outcomes import (
    HANG,
    LIMIT,
    REFUSED,
    RIGHT,
    TRACEBACK,
    UNREADABLE,
    Memory,
    NotReadBackError,
    TooLongError,
    late,
)
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from distretarget import DistretargetError, Motion, Options, Skeleton, Tally, Target
from distretarget.batch.packed import packed_part, unpacked
from distretarget.io.bvh import parse_bvh
from distretarget.io.bvh_writer import format_bvh, python_refusals
from distretarget.io.input_file import InputFile
from distretarget.io.map_json import parse_map
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.io.target_file import TargetFile, parse_target
from distretarget.pipeline.conversion import Recipe
from distretarget.pipeline.conversion import convert as convert_clip

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
import strategies as made

MEMORY = "more than 2 GB"
OUTCOMES = (RIGHT, REFUSED, TRACEBACK, HANG, MEMORY, UNREADABLE)
MOST_MEMORY = 2 * 2**30  # of an input [bytes]
ROUND = 500  # inputs from one seed
BATCH = {"readers": 1000, "pipeline": 100, "scenes": 50, "contacts": 50, "commands": 50, "processes": 5}  # at a time
SLOW = list(HealthCheck)  # only generation, however slow
UNCHECKED = settings(database=None, deadline=None, phases=[Phase.generate], suppress_health_check=SLOW)
SAME = 1e-6  # how far positions may be off when they are read back [of the largest coordinate]

texts = st.one_of(
    st.tuples(st.just("clip"), st.one_of(made.clips, made.broken(made.clips))),
    st.tuples(st.just("target"), st.one_of(made.targets, made.broken_json(made.skeleton_files()))),
    st.tuples(st.just("map"), st.one_of(made.map_files, made.broken_json(made.map_files))),
    st.tuples(st.just("record"), st.one_of(made.records(), made.broken_json(made.records()))),
)
jobs = made.often(
    st.tuples(made.pairs, st.just("{}"), made.options),
    st.tuples(made.pairs, made.map_files, made.strange_options),
    st.tuples(st.tuples(made.broken(made.clips), made.targets), st.just("{}"), made.options),
)
lines = st.tuples(
    st.sampled_from(("retarget", "retarget", "diff", "show", "export", "match", "batch")),
    made.often(made.pairs, st.tuples(made.broken(made.clips), made.broken_json(made.skeleton_files()))),
    made.often(st.just("{}"), made.broken_json(made.map_files)),
    st.sampled_from(("", "", "SQLite format 3\0", "a text")),
    made.often(made.options, made.strange_options),
    st.sampled_from(("", "", "", ">&-", "2>&-", "<&-", ">&- 2>&- <&-", ">/dev/full", "2>/dev/full")),
)


# ---- what is done with an input


def _file(text: str, path: str) -> InputFile:
    """A file with a text."""
    return InputFile(text.encode("utf-8", "surrogateescape"), path)


def read(case: tuple[str, str]) -> None:
    """Parse a text, write the result, parse that, and compare."""
    kind, text = case
    if kind == "clip":
        motion = parse_bvh(text, "clip.bvh")
        _same_motion(motion, _again(lambda: parse_bvh(format_bvh(motion), "again.bvh")))
    elif kind == "target":
        target = parse_target(_file(text, "target.json"))
        if isinstance(target, Target):
            written, body = skeleton_to_json(target.skeleton, target.name, target.map), target.skeleton
            again = _again(lambda: parse_target(_file(written, "again.json"))).skeleton
            if body.keys != again.keys or body.channels != again.channels:
                raise NotReadBackError("joints or channels")
            _close(body.offsets, again.offsets, "offsets")
    elif kind == "map":
        pairs = dict(parse_map(text, "map.json").pairs)
        if dict(parse_map(json.dumps(pairs), "again.json").pairs) != pairs:
            raise NotReadBackError("the map")
    else:
        with contextlib.suppress(ValueError):  # the database says that it is damaged
            tally = Tally(clips=3, seconds=1.0)
            tally.add(unpacked("{}", "{}", packed_part(text.encode("utf-8", "surrogatepass")), packed_part(b"")))
            assert tally.lines


def convert(case: tuple[tuple[str, str], str, dict[str, Any]]) -> None:
    """Retarget a clip, write the result, parse it, and compare."""
    (source, target), joint_map, options = case
    chosen = Options(**{key: value for key, value in options.items() if key not in ("jobs", "q")})
    clip, recipe = _file(source, "clip.bvh"), Recipe(chosen, parse_map(joint_map, "map.json"))
    body = TargetFile.of(_file(target, "target"))
    result = convert_clip(recipe.read(clip)[0], clip, body, recipe, name="clip", kinds=("BVH",)).result
    text = format_bvh(result.motion)
    again = _again(lambda: parse_bvh(text, "again.bvh"))
    _same_motion(result.motion, again)
    _check_other_reader(text, result.motion.skeleton)
    if len(again) != len(result.source):
        raise NotReadBackError(f"{len(again)} frames of {len(result.source)}")
    json.dumps(result.metrics, allow_nan=False)
    list(result.warnings)


def _check_other_reader(text: str, skeleton: Skeleton) -> None:
    """Check that pybvh reads a result, or that the run says that it will not."""
    with tempfile.NamedTemporaryFile(suffix=".bvh") as file:
        file.write(text.encode("utf-8", "surrogateescape"))
        file.flush()
        try:
            with warnings.catch_warnings(action="ignore"):
                pybvh.read_bvh_file(file.name)
        except Exception as error:
            if not any("pybvh" in line for line in python_refusals(skeleton)):
                raise NotReadBackError(f"pybvh cannot read it, and no line says so: {error!r}") from error


def run(case: tuple[str, tuple[str, str], str, str, dict[str, Any], str]) -> str:
    """Run the command line once on files with these texts and closed or full streams, and return the outcome."""
    command, (clip, target), joint_map, database, options, streams = case
    chosen = [f"--{key.replace('_', '-')}={value}" for key, value in options.items()]
    arguments = {
        "retarget": ["in.bvh", "target", "-o", "out.bvh", "--json", "out.json", *chosen],
        "diff": ["diff", "in.bvh", "in.bvh", "--json", "out.json"],
        "show": ["skeleton", "show", "target"],
        "export": ["skeleton", "export", "in.bvh", "-o", "out.json"],
        "match": ["skeleton", "match", "in.bvh", "target", "--map", "map.json"],
        "batch": ["batch", "in.bvh", "target", "-o", "out", "--jobs", "1", "--map", "map.json"],
    }[command]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "out").mkdir()
        files = {"in.bvh": clip, "target": target, "map.json": joint_map, "out/results.sqlite": database}
        for file, text in files.items():
            _write(folder / file, text)
        program = ["sh", "-c", f'exec "$@" {streams}', "sh", sys.executable, "-m", "distretarget", *arguments]
        try:
            done = subprocess.run(program, cwd=folder, capture_output=True, timeout=LIMIT, stdin=subprocess.DEVNULL)
        except subprocess.TimeoutExpired as error:
            raise TooLongError from error
        errors = done.stderr.decode("utf-8", "replace")
        if "Traceback" in errors or "Exception ignored" in errors or done.returncode not in (0, 1, 2):
            raise RuntimeError(f"status {done.returncode}: {errors[-600:]}")
        if done.returncode == 0:
            _check_written(folder)
            return RIGHT
    if (
        command != "batch"
        and "2>" not in streams
        and not "".join(errors.splitlines()[-1:]).startswith("distretarget: ")
    ):
        raise RuntimeError(f"status {done.returncode}, and no line says why: {errors[-600:]}")
    return REFUSED


def _write(path: Path, text: str) -> None:
    path.write_bytes(text.encode("utf-8", "surrogatepass"))


def _check_written(folder: Path) -> None:
    for path in (folder / "out.bvh", folder / "out" / "in.bvh"):
        if path.exists():
            text = path.read_bytes().decode("utf-8", "surrogateescape")
            motion = _again(lambda text=text: parse_bvh(text, "out.bvh"))
            if not np.all(np.isfinite(motion.positions)):
                raise NotReadBackError(path.name)
    if (folder / "out.json").exists():
        json.loads((folder / "out.json").read_bytes())


def _again(reading: Callable[[], Any]) -> Any:
    """Parse a text that the program has written; an error means that it cannot be read back."""
    try:
        return reading()
    except DistretargetError as error:
        raise NotReadBackError(str(error)) from error


def _same_motion(motion: Motion, again: Motion) -> None:
    order = list(motion.skeleton.depth_first)  # in which BVH files list joints; their End Sites have no names
    if _named(motion.skeleton) != _named(again.skeleton):
        raise NotReadBackError("joints or channels")
    _close(motion.skeleton.offsets[order[1:]], again.skeleton.offsets[1:], "offsets")
    if motion.positions.shape != again.positions.shape or motion.frame_time_text != again.frame_time_text:
        raise NotReadBackError("frames or frame time")
    if sum(channel.endswith("position") for channel in motion.skeleton.channels[0]) == 3:
        _close(motion.positions[:, order], again.positions, "positions")


def _named(skeleton: Skeleton) -> list[tuple[str, tuple[str, ...]]]:
    """Names and channels of all joints, depth first; End Sites without their names."""
    ends = skeleton.end_sites
    return [("" if ends[j] else skeleton.names[j], skeleton.channels[j]) for j in skeleton.depth_first]


def _close(values: Any, again: Any, what: str) -> None:
    if not (np.all(np.isfinite(values)) and np.all(np.isfinite(again))):
        raise NotReadBackError(f"{what} are not finite")
    if values.size and np.abs(values - again).max() > SAME * max(1.0, np.abs(values).max()):
        raise NotReadBackError(f"{what} are off by {np.abs(values - again).max():g}")


# ---- how it ends


def outcome_of(action: Callable[[Any], str | None], case: Any) -> tuple[str, str]:
    """Return the outcome of an action on an input, and the details of a failure."""
    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(LIMIT)
    memory = Memory()
    try:
        with warnings.catch_warnings(action="error", category=RuntimeWarning):  # which a user would see
            outcome = action(case) or RIGHT
        used = memory.peak()
        return (outcome, "") if used < MOST_MEMORY else (MEMORY, f"{used / 2**20:.0f} MB; {outcome}")
    except DistretargetError as error:
        return (REFUSED, "") if "\n" not in str(error) else (TRACEBACK, f"several lines: {error}")
    except TooLongError:
        return HANG, ""
    except NotReadBackError as error:
        return UNREADABLE, str(error)
    except Exception as error:  # whatever a user would see as a traceback
        return TRACEBACK, "".join(traceback.format_exception(error)[-3:])
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@dataclass
class Tried:
    """How many inputs had each outcome, and the inputs that failed, with details."""

    counts: Counter[str] = field(default_factory=Counter)
    wrong: list[tuple[Any, str]] = field(default_factory=list)


def tried(action: Callable[[Any], str | None], cases: st.SearchStrategy[Any], count: int, first_seed: int) -> Tried:
    """Try `count` inputs of a strategy; Ctrl-C stops early."""
    found = Tried()
    with contextlib.suppress(KeyboardInterrupt):
        while left := count - found.counts.total():

            @seed(first_seed)
            @settings(UNCHECKED, max_examples=min(left, ROUND))
            @given(cases)
            def one_round(case: Any) -> None:
                if found.counts.total() < count:
                    outcome, known = outcome_of(action, case)
                    found.counts[outcome] += 1
                    if outcome not in (RIGHT, REFUSED):
                        found.wrong.append((case, f"{outcome}: {known}"))

            one_round()
            first_seed += 1
    return found


PARTS: dict[str, tuple[Callable[[Any], str | None], st.SearchStrategy[Any]]] = {
    "readers": (read, texts),
    "pipeline": (convert, jobs),
    "scenes": (run_in_folder, scenes()),
    "contacts": (run_in_folder, asked()),
    "commands": (run_in_folder, commands()),
    "processes": (run, lines),
}


@click.command(help=__doc__)
@click.option("--readers", default=0)
@click.option("--pipeline", default=0)
@click.option("--scenes", default=0)
@click.option("--contacts", default=0)
@click.option("--commands", default=0)
@click.option("--processes", default=0)
@click.option("--seconds", default=0.0)
@click.option("--seed", "first_seed", default=0)
@click.option("--keep", type=Path)
def main(seconds: float, first_seed: int, keep: Path | None, **counts: int) -> None:
    """Try as many inputs as asked for, and print the outcomes of each part."""
    started, wrong, rounds = time.monotonic(), 0, 0
    totals = {part: Tried() for part in PARTS}
    while not rounds or time.monotonic() - started < seconds:
        for part, (action, cases) in PARTS.items():
            if not seconds or time.monotonic() - started < seconds:
                count = BATCH[part] if seconds else counts[part]
                found = tried(action, cases, count, 1000 * first_seed + rounds)
                totals[part].counts += found.counts
                for case, known in found.wrong:
                    print(f"--- {part} {wrong}: {known}", flush=True)
                    if keep:
                        keep.mkdir(parents=True, exist_ok=True)
                        (keep / f"{part}_{wrong}.json").write_text(json.dumps(case, indent=1))
                    wrong += 1
        rounds += 1
    for part, found in totals.items():
        ends = ", ".join(f"{found.counts[outcome]:,} {outcome}" for outcome in OUTCOMES)
        print(f"{part}: {found.counts.total():,} inputs: {ends}", flush=True)
    print(f"{time.monotonic() - started:.0f} s")
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
