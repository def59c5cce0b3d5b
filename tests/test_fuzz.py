"""A short run of generated inputs: each is written right, or refused in one line (`benchmarks/fuzz.py` runs more)."""

import fuzz
import pytest
from fuzz_outcomes import HANG, REFUSED, RIGHT, TRACEBACK, UNREADABLE, NotReadBackError, TooLongError, outcome_of

from distretarget import DistretargetError

FINDINGS = {  # inputs that once went wrong
    "a clip without bones as a target": ("target", "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 0\n}\n"),
    "a record of a wrong kind": ("record", '{"input": 3}'),
    "brackets": ("record", "[" * 100_000),
    "an object of brackets": ("target", "{" + "[" * 100_000),
    "a map to a number": ("map", '{"Hips": 3}'),
    "noise beside OFFSETs as large as can be": (
        "clip",
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n"
        + "".join(f"JOINT {n}\n{{\nOFFSET 0 1e12 0\nCHANNELS 3 Xposition Yposition Zposition\n}}\n" for n in "bc")
        + "}\nMOTION\nFrames: 1\nFrame Time: 1\n"
        + "0 5 0 " * 3,
    ),
    "a frame time of nothing": (
        "clip",
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 0\n}\nMOTION\nFrames: 0\nFrame Time: 5e-324\n",
    ),
}


@pytest.mark.parametrize("case", FINDINGS.values(), ids=FINDINGS)
def test_findings_stay_mended(case):
    outcome, known = outcome_of(fuzz.read, case)
    assert outcome in (RIGHT, REFUSED), known


@pytest.mark.parametrize(
    ("part", "count"),
    [("readers", 100), ("pipeline", 25), ("scenes", 8), ("contacts", 8), ("commands", 10)],
)
def test_generated_inputs(part, count):
    tried = fuzz.tried(fuzz.PARTS[part], count, first_seed=10**6)
    assert tried.counts.total() == count
    assert not tried.wrong


def test_what_goes_wrong_is_told_apart():
    def fails(case):
        raise case

    assert outcome_of(fails, ValueError("x"))[0] == TRACEBACK
    assert outcome_of(fails, NotReadBackError("x"))[0] == UNREADABLE
    assert outcome_of(fails, TooLongError())[0] == HANG
    assert outcome_of(fails, DistretargetError("one line"))[0] == REFUSED
    assert outcome_of(fails, DistretargetError("two\nlines"))[0] == TRACEBACK
