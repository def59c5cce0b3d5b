"""Characters that Blender exports: their skeleton is the rest pose, and a player shows written motions as they are."""

import json
import os
import subprocess

import gltf_player
import numpy as np
import pytest
from bodies import swaying
from characters import ARMATURE, character

from distretarget import load_target, write_motion
from interop.played import BONES, ROLLED, WALK
from interop.players import missing
from interop.readers import BLENDER, HERE


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """The folder with the files of all ways, and the places of their joints."""
    if reason := missing("Blender"):
        pytest.skip(reason)
    folder = tmp_path_factory.mktemp("blender")
    made = character(BONES, axes=ROLLED, above=ARMATURE)
    made.animate("walk", WALK)
    path = made.write(folder / "hero.glb")
    command = [os.environ[BLENDER], HERE / "blender_export.py", path, folder]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
    return folder, json.loads(done.stdout.strip().splitlines()[-1])


@pytest.mark.parametrize("way", ["usual", "moved", "another pose", "no armature", "applied"])
def test_files_that_blender_exports(way, exported, tmp_path):
    folder, places = exported
    target = load_target(folder / f"{way}.glb")
    skeleton = target.skeleton
    found = skeleton.rest_positions + skeleton.offsets[0]
    assert set(skeleton.names) == set(places[way])
    assert found == pytest.approx(np.array([places[way][name] for name in skeleton.names]), abs=1e-4)

    motion = swaying(skeleton, 4)
    write_motion(tmp_path / "out.glb", motion, folder / f"{way}.glb")
    document, buffer = gltf_player.load(tmp_path / "out.glb")
    worlds = gltf_player.worlds(document, buffer, "out", motion.frame_time * np.arange(len(motion)))
    joints = target.character.nodes[-len(skeleton) :]
    assert worlds[:, joints][..., :3, 3] == pytest.approx(motion.positions, abs=1e-5)
