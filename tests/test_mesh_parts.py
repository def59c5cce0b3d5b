"""Parts of a mesh put where their bones bring them: weights, bones without a place, and vertices that nothing moves."""

import numpy as np

from distretarget.character.mesh import MeshPart, _bound
from distretarget.character.nodes import Nodes

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
