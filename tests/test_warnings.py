"""Warnings: metrics above their limits, with frame and cause."""

import numpy as np

from distretarget.measure.metrics import BY_KEY, METRICS, SUFFIXES, Track
from distretarget.measure.verdict import limit_warnings

NOTHING = {metric.key: None for metric in METRICS}


def lines(result, copy=None, source=None, tracks=None):
    metrics = {"result": NOTHING | result, "rotation_copy": NOTHING | (copy or {}), "source": source or {}}
    sides = {side: {} for side in SUFFIXES} | {"result": tracks or {}}
    return list(limit_warnings(metrics, sides))


def test_a_metric_above_its_limit_names_value_frame_and_part_and_the_cause_if_one_was_found():
    tracks = {"foot_pitch": Track(np.array([[1.0, 2.0], [3.0, 17.0]]), parts=("LeftFoot", "RightFoot"))}
    assert lines({"foot_pitch": 5.75}, tracks=tracks) == [
        "foot pitch 5.75 degrees, limit 5; worst in frame 1, RightFoot"
    ]
    assert lines({"foot_pitch": 5.75}, {"foot_pitch": 0.5}, tracks=tracks)[0].startswith(
        "foot pitch 5.75 degrees (0.5 in the rotation copy), limit 5; "
    )

    metrics = {"result": NOTHING | {"foot_pitch": 5.75}, "rotation_copy": NOTHING, "source": {}}
    asked = []

    def cause_of(metric, frame, part):
        asked.append((metric.key, frame, part))
        return "the leg is straight"

    (line,) = limit_warnings(metrics, {"result": tracks}, cause_of)
    assert asked == [("foot_pitch", 1, "RightFoot")]
    assert line.endswith("worst in frame 1, RightFoot; cause: the leg is straight")


def test_only_what_was_measured_can_be_the_worst():
    track = Track(np.array([[np.nan, 2.0], [9.0, 1.0]]), np.array([[False, True], [False, True]]), ("a", "b"))
    assert BY_KEY["foot_pitch"].worst({"foot_pitch": track}) == (0, "b")


def test_limits_of_source_and_copy():
    tracks = {"jerk": Track(np.array([1.0, 5.0, 2.0])), "foot_skate": Track(np.array([[0.0, 0.1]]))}
    assert lines({"jerk": 4.6}, {"jerk": 1.0}, tracks=tracks) == ["jerk 4.6 body sizes/s³, limit 4.5; worst in frame 1"]
    assert lines({"jerk": 4.4}, {"jerk": 1.0}, tracks=tracks) == []
    assert lines({"jerk": 0.015}, {"jerk": 0.0}, tracks=tracks) == []  # a pose that is held still
    (line,) = lines({"foot_skate": 0.2}, {"foot_skate": 0.3}, {"foot_skate": 0.1}, tracks)
    assert line.startswith("foot skate 0.2 leg lengths/s, limit 0.135; worst in frame 0")


def test_metrics_worse_than_the_copy_but_within_their_limits_are_no_warning():
    result = {"foot_height": 0.5, "ankle_height": 2.5, "jerk": 9.0}
    assert lines(result, {"foot_height": 0.1, "ankle_height": 1.0, "jerk": 8.0}) == []


def test_nothing_measured_needs_no_look():
    assert lines({}) == []


def test_every_limit_says_what_it_means_and_what_to_look_for():
    for metric in METRICS:
        if metric.limit:
            assert metric.limit.reason
            assert metric.limit.cause
            assert metric.limit.formula(metric.unit)
    formulas = {metric.key: metric.limit.formula(metric.unit) for metric in METRICS if metric.limit}
    assert formulas["jerk"] == "1.5 times the rotation copy's + 3 body sizes/s³"
    assert formulas["foot_skate"] == "1.15 times the source's + 0.02 leg lengths/s"
    assert formulas["contact_error"] == "the rotation copy's + 0.002"
    assert formulas["not_converged"] == "0"
