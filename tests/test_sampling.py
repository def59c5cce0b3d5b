"""The frames of animations: at their own keys, whatever the rate and the rounding of their times."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from distretarget.character.animations import own_rate
from distretarget.character.sampling import Curve, sampled
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


@pytest.mark.parametrize("interpolation", ["LINEAR", "STEP", "CUBICSPLINE"])
def test_rotations_between_keys(interpolation):
    ends = Rotation.from_euler("X", [[0], [90]], degrees=True).as_quat()
    ends[1] *= -1.0  # the other sign is the same rotation
    keys = ends[:, None]
    if interpolation == "CUBICSPLINE":
        keys = np.stack([np.zeros((2, 4)), ends * [[1.0], [-1.0]], np.zeros((2, 4))], axis=1)
    found = Curve(np.array([1.0, 2.0]), keys, interpolation).at(np.array([0.0, 1.0, 1.25, 2.0, 3.0]), rotates=True)
    angles = Rotation.from_quat(found).magnitude()
    middle = {"LINEAR": np.pi / 8, "STEP": 0.0, "CUBICSPLINE": None}[interpolation]
    if middle is None:  # Hermite's blend with flat tangents, normalised
        share = 3 * 0.25**2 - 2 * 0.25**3
        blend = (1 - share) * ends[0] - share * ends[1]
        middle = Rotation.from_quat(blend).magnitude()
    assert angles == pytest.approx([0.0, 0.0, middle, np.pi / 2, np.pi / 2], abs=1e-12)


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
