"""Files of characters, read and written: joints are where a plain player has them, and all else stays as it is."""

import json
import warnings
from dataclasses import replace

import gltf_player
import numpy as np
import pytest
from bodies import SAMPLES
from characters import ARMATURE, LOOKING_BACK, as_vrm0, as_vrm1, as_vrma, character, chunks, packed, with_unknown_parts
from scipy.spatial.transform import Rotation
from test_characters import BONES, KINDS, ROLLED, WALK

from distretarget import FileError, Motion, load_target, read_bvh, read_motion, retarget, write_motion
from distretarget.body.body import Body
from distretarget.character.nodes import Animation

NEAR = 1e-5  # [m]


def by_node(path, made):
    """The numbers of a file's joints, in the order of those that it was made of."""
    places = {node: place for place, node in enumerate(joint_nodes(path))}
    return [places[node] for node in made.joints]


def joint_nodes(path):
    """The node of each joint."""
    return load_target(path).character.joint_nodes.tolist()


def played(path, animation, times, nodes):
    """Where a plain player has nodes in an animation, (times, nodes, 3) [m]."""
    document, buffer = gltf_player.load(path)
    return gltf_player.worlds(document, buffer, animation, times)[:, nodes][..., :3, 3]


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "matrices"])
def test_a_motion_is_what_a_player_shows(tmp_path, kind):
    made = character(BONES, **KINDS[kind])
    made.animate("walk", WALK)
    path = made.write(tmp_path / "hero.glb")
    motion, joints = read_motion(path), by_node(path, made)
    assert motion.positions[:, joints] == pytest.approx(WALK.positions, abs=NEAR)
    assert played(path, "walk", WALK.times, made.joints) == pytest.approx(WALK.positions, abs=2e-6)
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
    assert played(path, "walk", WALK.times, made.joints) == pytest.approx(WALK.positions, abs=error)


@pytest.mark.parametrize("kind", KINDS)
def test_a_written_motion_is_where_a_player_shows_it(tmp_path, kind):
    made = character(BONES, **KINDS[kind])
    source, out = made.write(tmp_path / "hero.glb"), tmp_path / "hero_clap.glb"
    result = retarget(read_bvh(SAMPLES / "clap.bvh")[:40], load_target(source)).motion
    write_motion(out, result, source, name="clap")
    times = result.frame_time * np.arange(len(result))
    found = played(out, "clap", times, joint_nodes(source))
    assert found == pytest.approx(result.positions, abs=NEAR)


def clapping(source, frames=20):
    return retarget(read_bvh(SAMPLES / "clap.bvh")[:frames], load_target(source)).motion


def without_new(document, before):
    """A document without what a writer may add to it."""
    document = {**document}
    for key in ("accessors", "bufferViews", "animations"):
        document[key] = document[key][: len(before.get(key, []))]
    document["buffers"] = before["buffers"]
    return {key: value for key, value in document.items() if value or key in before}


@pytest.mark.parametrize("animated", [False, True])
def test_all_else_in_the_file_stays_as_it_is(tmp_path, animated):
    made = with_unknown_parts(as_vrm1(character(BONES, axes=ROLLED, above=ARMATURE), springs=["Head"]))
    if animated:
        made.animate("walk", WALK)
    source, out = made.write(tmp_path / "hero.vrm"), tmp_path / "hero_clap.vrm"
    write_motion(out, clapping(source), source)
    (before, old), (after, new) = chunks(source.read_bytes()), chunks(out.read_bytes())
    assert without_new(after, before) == before
    assert new.startswith(old)
    assert after["buffers"][0]["byteLength"] == len(new)
    assert [entry["name"] for entry in after["animations"]] == ["walk", "hero_clap"][not animated :]


def test_numbers_in_the_document_keep_their_digits(tmp_path):
    made = character(BONES)
    source = made.write(tmp_path / "hero.glb")
    document, buffer = chunks(source.read_bytes())
    text = json.dumps(document)[:-1] + ', "extras": {"exact": 1.50000e-3, "long": 0.12345678901234567890123 }}'
    source.write_bytes(packed(text, buffer))
    out = tmp_path / "out.glb"
    write_motion(out, clapping(source), source)
    assert b'"extras": {"exact": 1.50000e-3, "long": 0.12345678901234567890123 }' in out.read_bytes()


def test_unknown_chunks_stay(tmp_path):
    source = character(BONES).write(tmp_path / "hero.glb")
    content = source.read_bytes() + (8).to_bytes(4, "little") + b"ACME12345678"
    source.write_bytes(content[:8] + len(content).to_bytes(4, "little") + content[12:])
    out = tmp_path / "out.glb"
    write_motion(out, clapping(source), source)
    assert out.read_bytes().endswith(b"ACME12345678")


@pytest.mark.parametrize("mode", ["add", "replace"])
def test_animations_are_added_or_replaced(tmp_path, mode):
    made = character(BONES)
    for name in ("clap", "walk"):
        made.animate(name, WALK)
    source, out = made.write(tmp_path / "hero.glb"), tmp_path / "clap.glb"
    motion = clapping(source)
    write_motion(out, motion, source, animations=mode)
    names = [entry["name"] for entry in chunks(out.read_bytes())[0]["animations"]]
    assert names == (["clap", "walk", "clap 2"] if mode == "add" else ["clap"])
    found = played(out, names[-1], motion.frame_time * np.arange(len(motion)), joint_nodes(source))
    assert found == pytest.approx(motion.positions, abs=NEAR)


@pytest.mark.parametrize(("source_ending", "out"), [("glb", "out.gltf"), ("gltf", "out.glb"), ("gltf", "out.gltf")])
@pytest.mark.parametrize("elsewhere", [False, True])
def test_each_container_can_be_written_from_each(tmp_path, source_ending, out, elsewhere):
    source = character(BONES, axes=ROLLED).write(tmp_path / f"hero.{source_ending}")
    folder = tmp_path / "other" if elsewhere else tmp_path
    folder.mkdir(exist_ok=True)
    motion = clapping(source)
    write_motion(folder / out, motion, source, name="clap")
    again = read_motion(folder / out)
    assert again.positions == pytest.approx(motion.positions, abs=NEAR)
    found = played(folder / out, "clap", motion.frame_time * np.arange(len(motion)), joint_nodes(source))
    assert found == pytest.approx(motion.positions, abs=NEAR)


def test_only_what_moves_has_keys(tmp_path):
    source, out = character(BONES, axes=ROLLED).write(tmp_path / "hero.glb"), tmp_path / "clap.glb"
    motion = clapping(source)
    write_motion(out, motion, source)
    document, _ = chunks(out.read_bytes())
    channels = document["animations"][0]["channels"]
    moving = [channel["target"]["node"] for channel in channels if channel["target"]["path"] == "translation"]
    assert moving == [joint_nodes(source)[0]]
    turning = [channel["target"]["node"] for channel in channels if channel["target"]["path"] == "rotation"]
    still = np.abs(motion.rotations - [0, 0, 0, 1]).max(axis=(0, 2)) < 1e-9
    assert sorted(turning) == sorted(node for node, rests in zip(joint_nodes(source), still, strict=True) if not rests)


def test_motion_to_bvh_and_back_is_the_same(tmp_path):
    made = character(BONES, axes=ROLLED, above=ARMATURE)
    made.animate("walk", WALK)
    source, bvh, out = made.write(tmp_path / "hero.glb"), tmp_path / "walk.bvh", tmp_path / "again.glb"
    write_motion(bvh, read_motion(source))
    write_motion(out, read_motion(bvh), source, name="again")
    assert played(out, "again", WALK.times, made.joints) == pytest.approx(WALK.positions, abs=1e-4)


def test_in_place_keeps_the_path_beside_the_motion(tmp_path):
    source, out = character(BONES).write(tmp_path / "hero.glb"), tmp_path / "walk.glb"
    motion = retarget(read_bvh(SAMPLES / "walk.bvh"), load_target(source)).motion
    write_motion(out, motion, source, in_place=True)
    document, _ = chunks(out.read_bytes())
    path = np.array(document["animations"][0]["extras"]["root_path"])
    again = read_motion(out).root_positions
    assert path == pytest.approx(motion.root_positions, abs=1e-5)
    assert np.ptp(again[:, [0, 2]], axis=0) == pytest.approx([0, 0], abs=NEAR)
    assert again[:, 1] == pytest.approx(path[:, 1], abs=NEAR)


@pytest.mark.parametrize("version", [0, 1])
def test_the_humanoid_of_a_vrm_decides(tmp_path, version):
    names = [f"bone {number}" for number in range(len(BONES.names))]
    bones = BONES.turned(LOOKING_BACK) if version == 0 else BONES
    made = character(bones, axes=ROLLED)
    (as_vrm0 if version == 0 else as_vrm1)(made)
    for node, name in zip(made.joints, names, strict=True):
        made.document["nodes"][node]["name"] = name
    source = made.write(tmp_path / "hero.vrm")
    result = retarget(read_bvh(SAMPLES / "clap.bvh")[:20], load_target(source))
    body = result.matching.target
    assert body.anatomy.method == "humanoid"
    assert body.anatomy.roles["leftHand"] == by_node(source, made)[BONES.names.index("LeftWrist")]
    assert body.reference.axes[:, 2] == pytest.approx([0, 0, 1.0 if version else -1.0])
    assert (result.drivers[[body.anatomy.roles[role] for role in ("hips", "leftFoot", "rightHand")]] >= 0).all()


def test_vrm_animations_are_read_and_written(tmp_path):
    made = as_vrma(character(BONES, above=ARMATURE, meshes=None))
    made.animate("walk", WALK)
    source = made.write(tmp_path / "walk.vrma")
    motion = read_motion(source)
    assert motion.positions[:, by_node(source, made)] == pytest.approx(WALK.positions, abs=NEAR)
    out = tmp_path / "again.vrma"
    write_motion(out, motion)
    again = read_motion(out)
    joint = dict(again.skeleton.humanoid)
    for bone, number in motion.skeleton.humanoid:
        assert again.positions[:, joint[bone]] == pytest.approx(motion.positions[:, number], abs=NEAR)


def test_any_person_can_become_a_vrm_animation(tmp_path):
    clip = read_bvh(SAMPLES / "walk.bvh")[:20]
    target = load_target(SAMPLES / "rigs" / "unreal_a.json")  # an A-pose, in cm
    result = retarget(clip, target)
    write_motion(tmp_path / "walk.vrma", result.motion)
    again = read_motion(tmp_path / "walk.vrma")
    body, joints = Body.of(result.motion.skeleton), dict(again.skeleton.humanoid)
    height = body.height
    assert Body.of(again.skeleton).height * 100 == pytest.approx(height, rel=0.2)
    for role in ("leftHand", "rightFoot", "head", "hips"):
        found, wanted = again.positions[:, joints[role]], result.motion.positions[:, body.anatomy.roles[role]]
        turned = Rotation.from_matrix(body.reference.axes.T).apply(wanted) / 100
        assert found == pytest.approx(turned, abs=1e-4)
    arms = again.skeleton.offsets[[joints["leftLowerArm"], joints["leftHand"]]]
    assert arms / np.linalg.norm(arms, axis=1)[:, None] == pytest.approx(np.tile([1.0, 0.0, 0.0], (2, 1)), abs=1e-6)


def test_what_scales_lose_is_said(tmp_path):
    made = character(BONES, above=np.diag([0.01, 0.01, 0.01, 1.0]))
    made.animate("walk", WALK, scales=True)
    assert load_target(made.write(tmp_path / "even.glb")).character.warnings == ()
    made.document["nodes"][0]["scale"] = [0.01, 0.012, 0.01]
    (warning,) = load_target(made.write(tmp_path / "uneven.glb")).character.warnings
    assert "the scale of 'Armature' is uneven, by 17 %" in warning
    made = character(BONES)
    number = made.animate("walk", WALK, scales=True)
    channel = next(
        each for each in made.document["animations"][number]["channels"] if each["target"]["path"] == "scale"
    )
    entry = made.document["animations"][number]["samplers"][channel["sampler"]]
    entry["output"] = made.accessor(np.linspace([1, 1, 1], [2, 2, 2], len(WALK.times)))
    with pytest.warns(UserWarning, match="the scales of 'Hips' change in the animation; they are left out"):
        read_motion(made.write(tmp_path / "growing.glb"))


@pytest.mark.parametrize("kind", ["weights", "preset", "custom"])
def test_moving_morph_targets_and_expressions_are_left_out_and_it_is_said(kind, tmp_path):
    made = character(BONES)
    number = made.animate("walk", WALK)
    with warnings.catch_warnings(action="error"):
        plain = read_motion(made.write(tmp_path / "plain.glb"))
    if kind == "weights":
        animation = made.document["animations"][number]
        animation["channels"].append({"sampler": 0, "target": {"node": 0, "path": "weights"}})
    else:
        extension = as_vrma(made).document["extensions"]["VRMC_vrm_animation"]
        extension["expressions"] = {kind: {"happy": {"node": 0}}}
    with pytest.warns(UserWarning, match="moves morph targets or expressions, such as those of a face; they are left"):
        motion = read_motion(made.write(tmp_path / "smiling.glb"))
    np.testing.assert_array_equal(motion.rotations, plain.rotations)


def test_a_compressed_mesh_stays_and_is_said(tmp_path):
    made = character(BONES)
    made.uses("KHR_draco_mesh_compression")
    source, out = made.write(tmp_path / "hero.glb"), tmp_path / "clap.glb"
    (warning,) = load_target(source).character.warnings
    assert "its mesh is compressed by Draco" in warning
    write_motion(out, clapping(source), source)
    assert chunks(out.read_bytes())[0]["meshes"] == made.document["meshes"]


def test_a_character_of_rigid_parts_has_the_joints_that_names_show(tmp_path):
    """No skin: each part is a mesh that hangs on a node, and the nodes have the names of a body."""
    made = character(BONES, axes=ROLLED, above=ARMATURE, meshes=None)
    for joint in range(len(BONES.names)):
        made.rigid(f"part {joint}", joint)
    source, out = made.write(tmp_path / "robot.glb"), tmp_path / "clap.glb"
    target = load_target(source)
    joints = [BONES.names.index(name) for name in target.skeleton.names]
    places = target.skeleton.rest_positions + target.skeleton.offsets[0]
    assert places == pytest.approx(BONES.positions[joints], abs=NEAR)
    assert len(joints) == len(BONES.names)
    motion = clapping(source)
    write_motion(out, motion, source)
    found = played(out, "clap", motion.frame_time * np.arange(len(motion)), joint_nodes(source))
    assert found == pytest.approx(motion.positions, abs=NEAR)


def test_quaternions_in_a_file_do_not_jump_to_their_opposites(tmp_path):
    """A joint that turns on and on, whose quaternions a motion may have with either sign."""
    source = character(BONES).write(tmp_path / "hero.glb")
    motion = clapping(source)
    angles = np.radians(20.0) * np.arange(len(motion))
    rotations = np.array(motion.rotations)
    rotations[:, 5] = Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0]).as_quat(canonical=True)
    rotations[::2] *= -1.0
    write_motion(tmp_path / "out.glb", replace(motion, rotations=rotations), source, animations="replace")
    document, buffer = gltf_player.load(tmp_path / "out.glb")
    turning = 0
    for channel in document["animations"][0]["channels"]:
        if channel["target"]["path"] == "rotation":
            sampler = document["animations"][0]["samplers"][channel["sampler"]]
            keys = gltf_player.values(document, buffer, sampler["output"])
            assert (keys[1:] * keys[:-1]).sum(axis=1).min(initial=1.0) > 0.5
            turning += 1
    assert turning > 0


def test_what_is_written_below_nodes_of_uneven_scale_is_read_back(tmp_path):
    """The scale of the upper node makes 2 m of 1 m along Y, and that of the lower one takes it back."""
    above = np.diag([1.0, 0.5, 1.0, 1.0])
    above[1, 3] = 1.0
    content = character(BONES, above=above).write(tmp_path / "even.glb").read_bytes()
    document, buffer = chunks(content)
    top = {"scale": [1.0, 2.0, 1.0], "children": document["scenes"][0]["nodes"]}
    document["scenes"][0]["nodes"] = [len(document["nodes"])]
    document["nodes"].append(top)
    source = tmp_path / "uneven.glb"
    source.write_bytes(packed(document, buffer))
    motion = clapping(source)
    write_motion(tmp_path / "out.glb", motion, source, name="clap")
    with pytest.warns(UserWarning, match="the scale of '' is uneven"):
        again = read_motion(tmp_path / "out.glb")
    assert again.positions == pytest.approx(motion.positions, abs=NEAR)


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_a_bone_that_moves_by_more_than_a_millionth_of_the_body_has_keys(tmp_path, scale):
    source = character(BONES, above=np.diag([scale, scale, scale, 1.0])).write(tmp_path / "hero.glb")
    one = load_target(source).character
    skeleton, size = one.skeleton, np.abs(one.skeleton.rest_positions).max()
    for share, moves in ((3e-7, False), (3e-6, True)):
        translations = np.tile(skeleton.offsets, (2, 1, 1))
        translations[1, 5, 0] += share * size
        motion = Motion.of_translations(skeleton, translations, np.tile(skeleton.rest_rotations, (2, 1, 1)), "0.1")
        assert (one.joint_nodes[5] in one.animation(motion, "x").translations) == moves


def test_a_small_file_has_at_most_a_million_poses_and_a_large_one_as_many_as_bytes(tmp_path):
    one = load_target(character(BONES).write(tmp_path / "hero.glb")).character
    most = 1_000_000 // len(one.nodes)
    assert len(one.motion(Animation("long", most, "0.01"), 10)) == most
    with pytest.raises(FileError, match=f"{most + 1} frames of {len(one.nodes)} joints are too many"):
        one.motion(Animation("long", most + 1, "0.01"), 10)
    assert len(one.motion(Animation("long", most + 1, "0.01"), (most + 1) * len(one.nodes))) == most + 1
