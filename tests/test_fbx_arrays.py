"""What the FBX reader's process hands over, turned into nodes, skins and weights: each rule with a known answer."""

import numpy as np

from distretarget.character.nodes import INFLUENCES, Nodes
from distretarget.io.fbx import _inverse, _skins, influences_of

STILL = np.array([0.0, 0.0, 0.0, 1.0])


def test_the_strongest_bones_of_a_vertex_are_kept_the_strongest_first():
    many = INFLUENCES + 2
    moved = np.array([0] * many + [1])
    movers, weights = np.array([*range(many), 5]), np.array([*(0.1 * np.arange(1, many + 1)), 0.3])
    joints, shares = influences_of(3, moved, movers, weights)
    assert joints.shape == shares.shape == (3, INFLUENCES)
    assert joints[0].tolist() == list(range(many - 1, 1, -1))
    np.testing.assert_allclose(shares[0], 0.1 * np.arange(many, 2, -1))
    assert (joints[1, 0], shares[1, 0], shares[1, 1:].any(), shares[2].any()) == (5, 0.3, False, False)
    matrix = np.eye(4)
    matrix[:3, 3], matrix[0, 0] = [1.0, 2.0, 3.0], 2.0
    np.testing.assert_allclose(_inverse(matrix) @ matrix, np.eye(4), atol=1e-15)
    flat, skewed = np.diag([1.0, 1.0, 0.0, 1.0]), np.eye(4)
    skewed[:3, 1] = skewed[:3, 0]
    for singular in (flat, skewed, np.full((4, 4), np.nan), 1e300 * np.eye(4)):
        assert not _inverse(singular).any()


def test_of_several_bind_poses_the_first_counts():
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 1, 3] = [1.0, 2.0, 3.0]
    nodes = Nodes(("Hips", "Knee"), np.array([-1, 0]), np.zeros((2, 3)), np.tile(STILL, (2, 1)), np.ones((2, 3)))
    nothing = np.zeros(0, np.intp)
    read = {"counts": nothing, "joints": nothing, "binds": np.zeros((0, 4, 4)), "pivots": np.zeros((2, 3))}
    read |= {"posed": np.array([0, 1, 0]), "poses": poses, "is_bone": np.array([True, True])}
    (skin,) = _skins(nodes, read)
    assert skin.joints.tolist() == [0, 1]
    np.testing.assert_allclose(skin.inverse_binds[:, 1, 3], [-1.0, -2.0])
