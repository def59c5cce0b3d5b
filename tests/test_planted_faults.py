"""Faults that a person would see, planted in results and in what the solver begins with: figure and verdict tell."""

from dataclasses import replace

import pytest
from bodies import HERO
from planted_in_results import FAULTS, seen, seen_of_solver, stage_of

from distretarget.measure.metrics import BY_KEY

# The figure that is to tell of each; others may, too.
BY = {
    "root 3 % of height lower": "floor",
    "root 2 % of height higher": "floor",
    "a foot's toes 20 degrees up": "foot_pitch",
    "a foot 20 degrees on its edge": "sole_tilt",
    "a foot points 20 degrees aside": "heading",
    "a hand's contact 5 % of height aside": "skin_gap",
    "a contact 5 frames late": "touch_missed",
    "an upper arm 4 % of height in the trunk": "part_depth",
    "a hand 3 % of height in the belly": "skin_depth",
    "a head 30 degrees down": "head_tilt",
    "a pop of an elbow": "pop",
    "jitter of 0.5 degrees while a contact holds": "shaking",
    "left and right exchanged": "direction_error_p99",
    "half the path": "foot_skate",
    "a drift of 0.1 leg lengths a second": "foot_skate",
    "a crouch": "hips_height_largest",
    "palms turned by 90 degrees": "turned",
    "a trunk that leans by 20 degrees": "trunk_tilt",
    "an arm 25 degrees out without need": "needless",
    "legs 10 degrees apart": "splay",
    "legs that pass through each other": "splay",
    "hips that shake": "hips_acceleration",
}
# Those of the solver's start that it does not mend.
OF_SOLVER = {
    "a foot's toes 20 degrees up": "foot_pitch",
    "a foot 20 degrees on its edge": "sole_tilt",
    "a foot points 20 degrees aside": "heading",
    "a head 30 degrees down": "head_tilt",
    "left and right exchanged": "direction_error_p99",
    "a trunk that leans by 20 degrees": "trunk_tilt",
    "an arm 25 degrees out without need": "needless",
}


def test_there_are_twenty_and_each_has_its_figure():
    assert len(FAULTS) >= 20
    assert BY.keys() == FAULTS.keys()


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_seen_and_named_by_the_verdict(name):
    sample, plant = FAULTS[name]
    stage = stage_of(HERO, sample)
    key = BY[name]
    assert key in seen(HERO, FAULTS[name])
    text = replace(stage.result, motion=plant(stage)).verdict
    assert BY_KEY[key].label in text.partition("Check: ")[2]


@pytest.mark.parametrize("name", OF_SOLVER)
def test_a_fault_in_what_the_solver_begins_with_is_seen(name):
    assert OF_SOLVER[name] in seen_of_solver(HERO, FAULTS[name])


@pytest.mark.parametrize("name", FAULTS)
def test_without_the_fault_its_figure_is_within_its_limit(name):
    assert not BY_KEY[BY[name]].over_limit(stage_of(HERO, FAULTS[name][0]).result.metrics)
