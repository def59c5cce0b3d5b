"""The mesh of a character: where its skin is in the rest pose and in motion, and what becomes of bad ones."""

import json

import gltf_player
import numpy as np
import pytest
from characters import ARMATURE, box_mesh, character, chunks
from test_character_files import glb
from test_characters import BONES, WALK

from distretarget import Motion, load_target, read_motion
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


def test_joints_without_weight_may_be_any_number(tmp_path):
    """Exporters leave numbers beyond the skin's joints where the weight is 0."""
    document, binary = chunks(hero().glb())
    joints, weights = (
        np.frombuffer(
            binary, kind, 4 * accessor["count"], document["bufferViews"][accessor["bufferView"]]["byteOffset"]
        )
        for accessor, kind in (
            (document["accessors"][attributes(document)["JOINTS_0"]], "<u2"),
            (document["accessors"][attributes(document)["WEIGHTS_0"]], "<f4"),
        )
    )
    assert (weights == 0).any()
    junk = np.where(weights == 0, 9999, joints).astype("<u2").tobytes()
    path = tmp_path / "hero.glb"
    path.write_bytes(glb(json.dumps(document), binary.replace(joints.tobytes(), junk)))
    plain = hero().write(tmp_path / "plain.glb")
    np.testing.assert_array_equal(read(path)[1].vertices, read(plain)[1].vertices)


def changed(tmp_path, change):
    """A hero whose document is changed."""
    document, binary = chunks(hero().glb())
    change(document)
    path = tmp_path / "hero.glb"
    path.write_bytes(glb(json.dumps(document), binary))
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
