"""Solution flips: found by their speed and smoothed, each shot apart; single-frame spikes stay."""

from types import SimpleNamespace

import numpy as np
import pytest

from distretarget.ik.poses import Poses
from distretarget.objectives import contact
from distretarget.objectives.activation import ContactSettings
from distretarget.objectives.contact import smooth_flips, smooth_landings
from distretarget.objectives.supports import no_supports

FRAME_TIME = 1 / 60  # [s]


def course(deviation):
    """Poses of two parts and the root, of which the first follows the given deviations [rad]."""
    v = np.zeros((len(deviation), 3, 3))
    v[:, 0, 1] = deviation
    v[:, 1, 2] = 0.1 * np.sin(np.arange(len(deviation)) / 10)
    v[:, 2, 0] = np.linspace(0, 1, len(deviation))
    return v


def one_shot(v):
    return np.zeros(len(v), np.intp)


def smoothed(v, frame_time=FRAME_TIME, shots=None, held=0.0):
    """The poses with no jump, as a copy; `held` is how firmly all parts are held."""
    smooth = np.array(v)
    smooth_flips(smooth, np.full(v.shape[:2], held), one_shot(v) if shots is None else shots, frame_time)
    return smooth


def test_poses_without_a_jump_are_left_as_they_are():
    v = course(0.5 * np.sin(np.arange(100) / 10))
    np.testing.assert_array_equal(smoothed(v), v)
    v = course(np.zeros(100))
    v[50:, 2] += 5.0
    np.testing.assert_array_equal(smoothed(v), v)
    v = course(np.zeros(100))
    same = np.array(v)
    smooth_landings(same, np.array([0]), one_shot(v), FRAME_TIME)
    np.testing.assert_array_equal(same, v)


def test_a_lasting_jump_becomes_smooth():
    v = course(np.where(np.arange(120) < 60, 0.0, 1.0))
    smooth = smoothed(v)
    steps = np.diff(smooth[:, 0, 1])
    assert np.all(steps >= -1e-12)
    assert steps.max() < 0.2
    np.testing.assert_array_equal(smooth[[0, 40, 80, 119]], v[[0, 40, 80, 119]])
    np.testing.assert_allclose(smooth[:, 0, 1], 1.0 - smooth[::-1, 0, 1], atol=1e-12)  # on both sides alike
    np.testing.assert_allclose(smooth[:, 1:], v[:, 1:])


@pytest.mark.parametrize("frames", [1, 2])
def test_a_spike_stays_alone(frames):
    deviation = np.zeros(100)
    deviation[50 : 50 + frames] = 1.5
    v = course(deviation)
    np.testing.assert_allclose(smoothed(v), v, atol=1e-12)


def test_parts_that_are_held_are_smoothed_where_they_flip_only():
    slow = course(0.1 * np.clip(np.arange(120) - 57, 0, 6))
    assert (smoothed(slow) != slow).any()
    np.testing.assert_array_equal(smoothed(slow, held=1.0), slow)
    flip = course(np.where(np.arange(120) < 60, 0.0, 1.0))
    np.testing.assert_array_equal(smoothed(flip, held=1.0), smoothed(flip))


def test_jumps_are_judged_by_their_speed_not_by_their_frame():
    fast = course(np.linspace(0, 3, 60))
    np.testing.assert_array_equal(smoothed(fast, 1 / 60), fast)
    np.testing.assert_array_equal(smoothed(fast, 1 / 30), fast)
    assert (smoothed(fast, 1 / 240) != fast).any()


def test_what_the_floor_stops_stops_smoothly_and_nothing_else_changes():
    v = course(np.maximum(np.arange(100) - 50.0, 0.0) * 0.02)
    smooth = np.array(v)
    smooth_landings(smooth, np.array([0]), one_shot(v), FRAME_TIME)
    accelerations = [np.abs(np.diff(poses[:, 0, 1], 2)).max() for poses in (v, smooth)]
    assert accelerations[1] < 0.25 * accelerations[0]
    np.testing.assert_allclose(smooth[:40], v[:40], atol=1e-12)
    np.testing.assert_allclose(smooth[60:90], v[60:90], atol=1e-12)
    np.testing.assert_array_equal(smooth[:, 1:], v[:, 1:])


def test_a_cut_is_not_a_flip_and_shots_are_smoothed_apart():
    v = course(np.where(np.arange(120) < 60, 0.0, 1.0))
    v[30:, 0, 1] += 1.0
    shots = (np.arange(120) >= 60).astype(np.intp)
    smooth = smoothed(v, shots=shots)
    np.testing.assert_array_equal(smooth[60:], v[60:])
    np.testing.assert_array_equal(smooth[:60], smoothed(v[:60]))
    assert np.abs(np.diff(smooth[:60, 0, 1])).max() < 0.2
    landed = np.array(v)
    smooth_landings(landed, np.array([0]), shots, FRAME_TIME)
    np.testing.assert_allclose(landed[60:, 0, 1], np.full(60, 2.0), atol=1e-12)


def test_the_solver_smooths_its_flips_and_its_landings(monkeypatch):
    """Both, and each shot apart: what the frames' minima are is not changed otherwise."""
    flip = course(np.where(np.arange(120) < 60, 0.0, 1.0))
    landing = course(np.maximum(np.arange(120) - 90.0, 0.0) * 0.02)
    solved, shots = np.concatenate([flip[:, :2], landing], axis=1), one_shot(flip)
    clip = SimpleNamespace(frame_time=FRAME_TIME, shots=shots, loose_parts=np.array([2]))
    monkeypatch.setattr(contact, "held_parts", lambda *_: np.zeros(solved.shape[:2]))
    monkeypatch.setattr(contact, "solve_in_chunks", lambda *_: Poses(np.array(solved), np.zeros((4, 120))))
    v = contact.solve_contact(clip, no_supports(120), ContactSettings()).v
    expected = np.array(solved)
    smooth_flips(expected, np.zeros(expected.shape[:2]), shots, FRAME_TIME)
    smooth_landings(expected, clip.loose_parts, shots, FRAME_TIME)
    assert (expected != solved).any(axis=(0, 2)).tolist() == [True, False, True, False, False]
    np.testing.assert_array_equal(v, expected)
