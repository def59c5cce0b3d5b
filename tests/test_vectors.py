"""Lengths, directions, products and angles of vectors, against numpy's and exact angles; few of many points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from distretarget.numerics.vectors import angles_between, cross, extent, lengths, level, normalised, spread_out

VECTORS = np.random.default_rng(0).normal(size=(2, 5, 7, 3))


def test_lengths_are_numpys():
    a = VECTORS[0]
    np.testing.assert_allclose(lengths(a), np.linalg.norm(a, axis=-1), rtol=1e-15)
    assert lengths(np.zeros((0, 3))).shape == (0,)


def test_the_extent_is_the_largest_absolute_value():
    assert extent(np.array([[1.0, -3.0], [2.0, 0.5]])) == extent(np.array([3.0, -2.0])) == 3.0
    assert extent(np.zeros((0, 3))) == 0.0
    assert np.isnan(extent(np.array([1.0, np.nan])))
    assert extent(np.array([-np.inf])) == np.inf


def test_a_vector_of_no_length_has_no_direction():
    np.testing.assert_array_equal(normalised(np.array([[0.0, 3, 4], [0, 0, 0]])), [[0, 0.6, 0.8], [0, 0, 0]])


def test_cross_products_are_numpys():
    a, b = VECTORS[..., :3]
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
    np.testing.assert_array_equal(cross(a, b[0, 0]), np.cross(a, b[0, 0]))


def test_the_level_part_lies_across_up():
    up = normalised(np.array([1.0, 2, 2]))
    flat = level(VECTORS[0], up)
    np.testing.assert_allclose(flat @ up, 0, atol=1e-15)
    np.testing.assert_allclose(np.cross(VECTORS[0] - flat, up), 0, atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi / 2, np.pi - 1e-9, np.pi])
def test_angles_between_vectors_of_any_length_are_exact(angle):
    """Also where a cosine would lose them, near 0 and 180 degrees."""
    turned = Rotation.from_rotvec([0, 0, angle]).apply([3.0, 0, 0])
    assert angles_between(np.array([0.2, 0, 0]), turned) == pytest.approx(angle, rel=1e-12)


def test_a_vector_of_no_length_is_at_no_angle():
    assert angles_between(np.zeros(3), VECTORS[0, 0, 0]) == 0


def test_the_ends_of_a_line_come_first_then_its_middle():
    line = np.linspace(0, 1, 101)[:, None]
    assert spread_out(line, 3).tolist() == [0, 100, 50]


def test_few_points_are_all_kept():
    assert sorted(spread_out(np.eye(3), 10).tolist()) == [0, 1, 2]
