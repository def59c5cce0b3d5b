"""Of processes that run side by side one compiles a function, and the others wait for it and load its code."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core import event

from distretarget.numerics import code_cache, compiled
from distretarget.numerics.parallel import cores

fcntl = pytest.importorskip("fcntl", reason="nobody waits where there are no locks")

COMPILED = """
import sys
from numba.core import event

names = []

class Listener(event.Listener):
    def on_start(self, event):
        names.append(event.data["dispatcher"].py_func.__name__)
    def on_end(self, event):
        pass

event.register("numba:compile", Listener())
{run}
print(*names)
"""
CHECK = """
import numpy as np
from distretarget.numerics.rotations import first_not_unit
first_not_unit(np.eye(4), 1e-6)
"""
FROM_SOURCE = """
from importlib.machinery import SourceFileLoader
of_file = SourceFileLoader.get_code
def of_source(self, name):
    if name.startswith("distretarget"):
        return self.source_to_code(self.get_data(self.path), self.path)
    return of_file(self, name)
SourceFileLoader.get_code = of_source
"""
KEYS = """
from distretarget.objectives import contact
from distretarget.objectives import paper
for code in (contact._solve, paper._solve_poses):
    print(code._cache._index_key("signature", code.targetctx.codegen()))
"""
WARM = """
from distretarget.batch.compile_ahead import warm
warm("contact")
"""


def twice(x):
    return 2.0 * x


class Seen(event.Listener):
    """What happened, and what to do when it begins."""

    def __init__(self, then=lambda: None):
        self.kinds, self.then = [], then

    def on_start(self, started):
        self.kinds.append(started.kind)
        self.then()

    def on_end(self, ended):
        pass


@pytest.fixture
def code(tmp_path, monkeypatch):
    """Compile `twice` as another process would, which shares nothing but the folder of compiled code."""
    monkeypatch.setattr(compiled, "code_folder", lambda: tmp_path)
    return lambda: compiled.compiled()(twice)


def locked(function):
    """Lock a function, as a process that compiles it does."""
    cache = function._cache
    cache._impl.locator.ensure_cache_path()
    file = Path(cache._cache_path, f"{cache._impl.filename_base}.lock").open("wb")  # noqa: SIM115
    fcntl.flock(file, fcntl.LOCK_EX)
    return file


def test_code_is_loaded_where_another_has_compiled_it(code):
    first, second = code(), code()
    assert first(2.0) == second(2.0) == 4.0
    assert sum(first.stats.cache_misses.values()) == 1
    assert sum(second.stats.cache_hits.values()) == 1


def test_who_finds_a_function_locked_waits_and_then_loads_it(code):
    first, second = code(), code()
    file = locked(second)

    def end():
        file.close()
        first(2.0)

    seen = Seen(then=end)
    with event.install_listener(code_cache.WAITING, seen):
        assert second(2.0) == 4.0
    assert seen.kinds[0] == code_cache.WAITING
    assert sum(second.stats.cache_hits.values()) == 1


def test_a_process_that_ends_on_the_way_lets_the_others_compile(code):
    function = code()
    with event.install_listener(code_cache.WAITING, Seen(then=locked(function).close)):
        assert function(2.0) == 4.0
    assert sum(function.stats.cache_misses.values()) == 1


def test_nobody_waits_for_ever(code, monkeypatch):
    monkeypatch.setattr(code_cache, "LONGEST_WAIT", 0.0)
    function = code()
    with locked(function):
        assert function(2.0) == 4.0


def test_waiting_is_announced(code):
    function, lines = code(), []
    file = locked(function)
    with compiled.announced_compilation(lines.append), event.install_listener(code_cache.WAITING, Seen(file.close)):
        function(2.0)
    assert len(lines) == 1


def run_side_by_side(text, folder, count):
    """The names of the functions that each of some processes compiles, which begin with an empty folder."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder)}
    environment.pop("OMP_NUM_THREADS", None)
    command = [sys.executable, "-c", COMPILED.format(run=text)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    running = [subprocess.Popen(command, env=environment, **pipes) for _ in range(count)]
    ends = [process.communicate() for process in running]
    assert [process.returncode for process in running] == count * [0], ends
    return [names.split() for names, _ in ends]


def test_two_processes_side_by_side_compile_everything_once(tmp_path):
    one, other = run_side_by_side(CHECK, tmp_path, 2)
    assert (one + other).count("_first_not_unit") == 1


def test_code_is_found_by_processes_that_read_modules_from_source_and_from_pyc_files():
    runs = [
        subprocess.run([sys.executable, "-c", text + KEYS], capture_output=True, text=True)
        for text in ("", FROM_SOURCE)
    ]
    (of_contact, of_paper), again = (run.stdout.splitlines() for run in runs)
    assert [of_contact, of_paper] == again
    assert of_contact != of_paper


def test_another_process_compiles_the_solver_in_the_first_run(tmp_path):
    """And in no later one: then there is nothing to compile."""
    if cores() < 2:
        pytest.skip("there is one core")
    (first,) = run_side_by_side(WARM, tmp_path, 1)
    assert "_write_springs" in first
    assert "solve" not in first
    assert run_side_by_side(WARM, tmp_path, 1) == [[]]
