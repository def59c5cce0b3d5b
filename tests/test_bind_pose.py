"""The bind pose of characters whose nodes show another pose."""

import numpy as np
import pytest
from bodies import SAMPLES
from characters import ARMATURE, Bones, Performance, box_mesh, character
from scipy.spatial.transform import Rotation

from distretarget import load_target, read_bvh

BONES = Bones.of(read_bvh(SAMPLES / "walk.bvh").skeleton)


def turning(*names):
    """A performance of one frame in which some joints turn, and take along what is below them."""
    turns, positions = [], BONES.positions.copy()
    for joint, parent in enumerate(BONES.parents):
        above = turns[parent] if parent >= 0 else Rotation.identity()
        if parent >= 0:
            positions[joint] = positions[parent] + above.apply(BONES.positions[joint] - BONES.positions[parent])
        turns.append(above * Rotation.from_rotvec([0.6, 0.2, -0.3] if BONES.names[joint] in names else [0, 0, 0]))
    return Performance(Rotation.concatenate(turns).as_quat()[None], positions[None], np.zeros(1))


def bind_pose(made, path):
    """Those of the joints that the skeleton of a file has, and their places in its rest pose."""
    target = load_target(made.write(path))
    nodes = target.character.nodes[-len(target.skeleton) :].tolist()
    joints = [joint for joint, node in enumerate(made.joints) if node in nodes]
    places = target.skeleton.rest_positions + target.skeleton.offsets[0]
    return joints, places[[nodes.index(made.joints[joint]) for joint in joints]]


@pytest.mark.parametrize("above", [None, ARMATURE], ids=["plain", "armature"])
@pytest.mark.parametrize("shown", [["Chest"], ["Chest", "LeftHip"], BONES.names], ids=["bent", "a leg too", "all"])
def test_shown_poses_do_not_matter(shown, above, tmp_path):
    made = character(BONES, axes=BONES.along_bones(0.5), above=above)
    made.show(turning(*shown))
    _, places = bind_pose(made, tmp_path / "hero.glb")
    assert places == pytest.approx(BONES.positions, abs=1e-5)


def test_skins_that_share_joints_were_bound_in_one_place(tmp_path):
    """The skin of the upper body, the larger one, does not have the hips."""
    made = character(BONES, meshes=[box_mesh(BONES, range(2, 17)), box_mesh(BONES, [0, 1, 2])], all_joints=False)
    assert made.joints[2] in made.document["skins"][0]["joints"]
    assert made.joints[2] in made.document["skins"][1]["joints"]
    made.show(turning("Chest"))
    joints, places = bind_pose(made, tmp_path / "hero.glb")
    assert len(joints) == 17
    assert places == pytest.approx(BONES.positions[joints], abs=1e-5)
