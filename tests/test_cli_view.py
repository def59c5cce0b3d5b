"""`distretarget view`: files in a page, written or opened in a browser."""

import json
import zlib
from base64 import b64decode, b64encode

import numpy as np
import pytest
from bodies import HERO, SAMPLES, sample_target
from characters import chunks
from click.testing import CliRunner
from pages import embedded

from distretarget import load_target, read_bvh, retarget, write_motion
from distretarget.cli import cli
from distretarget.cli import view as view_module
from distretarget.io.input_file import load_file
from distretarget.report.actors import _materials
from distretarget.report.stage import small_stage
from distretarget.skin.mesh import Looks, Material

WALK = SAMPLES / "walk.bvh"


def view(*arguments):
    return CliRunner().invoke(cli, ["view", *map(str, arguments)])


def stage_of(path):
    return embedded(path.read_text("utf-8"), "stage")


def test_files_stand_side_by_side(tmp_path):
    page = tmp_path / "page.html"
    done = view(WALK, HERO, SAMPLES / "child.json", "-o", page)
    assert done.exit_code == 0, done.output
    stage = stage_of(page)
    assert stage["sides"] == ["walk.bvh", "hero.glb", "child.json"]
    assert stage["frames"] == 249
    bodies = [stage["bodies"][actor["body"]] for actor in stage["actors"]]
    assert "carriers" in bodies[0]
    assert "mesh" in bodies[1]
    assert str(tmp_path) not in page.read_text("utf-8")
    assert "exists" in str(view(WALK, "-o", page).exception)


def test_a_character_has_the_materials_of_its_file(tmp_path):
    assert view(HERO, "-o", tmp_path / "page.html").exit_code == 0
    (body,) = stage_of(tmp_path / "page.html")["bodies"]
    materials = load_file(HERO).gltf.text
    named = json.loads(materials)["materials"]
    shown = body["mesh"]["materials"]
    colours = [named[one["number"]]["pbrMetallicRoughness"]["baseColorFactor"] for one in shown]
    assert [one["colour"] for one in shown] == colours
    assert len(shown) == len(named) > 1
    assert sum(one["triangles"] for one in shown) == len(sample_target("hero").mesh().triangles)


def test_an_image_goes_with_its_material():
    image = b"\x89PNG" + bytes(64)
    looks = Looks((Material(image=image, normal_map=image), Material()), np.array([0, 1, 0, -1]), np.zeros((5, 2)))
    first, *others = _materials(looks)
    assert first["image"] == first["normal_map"] == "data:image/png;base64," + b64encode(image).decode()
    assert first["triangles"] == 2
    assert [one["triangles"] for one in others] == [1, 1]


@pytest.mark.parametrize(("uri", "shown"), [("skin.png", True), ("../skin.png", False), ("none.png", False)])
def test_an_image_beside_a_gltf_file_is_shown(uri, shown, tmp_path):
    (tmp_path / "hero").mkdir()
    image = b"\x89PNG" + bytes(64)
    for folder in (tmp_path, tmp_path / "hero"):
        (folder / "skin.png").write_bytes(image)
    document, binary = chunks(HERO.read_bytes())
    document["buffers"][0]["uri"] = "hero.bin"
    document |= {"images": [{"uri": uri}], "textures": [{"source": 0}]}
    material = document["materials"][0]
    material["pbrMetallicRoughness"]["baseColorTexture"] = material["normalTexture"] = {"index": 0}
    (tmp_path / "hero" / "hero.bin").write_bytes(binary)
    (tmp_path / "hero" / "hero.gltf").write_text(json.dumps(document))
    first, *others = load_target(tmp_path / "hero" / "hero.gltf").mesh().looks.materials
    assert first.image == first.normal_map == (image if shown else b"")
    assert not any(one.image for one in others)


def test_all_animations_of_a_file_are_shown_and_the_last_first(tmp_path):
    path, page = tmp_path / "hero.glb", tmp_path / "page.html"
    target = sample_target("hero")
    motion = retarget(read_bvh(WALK), target).motion[:5]
    write_motion(path, motion, HERO, name="walk")
    write_motion(path, motion[:2], path, name="stop", overwrite=True)
    assert view(path, "-o", page).exit_code == 0
    stage = stage_of(page)
    assert stage["sides"] == ["hero.glb: 1 walk", "hero.glb: 2 stop"]
    assert (stage["first"], stage["frames"], len(stage["bodies"])) == (1, 5, 1)
    small = small_stage(load_file(WALK), None, load_file(path))
    assert "mesh" not in small["bodies"][1]
    shown = zlib.decompress(b64decode(small["actors"][1]["path"]))
    assert len(shown) == 2 * 3 * 4  # the two frames of what was added last
    assert view(path, "-o", page, "--clip", "stop", "--overwrite").exit_code == 0
    assert stage_of(page)["frames"] == 2
    error = str(view(path, "-o", page, "--clip", "run", "--overwrite").exception)
    assert "no animation 'run'; it has 'walk', 'stop'" in error


def test_alone_a_clip_has_a_timeline(tmp_path):
    assert view(SAMPLES / "clap.bvh", "-o", tmp_path / "page.html").exit_code == 0
    stage = stage_of(tmp_path / "page.html")
    assert "left hand - right hand" in {row["name"] for row in stage["rows"]}
    assert all(row["points"][0] for row in stage["rows"])


def test_of_a_folder_all_files_are_shown(tmp_path):
    for name in ("b.bvh", "a.bvh", "deep/c.bvh", "notes.txt"):
        (tmp_path / "clips" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "clips" / name).write_bytes(WALK.read_bytes())
    assert view(tmp_path / "clips", "-o", tmp_path / "page.html").exit_code == 0
    assert stage_of(tmp_path / "page.html")["sides"] == ["a.bvh", "b.bvh", "c.bvh"]
    (tmp_path / "clips" / "a.bvh").write_text("HIERARCHY")
    done = view(tmp_path / "clips", "-o", tmp_path / "page.html", "--overwrite")
    assert done.exit_code == 0
    assert "warning: " in done.output
    assert stage_of(tmp_path / "page.html")["sides"] == ["b.bvh", "c.bvh"]
    assert view(tmp_path / "clips" / "a.bvh").exit_code == 1
    (tmp_path / "empty").mkdir()
    assert "has no motion or character" in str(view(tmp_path / "empty").exception)


@pytest.mark.parametrize("opens", [True, False])
def test_a_browser_is_opened_or_the_page_is_named(opens, monkeypatch):
    asked = []
    monkeypatch.setattr(view_module.webbrowser, "open", lambda address: asked.append(address) or opens)
    done = view(WALK)
    (address,) = asked
    assert address.startswith("file:")
    path = address.rpartition("/")[2]
    assert path.endswith(".html")
    assert path in (done.output if opens else str(done.exception))
    assert (done.exit_code == 0) == opens


def test_a_page_is_played_whatever_its_files_are_called(tmp_path, open_player):
    name = "__proto__ \u202e&amp; <b>" + 100 * "x" + ".bvh"
    (tmp_path / name).write_bytes(WALK.read_bytes())
    files = [tmp_path / name, HERO, *[WALK] * 3]
    assert view(*files, "-o", tmp_path / "page.html").exit_code == 0
    tab = open_player(tmp_path / "page.html", width=390, height=844, color_scheme="dark")
    assert tab.locator("#labels > div").all_inner_texts() == [name]
    assert tab.evaluate("document.scrollingElement.scrollWidth") <= 390
    tab.select_option("#sides select", index=1)
    assert tab.locator("#labels > div").all_inner_texts() == ["hero.glb"]
    tab.click("#play")
    assert tab.get_attribute("#play", "aria-label") == "Stop"
