"""Rules of glTF and VRM, each with a small file and a known answer."""

import numpy as np
import pytest
from gltf_file import Gltf as Making
from scipy.spatial.transform import Rotation

from distretarget import SkeletonFileError
from distretarget.io import gltf as reading
from distretarget.io.gltf import parse_gltf
from distretarget.io.gltf_scene import _influences, _triangles, _vrm_0, decomposed


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


def influences(joints, weights, bones, more=()):
    """Those of the first four bones of each vertex, and of `more`, joints and weights."""
    making, attributes = Making(), {}
    for number, (some, shares) in enumerate([(joints, weights), *more]):
        attributes[f"JOINTS_{number}"] = making.accessor(np.array(some), "u1")
        attributes[f"WEIGHTS_{number}"] = making.accessor(np.array(shares))
    file, fields = primitive(making, attributes=attributes)
    return _influences(file, fields.node, fields.inner("attributes"), len(joints), bones)


def test_joints_without_weight_may_be_any_number():
    joints, weights = influences([[1, 255, 7, 2], [2, 0, 200, 3]], [[1.0, 0.0, 0.0, 0.0], [0.25, 0.75, 0.0, 0.0]], 3)
    assert joints.tolist() == [[1, 0, 0, 0], [2, 0, 0, 0]]
    assert weights.tolist() == [[1.0, 0.0, 0.0, 0.0], [0.25, 0.75, 0.0, 0.0]]


def test_more_than_four_bones_may_move_a_vertex():
    more = [([[4, 3, 0, 9]], [[0.2, 0.1, 0.0, 0.0]]), ([[1, 0, 0, 0]], [[0.05, 0.0, 0.0, 0.0]])]
    joints, weights = influences([[0, 1, 2, 3]], [[0.4, 0.1, 0.1, 0.05]], 5, more)
    assert joints.tolist() == [[0, 4, 1, 2, 3, 3, 1, 0]]
    np.testing.assert_allclose(weights, [[0.4, 0.2, 0.1, 0.1, 0.1, 0.05, 0.05, 0.0]], atol=1e-7)


def test_of_many_bones_those_count_that_move_a_vertex_most():
    """So a small file whose sets of influences are one accessor, used again and again, makes no large arrays."""
    more = [([[k % 5, 0, 0, 0]], [[k / 400, 0.0, 0.0, 0.0]]) for k in range(1, 400)]
    joints, weights = influences([[0, 0, 0, 0]], [[0.0] * 4], 5, more)
    np.testing.assert_allclose(weights, [np.arange(399, 391, -1) / 400], rtol=1e-6)
    assert joints.tolist() == [[4, 3, 2, 1, 0, 4, 3, 2]]


def test_joints_with_weight_must_be_in_the_skin():
    with pytest.raises(SkeletonFileError, match="has the joint 3; its skin has 3"):
        influences([[0, 3, 0, 0]], [[0.5, 0.5, 0.0, 0.0]], 3)


def test_the_thumbs_of_vrm_0_are_named_one_bone_further_out():
    making = Making()
    names = [
        "leftThumbProximal",
        "leftThumbIntermediate",
        "leftThumbDistal",
        "rightThumbProximal",
        "rightIndexProximal",
    ]
    for name in names:
        making.add("nodes", name=name)
    bones = [{"bone": name, "node": number} for number, name in enumerate(names)]
    making.document["extensions"] = {"VRM": {"humanoid": {"humanBones": [*bones, {"bone": "jaw", "node": -1}]}}}
    file = parsed(making)
    found = dict(_vrm_0(file, file.document.inner("extensions").inner("VRM").inner("humanoid")["humanBones"]))
    assert found == {
        "leftThumbMetacarpal": 0,
        "leftThumbProximal": 1,
        "leftThumbDistal": 2,
        "rightThumbMetacarpal": 3,
        "rightIndexProximal": 4,
    }
