"""Faults planted into clean clips are found, each by its name, and clean clips have none."""

from functools import cache

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
