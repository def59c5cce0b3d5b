"""Cuts in a clip, and what is computed between them."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES, lengthened, matched, moved, person, posed, swaying
from scipy.spatial.transform import Rotation

from distretarget import read_bvh, retarget
from distretarget.baseline.rotation_copy import RootScale
from distretarget.numerics.time_series import by_shot, find_shots
from distretarget.objectives.clip import Clip

LENGTH = 0.888


def positions(frames=40):
    return swaying(person(), frames).positions


def shots(x, length=LENGTH, frame_time=1.0):
    return find_shots(x, np.arange(x.shape[1]), length, frame_time)


def test_a_clip_without_a_cut_is_one_shot():
    np.testing.assert_array_equal(shots(positions()), np.zeros(40))
    np.testing.assert_array_equal(shots(np.zeros((1, 3, 3))), [0])


@pytest.mark.parametrize("cut", [1, 2, 17, 39])
def test_a_body_that_jumps_begins_a_shot(cut):
    x = np.array(positions())
    x[cut:] += [0.0, 0.0, 2.0]
    np.testing.assert_array_equal(shots(x), np.arange(40) >= cut)
    np.testing.assert_array_equal(shots(100 * x, 100 * LENGTH), np.arange(40) >= cut)


def test_one_bad_frame_and_small_jumps_are_no_cut():
    x = np.array(positions())
    x[12] += 2.0
    assert shots(x).max() == 0
    still = np.tile(positions()[:1], (40, 1, 1))
    still[20:] += 0.01 * LENGTH / np.sqrt(3)
    assert shots(still).max() == 0


@pytest.mark.parametrize("backwards", [False, True])
def test_frames_that_the_body_leaves_faster_than_anybody_can_are_shots_of_their_own(backwards):
    """A body that rushes to its place within three frames: as seen where a T-pose was put before a motion."""
    x = np.tile(positions()[:1], (40, 1, 1))
    x[:3, :, 2] += np.array([0.9, 0.5, 0.2])[:, None]
    x = x[::-1] if backwards else x
    rushes = np.array([*range(4), *[3] * 36])
    np.testing.assert_array_equal(shots(x, frame_time=0.01), rushes.max() - rushes[::-1] if backwards else rushes)
    assert shots(x).max() == 0


def test_a_body_that_was_too_fast_rushes_until_it_has_slowed_down():
    """Steps of 18, 10 and 4 leg lengths / s: only the first is faster than anybody can be."""
    x = np.tile(positions()[:1], (40, 1, 1))
    x[:3, :, 2] += LENGTH * np.array([0.32, 0.14, 0.04])[:, None]
    np.testing.assert_array_equal(shots(x, frame_time=0.01), [*range(4), *[3] * 36])
    np.testing.assert_array_equal(shots(x[1:], frame_time=0.01), np.zeros(39))


@pytest.mark.parametrize(("jump", "cuts"), [(0.015, 0), (0.03, 1)])
def test_a_still_person_who_jumps_by_a_fiftieth_of_a_leg_begins_a_shot(jump, cuts):
    path = np.where(np.arange(40) < 20, 1.0, 1.0 + jump * LENGTH)[:, None] * [0.0, 1.0, 0.0]
    still = posed(person(), {}, path)
    assert Clip.of(matched(still, person()), RootScale.even(1.0)).shots.max() == cuts


def test_values_are_computed_for_each_shot_on_its_own():
    values = np.array([[1.0], [3.0], [10.0], [20.0], [30.0]])
    means = by_shot(lambda v: np.broadcast_to(v.mean(axis=0), v.shape), np.array([0, 0, 1, 1, 1]), values)
    np.testing.assert_allclose(means[:, 0], [2, 2, 20, 20, 20])


@pytest.mark.parametrize(
    ("first", "second"), [("walk", "squat"), ("clap", "hands_on_hips"), ("supports/push_up", "supports/crawl")]
)
def test_each_shot_is_retargeted_like_a_clip_of_its_own(first, second):
    """Nothing reaches across a cut: neither contacts, foot lock and other supports nor what smooths them."""
    one, other = (read_bvh(SAMPLES / f"{name}.bvh") for name in (first, second))
    target = lengthened(one.rigid_skeleton, {"Toe": 1.5, "Knee": 0.9, "Wrist": 1.2})
    other = moved(other, Rotation.from_euler("Y", 90, degrees=True), shift=(300.0, 0.0, -200.0))
    both = replace(
        one,
        root_positions=np.concatenate([one.root_positions, other.root_positions]),
        rotations=np.concatenate([one.rotations, other.rotations]),
    )
    result = retarget(both, target)
    expected = np.concatenate([retarget(each, target).motion.positions for each in (one, other)])
    assert np.abs(result.motion.positions - expected).max() < 1e-6 * result.matching.target.height
