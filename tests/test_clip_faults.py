"""Faults planted into clean clips are found, each by its name, and clean clips have none."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES
from planted_faults import PLANTED, faults_of

from distretarget import read_bvh

CLEAN = ("clap", "squat", "turn", "walk", "wave")


@cache
def clean(name):
    return read_bvh(SAMPLES / f"{name}.bvh")


@pytest.mark.parametrize("name", CLEAN)
def test_clean_clips_have_no_faults(name):
    assert faults_of(clean(name)) == {}


@pytest.mark.parametrize("fault", PLANTED)
@pytest.mark.parametrize("name", ["squat", "walk"])
def test_a_planted_fault_is_found(name, fault):
    kind, plant = PLANTED[fault]
    assert kind in faults_of(plant(clean(name)))


@pytest.mark.parametrize("frames", [slice(0), slice(1), slice(2), slice(3), slice(5), np.zeros(50, np.intp)])
def test_short_and_still_clips_have_no_faults_but_that(frames):
    part = clean("walk")[frames]
    still = {"still"} if isinstance(frames, np.ndarray) else set()
    assert faults_of(part).keys() == ({"unreadable"} if len(part) < 2 else still)


def test_a_frame_of_a_fault_is_one_of_the_clip_as_it_is():
    """Frames left out of the search, repeated ones and those before the motion begins, count."""
    planted = PLANTED["an arm that leaps for a frame"][1](clean("walk"))
    assert faults_of(planted)["jumps"].frame in (124, 125)
    late = PLANTED["T-pose in the first five frames"][1](planted[np.repeat(np.arange(len(planted)), 2)])
    found = faults_of(late)
    assert found["first_pose"].value == 5
    assert found["jumps"].frame in range(248, 252)


@pytest.mark.parametrize("milliseconds", ["33.333", "8.3333", "16.667"])
def test_a_frame_time_in_milliseconds_is_a_fault(milliseconds):
    found = faults_of(replace(clean("walk"), frame_time_text=milliseconds))["frame_time"]
    assert found.where == f"{float(milliseconds):.3g} s a frame"
