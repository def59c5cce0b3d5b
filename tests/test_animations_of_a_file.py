"""Animations of one file do not depend on which was played before: what one moves, the others have keys for."""

import copy

import gltf_player
import numpy as np
import pytest
from bodies import SAMPLES
from characters import ARMATURE, Bones, Performance, character, chunks

from distretarget import Motion, load_target, read_bvh, write_motion

BONES = Bones.of(read_bvh(SAMPLES / "walk.bvh").skeleton)
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
