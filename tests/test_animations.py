"""Animations: their values between keys, and their frames at keys, whatever the rate and the rounding of times."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from distretarget.character.animations import own_rate
from distretarget.character.nodes import Curve, sampled
from distretarget.errors import FileError


def float32(times):
    return np.float32(times).astype(float)


@pytest.mark.parametrize("rate", [10.0, 24.0, 29.97, 30.0, 59.94, 60 / 1.00002, 60.0, 120.0])
@pytest.mark.parametrize(("frames", "start"), [(2, 0.0), (50, 1 / 24), (10_000, 0.0), (10_000, 100.0)])
def test_frames_are_keys(rate, frames, start):
    times = float32(start + np.arange(frames) / rate)
    curve = Curve(times, np.arange(frames, dtype=float)[:, None, None] * [1.0, 0, 0], "LINEAR")
    animation = sampled("a.glb", "walk", {"translation": {5: curve}, "rotation": {}, "scale": {}}, None, 10**6)
    assert animation.frames == frames
    assert animation.translations[5][:, 0] == pytest.approx(np.arange(frames), abs=1e-9)
    assert float(animation.frame_time_text) == pytest.approx(1 / rate, rel=2e-2 / frames + 1e-6)


def test_rates_of_few_keys():
    assert own_rate(np.array([0.0])) == 30.0
    assert own_rate(np.array([0.0, 1.0, 2.0])) == 24.0
    assert own_rate(np.array([0.0, 0.1, 0.3, 0.7])) == pytest.approx(10.0)
    assert own_rate(np.array([0.0, 0.5, 0.7])) == 30.0
    assert own_rate(np.array([0.0, 0.013, 0.5, 0.7])) == 60.0


def test_what_is_too_long_is_refused():
    curve = Curve(np.array([0.0, 1e9]), np.zeros((2, 1, 3)), "LINEAR")
    with pytest.raises(FileError, match="is 1e\\+09 s long; at 100 frames/s that is too much"):
        sampled("a.glb", "walk", {"translation": {0: curve}, "rotation": {}, "scale": {}}, 100.0, 10**6)


def test_frames_far_apart_stay_as_they_are():
    times, places = 1000.0 * np.arange(50), np.arange(150.0).reshape(50, 1, 3)
    curves = {"translation": {0: Curve(times, places, "LINEAR")}, "rotation": {}, "scale": {}}
    found = sampled("a.glb", "walk", curves, None, 10**6)
    assert (found.frames, found.frame_time_text) == (50, "1000")
    np.testing.assert_array_equal(found.translations[0], places[:, 0])


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
