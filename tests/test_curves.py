"""Keys of animations between their times: steps, lines and splines, of places and of rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from distretarget.character.sampling import Curve

TIMES = np.array([1.0, 2.0, 4.0])


def curve(values, interpolation="LINEAR"):
    keys = np.asarray(values, float)
    return Curve(TIMES, keys if keys.ndim == 3 else keys[:, None], interpolation)


def about_z(degrees):
    return Rotation.from_euler("Z", degrees, degrees=True).as_quat()


def test_a_step_holds_a_key_until_the_next():
    steps = curve([[1.0], [2.0], [3.0]], "STEP")
    at = steps.at(np.array([0.0, 1.0, 1.9, 2.0, 3.999, 4.0, 9.0]), rotates=False)
    assert at[:, 0].tolist() == [1.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0]


def test_lines_lead_from_key_to_key_and_the_first_and_last_hold():
    at = curve([[0.0], [1.0], [5.0]]).at(np.array([0.0, 1.25, 2.0, 3.5, 4.0, 7.0]), rotates=False)
    np.testing.assert_allclose(at[:, 0], [0.0, 0.25, 1.0, 4.0, 5.0, 5.0])


def test_rotations_turn_the_shorter_way_evenly():
    opposite = curve([about_z(0), -about_z(90), about_z(150)])
    at = opposite.at(np.array([1.0, 1.5, 2.5, 3.0]), rotates=True)
    angles = Rotation.from_quat(at).as_euler("ZYX", degrees=True)[:, 0]
    np.testing.assert_allclose(angles, [0.0, 45.0, 105.0, 120.0], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(at, axis=1), 1.0)


def test_splines_are_hermites_with_the_tangents_out_and_in():
    """Halfway between p and q, after d seconds: (p + q) / 2 + d (out - in) / 8."""
    keys = [[[9.0], [1.0], [2.0]], [[-3.0], [4.0], [5.0]], [[7.0], [0.0], [9.0]]]
    at = curve(keys, "CUBICSPLINE").at(np.array([1.0, 1.5, 2.0, 3.0]), rotates=False)
    np.testing.assert_allclose(at[:, 0], [1.0, 2.5 + (2.0 + 3.0) / 8, 4.0, 2.0 + 2.0 * (5.0 - 7.0) / 8])


def test_splines_of_rotations_are_unit_quaternions_also_through_zero():
    none = np.zeros(4)
    keys = [[none, about_z(0), none], [none, about_z(90), none], [none, -about_z(90), none]]
    at = curve(keys, "CUBICSPLINE").at(np.array([1.5, 3.0]), rotates=True)
    np.testing.assert_allclose(np.linalg.norm(at, axis=1), 1.0)
    np.testing.assert_allclose(at[0], about_z(45), atol=1e-9)
    np.testing.assert_allclose(at[1], about_z(90), atol=1e-9)  # the spline is zero there


@pytest.mark.parametrize("interpolation", ["STEP", "LINEAR"])
def test_a_single_key_holds_for_ever(interpolation):
    one = Curve(np.array([1.0]), np.array([[[2.0]]]), interpolation)
    assert one.at(np.array([0.0, 1.0, 5.0]), rotates=False)[:, 0].tolist() == [2.0, 2.0, 2.0]
