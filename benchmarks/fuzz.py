"""Give the program generated inputs, valid and broken, and count the outcomes.

    python benchmarks/fuzz.py [--readers N] [--pipeline N] [--characters N] [--scenes N] [--contacts N] [--commands N]
                              [--seconds N] [--seed N] [--keep FOLDER]

Readers: N texts are read as clips, skeleton files, maps or records, written, and read again. Pipeline: N clips are
retargeted with targets, maps and options, and the results read again, by pybvh too. Characters: N mutated glTF files
are read as targets and as motions, written and read again. Scenes, contacts, commands: N folders of generated files,
pipes, devices and links among them, are given to one command. `--seconds` runs all parts for about this time, instead
of counts. Each input has one of the `OUTCOMES`; the first two are right, and the exit status is 1 if there is any
other. `--keep` writes the inputs with other outcomes to a folder, characters by their seed. The same seed gives the
same inputs. Ctrl-C ends a part early.
"""

from __future__ import annotations

import contextlib
import json
import resource
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import click
from fuzz_characters import through
from fuzz_folders import commands, contacts, run_in_folder, scenes
from fuzz_outcomes import OUTCOMES, REFUSED, RIGHT, outcome_of
from fuzz_texts import convert, jobs, read, texts
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

ALL_MEMORY = 6 * 2**30  # of this process [bytes]
ROUND = 500  # inputs from one seed
SLOW = list(HealthCheck)  # only generation, however slow
UNCHECKED = settings(database=None, deadline=None, phases=[Phase.generate], suppress_health_check=SLOW)


class Part(NamedTuple):
    """An action, its inputs, and how many are tried at a time with `--seconds`."""

    action: Callable[[Any], str | None]
    cases: st.SearchStrategy[Any]
    at_a_time: int


PARTS = {
    "readers": Part(read, texts, 1000),
    "pipeline": Part(convert, jobs, 100),
    "characters": Part(through, st.integers(0, 2**40), 100),
    "scenes": Part(run_in_folder, scenes(), 50),
    "contacts": Part(run_in_folder, contacts(), 50),
    "commands": Part(run_in_folder, commands(), 50),
}


@dataclass
class Tried:
    """How many inputs had each outcome, and the inputs that failed, with details."""

    counts: Counter[str] = field(default_factory=Counter)
    wrong: list[tuple[Any, str]] = field(default_factory=list)


def tried(part: Part, count: int, first_seed: int) -> Tried:
    """Try `count` inputs of a part; Ctrl-C stops early."""
    found = Tried()
    with contextlib.suppress(KeyboardInterrupt):
        while left := count - found.counts.total():

            @seed(first_seed)
            @settings(UNCHECKED, max_examples=min(left, ROUND))
            @given(part.cases)
            def one_round(case: Any) -> None:
                if found.counts.total() < count:
                    outcome, details = outcome_of(part.action, case)
                    found.counts[outcome] += 1
                    if outcome not in (RIGHT, REFUSED):
                        found.wrong.append((case, f"{outcome}: {details}"))

            one_round()
            first_seed += 1
    return found


@click.command(help=__doc__)
@click.option("--seconds", default=0.0)
@click.option("--seed", "first_seed", default=0)
@click.option("--keep", type=Path)
def main(seconds: float, first_seed: int, keep: Path | None, **counts: int) -> None:
    """Try the inputs of all parts, and print the outcomes."""
    resource.setrlimit(resource.RLIMIT_AS, (ALL_MEMORY, ALL_MEMORY))
    started, wrong, rounds = time.monotonic(), 0, 0
    totals = {name: Tried() for name in PARTS}
    while not rounds or time.monotonic() - started < seconds:
        for name, part in PARTS.items():
            if not seconds or time.monotonic() - started < seconds:
                found = tried(part, part.at_a_time if seconds else counts[name], 1000 * first_seed + rounds)
                totals[name].counts += found.counts
                for case, details in found.wrong:
                    print(f"--- {name} {wrong}: {details}", flush=True)
                    if keep:
                        keep.mkdir(parents=True, exist_ok=True)
                        (keep / f"{name}_{wrong}.json").write_text(json.dumps(case, indent=1))
                    wrong += 1
        rounds += 1
    for name, found in totals.items():
        ends = ", ".join(f"{found.counts[outcome]:,} {outcome}" for outcome in OUTCOMES)
        print(f"{name}: {found.counts.total():,} inputs: {ends}", flush=True)
    print(f"{time.monotonic() - started:.0f} s")
    sys.exit(wrong > 0)


main.params += [click.Option([f"--{name}"], default=0) for name in PARTS]

if __name__ == "__main__":
    main()
