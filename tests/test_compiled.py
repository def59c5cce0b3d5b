"""Compiled code is kept where it can be, is never out of date, and gives the same bytes in all runs."""

import errno
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from bodies import SAMPLES
from numba.core import config
from numba.core.caching import IndexDataCacheFile

from distretarget.numerics import compiled as module
from distretarget.numerics.compiled import PACKAGE, announced_compilation, compiled, inlined, merged, uncompiled

RUN = """
import hashlib, sys
from distretarget import load_target, read_bvh, retarget
from distretarget.numerics.compiled import announced_compilation

with announced_compilation(lambda line: print(line.partition(",")[0])):
    result = retarget(read_bvh(sys.argv[1]), load_target(sys.argv[2]))
print(hashlib.sha256(result.motion.rotations.tobytes()).hexdigest())
"""
READ = """
import sys
from distretarget import read_bvh
from distretarget.numerics.compiled import announced_compilation

with announced_compilation(print):
    print(len(read_bvh(sys.argv[1])))
"""
COMMAND = [sys.executable, "-c", RUN, SAMPLES / "squat.bvh", SAMPLES / "rigs" / "lafan1_a.json"]
FIRST = "compiling for the first run"


@inlined()
def squared(x):
    return x * x


@merged
def sum_of_squares(values):
    total = 0.0
    for value in values:
        total += squared(value)
    return total


def length(values):
    return np.sqrt(sum_of_squares(values))


def start(folder, **changes):
    """Retarget a clip in another process, which says when it compiles, and then the hash of the result."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder)} | changes
    pipe = subprocess.PIPE
    return subprocess.Popen(COMMAND, env=environment, stdout=pipe, stderr=pipe, text=True)


def end(process):
    output, errors = process.communicate()
    assert (process.returncode, errors) == (0, "")
    return output.split("\n")[:-1]


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A folder that two processes have filled side by side, and what they said."""
    folder = tmp_path_factory.mktemp("code")
    running = [start(folder), start(folder, OMP_NUM_THREADS="1", PYTHONDONTWRITEBYTECODE="1")]
    return folder, [end(process) for process in running]


def test_processes_that_compile_side_by_side_get_the_same_bytes(kept):
    _, (one, other) = kept
    assert one == other
    assert one[0] == FIRST
    assert len(one[1]) == 64


def test_later_runs_compile_nothing_and_get_the_bytes_of_the_first(kept):
    folder, ((_, first), _) = kept
    assert end(start(folder)) == [first]


@pytest.fixture
def places(tmp_path, monkeypatch):
    """The three places to keep code in, in order; a place that is made a file cannot be used."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "chosen"))
    monkeypatch.setattr(module, "PACKAGE", tmp_path / "package")
    for name in ("HOME", "USERPROFILE"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    return [tmp_path / "chosen", tmp_path / "package", tmp_path / "home"]


def chosen():
    return module.code_folder.__wrapped__()


def test_code_is_kept_in_the_first_place_that_can_be_written_to(places):
    for place in places:
        assert chosen().is_relative_to(place)
        shutil.rmtree(place)
        place.touch()
    assert chosen() is None


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="permissions of POSIX systems")
def test_code_is_not_taken_from_a_folder_that_others_can_write_to(places):
    """Whoever writes there could have prepared code, which would be run."""
    first, second, _ = places
    folder = chosen()
    assert folder.stat().st_mode & 0o077 == 0
    folder.chmod(0o777)
    assert chosen().is_relative_to(second)
    folder.chmod(0o700)
    first.chmod(0o777)  # others could replace the folder in it
    assert chosen().is_relative_to(second)
    first.chmod(0o1777)
    assert chosen() == folder


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="permissions of POSIX systems")
def test_a_folder_of_somebody_else_is_not_private(tmp_path, monkeypatch):
    owners = {tmp_path: 12345}
    stat = type(tmp_path).stat

    def owned(path, **options):
        status = stat(path, **options)
        return os.stat_result((*status[:4], owners.get(path, status.st_uid), *status[5:]))

    assert module.is_private(tmp_path)
    monkeypatch.setattr(type(tmp_path), "stat", owned)
    assert not module.is_private(tmp_path)


def test_functions_are_compiled_also_where_no_code_can_be_kept(monkeypatch):
    lines = []
    monkeypatch.setattr(module, "code_folder", lambda: None)
    with announced_compilation(lines.append):
        assert compiled()(length)(np.array([3.0, 4.0])) == 5.0
    assert len(lines) == 1
    assert "in every run" in lines[0]


def test_code_of_two_kinds_of_arrays_is_loaded_by_another_function_of_the_same_source(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "code_folder", lambda: tmp_path)
    first, second = compiled()(length), compiled()(length)
    assert first(np.array([3.0, 4.0])) == second(np.array([3.0, 4.0])) == 5.0
    assert first(np.array([3, 4, 12])) == second(np.array([3, 4, 12])) == 13.0
    assert len([*tmp_path.rglob("*.nbc")]) == 2
    assert str(tmp_path) != config.CACHE_DIR, "the folder is that of the package's own functions alone"


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", ["empty", "cut", "other bytes", "one byte"])
def test_damaged_code_is_compiled_again(tmp_path, monkeypatch, suffix, damage):
    monkeypatch.setattr(module, "code_folder", lambda: tmp_path)
    values = np.array([3.0, 4.0])
    assert compiled()(length)(values) == 5.0
    (file,) = tmp_path.rglob(f"*{suffix}")
    whole = file.read_bytes()
    middle = len(whole) // 2
    changed = bytes([whole[middle] ^ 1])
    file.write_bytes(
        {
            "empty": b"",
            "cut": whole[:middle],
            "other bytes": b"\0" * len(whole),
            "one byte": whole[:middle] + changed + whole[middle + 1 :],
        }[damage]
    )
    assert compiled()(length)(values) == 5.0
    kept = file.read_bytes()
    assert len(kept) > middle, "it is kept again"
    lines = []
    with announced_compilation(lines.append):
        assert compiled()(length)(values) == 5.0
    assert not lines


def test_a_run_does_without_code_that_cannot_be_written(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "code_folder", lambda: tmp_path)
    monkeypatch.setattr(IndexDataCacheFile, "_open_for_write", full_disk)
    assert compiled()(length)(np.array([3.0, 4.0])) == 5.0


def full_disk(*_):
    raise OSError(errno.ENOSPC, "no space left")


def test_functions_on_few_numbers_run_as_python_where_that_is_sooner(monkeypatch):
    monkeypatch.setattr(module, "_code_of", lambda *_: lambda _: "compiled")
    monkeypatch.delitem(sys.modules, "numba")
    say = compiled()(lambda values: f"{len(values)} as Python")
    with uncompiled():
        assert say(np.zeros(3)) == "3 as Python"
        assert say(np.zeros(1_000_000)) == "compiled"
    assert say(np.zeros(3)) == "compiled"


@pytest.mark.usefixtures("places")
def test_a_changed_source_has_its_own_folder(tmp_path):
    (tmp_path / "package").mkdir()
    source = tmp_path / "package" / "solver.py"
    folders = set()
    for line in ("a", "b"):
        source.write_text(f"from distretarget.numerics.compiled import compiled  # {line}")
        folders.add(chosen())
    assert len(folders) == 2


def test_the_program_runs_in_an_installation_that_nobody_can_write_to(tmp_path):
    """A file stands wherever a folder would have to be made."""
    copy = tmp_path / "site"
    shutil.copytree(PACKAGE, copy / "distretarget", ignore=shutil.ignore_patterns("__pycache__"))
    for place in ("site/distretarget/__pycache__", "home"):
        (tmp_path / place).touch()
    home = {"HOME": str(tmp_path / "home"), "USERPROFILE": str(tmp_path / "home"), "NUMBA_CACHE_DIR": ""}
    environment = os.environ | home | {"PYTHONPATH": str(copy), "PYTHONSAFEPATH": "1"}
    command = [sys.executable, "-c", READ, SAMPLES / "walk.bvh"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    told, frames = done.stdout.splitlines()
    assert "no folder to keep the code in" in told
    assert frames == "249"
