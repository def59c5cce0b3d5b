"""Causes: said where the run shows them in that frame, and not otherwise."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, person, posed

from distretarget import read_bvh, retarget
from distretarget.measure.metrics import BY_KEY
from distretarget.objectives.supports import no_supports
from distretarget.pipeline.causes import Causes

DOWN = np.array([0.0, 0.0, 1.4])


@cache
def result():
    return retarget(read_bvh(SAMPLES / "clap.bvh"), person())


def causes(**turns):
    """Those of one pose of a person, who is straight but for the turns of joints, in two frames."""
    motion = posed(person(), turns, np.tile([0.0, 0.9, 0.0], (2, 1)))
    run = result()
    return Causes(motion, run.matching, no_supports(2), run.effort)


def with_rest(weights, name="LeftAnkle"):
    """Those of a person with a joint that rests so much in each of two frames."""
    known, joint = causes(), np.array([person().names.index(name)])
    rests = no_supports(2).with_joints(joint, joint, np.array(weights)[:, None], np.zeros((2, 1, 3)))
    return replace(known, supports=rests)


@pytest.mark.parametrize("key", ["foot_skate", "foot_height", "ankle_height", "hips_height_largest"])
def test_a_straight_leg_reaches_no_farther(key):
    straight, bent = causes(), causes(LeftKnee=np.array([0.6, 0.0, 0.0]))
    words = "the left leg is straight and reaches no farther"
    assert straight.of(BY_KEY[key], 0, "LeftAnkle") == words
    assert straight.of(BY_KEY[key], 0, "RightAnkle") == words.replace("left", "right")
    assert bent.of(BY_KEY[key], 0, "LeftAnkle") == ""
    assert bent.of(BY_KEY[key], 0, "RightAnkle") == words.replace("left", "right")


def test_a_straight_arm_reaches_no_farther():
    gap = BY_KEY["skin_gap"]
    assert causes().of(gap, 0, "left hand") == "the left arm is straight and reaches no farther"
    assert causes(LeftElbow=np.array([0.0, 0.9, 0.0])).of(gap, 0, "left hand") == ""
    assert causes().of(BY_KEY["support_height"], 0, "LeftKnee") == ""  # a knee is no end of a leg


def test_a_rest_that_begins_or_ends_in_that_limb_makes_it_pop():
    for key in ("pop", "turn"):
        assert with_rest([0.0, 1.0]).of(BY_KEY[key], 0, "LeftKnee") == "LeftAnkle comes to rest"
        assert with_rest([1.0, 0.0]).of(BY_KEY[key], 1, "LeftKnee") == "LeftAnkle leaves its rest"
        assert with_rest([1.0, 1.0]).of(BY_KEY[key], 1, "LeftKnee") == ""
        assert with_rest([0.0, 1.0]).of(BY_KEY[key], 0, "RightKnee") == ""


def test_a_hand_that_rests_is_held_where_skin_sinks_in():
    depth = BY_KEY["skin_depth"]
    assert with_rest([0.0, 1.0], "LeftWrist").of(depth, 1, "left hand") == "LeftWrist is held where it rests"
    assert with_rest([0.0, 1.0], "LeftWrist").of(depth, 0, "left hand") == ""
    assert with_rest([0.0, 1.0], "LeftWrist").of(depth, 1, "right hand") == ""


def test_alignment_is_blamed_on_rest_poses_alone_in_which_nobody_stands():
    known = causes()
    lying = replace(known.matching, source=replace(known.matching.source))
    assert known.of(BY_KEY["head_tilt"], 0, "Head") == ""
    lying.source.__dict__["stands_at_rest"] = False
    assert replace(known, matching=lying).of(BY_KEY["head_tilt"], 0, "Head") == (
        "nobody can stand in the rest pose of the source"
    )


def test_a_solver_that_stopped_says_after_how_many_steps():
    known = causes()
    assert known.of(BY_KEY["not_converged"], 3, "") == f"the solver stopped after {known.effort.iterations[3]} steps"


def test_of_what_has_no_part_or_no_limb_nothing_is_said():
    assert causes().of(BY_KEY["jerk"], 0, "") == causes().of(BY_KEY["turn"], 0, "Neck") == ""
