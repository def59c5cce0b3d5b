"""What the command line does about usual mistakes with characters, and with several clips in one file."""

import shutil

import gltf_player
import numpy as np
import pytest
from bodies import HERO, SAMPLES, person, sample
from fbx_text import Node, fbx
from program import refused
from program import run as run_program

from distretarget import read_bvh, read_motion, write_bvh


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder with two short clips, two targets, and the character."""
    (tmp_path / "clips").mkdir()
    for name in ("walk", "wave"):
        write_bvh(tmp_path / "clips" / f"{name}.bvh", sample(name)[:10])
    shutil.copy(HERO, tmp_path)
    shutil.copy(SAMPLES / "child.json", tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(text):
    return run_program(*text.split())


def animations(path):
    return [entry["name"] for entry in gltf_player.load(path)[0]["animations"]]


def test_the_animation_is_named_after_the_clip_and_found_by_its_name(folder):
    run("clips/walk.bvh hero.glb -o one.glb")
    run("clips/wave.bvh one.glb -o two.glb")
    assert animations(folder / "two.glb") == ["walk", "wave"]
    run("two.glb child.json -o second.bvh --clip #2")
    run("two.glb child.json -o named.bvh --clip wave")
    assert (folder / "second.bvh").read_bytes() == (folder / "named.bvh").read_bytes()
    run("two.glb hero.glb -o other.glb --clip #2")
    run("two.glb hero.glb -o wave.glb --clip wave")
    assert [animations(folder / name) for name in ("other.glb", "wave.glb")] == [["two"], ["wave"]]


def test_diff_chooses_from_a_file_with_several_animations():
    run("batch clips hero.glb -o all.glb --merge")
    assert "choose one with --clip" in run("diff clips/wave.bvh all.glb").stderr
    assert run("diff clips/wave.bvh all.glb --clip wave --json metrics.json").returncode == 0
    assert "did you mean 'wave'?" in run("diff clips/wave.bvh all.glb --clip waves").stderr


def test_merged_clips_in_place_keep_their_paths(folder):
    run("batch clips hero.glb -o all.glb --merge --in-place")
    run("clips/walk.bvh hero.glb -o walk.bvh")
    document, _ = gltf_player.load(folder / "all.glb")
    path = document["animations"][0]["extras"]["root_path"]
    np.testing.assert_allclose(path, read_bvh(folder / "walk.bvh").root_positions, atol=1e-5)
    places = read_motion(folder / "all.glb", "walk").root_positions
    np.testing.assert_allclose(places[:, [0, 2]], places[:1, [0, 2]].repeat(10, axis=0), atol=1e-6)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (
            "hero.glb clips/walk.bvh -o out.glb",
            "hero.glb: has no motion, expected one as SOURCE; if it is the target, it comes last: "
            "distretarget clips/walk.bvh hero.glb -o OUT.glb",
        ),
        ("hero.glb child.json -o out.bvh", "hero.glb: has no animation; expected a file with a motion"),
        (
            "hero.glb clips/walk.bvh -o out.bvh",
            "hero.glb: has no motion, expected one as SOURCE; if it is the target, it comes last: distretarget "
            "clips/walk.bvh hero.glb -o OUT.glb",
        ),
        (
            "clips/walk.bvh child.json -o out.glb",
            "out.glb: .glb is the target's own file with the motion, but 'child.json' is a skeleton file; write .bvh",
        ),
        ("clips/walk.bvh hero.glb -o out.fbx", "out.fbx: FBX is read, but not written; write .glb, which Blender, "),
        ("clips/walk.bvh hero.glb -o out", "expected one of .bvh, .glb, .gltf, .vrm, .vrma, .npz, such as 'out.glb'"),
        ("clips/walk.bvh child.json -o out", "such as 'out.bvh'"),
        ("clips/walk.bvh clips/wave.bvh -o out.glb", "'clips/wave.bvh' is BVH; write .bvh"),
        ("clips/walk.bvh hero.glb -o out.vrm", "out.vrm: 'hero.glb' is no VRM model; write .glb"),
        ("clips/walk.bvh hero.glb -o hero.glb --overwrite", "hero.glb: is an input as well"),
        ("batch clips child.json -o all.glb --merge", "but 'child.json' is a skeleton file"),
    ],
)
def test_usual_mistakes_end_in_a_line_that_helps(line, expected):
    assert expected in refused(*line.split())


def test_a_character_before_its_animation_is_told_to_come_last(folder):
    (folder / "hero.vrm").write_bytes((folder / "hero.glb").read_bytes())
    run("clips/walk.bvh hero.glb -o walk.vrma")
    done = run("hero.vrm walk.vrma -o out.vrm")
    assert "hero.vrm: has no motion, expected one as SOURCE; if it is the target, it comes last" in done.stderr


def test_the_animation_of_a_character_is_for_characters_in_fbx_too(folder):
    pytest.importorskip("ufbx")
    run("clips/walk.bvh hero.glb -o walking.glb")
    body = person()
    joints = zip(body.names, body.parents, body.offsets, strict=True)
    bones = [Node(name, int(parent), T=tuple(100.0 * offset)) for name, parent, offset in joints]
    (folder / "bones.fbx").write_bytes(fbx(bones))
    assert "bones.fbx: has no mesh to write; write .bvh" in refused("walking.glb", "bones.fbx", "-o", "out.glb")
    run("walking.glb bones.fbx -o out.bvh")


def test_a_target_of_another_program_is_called_by_its_name(folder):
    (folder / "hero.blend").write_bytes(b"BLENDER")
    assert "hero.blend: is Blender, expected BVH, glTF" in run("clips/walk.bvh hero.blend -o out.glb").stderr
