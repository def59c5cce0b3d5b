"""Warming up compiles everything that clips need; nothing is compiled after it."""

import subprocess
import sys

import numba
import pytest
from bodies import SAMPLES, other_lengths, person, swaying

from distretarget import Options, load_target, read_bvh, retarget
from distretarget.pipeline.compile_ahead import warm

WATCHED = """
import pickle
import sys
from distretarget import load_target, read_bvh
from distretarget.batch.job import Job, Recipe, convert
from distretarget.batch.plan import Clip
from distretarget.batch.record import new_record
from distretarget.pipeline.options import Options
from distretarget.io.input_file import load_file
from distretarget.io.target_file import TargetFile
from distretarget.pipeline.compile_ahead import warm
from numba.core.dispatcher import Dispatcher

warm(sys.argv[1])
compile, late = Dispatcher.compile, []
Dispatcher.compile = lambda self, signature: late.append(self.py_func.__name__) or compile(self, signature)
for target in sys.argv[2:4]:
    for clip in sys.argv[4:]:
        recipe = Recipe(Options(objective=sys.argv[1]))
        planned = Clip(clip, TargetFile.of(load_file(target)), ("out.bvh",), 0)
        job = Job(load_file(clip), pickle.dumps(planned.target), recipe, new_record(planned, {}), planned.outputs)
        assert convert(job).outputs
print(late)
"""


@pytest.mark.parametrize("objective", ["contact", "paper"])
def test_nothing_is_compiled_after_warming_up(objective):
    files = [SAMPLES / name for name in ("long_arms.json", "rigs/mixamo_t.json", "clap.bvh", "walk.bvh")]
    done = subprocess.run([sys.executable, "-c", WATCHED, objective, *files], capture_output=True, text=True)
    assert done.stderr == ""
    assert done.stdout == "[]\n"


def test_the_solver_is_compiled_for_one_layout_of_arrays(monkeypatch):
    seen = set()

    def note(*arguments):
        seen.add(tuple(str(numba.typeof(argument)) for argument in arguments))

    monkeypatch.setattr("distretarget.objectives.contact._solve", note)
    warm("contact")
    for supports in ("hold", "free"):
        retarget(swaying(person(), frames=3), other_lengths(person()), Options(supports=supports))
    retarget(read_bvh(SAMPLES / "squat.bvh"), load_target(SAMPLES / "child.json"))
    assert len(seen) == 1
