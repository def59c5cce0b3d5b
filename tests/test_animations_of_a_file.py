"""Animations of one file do not depend on which was played before: what one moves, the others have keys for."""

import copy
import json

import gltf_player
import numpy as np
import pytest
from bodies import sample
from characters import ARMATURE, Bones, Performance, character, chunks
from gltf_file import glb

from distretarget import FileError, Motion, load_target, write_motion
from distretarget.character.nodes import Animation
from distretarget.io import gltf_writer
from distretarget.io.gltf import parse_gltf
from distretarget.io.gltf_writer import animated

BONES = Bones.of(sample("walk").skeleton)
SWAY = Performance.swaying(BONES, 5)


def still(path):
    """A motion of a character of which only the root turns."""
    skeleton = load_target(path).character.skeleton
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (3, len(skeleton), 1))
    rotations[1:, 0] = [0.0, np.sin(0.2), 0.0, np.cos(0.2)]
    return Motion(skeleton, np.tile(skeleton.offsets[0], (3, 1)), rotations, "0.1")


def after_another(document, buffer, another):
    """The document whose nodes show what another animation leaves them with."""
    left, entry = copy.deepcopy(document), document["animations"][another]
    for channel in entry["channels"]:
        output = gltf_player.values(document, buffer, entry["samplers"][channel["sampler"]]["output"])
        left["nodes"][channel["target"]["node"]][channel["target"]["path"]] = output[-1].tolist()
    return left


@pytest.mark.parametrize("above", [None, ARMATURE], ids=["plain", "armature"])
def test_an_animation_looks_the_same_after_another(above, tmp_path):
    made = character(BONES, axes=BONES.along_bones(0.5), above=above)
    made.animate("sway", SWAY, all_translations=True, scales=True)
    path = made.write(tmp_path / "hero.glb")
    write_motion(tmp_path / "still.glb", still(path), path)
    document, buffer = chunks((tmp_path / "still.glb").read_bytes())
    times = [0.0, 0.1, 0.2]
    alone = gltf_player.worlds(document, buffer, "still", times)
    after = gltf_player.worlds(after_another(document, buffer, 0), buffer, "still", times)
    assert after == pytest.approx(alone, abs=1e-6)


def test_what_no_animation_moves_has_no_keys(tmp_path):
    made = character(BONES)
    made.animate("sway", SWAY)
    path = made.write(tmp_path / "hero.glb")
    write_motion(tmp_path / "still.glb", still(path), path, animations="replace")
    document, _ = chunks((tmp_path / "still.glb").read_bytes())
    assert [channel["target"] for channel in document["animations"][0]["channels"]] == [
        {"node": made.joints[0], "path": "rotation"}
    ]


def animations_named(names, path, **options):
    """The content of a file with animations of these names, of which each turns the first joint."""
    turns = {0: np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))}
    clips = [Animation(name, 3, "0.1", rotations=turns) for name in names]
    return b"".join(animated(parse_gltf(path.read_bytes(), path), clips, **options))


@pytest.mark.parametrize(
    ("mode", "given", "names"),
    [
        ("add", ["sway", "sway", "walk"], ["sway", "sway 2", "sway 3", "walk"]),
        ("replace", ["sway", "walk", "walk"], ["sway", "walk", "walk 2"]),
        ("add", ["walk", "walk 2", "walk"], ["sway", "walk", "walk 2", "walk 3"]),
    ],
)
def test_names_that_are_taken_get_the_first_free_number(mode, given, names, tmp_path):
    made = character(BONES)
    made.animate("sway", SWAY)
    document, _ = chunks(animations_named(given, made.write(tmp_path / "hero.glb"), mode=mode))
    assert [each["name"] for each in document["animations"]] == names


def test_a_glb_of_more_than_four_gigabytes_is_refused(tmp_path, monkeypatch):
    path = character(BONES).write(tmp_path / "hero.glb")
    size = len(animations_named(["walk"], path))
    monkeypatch.setattr(gltf_writer, "LARGEST_GLB", size)
    assert len(animations_named(["walk"], path)) == size
    monkeypatch.setattr(gltf_writer, "LARGEST_GLB", size - 1)
    with pytest.raises(FileError, match="it would be larger than 4 GB"):
        animations_named(["walk"], path)


@pytest.mark.parametrize("more", [0, 1, 2, 3])
def test_new_numbers_are_on_a_multiple_of_four_whatever_the_file_holds(more, tmp_path):
    path = character(BONES).write(tmp_path / "hero.glb")
    document, buffer = chunks(path.read_bytes())
    buffer += bytes(more)  # some programs do not fill the binary chunk up
    document["buffers"] = [{"byteLength": len(buffer)}]
    path.write_bytes(glb(json.dumps(document).encode(), buffer))
    written, binary = chunks(animations_named(["walk"], path))
    assert all(view["byteOffset"] % 4 == 0 for view in written["bufferViews"])
    assert len(binary) % 4 == 0
    (sampler,) = written["animations"][0]["samplers"]
    np.testing.assert_allclose(gltf_player.values(written, binary, sampler["input"]).ravel(), [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(gltf_player.values(written, binary, sampler["output"]), [[0.0, 0.0, 0.0, 1.0]] * 3)
