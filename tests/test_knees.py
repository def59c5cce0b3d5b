"""Knees that the source bends a little backwards: they are straight under feet that rest nearer to the hips."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import LEG, PERSON, UP, body_of, lengthened, matched, posed

from distretarget.baseline.rotation_copy import RootScale
from distretarget.objectives.clip import Clip
from distretarget.objectives.foot_lock import find_foot_lock
from distretarget.objectives.leg_bends import BACKWARDS, with_straight_knees

FRAMES = 40


def in_front(clip):
    """(frames,), how far the left knee is in front of the line from hip to ankle [leg lengths]."""
    hip, knee, ankle = (clip.copy.positions[:, PERSON.index(f"Left{name}")] for name in ("Hip", "Knee", "Ankle"))
    axis = (ankle - hip) / np.linalg.norm(ankle - hip, axis=1, keepdims=True)
    off = knee - hip - ((knee - hip) * axis).sum(axis=1, keepdims=True) * axis
    return off[:, 2] / LEG


def with_bend(bend, raised):
    """The clip of a person whose left knee is bent back by an angle [rad], as copied and with straight knees; the
    left foot's place is raised [leg lengths].
    """
    angles = np.tile([-bend, 0.0, 0.0], (FRAMES, 1))
    standing = posed(PERSON, {"LeftKnee": angles, "LeftAnkle": -angles}, np.tile(LEG * UP, (FRAMES, 1)))
    clip = Clip.of(matched(standing, PERSON), RootScale.even(1.0))
    feet = find_foot_lock(clip)
    places = feet.places.copy()
    places[:, :2] += raised * LEG * UP
    return clip, with_straight_knees(clip, replace(feet, places=places), body_of(PERSON).limbs)


def test_a_knee_is_straight_and_foot_and_hips_stay():
    copied, clip = with_bend(0.1, 0.02)
    assert in_front(copied).max() < -0.02
    np.testing.assert_allclose(in_front(clip), 0.0, atol=1e-3)
    others = [joint for joint, name in enumerate(PERSON.names) if name != "LeftKnee"]
    np.testing.assert_allclose(clip.copy.positions[:, others], copied.copy.positions[:, others], atol=1e-2 * LEG)


@pytest.mark.parametrize(("bend", "raised"), [(0.1, 0.0), (0.1, -0.02), (-0.1, 0.02), (2.0 * BACKWARDS, 0.02)])
def test_knees_stay_under_feet_in_place_and_if_they_bend_forwards_or_far_back(bend, raised):
    copied, clip = with_bend(bend, raised)
    np.testing.assert_allclose(clip.copy.positions, copied.copy.positions, atol=1e-9)


def test_legs_without_shins_stay():
    target = lengthened(PERSON, {"Ankle": 0.0})
    clip = Clip.of(matched(posed(PERSON, {}, np.tile(LEG * UP, (FRAMES, 1))), target), RootScale.even(1.0))
    straight = with_straight_knees(clip, find_foot_lock(clip), body_of(target).limbs)
    np.testing.assert_allclose(straight.copy.positions, clip.copy.positions, atol=1e-9)
