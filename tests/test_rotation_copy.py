"""The root of the rotation copy: its scale, where its path runs, and how long strides may be."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import SIDES, lengthened, matched, person, posed, sample, swaying, tree_of
from scipy.spatial.transform import Rotation
from skeleton_edits import with_offset

from distretarget.baseline.rotation_copy import RootScale, find_root_scale, longest_strides, root_path, rotation_copy


def chain():
    """Three joints in a row, without legs."""
    return tree_of(np.eye(3), "abc")


def test_root_scale_is_the_ratio_of_leg_lengths():
    body = person()
    factors = np.ones(len(body))
    for side in SIDES:
        factors[[body.index(f"{side}Knee"), body.index(f"{side}Ankle")]] = 0.6
        factors[body.index(f"{side}Elbow")] = 3.0
    target = body.with_lengths(body.lengths * factors)
    assert find_root_scale(matched(body, target)) == pytest.approx(0.6)


def test_root_scale_of_bodies_without_legs_is_the_ratio_of_the_longest_paths_that_both_have():
    body = chain()
    assert find_root_scale(matched(body, body.with_offsets(3 * body.offsets))) == pytest.approx(3.0)
    body = chain()
    longer = replace(body, offsets=body.offsets * [[1], [2], [5]])
    assert find_root_scale(matched(body, longer, {"c": None})) == pytest.approx(2.0)
    flat = replace(body, offsets=body.offsets * [[1], [0], [1]])
    assert find_root_scale(matched(body, flat, {"c": None})) == 1.0


def test_feet_that_turn_out_below_thighs_without_length_turn_nothing():
    body = person()
    offsets = body.offsets.copy()
    for side, turn in zip(SIDES, (30, -30), strict=True):
        toe = body.index(f"{side}Toe")
        offsets[toe] = Rotation.from_euler("Y", turn, degrees=True).apply(offsets[toe])
        offsets[body.index(f"{side}Knee")] = 0.0
    matching = matched(swaying(body, angle=0.4), body.with_offsets(offsets))
    assert matching.turnout.all()
    assert np.isfinite(rotation_copy(matching, RootScale.even(1.0)).positions).all()


def test_the_hips_stand_over_the_scaled_place_of_the_sources():
    source = swaying(person(), angle=0.4)
    target = lengthened(person(), {"LeftHip": 1.6, "RightHip": 1.4, "Knee": 0.7, "Chest": 1.3})
    matching, scale = matched(source, target), 0.8
    copy = rotation_copy(matching, RootScale.even(scale))
    moved = replace(copy, root_positions=root_path(copy, matching, RootScale.even(scale)))
    hips = [target.index(f"{side}Hip") for side in SIDES]
    middle = source.positions[:, hips].mean(axis=1)
    np.testing.assert_allclose(moved.positions[:, hips].mean(axis=1), scale * middle, atol=1e-12)
    assert np.abs(copy.positions[:, hips].mean(axis=1) - scale * middle).max() > 1e-3


def test_a_body_without_legs_keeps_the_path_of_the_copy():
    source = swaying(chain())
    matching = matched(source, chain())
    copy = rotation_copy(matching, RootScale.even(2.0))
    np.testing.assert_array_equal(root_path(copy, matching, RootScale.even(2.0)), 2 * source.root_positions)


def test_strides_may_be_somewhat_longer_than_steps_and_far_longer_where_nobody_walks():
    motion = sample("walk")
    assert 1.2 < longest_strides(matched(motion, motion)) < 2.0
    motion = sample("wave")
    assert longest_strides(matched(motion, motion)) > 4.0
    body = swaying(person(), frames=8)
    assert longest_strides(matched(body, body)) == np.inf


def test_feet_that_rest_farther_away_than_legs_reach_show_no_strides():
    """One leg of a broken file is no longer than its foot is high, so that the mean of both is too short."""
    body = person()
    leg = [body.index(joint) for joint in ("LeftKnee", "LeftAnkle")]
    short = with_offset(body, leg, 0.01 * body.offsets[leg])
    body = posed(short, {}, np.tile([0.0, 1.0, 0.0], (10, 1)))
    assert longest_strides(matched(body, body)) == np.inf


@pytest.mark.parametrize("angle", [0.2, 0.4])
def test_strides_may_be_as_long_as_straight_legs_reach_with_the_hips_a_tenth_of_a_leg_lower(angle):
    split = {"LeftHip": np.array([angle, 0, 0]), "RightHip": np.array([-angle, 0, 0])}
    body = posed(person(), split, np.tile([0.0, 1.0, 0.0], (10, 1)))
    expected = np.sqrt(1 - (np.cos(angle) - 0.1) ** 2) / np.sin(angle)
    assert longest_strides(matched(body, body)) == pytest.approx(expected)
