"""Characters with controls: the bones that deform are joints, and where a plain player shows them."""

import gltf_player
import numpy as np
import pytest
from bodies import swaying
from characters import ARMATURE, Bones, character
from named_bodies import tree
from scipy.spatial.transform import Rotation
from test_deform_bones import ALONE, GENERATED

from distretarget import load_target, read_motion, write_motion


def made(text):
    """A character with the joints of a tree at random places, with random axes."""
    body, draw = tree(text), np.random.default_rng(5)
    bones = Bones(body.names, body.parents, draw.uniform(-1, 1, (len(body), 3)))
    return character(bones, axes=Rotation.random(len(body), rng=draw), above=ARMATURE)


@pytest.mark.parametrize("text", [GENERATED, ALONE])
def test_a_motion_of_the_bones_that_deform_is_where_a_player_shows_it(tmp_path, text):
    path, out = made(text).write(tmp_path / "hero.glb"), tmp_path / "hero_sways.glb"
    skeleton = load_target(path).skeleton
    assert {name for name in skeleton.names if not name.startswith("DEF-")} == set()
    motion = swaying(skeleton)
    write_motion(out, motion, path, name="sway")
    document, buffer = gltf_player.load(out)
    worlds = gltf_player.worlds(document, buffer, "sway", motion.frame_time * np.arange(len(motion)))
    names = [node.get("name") for node in document["nodes"]]
    found = worlds[:, [names.index(name) for name in skeleton.names]][..., :3, 3]
    assert found == pytest.approx(motion.positions, abs=1e-5)
    assert read_motion(out, clip="sway").positions == pytest.approx(motion.positions, abs=1e-5)


def test_controls_stay_and_bones_that_hang_from_bones_in_the_file_only_turn(tmp_path):
    path = made(GENERATED).write(tmp_path / "hero.glb")
    hero = load_target(path).character
    animation = hero.animation(swaying(hero.skeleton), "sway")
    names = [node.get("name") for node in gltf_player.load(path)[0]["nodes"]]
    shifted, turned = ({names[node] for node in moving} for moving in (animation.translations, animation.rotations))
    assert turned == shifted | turned == set(hero.skeleton.names)
    hang_from_controls = {"thigh", "pelvis", "shoulder", "upper_arm", "f_index", "jaw", "spine"}
    assert {name.removeprefix("DEF-").split(".")[0] for name in shifted} == hang_from_controls
