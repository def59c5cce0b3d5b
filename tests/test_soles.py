"""How each foot stands flat: by the rest pose, by the motion, or by its usual build."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from bodies import CORPUS, UP, body_of, needs_corpus, posed, with_feet
from table_one import table_one

from distretarget import read_bvh, retarget
from distretarget.body.body import Body
from distretarget.body.reference_pose import FOOT_PITCH
from distretarget.body.soles import find_soles

feet = partial(with_feet, foot=0.12, tip=0.06)


@pytest.mark.parametrize("pitch", [0.0, 0.2, 0.75])
def test_a_foot_stands_flat_as_in_a_rest_pose_in_which_a_person_can_stand(pitch):
    body = body_of(feet(pitch))
    for sole in find_soles(body, body.legs):
        assert sole.known
        np.testing.assert_allclose(sole.normal, UP, atol=1e-12)
        assert sole.ankle == pytest.approx(0.18 * np.sin(pitch))
        np.testing.assert_allclose(sole.heights, np.sin(pitch) * np.array([0.18, 0.06, 0.0]), atol=1e-12)


@pytest.mark.parametrize("pitch", [0.2, 0.75])
def test_a_tip_that_continues_the_foot_with_its_length_into_the_floor_is_made_up(pitch):
    skeleton = feet(pitch)
    offsets = np.array(skeleton.offsets)
    for side in ("Left", "Right"):
        offsets[skeleton.index(f"{side}Toe_End")] = offsets[skeleton.index(f"{side}Toe")]
    body = body_of(skeleton.with_offsets(offsets))
    for sole in find_soles(body, body.legs):
        assert sole.ankle == pytest.approx(0.12 * np.sin(pitch))


def test_a_foot_that_hangs_at_rest_stands_as_it_rests_in_the_motion():
    skeleton = feet(np.pi / 2)
    lifted = {f"{side}Ankle": [-1.2, 0, 0] for side in ("Left", "Right")}
    body = Body.of(skeleton, posed(skeleton, lifted, np.tile([0, 1.0, 0], (30, 1))))
    for sole in find_soles(body, body.legs):
        assert sole.known
        assert sole.ankle == pytest.approx(0.18 * np.sin(np.pi / 2 - 1.2), abs=1e-6)
    body = body_of(feet(np.pi / 2))
    for sole in find_soles(body, body.legs):
        assert not sole.known
        assert sole.ankle == pytest.approx(0.18 * np.sin(FOOT_PITCH))


def test_both_feet_are_as_flat_as_the_flatter_one():
    skeleton = feet(np.pi / 2)
    lifted = {"LeftAnkle": [-1.2, 0, 0], "RightAnkle": [-0.5, 0, 0]}
    body = Body.of(skeleton, posed(skeleton, lifted, np.tile([0, 1.0, 0], (30, 1))))
    left, right = find_soles(body, body.legs)
    assert left.ankle == pytest.approx(right.ankle)


@pytest.mark.parametrize("pitch", [0.0, 0.4])
def test_a_foot_that_hangs_in_the_rest_pose_of_a_target_stands_on_its_sole_in_the_result(pitch):
    """Soles are aligned with soles: a rig whose feet hang in the rest pose does not walk on the tips of its toes."""
    source, target = posed(feet(pitch), {}, np.tile([0, 1.0, 0], (30, 1))), feet(np.pi / 2)
    positions = retarget(source, target).motion.positions
    foot = positions[:, target.index("LeftToe")] - positions[:, target.index("LeftAnkle")]
    np.testing.assert_allclose(foot @ UP, -0.12 * np.sin(FOOT_PITCH), atol=1e-6)


def test_a_leg_without_a_foot_has_a_sole_at_the_ankle():
    body = body_of(table_one())
    legs = tuple(replace(leg, ankle=leg.toe) for leg in body.legs)
    for sole in find_soles(body, legs):
        np.testing.assert_array_equal(sole.heights, [0.0])


@needs_corpus
def test_a_short_bone_straight_down_from_the_ankle_is_no_hanging_foot():
    body = Body.of_motion(read_bvh(CORPUS / "pybvh" / "bvh_test3.bvh"))
    for sole in find_soles(body, body.legs):
        assert sole.known
        np.testing.assert_allclose(sole.normal, UP, atol=1e-9)
        np.testing.assert_allclose(sole.heights[1:], 0.0, atol=1e-9)
