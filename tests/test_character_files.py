"""Files of characters, read and written: joints are where a plain player has them, and all else stays as it is."""

import json

import gltf_player
import numpy as np
import pytest
from bodies import SAMPLES
from characters import (
    ARMATURE,
    LOOKING_BACK,
    Bones,
    Performance,
    as_vrm0,
    as_vrm1,
    as_vrma,
    box_mesh,
    character,
    chunks,
    with_unknown_parts,
)
from scipy.spatial.transform import Rotation
from test_characters import BONES, KINDS, ROLLED, WALK

from distretarget import Motion, load_target, read_bvh, read_motion, retarget, write_motion
from distretarget.body.body import Body
from distretarget.errors import DistretargetError
from distretarget.io.input_file import load_file
from distretarget.io.motion_file import parse_character

NEAR = 1e-5  # [m]


def by_node(path, made):
    """The numbers of a file's joints, in the order of those that it was made of."""
    places = {node: place for place, node in enumerate(joint_nodes(path))}
    return [places[node] for node in made.joints]


def joint_nodes(path):
    """The node of each joint."""
    character = parse_character(load_file(path))
    return character.nodes[-len(character.skeleton) :].tolist()


def played(path, animation, times, nodes):
    """Where a plain player has nodes in an animation, (times, nodes, 3) [m]."""
    document, buffer = gltf_player.load(path)
    return gltf_player.worlds(document, buffer, animation, times)[:, nodes][..., :3, 3]


@pytest.mark.parametrize("ending", ["glb", "gltf"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_skeleton_is_the_bind_pose(tmp_path, kind, ending):
    made = character(BONES, **KINDS[kind])
    path = made.write(tmp_path / f"hero.{ending}")
    skeleton = load_target(path).skeleton
    places = (skeleton.rest_positions + skeleton.offsets[0])[by_node(path, made)]
    assert places == pytest.approx(BONES.positions, abs=NEAR)
    assert (skeleton.units, skeleton.up) == ("m", "Y")


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "matrices"])
def test_a_motion_is_what_a_player_shows(tmp_path, kind):
    made = character(BONES, **KINDS[kind])
    made.animate("walk", WALK)
    path = made.write(tmp_path / "hero.glb")
    motion, joints = read_motion(path), by_node(path, made)
    assert motion.positions[:, joints] == pytest.approx(WALK.positions, abs=NEAR)
    turns = Rotation.from_quat(motion.world_rotations[:, joints]) * Rotation.from_quat(WALK.turns).inv()
    assert turns.magnitude().max() < 1e-4
    assert motion.frame_time == pytest.approx(WALK.times[1], rel=1e-4)


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"interpolation": "STEP"}, NEAR),
        ({"interpolation": "CUBICSPLINE"}, NEAR),
        ({"rotations": "i2"}, 2e-3),
        ({"rotations": "i1"}, 0.1),
        ({"stride": 24}, NEAR),
        ({"sparse": True}, NEAR),
        ({"scales": True, "all_translations": True}, NEAR),
        ({"flipped": True, "still": False}, NEAR),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_all_ways_to_store_keys(tmp_path, options, error):
    made = character(BONES, axes=ROLLED, above=ARMATURE)
    made.animate("walk", WALK, **options)
    path = made.write(tmp_path / "hero.glb")
    assert read_motion(path).positions[:, by_node(path, made)] == pytest.approx(WALK.positions, abs=error)


@pytest.mark.parametrize("kind", KINDS)
def test_a_written_motion_is_where_a_player_shows_it(tmp_path, kind):
    made = character(BONES, **KINDS[kind])
    source, out = made.write(tmp_path / "hero.glb"), tmp_path / "hero_clap.glb"
    result = retarget(read_bvh(SAMPLES / "clap.bvh")[:40], load_target(source)).motion
    write_motion(out, result, source, name="clap")
    times = result.frame_time * np.arange(len(result))
    found = played(out, "clap", times, joint_nodes(source))
    assert found == pytest.approx(result.positions, abs=NEAR)


def test_the_bind_pose_counts_not_the_pose_shown(tmp_path):
    made = character(BONES, axes=ROLLED, above=ARMATURE)
    made.show(WALK, 3)
    source, out = made.write(tmp_path / "hero.glb"), tmp_path / "hero_clap.glb"
    skeleton = load_target(source).skeleton
    places = (skeleton.rest_positions + skeleton.offsets[0])[by_node(source, made)]
    assert places == pytest.approx(BONES.positions, abs=NEAR)
    result = retarget(read_bvh(SAMPLES / "clap.bvh")[:20], load_target(source)).motion
    write_motion(out, result, source)
    found = played(out, "hero_clap", result.frame_time * np.arange(20), joint_nodes(source))
    assert found == pytest.approx(result.positions, abs=NEAR)
