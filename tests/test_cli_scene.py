"""`distretarget scene`, as a user meets it: files that are missing, links, names and times."""

import json

import pytest
from bodies import person, swaying
from program import run

from distretarget import write_bvh


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


# ---- numbers


def test_a_prop_that_becomes_too_large_is_to_blame_itself(folder):
    write_bvh("box.bvh", swaying(person(), frames=4))
    written(folder / "scenes" / "large", props=[{"name": "box", "file": str(folder / "box.bvh"), "scale": 1e12}])
    done = run("scene", "scenes/large/scene.json", "-o", "out")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert done.stderr.startswith(f"distretarget: {folder / 'box.bvh'}: 'box' reaches beyond 1e+12")


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
