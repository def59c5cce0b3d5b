"""What the FBX reader's process hands over, turned into nodes, skins and weights: each rule with a known answer."""

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.character.nodes import INFLUENCES, Nodes
from distretarget.io.fbx import _inverse, _parts, _skins, influences_of

QUARTER = Rotation.from_euler("Z", 90, degrees=True).as_quat()
STILL = np.array([0.0, 0.0, 0.0, 1.0])


def moved_by(place, turn=STILL, scale=(1.0, 1.0, 1.0)):
    """The ten numbers of a node."""
    return [*place, *turn, *scale]


def parts(transforms, pivots=None, unapplied=None, parents=(-1, 0)):
    read = {
        "parents": np.array(parents),
        "pivots": np.zeros((2, 3)) if pivots is None else np.array(pivots),
        "unapplied": np.zeros((2, 2, 3)) if unapplied is None else np.array(unapplied),
    }
    return _parts("a.fbx", read, np.array(transforms, float), np.arange(2))


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


def test_nodes_are_at_their_pivots():
    """A node turned by 90 degrees about Z brings its pivot (1, 0, 0) to (0, 1, 0); those below start from it."""
    transforms = [moved_by([5.0, 0.0, 0.0], QUARTER), moved_by([0.0, 3.0, 0.0])]
    translations, _, _ = parts(transforms, pivots=[[1.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    np.testing.assert_allclose(translations, [[5.0, 1.0, 0.0], [-1.0, 3.0, 2.0]], atol=1e-12)
    larger = [moved_by([5.0, 0.0, 0.0], QUARTER, (2.0, 1.0, 1.0)), transforms[1]]
    translations, _, scales = parts(larger, pivots=[[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(translations, [[5.0, 2.0, 0.0], [-1.0, 3.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(scales[0], [2.0, 1.0, 1.0])


def test_rotations_that_fbx_does_not_apply_are_taken_away_before_and_after():
    before, own, after = ([90.0, 0.0, 0.0], [0.0, 30.0, 0.0], [0.0, 0.0, 45.0])
    turns = [Rotation.from_euler("xyz", each, degrees=True) for each in (before, own, after)]
    applied = turns[0] * turns[1] * turns[2].inv()
    _, rotations, _ = parts(
        [moved_by([0.0, 0.0, 0.0], applied.as_quat()), moved_by([0.0, 0.0, 0.0], QUARTER)],
        unapplied=[[before, after], np.zeros((2, 3))],
    )
    np.testing.assert_allclose(Rotation.from_quat(rotations[0]).as_matrix(), turns[1].as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rotations[1], QUARTER)
