"""`distretarget scene`, as a user meets it: files that are missing, links, names and times."""

import json

import numpy as np
import pytest
from bodies import SAMPLES, person, swaying
from program import refused, run, succeeded

from distretarget import read_motion, write_bvh
from distretarget.batch import results
from distretarget.errors import FileError
from distretarget.io.files import write_whole


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder, with a clip, and a scene of it in scenes/one."""
    monkeypatch.chdir(tmp_path)
    write_bvh("clip.bvh", swaying(person(), frames=4))
    written(tmp_path / "scenes" / "one")
    return tmp_path


def written(folder, performer=(), **others):
    """Write a scene of one performer into a folder that is made."""
    folder.mkdir(parents=True)
    clip = folder.parents[1] / "clip.bvh"
    one = {"name": "lead", "source": str(clip), "target": str(clip), **dict(performer)}
    document = {"format": "distretarget-scene", "version": 1, "performers": [one], **others}
    (folder / "scene.json").write_text(json.dumps(document))


# ---- folders of scenes


def test_a_folder_of_scenes_goes_on_where_it_stopped(folder):
    scenes = folder / "scenes"
    written(scenes / "broken")
    (scenes / "broken" / "scene.json").write_text("{")
    written(scenes / "missing", {"source": str(folder / "later.bvh")})
    first = run("scene", "scenes", "-o", "out")
    assert (first.returncode, first.stderr.count("failed: ")) == (1, 2)
    assert first.stdout.endswith("3 scenes: 1 converted, 0 done before, 2 failed\n")
    made = (folder / "out" / "one" / "lead.bvh").stat().st_mtime_ns
    write_bvh("later.bvh", swaying(person(), frames=4))
    (scenes / "broken" / "scene.json").unlink()
    second = run("scene", "scenes", "-o", "out")
    assert (second.returncode, second.stderr) == (0, "")
    assert second.stdout.endswith("2 scenes: 1 converted, 1 done before, 0 failed\n")
    assert (folder / "out" / "one" / "lead.bvh").stat().st_mtime_ns == made


def test_a_scene_goes_on_after_a_full_disk(folder, monkeypatch):
    """The prop is written before the performer, for which there is no space."""
    write_bvh("box.bvh", swaying(person(), frames=4))
    written(folder / "scenes" / "two", props=[{"name": "box", "file": str(folder / "box.bvh")}])

    def on_a_full_disk(path, *others, **options):
        if path.name == "lead.bvh":
            raise FileError(path, "the disk is full")
        write_whole(path, *others, **options)

    with monkeypatch.context() as full:
        full.setattr(results, "write_whole", on_a_full_disk)
        first = run("scene", "scenes", "-o", "out")
    assert first.stdout.endswith("2 scenes: 0 converted, 0 done before, 2 failed\n")
    assert (folder / "out" / "two" / "box.bvh").exists()
    second = run("scene", "scenes", "-o", "out")
    assert (second.returncode, second.stderr) == (0, "")
    assert second.stdout.endswith("2 scenes: 2 converted, 0 done before, 0 failed\n")


def test_a_scene_that_has_changed_is_made_again_and_other_files_stay(folder):
    run("scene", "scenes", "-o", "out")
    write_bvh("clip.bvh", swaying(person(), frames=5), overwrite=True)
    done = run("scene", "scenes", "-o", "out", "--report", "report.html")
    assert done.stdout.endswith("1 scene: 1 converted, 0 done before, 0 failed\n")
    assert "Frames: 5" in (folder / "out" / "one" / "lead.bvh").read_text()
    (folder / "out" / "one" / "lead.bvh").write_text("mine")
    assert "exists already; --overwrite replaces it" in run("scene", "scenes", "-o", "out").stderr
    assert (folder / "out" / "one" / "lead.bvh").read_text() == "mine"


# ---- numbers


def test_a_prop_that_becomes_too_large_is_to_blame_itself(folder):
    write_bvh("box.bvh", swaying(person(), frames=4))
    written(folder / "scenes" / "large", props=[{"name": "box", "file": str(folder / "box.bvh"), "scale": 1e12}])
    line = refused("scene", "scenes/large/scene.json", "-o", "out")
    assert line.startswith(f"distretarget: {folder / 'box.bvh'}: 'box' reaches beyond 1e+12")


# ---- links


def test_no_link_leads_out_of_the_folder_of_results(folder):
    (folder / "outside").mkdir()
    (folder / "precious.bvh").write_text("precious")
    (folder / "out").mkdir()
    (folder / "out" / "one").symlink_to(folder / "outside")
    (folder / "out" / "lead.bvh").symlink_to(folder / "precious.bvh")
    for source in ("scenes", "scenes/one/scene.json"):
        done = run("scene", source, "-o", "out", "--overwrite")
        assert done.returncode == 1
        assert "leads out of the folder 'out'; remove the link" in done.stderr
    assert not list((folder / "outside").iterdir())
    assert (folder / "precious.bvh").read_text() == "precious"


def test_each_result_is_in_the_unit_of_its_target(tmp_path):
    clips, body = SAMPLES / "scenes" / "high_five", SAMPLES / "child.json"
    document = json.loads(body.read_text())
    for joint in document["joints"]:
        joint["offset"] = [0.01 * number for number in joint["offset"]]
    metres = tmp_path / "metres.json"
    metres.write_text(json.dumps(document | {"units": "m"}))
    for name, target in (("mixed", metres), ("alike", body)):
        targets = "-t", body, "-t", target
        succeeded("scene", clips / "one.bvh", clips / "other.bvh", *targets, "-o", tmp_path / name, "-q")
    for name, factor in (("one", 1.0), ("other", 100.0)):
        mixed, alike = (read_motion(tmp_path / folder / f"{name}.bvh").positions for folder in ("mixed", "alike"))
        np.testing.assert_allclose(factor * mixed, alike, atol=1e-3)


def test_a_scene_file_takes_no_target(folder):
    scene = folder / "one" / "scene.json"
    line = refused("scene", scene, "-t", SAMPLES / "child.json", "-o", folder / "out", status=2)
    assert "scene.json is a scene or a folder of scenes, which name their targets; leave out -t." in line
