"""Vectors, least rotations, Cholesky factors, and how near joints come: against numpy, scipy and known answers."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from distretarget.ik.curvature import factorise, solve_factored
from distretarget.numerics.joint_pairs import least_distances
from distretarget.numerics.quaternions import least_rotation
from distretarget.numerics.rotations import best_rotation, least, least_matrix
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


@pytest.mark.parametrize("zeros", [[], [(0, 1)], [(0, 1), (0, 2)], [(0, 1), (0, 2), (1, 2)]])
def test_the_factor_solves_what_the_curvature_multiplies(zeros):
    """With blocks of zeros, too."""
    draw = np.random.default_rng(0)
    half = draw.normal(size=(9, 9))
    H = half @ half.T + 30.0 * np.eye(9)
    for p, q in zeros:
        for row, column in ((p, q), (q, p)):
            H[3 * row : 3 * row + 3, 3 * column : 3 * column + 3] = 0.0
    U, active = H.copy(), np.array([0, 2, 3])
    factorise(U, 9)
    factor = np.triu(U, 1) + np.diag(1 / np.diag(U))
    np.testing.assert_allclose(factor.T @ factor, H)
    gradient, d = draw.normal(size=(2, 5, 3))
    solve_factored(U, active, gradient, d, np.empty(9))
    np.testing.assert_allclose(H @ d[active].ravel(), gradient[active].ravel())
    np.testing.assert_array_equal(d[[1, 4]], 0)


ONE, OTHER = np.array([0]), np.array([1])
TAU = np.array([2.0])


def distances_of(x, shots=None, y=0.0):
    """D and the least D, (frames,) each, of a point in the origin and one at x, (frames,), and y."""
    points = np.zeros((len(x), 2, 3))
    points[:, 1, 0], points[:, 1, 1] = x, y
    shots = np.zeros(len(x), np.intp) if shots is None else np.array(shots, np.intp)
    D, least = least_distances(points, points, ONE, OTHER, TAU, shots)
    return D[:, 0], least[:, 0]


def test_what_passes_between_two_frames_is_as_near_as_it_comes():
    D, least = distances_of(np.array([-0.5, -0.3, -0.1, 0.1, 0.3, 0.5]), y=0.04)
    np.testing.assert_allclose(D, np.hypot([0.5, 0.3, 0.1, 0.1, 0.3, 0.5], 0.04) / 2)
    np.testing.assert_allclose(least, np.hypot([0.4, 0.2, 0.0, 0.0, 0.2, 0.4], 0.04) / 2)


def test_it_is_the_distance_of_the_frame_where_nothing_comes_nearer():
    D, least = distances_of(np.array([0.3, 0.2, 0.2, 0.2, 0.4]))
    np.testing.assert_allclose(least[1:4], D[1:4])


@pytest.mark.parametrize(("usual", "spike"), [(0.9, 0.0), (0.1, 0.9)])
def test_a_single_frame_that_jumps_counts_for_nothing_and_several_do(usual, spike):
    x = np.full(9, 2 * usual)
    x[4] = 2 * spike
    np.testing.assert_allclose(distances_of(x)[1], usual)
    x[3:6] = 2 * spike
    assert distances_of(x)[1][4] == pytest.approx(spike)


def test_nothing_passes_across_a_cut():
    x, shots = np.array([-0.4, -0.4, -0.2, 0.2, 0.4]), [0, 0, 0, 1, 1]
    assert distances_of(x)[1][2] == distances_of(x)[1][3] == 0.0
    np.testing.assert_allclose(distances_of(x, shots)[1][2:4], 0.1)


def test_a_motion_comes_as_near_at_any_frame_rate():
    """Two swings a second past a point, at 240, 120, 60 and 30 frames a second."""
    for late in (0.0, 0.003, 0.011):
        nearest = []
        for rate in (240, 120, 60, 30):
            t = np.arange(rate) / rate + late
            nearest.append(distances_of(np.cos(4 * np.pi * t), y=0.05)[1].min())
        np.testing.assert_allclose(nearest, 0.025, atol=0.003)
