"""Characters that tests make are what they claim to be: a plain player finds joints and meshes where they belong."""

import json

import gltf_player
import numpy as np
import pytest
from bodies import SAMPLES, swaying
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

from distretarget import read_bvh

MOTION = read_bvh(SAMPLES / "walk.bvh")[:8]
BONES, WALK = Bones.of(MOTION.skeleton), Performance.of(MOTION)
ROLLED = BONES.along_bones(np.linspace(-2, 2, len(BONES.names)))
ASIDE = np.block(
    [[0.5 * Rotation.from_euler("Z", 30, degrees=True).as_matrix(), np.array([[1.0], [2], [3]])], [0, 0, 0, 1]]
)
KINDS = {
    "plain": {},
    "rolled": {"axes": ROLLED},
    "armature": {"axes": ROLLED, "above": ARMATURE},
    "armature, mesh outside": {"above": ARMATURE, "under": False},
    "mesh elsewhere": {"above": ARMATURE, "under": False, "mesh_world": ASIDE},
    "mesh elsewhere, points in the world": {"axes": ROLLED, "under": False, "mesh_world": ASIDE, "space": np.eye(4)},
    "matrices": {"axes": ROLLED, "above": ARMATURE, "matrices": True},
    "scales": {"axes": ROLLED, "scales": {0: 2.0, 3: 0.25, 9: 10.0}},
    "helpers": {"axes": ROLLED, "helpers": [0, 4, 12], "above": ARMATURE},
    "skins": {"meshes": [box_mesh(BONES, range(11)), box_mesh(BONES, range(11, 22))], "all_joints": False},
}


def found(made, animation=None, times=(0.0,)):
    """Positions of joints, (times, joints, 3), and points of meshes as a player has them."""
    document, buffer = chunks(made.glb())
    placed = gltf_player.worlds(document, buffer, animation, times)
    return placed[:, made.joints][..., :3, 3], np.concatenate(gltf_player.skinned(document, buffer, placed), axis=1)


@pytest.mark.parametrize("kind", KINDS)
def test_joints_and_mesh_are_in_the_bind_pose(kind):
    joints, points = found(character(BONES, **KINDS[kind]))
    meshes = KINDS[kind].get("meshes", [box_mesh(BONES)])
    assert joints[0] == pytest.approx(BONES.positions, abs=1e-6)
    assert points[0] == pytest.approx(np.concatenate([mesh.points for mesh in meshes]), abs=1e-5)


def test_shown_pose_leaves_the_skin_bound_as_it_was():
    made, plain = character(BONES, axes=ROLLED), character(BONES, axes=ROLLED)
    made.show(WALK, 3)
    assert made.binary == plain.binary
    assert found(made)[0][0] == pytest.approx(WALK.positions[3], abs=1e-6)


def test_files_with_a_buffer_beside_them(tmp_path):
    made = character(BONES)
    made.animate("walk", WALK)
    document, buffer = gltf_player.load(made.write(tmp_path / "a walk.gltf"))
    placed = gltf_player.worlds(document, buffer, 0, WALK.times)
    assert placed[:, made.joints][..., :3, 3] == pytest.approx(WALK.positions, abs=2e-6)
    assert (tmp_path / "a walk.bin").is_file()


def test_rigid_meshes_go_with_their_joint():
    made = character(BONES, axes=ROLLED, above=ARMATURE)
    made.animate("walk", WALK)
    head = BONES.names.index("Head")
    hat = made.rigid("hat", head, (0, 0.2, 0))
    document, buffer = chunks(made.glb())
    placed = gltf_player.worlds(document, buffer, 0, WALK.times)
    turns = Rotation.from_quat(WALK.turns[:, head])
    assert placed[:, hat, :3, 3] == pytest.approx(WALK.positions[:, head] + turns.apply([0, 0.2, 0]), abs=1e-5)


def test_any_names():
    names = ["", "same", "same", "Left Upper Arm", "a:b/c", "日本", *BONES.names[6:]]
    document, _ = chunks(character(BONES.renamed(names)).glb())
    assert [node.get("name", "") for node in document["nodes"]] == [*names, "Body"]


def test_vrm_of_both_versions_and_vrm_animation():
    back = BONES.turned(LOOKING_BACK)
    old = as_vrm0(character(back))
    old.animate("walk", WALK.turned(LOOKING_BACK))
    assert found(old, 0, WALK.times)[0] == pytest.approx(
        LOOKING_BACK.apply(WALK.positions.reshape(-1, 3)).reshape(WALK.positions.shape), abs=2e-6
    )
    listed = {bone["bone"]: bone["node"] for bone in old.document["extensions"]["VRM"]["humanoid"]["humanBones"]}
    assert listed["leftUpperArm"] == BONES.names.index("LeftShoulder")
    new = as_vrm1(with_unknown_parts(character(BONES)), springs=["Neck", "Head"])
    assert new.document["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"]["hips"] == {"node": 0}
    moving = as_vrma(character(BONES, meshes=None))
    moving.animate("", WALK)
    assert "meshes" not in moving.document
    assert "VRMC_vrm_animation" in json.loads(json.dumps(moving.document))["extensionsUsed"]


@pytest.mark.parametrize("rig", ["mixamo_t", "unreal_a", "xsens_a", "lafan1_a"])
def test_skeletons_of_any_axes_and_units_stand_upright_in_metres(rig):
    from distretarget import load_target

    skeleton = load_target(SAMPLES / "rigs" / f"{rig}.json").skeleton
    bones = Bones.of(skeleton)
    heights = np.ptp(bones.positions, axis=0)
    assert 1.3 < heights[1] < 2.0
    walk = Performance.of(swaying(skeleton, 4))
    made = character(bones, axes=bones.along_bones(0.5), above=ARMATURE)
    made.animate("sway", walk, all_translations=True)
    assert found(made, 0, walk.times)[0] == pytest.approx(walk.positions, abs=1e-5)
