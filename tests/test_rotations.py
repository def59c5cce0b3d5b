"""The least rotation between directions: against scipy's alignment, and where directions are opposite or none."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from distretarget.numerics.quaternions import least_rotation
from distretarget.numerics.rotations import best_rotation, least, least_matrix


def test_the_least_rotation_is_that_of_scipy():
    a, b = np.random.default_rng(0).normal(size=(2, 40, 3))
    found = Rotation.from_quat(least_rotation(a, b))
    expected = Rotation.concatenate([Rotation.align_vectors(b[n], a[n])[0] for n in range(len(a))])
    np.testing.assert_allclose((found * expected.inv()).magnitude(), 0, atol=1e-7)


@pytest.mark.parametrize("a", [(0, 0, 2.0), (1.0, -2.0, 0.5), (1.0, 1.0, 1.0), (0, -3.0, 0)])
def test_opposite_directions_are_half_a_turn_apart(a):
    a = np.array([a])
    turn = Rotation.from_quat(least_rotation(a, -2.5 * a))
    np.testing.assert_allclose(turn.magnitude(), np.pi)
    np.testing.assert_allclose(turn.apply(a), -a, atol=1e-12)


def test_a_zero_vector_is_not_turned():
    none, some = np.zeros((1, 3)), np.ones((1, 3))
    for a, b in ((none, some), (some, none), (none, none)):
        np.testing.assert_array_equal(least_rotation(a, b), [[0, 0, 0, 1]])


def test_one_vector_is_fitted_by_the_least_rotation():
    a, b = np.random.default_rng(1).normal(size=(2, 5, 1, 3))
    np.testing.assert_array_equal(best_rotation(a, b), least_rotation(a[:, 0], b[:, 0]))


@pytest.mark.parametrize("vectors", [1, 2, 5])
def test_the_matrix_is_that_of_the_rotation(vectors):
    for a, b in np.random.default_rng(2).normal(size=(10, 2, vectors, 3)):
        np.testing.assert_allclose(least_matrix(a, b), least(a, b).as_matrix(), atol=1e-14)
