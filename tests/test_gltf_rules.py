"""Rules of glTF and VRM with small files and known answers; and meshes, where a player shows them."""

import gltf_player
import numpy as np
import pytest
from characters import ARMATURE, box_mesh, character, chunks, packed
from gltf_file import Gltf as Making
from scipy.spatial.transform import Rotation
from test_characters import BONES, WALK

from distretarget import Motion, SkeletonFileError, load_target, read_motion
from distretarget.character.mesh import MeshPart, _bound
from distretarget.character.nodes import Nodes
from distretarget.io import gltf as reading
from distretarget.io.gltf import parse_gltf
from distretarget.io.gltf_scene import _influences, _triangles, decomposed, gltf_nodes, gltf_scene
from distretarget.io.input_file import InputFile
from distretarget.io.reading import CharacterMesh, parse_target


def parsed(making):
    return parse_gltf(making.glb(), "small.glb")


def primitive(making, **fields):
    """The file, and the only primitive of its only mesh."""
    making.add("meshes", primitives=[{"attributes": {}} | fields])
    file = parsed(making)
    return file, file.entries("meshes")[0].entries().listed("primitives")[0].entries()


def with_positions(making, values, dtype="f4", **entry):
    """The file, and the reference to an accessor of some values."""
    number = making.accessor(np.array(values), dtype)
    making.document["accessors"][number] |= entry
    file, fields = primitive(making, attributes={"POSITION": number})
    return file, fields.inner("attributes")["POSITION"]


@pytest.mark.parametrize(
    ("dtype", "stored", "read"),
    [
        ("i1", [-128, -127, 127], [-1.0, -1.0, 1.0]),
        ("u1", [0, 51, 255], [0.0, 0.2, 1.0]),
        ("i2", [-32768, -32767, 32767], [-1.0, -1.0, 1.0]),
        ("u2", [0, 13107, 65535], [0.0, 0.2, 1.0]),
    ],
)
def test_normalized_integers_are_from_minus_one_to_one(dtype, stored, read):
    file, reference = with_positions(Making(), [stored], dtype, normalized=True)
    np.testing.assert_allclose(file.numbers(reference, "VEC3"), [read], atol=1e-15)
    file, reference = with_positions(Making(), [stored], dtype)
    np.testing.assert_array_equal(file.numbers(reference, "VEC3"), [stored])


def references_allowed(file, reference):
    """How often an accessor may be read, up to a million times."""
    for count in range(1_000_000):
        try:
            file.numbers(reference, "VEC3")
        except SkeletonFileError as error:
            assert "is referred to too often for a file of this size" in str(error)  # noqa: PT017 - counts first
            return count
    return 1_000_000


def test_a_small_file_may_refer_to_four_million_numbers():
    file, reference = with_positions(Making(), np.zeros((1000, 3)))
    assert references_allowed(file, reference) == 4_000_000 // 3000


def test_a_large_file_may_refer_to_two_numbers_for_each_of_its_bytes(monkeypatch):
    monkeypatch.setattr(reading, "FREE_NUMBERS", 0)
    making = Making()
    file, reference = with_positions(making, np.zeros((1000, 3)))
    assert references_allowed(file, reference) == 2 * len(making.glb()) // 3000


def cycles(triangles):
    """Triangles from their least vertex on, which keeps the side that they are seen from."""
    return [tuple(np.roll(each, -int(np.argmin(each))).tolist()) for each in triangles]


@pytest.mark.parametrize(
    ("mode", "triangles"),
    [
        (4, [(0, 1, 2), (3, 4, 5)]),
        (5, [(0, 1, 2), (1, 3, 2), (2, 3, 4), (3, 5, 4), (4, 5, 6)]),
        (6, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5), (0, 5, 6)]),
    ],
)
def test_strips_and_fans_face_the_side_that_the_specification_says(mode, triangles):
    assert cycles(_triangles(*primitive(Making(), mode=mode), 7)) == triangles


def test_indices_say_which_vertices_a_strip_has():
    making = Making()
    number = making.accessor(np.array([6, 2, 4, 0]), "u1")
    assert cycles(_triangles(*primitive(making, mode=5, indices=number), 7)) == [(2, 4, 6), (0, 4, 2)]
    with pytest.raises(SkeletonFileError, match="has the index 6; it has 6 vertices"):
        _triangles(*primitive(Making(making.document, making.binary), mode=5, indices=number), 6)


@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_a_matrix_is_taken_apart_and_put_together_again(mirrored):
    turn, scale = Rotation.from_euler("XYZ", [20, 30, 40], degrees=True), mirrored * np.array([1.0, 2.0, 0.5])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn.as_matrix() * scale, [1.0, 2.0, 3.0]
    translation, rotation, found = decomposed(matrix)
    np.testing.assert_allclose(translation, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(found, scale, atol=1e-12)
    np.testing.assert_allclose(Rotation.from_quat(rotation).as_matrix(), turn.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("digits", [3, 7])
def test_numbers_of_matrices_may_be_rounded(digits):
    making = character(BONES, axes=BONES.along_bones(0.3), above=np.diag([10.0, 10.0, 10.0, 1.0]), matrices=True)
    exact = gltf_nodes(parsed(making)).world
    for node in making.document["nodes"]:
        node["matrix"] = np.round(node["matrix"], digits).tolist()
    np.testing.assert_allclose(gltf_nodes(parsed(making)).world, exact, atol=200 * 10.0**-digits)


def influences(joints, weights, bones, more=()):
    """Those of the first four bones of each vertex, and of `more`, joints and weights."""
    making, attributes = Making(), {}
    for number, (some, shares) in enumerate([(joints, weights), *more]):
        attributes[f"JOINTS_{number}"] = making.accessor(np.array(some), "u1")
        attributes[f"WEIGHTS_{number}"] = making.accessor(np.array(shares))
    file, fields = primitive(making, attributes=attributes)
    return _influences(file, fields.node, fields.inner("attributes"), len(joints), bones)


def test_more_than_four_bones_may_move_a_vertex_of_which_those_count_that_move_it_most():
    more = [([[4, 3, 0, 9]], [[0.2, 0.1, 0.0, 0.0]]), ([[1, 0, 0, 0]], [[0.05, 0.0, 0.0, 0.0]])]
    joints, weights = influences([[0, 1, 2, 3]], [[0.4, 0.1, 0.1, 0.05]], 5, more)
    assert joints.tolist() == [[0, 4, 1, 2, 3, 3, 1, 0]]
    np.testing.assert_allclose(weights, [[0.4, 0.2, 0.1, 0.1, 0.1, 0.05, 0.05, 0.0]], atol=1e-7)
    more = [([[k % 5, 0, 0, 0]], [[k / 400, 0.0, 0.0, 0.0]]) for k in range(1, 400)]
    joints, weights = influences([[0, 0, 0, 0]], [[0.0] * 4], 5, more)
    np.testing.assert_allclose(weights, [np.arange(399, 391, -1) / 400], rtol=1e-6)
    assert joints.tolist() == [[4, 3, 2, 1, 0, 4, 3, 2]]


def test_joints_with_weight_must_be_in_the_skin():
    with pytest.raises(SkeletonFileError, match="has the joint 3; its skin has 3"):
        influences([[0, 3, 0, 0]], [[0.5, 0.5, 0.0, 0.0]], 3)
    joints, weights = influences([[1, 255, 7, 2], [2, 0, 200, 3]], [[1.0, 0.0, 0.0, 0.0], [0.25, 0.75, 0.0, 0.0]], 3)
    assert joints.tolist() == [[1, 0, 0, 0], [2, 0, 0, 0]]
    assert weights.tolist() == [[1.0, 0.0, 0.0, 0.0], [0.25, 0.75, 0.0, 0.0]]


def test_the_thumbs_of_vrm_0_are_named_one_bone_further_out():
    making = Making()
    names = [f"leftThumb{bone}" for bone in ("Proximal", "Intermediate", "Distal")]
    names += ["rightThumbProximal", "rightIndexProximal"]
    for name in names:
        making.add("nodes", name=name)
    bones = [{"bone": name, "node": number} for number, name in enumerate(names)]
    making.document["extensions"] = {"VRM": {"humanoid": {"humanBones": [*bones, {"bone": "jaw", "node": -1}]}}}
    found = gltf_scene(parsed(making)).humanoid
    assert found == {
        "leftThumbMetacarpal": 0,
        "leftThumbProximal": 1,
        "leftThumbDistal": 2,
        "rightThumbMetacarpal": 3,
        "rightIndexProximal": 4,
    }


SHEARED = np.array([[1.0, 0.4, 0.0, 0.1], [0.0, 2.0, 0.3, 0.0], [0.2, 0.0, 0.5, -0.3], [0.0, 0.0, 0.0, 1.0]])
RIGS = {
    "plain": {},
    "Z up in cm": {"above": ARMATURE},
    "bones along Y": {"axes": BONES.along_bones(0.3)},
    "mirrored": {"above": np.diag([-1.0, 1.0, 1.0, 1.0])},
    "matrices": {"matrices": True},
    "scaled joints": {"scales": {4: 1.3, 7: 0.5}, "axes": BONES.along_bones()},
    "nodes between joints": {"helpers": [1, 5]},
    "few joints in the skin": {"all_joints": False},
    "sheared space of the mesh": {"space": SHEARED},  # inverse bind matrices may be any transforms
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
    still = Motion(target.skeleton, np.zeros((1, 3)), target.skeleton.rest_rotations[None], "0.1")
    np.testing.assert_allclose(mesh.posed(still)[0], mesh.vertices, atol=1e-9)


def test_the_outside_of_a_mirrored_skin_is_outside(tmp_path):
    meshes = [read(hero(**RIGS[rig]).write(tmp_path / f"{rig}.glb"))[1] for rig in ("plain", "mirrored")]
    one, mirrored = (np.linalg.det(mesh.vertices[mesh.triangles]).sum() for mesh in meshes)
    assert mirrored == pytest.approx(one)


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


def test_vertices_and_normals_follow_bones_by_weight():
    for weights, up in (([1, 0], 0.0), ([0, 1], 2.0), ([0.5, 0.5], 1.0), ([3, 1], 0.5), ([0.1, 0.1], 1.0)):
        mesh = bound(weights)
        np.testing.assert_allclose(mesh.vertices, TRIANGLE + np.array([0.0, up, 0.0]), atol=1e-12)
        np.testing.assert_allclose(mesh.weights.sum(axis=1), 1.0)
    turned = np.tile(np.eye(4), (2, 1, 1))
    turned[1, :3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]  # X to Y
    mesh = bound([0.75, 0.25], turned, normals=np.tile([1.0, 0.0, 0.0], (3, 1)))
    np.testing.assert_allclose(mesh.looks.normals, np.tile([3.0, 1.0, 0.0], (3, 1)) / np.sqrt(10.0), atol=1e-12)


def test_what_no_bone_of_the_skeleton_moves_is_left_out():
    mesh = bound([2.0, -1.0])
    np.testing.assert_allclose(mesh.vertices, TRIANGLE, atol=1e-12)
    np.testing.assert_allclose(mesh.weights, [[1.0, 0.0]] * 3)
    to_bones = np.tile(np.eye(4), (2, 1, 1))
    to_bones[1, :3, :3] = 0.0
    np.testing.assert_allclose(bound([0.5, 0.5], to_bones).vertices, TRIANGLE, atol=1e-12)
    assert bound([0.0, 1.0], to_bones) is None
    mesh = bound([[1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    assert len(mesh.triangles) == 0
    assert len(mesh.vertices) == 2
    mesh = bound([0.5, 0.5], joints={0: 0})
    np.testing.assert_allclose(mesh.vertices, TRIANGLE, atol=1e-12)
    assert mesh.joints.max() == 0
