"""Where joints were when skin was bound to them, whatever pose is shown; and the bones that deform it."""

import gltf_player
import numpy as np
import pytest
from bodies import sample, swaying
from characters import ARMATURE, Bones, Performance, box_mesh, character
from named_bodies import roles, skeleton, tree
from scipy.spatial.transform import Rotation

from distretarget import load_target, read_motion, write_motion
from distretarget.character.character import deform_tree
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


def test_of_skins_with_a_joint_in_common_the_one_that_reaches_highest_decides_or_else_the_largest():
    other = np.array([transform([0.0, 0.3, 0.0], [0.5, 0.1 * joint, 0.0]) for joint in range(JOINTS)])
    low = SkinBinding(np.array([1, 2, 3]), np.linalg.inv(other[[1, 2, 3]]), ())
    high = SkinBinding(np.array([0, 1]), np.linalg.inv(BINDS[:2]), ())
    for skins in ([low, high], [high, low]):
        poses = bind_poses(nodes_at(BINDS), skins)
        np.testing.assert_allclose(poses[1], BINDS[1], atol=1e-9)
        to_world = BINDS[1] @ np.linalg.inv(other[1])
        np.testing.assert_allclose(poses[3], to_world @ other[3], atol=1e-9)
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


# As Rigify builds it: the spine hangs from the root, everything else from the originals.
GENERATED = (
    "rig(root>DEF-spine>DEF-spine.001>DEF-spine.002>DEF-spine.003>DEF-spine.004>DEF-spine.005>DEF-spine.006|torso("
    "hips|chest|MCH-spine.001>spine_fk.001>tweak_spine.001>ORG-spine.001|spine_fk>ORG-spine(ORG-pelvis.L>DEF-pelvis.L|"
    "DEF-thigh.L>DEF-thigh.L.001>DEF-shin.L>DEF-shin.L.001>DEF-foot.L>DEF-toe.L|ORG-thigh.L>ORG-shin.L>ORG-foot.L|"
    "DEF-thigh.R>DEF-thigh.R.001>DEF-shin.R>DEF-shin.R.001>DEF-foot.R>DEF-toe.R|ORG-thigh.R>ORG-shin.R)|"
    "MCH-spine.002>spine_fk.003>ORG-spine.003(MCH-ROT-head>head>ORG-spine.006>ORG-face>jaw_master>DEF-jaw|"
    "ORG-shoulder.L(DEF-shoulder.L|DEF-upper_arm.L>DEF-upper_arm.L.001>DEF-forearm.L>DEF-forearm.L.001>DEF-hand.L>"
    "ORG-palm.01.L(DEF-palm.01.L|DEF-f_index.01.L>DEF-f_index.02.L|f_index.01.L))|"
    "ORG-shoulder.R(DEF-shoulder.R|DEF-upper_arm.R>DEF-upper_arm.R.001>DEF-forearm.R>DEF-forearm.R.001>DEF-hand.R))))"
)


# The same as Blender writes it if only the bones that deform are asked for.
ALONE = (
    "rig(DEF-spine>DEF-spine.001>DEF-spine.002>DEF-spine.003>DEF-spine.004>DEF-spine.005>DEF-spine.006|DEF-pelvis.L|"
    "DEF-thigh.L>DEF-thigh.L.001>DEF-shin.L>DEF-shin.L.001>DEF-foot.L>DEF-toe.L|DEF-jaw|DEF-lid.B.L.001|DEF-brow.T.L|"
    "DEF-thigh.R>DEF-thigh.R.001>DEF-shin.R>DEF-shin.R.001>DEF-foot.R>DEF-toe.R|DEF-shoulder.L|DEF-shoulder.R|"
    "DEF-upper_arm.L>DEF-upper_arm.L.001>DEF-forearm.L>DEF-forearm.L.001>DEF-hand.L(DEF-palm.01.L|DEF-f_index.01.L>"
    "DEF-f_index.02.L)|DEF-upper_arm.R>DEF-upper_arm.R.001>DEF-forearm.R>DEF-forearm.R.001>DEF-hand.R)"
)


def deforming(text, rename=lambda name: name):
    """The tree of the bones that deform as a skeleton."""
    body = tree(text)
    names = [rename(name) for name in body.names]
    found = deform_tree(names, body.parents.tolist())
    bones = []
    while len(bones) < len(found):
        bones += [bone for bone in found if bone not in bones and found[bone] in (-1, *bones)]
    return skeleton([names[bone] for bone in bones], [bones.index(found[b]) if found[b] >= 0 else -1 for b in bones])


@pytest.mark.parametrize(
    ("text", "rename"),
    [
        (GENERATED, str),
        (GENERATED, lambda name: name.replace(".", "")),
        (GENERATED, lambda name: f"{name}_0{len(name)}"),
        (ALONE, str),
        (ALONE, lambda name: f"{name}_0{len(name)}"),
    ],
)
def test_bones_that_deform_hang_from_each_other_as_their_originals_do(text, rename):
    body = deforming(text, rename)
    above = {name: body.names[parent] for name, parent in zip(body.names, body.parents, strict=True) if parent >= 0}
    expected = {
        "DEF-thigh.L": "DEF-spine",
        "DEF-pelvis.L": "DEF-spine",
        "DEF-shoulder.L": "DEF-spine.003",
        "DEF-upper_arm.L": "DEF-shoulder.L",
        "DEF-upper_arm.L.001": "DEF-upper_arm.L",
        "DEF-palm.01.L": "DEF-hand.L",
        "DEF-f_index.01.L": "DEF-palm.01.L" if text == GENERATED else "DEF-hand.L",
        "DEF-jaw": "DEF-spine.006",
    }
    assert {rename(name): above[rename(name)] for name in expected} == {
        rename(name): rename(parent) for name, parent in expected.items()
    }
    assert body.names[0] == rename("DEF-spine")
    assert all(name.startswith("DEF-") for name in body.names)
    found = roles(body)
    assert (found["hips"], found["head"]) == (rename("DEF-spine"), rename("DEF-spine.006"))
    assert found["leftLowerArm"] == rename("DEF-forearm.L")
    assert found["leftIndex1"] == rename("DEF-f_index.01.L")


@pytest.mark.parametrize(
    "text",
    [
        "Hips>Spine>Head",
        "root>DEF-spine(DEF-spine.001|DEF-thigh.L>DEF-shin.L)",
        "root(DEF-box>DEF-lid|DEF-wheel.L|DEF-wheel.R)",
        GENERATED.replace("DEF-", "my_"),
    ],
)
def test_a_tree_that_shows_it_already_stays(text):
    body = tree(text)
    assert deform_tree(body.names, body.parents.tolist()) == {}


def test_where_all_bones_are_joints_hands_are_those_that_deform():
    found = roles(tree(GENERATED))
    assert (found["leftHand"], found["leftIndex1"]) == ("DEF-hand.L", "DEF-f_index.01.L")


def test_controls_are_left_out_also_where_the_bones_that_deform_hang_together():
    body = tree("root(DEF-spine(DEF-spine.001|DEF-thigh.L)|torso(ORG-spine|spine_fk|thigh_fk.L|head))")
    found = deform_tree(body.names, body.parents.tolist())
    assert {body.names[bone]: body.names[parent] for bone, parent in found.items() if parent >= 0} == {
        "DEF-spine.001": "DEF-spine",
        "DEF-thigh.L": "DEF-spine",
    }


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
