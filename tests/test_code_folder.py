"""Compiled code is kept where that can be done safely, and the program runs where it cannot."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from bodies import SAMPLES

from distretarget.numerics import code_folder as module
from distretarget.numerics.code_folder import PACKAGE

NOBODY = 65534  # a user who is not the one that runs the tests


@pytest.fixture
def places(tmp_path, monkeypatch):
    """The four places to keep code in, in order; a place that is made a file cannot be used."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "chosen"))
    monkeypatch.setattr(module, "PACKAGE", tmp_path / "package")
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "home")
    monkeypatch.setattr(module.tempfile, "gettempdir", lambda: str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    private = f"distretarget-{os.getuid()}" if hasattr(os, "getuid") else "distretarget"
    return [tmp_path / "chosen", tmp_path / "package", tmp_path / "home", tmp_path / "temporary" / private]


def chosen():
    return module.code_folder.__wrapped__()


def test_code_is_kept_in_the_first_place_that_can_be_written_to(places):
    for place in places:
        assert chosen().is_relative_to(place)
        shutil.rmtree(place)
        place.touch()
    assert chosen() is None


def test_code_of_versions_that_have_not_run_for_long_is_removed(places, tmp_path):
    names = {"old": f"compiled-{16 * '0'}", "recent": f"compiled-{16 * '1'}", "other": "compiled-notes"}
    folders = {kind: places[0] / name for kind, name in names.items()}
    for folder in folders.values():
        (folder / "code").mkdir(parents=True)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    link = places[0] / f"compiled-{16 * '2'}"
    link.symlink_to(elsewhere, target_is_directory=True)
    for path in (folders["old"], folders["other"], elsewhere):
        os.utime(path, (0, 0))
    assert chosen().parent == places[0]
    assert [kind for kind, folder in folders.items() if folder.exists()] == ["recent", "other"]
    assert elsewhere.exists()
    os.utime(folders["recent"], (0, 0))
    assert chosen().exists()
    assert folders["recent"].exists(), "only the first run of a version searches"


def make_link(folder, elsewhere):
    elsewhere.mkdir(0o700)
    folder.symlink_to(elsewhere)


def make_open_to_all(folder, _elsewhere):
    folder.mkdir()
    folder.chmod(0o777)


def make_of_another_user(folder, _elsewhere):
    if os.getuid() != 0:
        pytest.skip("only root can give a folder to another user")
    folder.mkdir(0o700)
    os.chown(folder, NOBODY, NOBODY)


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="temporary files are private here")
@pytest.mark.parametrize("make", [make_link, make_open_to_all, make_of_another_user])
def test_no_code_is_taken_from_a_folder_that_others_may_have_filled(places, tmp_path, make):
    for place in places[:3]:
        place.touch()
    make(places[3], tmp_path / "elsewhere")
    assert chosen() is None


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
    for place in ("site/distretarget/__pycache__", "home", f"distretarget-{getattr(os, 'getuid', str)()}"):
        (tmp_path / place).touch()
    home = {"HOME": str(tmp_path / "home"), "USERPROFILE": str(tmp_path / "home"), "NUMBA_CACHE_DIR": ""}
    environment = os.environ | home | {"TMPDIR": str(tmp_path), "PYTHONPATH": str(copy), "PYTHONSAFEPATH": "1"}
    command = [sys.executable, "-m", "distretarget", "skeleton", "show", SAMPLES / "rigs" / "unreal_a.json"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0
    assert done.stdout.startswith("68 joints, ")
    assert done.stderr.count("\n") == 1
    assert "no folder to keep the code in" in done.stderr
