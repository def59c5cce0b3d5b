"""The mesh of a character: its parts, where its skin is at rest and in motion, and what becomes of bad ones."""

import gltf_player
import numpy as np
import pytest
from characters import ARMATURE, box_mesh, character, chunks, packed
from test_characters import BONES, WALK

from distretarget import Motion, load_target, read_motion
from distretarget.character.mesh import MeshPart, _bound
from distretarget.character.nodes import Nodes
from distretarget.io.input_file import InputFile
from distretarget.io.target_file import CharacterMesh, parse_target

RIGS = {
    "plain": {},
    "Z up in cm": {"above": ARMATURE},
    "bones along Y": {"axes": BONES.along_bones(0.3)},
    "mirrored": {"above": np.diag([-1.0, 1.0, 1.0, 1.0])},
    "matrices": {"matrices": True},
    "scaled joints": {"scales": {4: 1.3, 7: 0.5}, "axes": BONES.along_bones()},
    "nodes between joints": {"helpers": [1, 5]},
    "few joints in the skin": {"all_joints": False},
}


def hero(**rig):
    return character(BONES, meshes=[box_mesh(BONES)], **rig)


def read(path):
    target = load_target(path)
    return target, target.mesh()


@pytest.mark.parametrize("rig", RIGS)
def test_the_skin_is_where_the_file_shows_it(tmp_path, rig):
    path = hero(**RIGS[rig]).write(tmp_path / "hero.glb")
    target, mesh = read(path)
    document, buffer = gltf_player.load(path)
    shown = np.concatenate(gltf_player.skinned(document, buffer, gltf_player.worlds(document, buffer, None, [0.0])), 1)
    np.testing.assert_allclose(mesh.vertices + target.skeleton.offsets[0], shown[0], atol=1e-6)
    np.testing.assert_allclose(mesh.weights.sum(axis=1), 1.0)
    still = Motion(target.skeleton, np.zeros((1, 3)), target.skeleton.unturned[None], "0.1")
    np.testing.assert_allclose(mesh.posed(still)[0], mesh.vertices, atol=1e-9)


@pytest.mark.parametrize("rig", [rig for rig in RIGS if rig != "matrices"])
def test_the_skin_moves_as_a_player_moves_it(tmp_path, rig):
    made = hero(**RIGS[rig])
    made.animate("walk", WALK)
    path = made.write(tmp_path / "hero.glb")
    file = InputFile(path.read_bytes(), path)
    motion = read_motion(path)
    mesh = CharacterMesh(file, parse_target(file).character)()
    document, buffer = gltf_player.load(path)
    times = np.arange(len(motion)) * motion.frame_time
    shown = gltf_player.skinned(document, buffer, gltf_player.worlds(document, buffer, 0, times))
    np.testing.assert_allclose(mesh.posed(motion), np.concatenate(shown, axis=1), atol=2e-5)
    up = np.array([0.6, 0.8, 0.0])
    np.testing.assert_allclose(mesh.heights(motion, up), mesh.posed(motion) @ up, atol=1e-9)


def changed(tmp_path, change):
    """A hero whose document is changed."""
    document, binary = chunks(hero().glb())
    change(document)
    path = tmp_path / "hero.glb"
    path.write_bytes(packed(document, binary))
    return load_target(path).mesh


def attributes(document):
    return document["meshes"][0]["primitives"][0]["attributes"]


BAD = {
    "no weights": (lambda d: attributes(d).pop("WEIGHTS_0"), "no joints and weights"),
    "a list for an accessor": (lambda d: attributes(d).update(NORMAL=[1]), "expected a whole number"),
    "no such accessor": (lambda d: attributes(d).update(POSITION=99), "an index of accessors"),
    "scalars": (lambda d: attributes(d).update(POSITION=d["meshes"][0]["primitives"][0]["indices"]), "type VEC3"),
    "another number of weights": (
        lambda d: d["accessors"][attributes(d)["WEIGHTS_0"]].update(count=3),
        "3 weights for",
    ),
    "indices beyond": (lambda d: d["accessors"][attributes(d)["POSITION"]].update(count=4), "weights for 4 vertices"),
    "Draco": (
        lambda d: d["meshes"][0]["primitives"][0].update(extensions={"KHR_draco_mesh_compression": {}}),
        "compressed by Draco",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_mesh_is_a_warning(tmp_path, case):
    change, expected = BAD[case]
    mesh = changed(tmp_path, change)
    assert mesh() is None
    (warning,) = mesh.warnings
    assert expected in warning


def test_a_file_without_meshes_has_none(tmp_path):
    mesh = load_target(character(BONES, meshes=None).write(tmp_path / "hero.glb")).mesh
    assert mesh() is None
    assert not mesh.warnings


def test_a_mesh_without_skin_moves_with_its_node(tmp_path):
    def hang(document):
        head = next(node for node in document["nodes"] if node.get("name") == "Head")
        head.setdefault("children", []).append(len(document["nodes"]))
        rigid = {"POSITION": attributes(document)["POSITION"]}
        document["meshes"].append({"primitives": [{"attributes": rigid}]})
        document["nodes"].append({"mesh": len(document["meshes"]) - 1, "translation": [0.0, 0.5, 0.0]})

    mesh = changed(tmp_path, hang)
    skeleton, found = mesh.character.skeleton, mesh()
    head = skeleton.index("Head")
    hung = (found.joints[:, 0] == head) & (found.weights[:, 0] == 1.0)
    assert hung.sum() >= len(found.vertices) / 2 - 2
    middle = found.vertices[hung].mean(axis=0) - skeleton.rest_positions[head]
    assert middle[1] > 0.5


PLACES = np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]])  # of two bones
TRIANGLE = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def bound(weights, to_bones=None, joints=None, normals=None):
    """A triangle bound to two bones, of which the second has moved up by 2 since."""
    nodes = Nodes(("a", "b"), np.array([-1, -1]), PLACES, np.tile([0.0, 0, 0, 1], (2, 1)), np.ones((2, 3)))
    weights = np.broadcast_to(np.asarray(weights, float), (3, 2))
    part = MeshPart(
        vertices=TRIANGLE,
        bones=np.array([0, 1]),
        to_bones=np.tile(np.eye(4), (2, 1, 1)) if to_bones is None else to_bones,
        joints=np.tile([0, 1], (3, 1)),
        weights=weights,
        triangles=np.array([[0, 1, 2]]),
        materials=np.array([-1]),
        uv=np.zeros((3, 2)),
        normals=normals,
    )
    binds = dict(enumerate(nodes.transforms))
    return _bound(part, 1, nodes, binds, joints or {0: 0, 1: 1})


def test_vertices_are_the_mean_of_where_bones_bring_them_by_weight():
    for weights, up in (([1, 0], 0.0), ([0, 1], 2.0), ([0.5, 0.5], 1.0), ([3, 1], 0.5), ([0.1, 0.1], 1.0)):
        mesh = bound(weights)
        np.testing.assert_allclose(mesh.vertices, TRIANGLE + np.array([0.0, up, 0.0]), atol=1e-12)
        np.testing.assert_allclose(mesh.weights.sum(axis=1), 1.0)


def test_normals_turn_with_bones_by_weight():
    turned = np.tile(np.eye(4), (2, 1, 1))
    turned[1, :3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]  # X to Y
    mesh = bound([0.75, 0.25], turned, normals=np.tile([1.0, 0.0, 0.0], (3, 1)))
    np.testing.assert_allclose(mesh.looks.normals, np.tile([3.0, 1.0, 0.0], (3, 1)) / np.sqrt(10.0), atol=1e-12)


def test_negative_weights_count_as_none():
    mesh = bound([2.0, -1.0])
    np.testing.assert_allclose(mesh.vertices, TRIANGLE, atol=1e-12)
    np.testing.assert_allclose(mesh.weights, [[1.0, 0.0]] * 3)


def test_bones_whose_matrix_has_no_inverse_move_nothing():
    to_bones = np.tile(np.eye(4), (2, 1, 1))
    to_bones[1, :3, :3] = 0.0
    np.testing.assert_allclose(bound([0.5, 0.5], to_bones).vertices, TRIANGLE, atol=1e-12)
    assert bound([0.0, 1.0], to_bones) is None


def test_a_triangle_with_a_vertex_that_nothing_moves_is_left_out():
    mesh = bound([[1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    assert len(mesh.triangles) == 0
    assert len(mesh.vertices) == 2


def test_bones_above_the_skeleton_move_nothing():
    mesh = bound([0.5, 0.5], joints={0: 0})
    np.testing.assert_allclose(mesh.vertices, TRIANGLE, atol=1e-12)
    assert mesh.joints.max() == 0
