"""The scripts in `examples/` run unchanged, and pass a type check as a user's code would."""

import runpy
import shutil
import subprocess
import sys

import numpy as np
import pytest
from bodies import ROOT, SAMPLES

EXAMPLES = ROOT / "examples"


@pytest.fixture
def run(monkeypatch, capsys):
    """Runs an example with arguments; returns what it printed."""

    def run(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
        return capsys.readouterr().out

    return run


def test_a_folder_becomes_a_data_set_of_positions_and_6d_rotations(run, tmp_path):
    (tmp_path / "clips").mkdir()
    for name in ("clap.bvh", "wave.bvh"):
        shutil.copy(SAMPLES / name, tmp_path / "clips")
    assert "2 clips: 2 converted" in run("data_set", tmp_path / "clips", SAMPLES / "child.json", tmp_path / "arrays")
    paths = sorted((tmp_path / "arrays").glob("*.npz"))
    assert [path.stem for path in paths] == ["clap", "wave"]
    assert len((tmp_path / "arrays/metrics.csv").read_text().splitlines()) == 3
    for path in paths:
        with np.load(path, allow_pickle=False) as arrays:
            frames, joints, _ = arrays["positions"].shape
            assert arrays["local_rotations"].shape == arrays["world_rotations"].shape == (frames, joints, 6)
            assert len(arrays["names"]) == len(arrays["parents"]) == joints
            columns = arrays["world_rotations"].reshape(frames, joints, 2, 3)
            np.testing.assert_allclose((columns[..., 0, :] * columns[..., 1, :]).sum(axis=-1), 0, atol=1e-6)
            assert len(arrays["shots"]) == frames


def test_a_clip_is_compared_with_its_source(run, tmp_path):
    printed = run("compare", SAMPLES / "clap.bvh", SAMPLES / "long_arms.json", tmp_path / "report.html")
    assert [line.split()[0] for line in printed.splitlines()] == ["source", "rotation_copy", "result"]
    assert "</html>" in (tmp_path / "report.html").read_text("utf-8")


def test_a_clip_is_printed_as_arrays(run):
    printed = run("arrays", SAMPLES / "clap.bvh")
    assert "LeftWrist" in printed
    assert ", 3, 3)" in printed


def test_the_example_of_a_data_set_is_ten_lines():
    lines = (EXAMPLES / "data_set.py").read_text().split('"""')[2].splitlines()
    assert len([line for line in lines if line.strip()]) <= 10


def test_the_examples_are_typed_strictly_from_outside_the_package(tmp_path):
    """Checked as in a user's project: in another folder, without this project's settings."""
    pytest.importorskip("mypy")
    for example in EXAMPLES.glob("*.py"):
        (tmp_path / example.name).write_text(example.read_text())
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", ROOT / ".mypy_cache", *tmp_path.glob("*.py")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert checked.returncode == 0, checked.stdout
