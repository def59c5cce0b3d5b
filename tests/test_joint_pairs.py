"""How near joints come to each other about each frame: known answers for points that pass, jump and are cut."""

import numpy as np
import pytest

from distretarget.numerics.joint_pairs import least_distances

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
