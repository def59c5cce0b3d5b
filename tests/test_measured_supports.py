"""Measuring what rests on the world apart from the feet: where it does, its slide and its height."""

from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, UP, matched, moved, person, posed
from sample_supports import SUPPORTED
from scipy.spatial.transform import Rotation

from distretarget import read_bvh
from distretarget.measure.supports import find_supports

FEET = ("Ankle", "Toe", "Toe_End")


@cache
def source(name):
    folder = SAMPLES / "supports" if name in SUPPORTED else SAMPLES
    return read_bvh(folder / f"{name}.bvh")


def measured(name, result=None):
    motion = source(name)
    return find_supports(motion, matched(motion, motion), UP).in_result(motion if result is None else result)


@pytest.mark.parametrize("name", ["cartwheel", "crawl", "kneel", "push_up"])
def test_the_known_supports_on_the_floor_are_found(name):
    found, keys = measured(name), source(name).skeleton.keys
    columns = dict(zip([keys[joint] for joint in found.joints], found.on_floor.T, strict=True))
    for support in SUPPORTED[name]().supports:
        if support.kind == "floor" and not support.joint.endswith(FEET):
            assert columns[support.joint][support.first : support.last + 1].all(), support


@pytest.mark.parametrize(("name", "side"), [("hand_on_wall", "Right"), ("climb_ladder", "Left")])
def test_hands_that_hold_on_to_something_are_found(name, side):
    found, keys = measured(name), source(name).skeleton.keys
    holding = {keys[joint] for joint, holds in zip(found.joints, found.holds.T, strict=True) if holds.any()}
    assert f"{side}Wrist" in holding
    assert not found.on_floor.any()


@pytest.mark.parametrize("name", ["walk", "squat", "wave", "turn", "clap", "hands_on_hips"])
def test_where_only_feet_rest_nothing_is_measured(name):
    assert measured(name).rest.shape[1] == 0


@pytest.mark.parametrize(("share", "holds"), [(0.0, True), (0.04, True), (0.2, False)])
def test_a_hand_holds_on_to_something_while_the_shoulder_goes_eight_times_as_far(share, holds):
    """A hand that goes a fifth of the shoulder's way, as of someone who sways, stays about there by chance."""
    leg, arm = 0.435 + 0.453, 0.273 + 0.258 + 0.17
    ahead = 0.04 * leg * np.sin(np.linspace(0, 4 * np.pi, 200))
    back = np.outer(np.arcsin((1 - share) * ahead / arm), [0, 1, 0])
    motion = posed(person(), {"LeftShoulder": back}, np.outer(ahead, [0, 0, 1.0]) + UP)
    found = find_supports(motion, matched(motion, motion), UP)
    hands = {motion.skeleton.names[joint] for joint, on in zip(found.joints, found.holds.T, strict=True) if on.any()}
    assert ("LeftWrist_End" in hands) == holds


def test_the_same_motion_slides_as_much_and_is_as_high():
    found = measured("crawl")
    np.testing.assert_array_equal(found.skate, found.skate_source)
    np.testing.assert_array_equal(found.height, 0)


def test_a_raised_and_sliding_result_is_measured_in_leg_lengths():
    motion = source("push_up")
    leg = matched(motion, motion).leg_lengths[0]
    raised = measured("push_up", moved(motion, Rotation.identity(), shift=(0, 0.05 * leg, 0)))
    np.testing.assert_allclose(raised.height, 5.0)
    np.testing.assert_allclose(raised.skate, raised.skate_source, atol=1e-9)


def test_the_body_is_carried_by_others_a_little_longer_than_they_rest():
    found = measured("cartwheel")
    rests, carries = found.rest.any(axis=1), found.carry(source("cartwheel").frame_time)
    assert carries[rests].all()
    assert rests.sum() + 55 <= carries.sum() <= rests.sum() + 61
