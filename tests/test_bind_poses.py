"""Where joints were when skin was bound to them, whatever pose is shown, and in which space the mesh is."""

import numpy as np
import pytest
from bodies import sample
from characters import ARMATURE, Bones, Performance, box_mesh, character
from scipy.spatial.transform import Rotation

from distretarget import load_target
from distretarget.character.from_scene import bind_poses
from distretarget.character.nodes import Nodes, SkinBinding

JOINTS = 10


def nodes_at(world):
    """Nodes without parents that show these transforms, (nodes, 4, 4), joined in a chain of places in the file."""
    count = len(world)
    nodes = Nodes(
        names=tuple(map(str, range(count))),
        parents=np.array([-1, *range(count - 1)]),
        translations=np.zeros((count, 3)),
        rotations=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        scales=np.ones((count, 3)),
    )
    vars(nodes)["world"] = np.array(world)
    return nodes


def transform(turn, place):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    matrix[:3, 3] = place
    return matrix


BINDS = np.array([transform([0.1 * joint, 0.0, 0.05], [0.0, 0.2 * joint, 0.1]) for joint in range(JOINTS)])
SPACE = transform([0.0, 0.7, 0.0], [0.3, 1.0, -0.2])
BENT = transform([0.0, 0.0, 1.0], [0.0, 0.0, 0.5])


def found(bent, joints=JOINTS):
    """The bind poses of a skin whose mesh is in `SPACE`, when some joints show another pose."""
    world = [SPACE @ bind @ (BENT if joint in bent else np.eye(4)) for joint, bind in enumerate(BINDS)]
    skin = SkinBinding(np.arange(joints), np.linalg.inv(BINDS), ())
    return bind_poses(nodes_at(world), [skin])


def test_half_of_the_joints_say_in_which_space_the_mesh_is():
    for bent in ({}, {0, 4}, {0, 2, 4, 6}, {0, 1, 2, 3, 4}):
        poses = found(bent)
        for joint in range(JOINTS):
            np.testing.assert_allclose(poses[joint], SPACE @ BINDS[joint], atol=1e-9)


def test_where_most_joints_show_other_poses_the_mesh_is_in_the_world():
    turns = [transform([0.3 * joint, 0.2, 0.1 * joint], [0.1 * joint, 0.0, 0.0]) for joint in range(JOINTS)]
    world = [SPACE @ bind @ turn for bind, turn in zip(BINDS, turns, strict=True)]
    poses = bind_poses(nodes_at(world), [SkinBinding(np.arange(JOINTS), np.linalg.inv(BINDS), ())])
    for joint in range(JOINTS):
        np.testing.assert_allclose(poses[joint], BINDS[joint], atol=1e-9)


def test_of_skins_with_a_joint_in_common_the_one_that_reaches_highest_decides():
    other = np.array([transform([0.0, 0.3, 0.0], [0.5, 0.1 * joint, 0.0]) for joint in range(JOINTS)])
    low = SkinBinding(np.array([1, 2, 3]), np.linalg.inv(other[[1, 2, 3]]), ())
    high = SkinBinding(np.array([0, 1]), np.linalg.inv(BINDS[:2]), ())
    for skins in ([low, high], [high, low]):
        poses = bind_poses(nodes_at(BINDS), skins)
        np.testing.assert_allclose(poses[1], BINDS[1], atol=1e-9)
        to_world = BINDS[1] @ np.linalg.inv(other[1])
        np.testing.assert_allclose(poses[3], to_world @ other[3], atol=1e-9)


def test_of_skins_that_reach_as_high_the_largest_decides():
    other = np.array([transform([0.0, 0.3, 0.0], [0.5, 0.1 * joint, 0.0]) for joint in range(JOINTS)])
    small = SkinBinding(np.array([0, 1]), np.linalg.inv(other[:2]), ())
    large = SkinBinding(np.array([0, 1, 2]), np.linalg.inv(BINDS[:3]), ())
    for skins in ([small, large], [large, small]):
        poses = bind_poses(nodes_at(BINDS), skins)
        np.testing.assert_allclose(poses[1], BINDS[1], atol=1e-9)


def test_a_skin_without_inverse_binds_was_bound_as_the_nodes_show():
    poses = bind_poses(nodes_at(BINDS), [SkinBinding(np.array([0, 2]), None, ())])
    assert sorted(poses) == [0, 2]
    np.testing.assert_array_equal(poses[2], BINDS[2])


BONES = Bones.of(sample("walk").skeleton)


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
