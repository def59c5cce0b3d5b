"""Metrics of feet, of hips over feet and of what else rests, on postures that are known by construction."""

from functools import cache, partial
from types import SimpleNamespace

import bodies
import numpy as np
import pytest
from bodies import ALONG, LEG, PERSON, SAMPLES, UP, lengthened, matched, moved, person, posed, taken, tree_of, with_feet
from sample_supports import SUPPORTED
from scipy.spatial.transform import Rotation

from distretarget import read_bvh
from distretarget.measure.comparison import Reference
from distretarget.measure.metrics import clip_metrics
from distretarget.measure.supports import find_feet, find_supports

TIME = 0.02
OVER_FEET = ("foot_height", "hips_height")
standing = partial(bodies.standing, height=LEG)


def measured(source, result, others_carry=None):
    """What is measured of feet, nan where it does not count."""
    matching, carry = matched(source, result), np.zeros(len(result), bool) if others_carry is None else others_carry
    found, supports = find_feet(source, matching, UP), find_supports(source, matching, UP).in_result(result)
    alone = SimpleNamespace(**vars(supports) | {"carry": lambda _time: carry})
    tracks = found.in_result(result, alone)
    known = {key: np.where(tracks[key].weights > 0, tracks[key].values, np.nan) for key in OVER_FEET}
    known |= {"skate": tracks["foot_skate"].values, "skate_source": found.paths.skate}
    return SimpleNamespace(stance=found.stance, **known)


def metrics(source, result):
    """The metrics of the clip; the bodies have their motions."""
    return clip_metrics(Reference(source, matched(source, result.skeleton), UP).compare(result).tracks)


def high_ankles(angle=30.0):
    """The person with feet that point down by an angle [degrees] in the rest pose, as in shoes with heels."""
    return with_feet(np.radians(angle))


def ankle_over_sole(body):
    return -body.offsets[body.index("LeftToe")][1]


def bent_knees(angle):
    """Turns that lower the hips, with feet and trunk level: by 1 - cos(angle) of a leg."""
    x = np.array([1.0, 0, 0])
    return {
        f"{side}{part}": x * k * angle
        for side in ("Left", "Right")
        for part, k in (("Hip", -1), ("Knee", 2), ("Ankle", -1))
    }


def test_one_frame_far_below_the_floor_leaves_the_feet_of_all_others_in_stance():
    """The lowest heights are those of a few frames in a hundred, not that of the very lowest frame."""
    path = np.where(np.arange(100) == 50, -2.0, 0.0)[:, None] * UP
    source = standing(frames=100, path=path)
    stance = find_feet(source, matched(source, source), UP).stance
    assert stance[:48].all()
    assert stance[53:].all()


def test_hips_are_compared_only_while_the_feet_alone_carry_the_body():
    """Hands, knees or a seat that rest as well ask for another height of the hips than the feet do."""
    source, others_carry = standing(), np.arange(30) < 10
    feet = measured(source, source, others_carry)
    assert np.isnan(feet.hips_height[:10]).all()
    np.testing.assert_allclose(feet.hips_height[10:], 0.0, atol=1e-9)


def test_feet_that_stand_do_not_slide_and_slide_is_the_horizontal_speed_in_leg_lengths():
    rising = np.outer(np.arange(30) * TIME, 0.2 * ALONG + 3.0 * UP)
    feet = measured(standing(), standing(path=rising))
    assert feet.stance.shape == (30, 4)
    assert feet.stance.all()
    np.testing.assert_allclose(feet.skate, np.full((30, 4), 0.2 / LEG))
    np.testing.assert_allclose(feet.skate_source, 0.0)


@pytest.mark.parametrize(("speed", "in_stance"), [(0.3, True), (0.4, False)])
def test_a_foot_faster_than_the_limit_is_not_in_stance(speed, in_stance):
    source = standing(path=np.outer(np.arange(30) * TIME * speed * LEG, ALONG))
    assert np.all(measured(source, standing()).stance == in_stance)
    if not in_stance:
        values = metrics(source, standing())
        assert {values[key] for key in ("foot_skate", *OVER_FEET, "hips_height_largest")} == {None}


def test_a_foot_above_its_lowest_heights_is_not_in_stance():
    lift = np.zeros(200)
    lift[100:160] = 0.07 * LEG
    source = standing(frames=200, path=np.outer(lift, UP))
    feet = measured(source, source)
    assert not feet.stance[101:159].any()
    assert feet.stance[:99].all()
    source = standing(frames=200, path=np.outer(lift * 0.05 / 0.07, UP))
    assert measured(source, source).stance[102:158].all()


def test_heights_are_scaled_by_leg_length_and_in_percent_of_it():
    big = moved(standing(), Rotation.identity(), (0, 0.1, 0), scale=2.0)
    feet = measured(standing(), big)
    np.testing.assert_allclose(feet.foot_height, 100 * 0.1 / (2 * LEG))
    np.testing.assert_allclose(feet.hips_height, 0.0, atol=1e-9)


def test_hips_are_measured_over_the_ankle():
    """A body that crouches with its feet on the floor, and one whose feet float, with its legs as in the source."""
    angle = 0.4
    crouching = standing(height=LEG * np.cos(angle), turns=bent_knees(angle))
    feet = measured(standing(), crouching)
    np.testing.assert_allclose(feet.hips_height, 100 * (1 - np.cos(angle)))
    np.testing.assert_allclose(feet.foot_height, 0.0, atol=1e-6)
    np.testing.assert_allclose(measured(standing(), standing(height=LEG + 0.2)).hips_height, 0.0, atol=1e-9)
    source = standing(turns=bent_knees(np.radians(80)))
    assert np.isnan(measured(source, source).hips_height).all()


def test_wide_hips_that_tilt_on_one_leg_are_measured_by_that_leg():
    """The other leg is kicked up, its foot above its hip joint: that stands on nothing, even in a clip of one frame."""
    tilt = np.array([0.0, 0.0, 0.4])
    turns = {"Hips": tilt, "LeftHip": -tilt, "RightHip": [-2.5, 0.0, 0.0]}
    source, result = (standing(body=body, frames=1, turns=turns) for body in (PERSON, lengthened(PERSON, {"Hip": 2.0})))
    feet = measured(source, result)
    np.testing.assert_array_equal(feet.stance, [[True, True, False, False]])
    np.testing.assert_allclose(feet.hips_height, [[0.0, np.nan]], atol=1e-9)


def test_the_largest_hips_height_is_of_a_frame():
    angles = np.zeros(30)
    angles[7] = 0.4
    turns = {name: np.outer(angles, turn) for name, turn in bent_knees(1.0).items()}
    values = metrics(standing(), standing(path=np.outer(LEG * (np.cos(angles) - 1), UP), turns=turns))
    assert values["hips_height_largest"] == pytest.approx(100 * (1 - np.cos(0.4)))
    assert values["hips_height"] == pytest.approx(100 * (1 - np.cos(0.4)) / 30)


def test_a_sole_in_the_floor_is_an_error_whatever_its_build_and_one_on_it_is_none():
    body = high_ankles()
    feet = measured(standing(), standing(body=body))
    np.testing.assert_allclose(feet.foot_height, 100 * ankle_over_sole(body) / LEG)
    body = high_ankles()
    feet = measured(standing(), standing(body=body, height=LEG + ankle_over_sole(body)))
    for key in OVER_FEET:
        np.testing.assert_allclose(getattr(feet, key), 0.0, atol=1e-9)


def test_the_heel_below_the_ankle_is_part_of_the_sole():
    """With its toes lifted a foot stands on the heel, though no joint is there; toes of another shape make no error."""
    body = high_ankles(20.0)
    offsets = np.array(body.offsets)
    ends = [body.index(f"{side}Toe_End") for side in ("Left", "Right")]
    offsets[ends] = offsets[ends] / np.linalg.norm(offsets[ends], axis=1, keepdims=True) * 0.2
    turns = {f"{side}Ankle": np.radians([-40.0, 0, 0]) for side in ("Left", "Right")}
    feet = measured(standing(body=body, turns=turns), standing(body=body.with_offsets(offsets), turns=turns))
    np.testing.assert_allclose(feet.foot_height, 0.0, atol=1e-9)


def test_feet_that_point_down_in_the_rest_pose_are_flat_as_they_rest():
    """Of such feet the motion shows how they stand: level here, with the ankle as high as in the source."""
    body = high_ankles(90.0)
    level = {f"{side}Ankle": np.radians([-90.0, 0, 0]) for side in ("Left", "Right")}
    on_the_floor = standing(body=body, turns=level)
    feet = measured(on_the_floor, standing())
    for key in OVER_FEET:
        np.testing.assert_allclose(getattr(feet, key), 0.0, atol=1e-6)


def test_without_toes_heights_are_those_of_ankles():
    body = taken(PERSON, [joint for joint, name in enumerate(PERSON.names) if "Toe" not in name])
    feet = measured(standing(), standing(body=body, height=LEG + 0.1))
    np.testing.assert_allclose(feet.foot_height, 100 * 0.1 / LEG)
    np.testing.assert_allclose(feet.hips_height, 0.0, atol=1e-9)


def test_a_body_without_legs_has_no_feet_to_measure():
    motion = posed(tree_of(np.outer([0, 1, 1, 1], UP)), {}, np.zeros((4, 3)))
    feet = measured(motion, motion)
    assert {getattr(feet, key).shape for key in ("stance", "skate", *OVER_FEET)} == {(4, 0)}
    assert feet.stance.dtype == bool
    values = metrics(motion, motion)
    assert {values[key] for key in ("foot_skate", *OVER_FEET, "hips_height_largest")} == {None}
    feet = measured(standing(frames=1), standing(frames=1, height=LEG + 0.1))
    assert feet.stance.all()
    np.testing.assert_allclose(feet.foot_height, 100 * 0.1 / LEG)


FEET = ("Ankle", "Toe", "Toe_End")


@cache
def source(name):
    folder = SAMPLES / "supports" if name in SUPPORTED else SAMPLES
    return read_bvh(folder / f"{name}.bvh")


def found_in(name, result=None):
    motion = source(name)
    return find_supports(motion, matched(motion, motion), UP).in_result(motion if result is None else result)


@pytest.mark.parametrize("name", ["cartwheel", "crawl", "kneel", "push_up"])
def test_the_known_supports_on_the_floor_are_found(name):
    found, keys = found_in(name), source(name).skeleton.keys
    columns = dict(zip([keys[joint] for joint in found.joints], found.on_floor.T, strict=True))
    for support in SUPPORTED[name]().supports:
        if support.kind == "floor" and not support.joint.endswith(FEET):
            assert columns[support.joint][support.first : support.last + 1].all(), support


@pytest.mark.parametrize(("name", "side"), [("hand_on_wall", "Right"), ("climb_ladder", "Left")])
def test_hands_that_hold_on_to_something_are_found(name, side):
    found, keys = found_in(name), source(name).skeleton.keys
    holding = {keys[joint] for joint, holds in zip(found.joints, found.holds.T, strict=True) if holds.any()}
    assert f"{side}Wrist" in holding
    assert not found.on_floor.any()


@pytest.mark.parametrize("name", ["walk", "squat", "wave", "turn", "clap", "hands_on_hips"])
def test_where_only_feet_rest_nothing_is_measured(name):
    assert found_in(name).rest.shape[1] == 0


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


def test_a_raised_and_sliding_result_is_measured_in_leg_lengths():
    motion = source("push_up")
    leg = matched(motion, motion).leg_lengths[0]
    raised = found_in("push_up", moved(motion, Rotation.identity(), shift=(0, 0.05 * leg, 0)))
    np.testing.assert_allclose(raised.height, 5.0)
    np.testing.assert_allclose(raised.skate, found_in("push_up").skate, atol=1e-9)
    motion = source("crawl")
    np.testing.assert_array_equal(found_in("crawl").skate, find_supports(motion, matched(motion, motion), UP).skate)
    np.testing.assert_array_equal(found_in("crawl").height, 0)


def test_the_body_is_carried_by_others_a_little_longer_than_they_rest():
    found = found_in("cartwheel")
    rests, carries = found.rest.any(axis=1), found.carry(source("cartwheel").frame_time)
    assert carries[rests].all()
    assert rests.sum() + 55 <= carries.sum() <= rests.sum() + 61
