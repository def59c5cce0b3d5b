"""The verdict: what it says of known metrics, and that it claims nothing that was not measured."""

import numpy as np
import pytest

from distretarget.measure.metrics import METRICS, Track
from distretarget.measure.verdict import verdict

NOTHING = {metric.key: None for metric in METRICS}
TRACKS = {
    "direction_error": Track(np.array([[1.0, 2.0], [12.4, 0.0]]), parts=("Neck", "LeftArm")),
    "hips_height": Track(np.array([[0.1, 0.2], [0.1, 7.0]])),
}
GOOD = {"contact_error": 0.01, "foot_skate": 0.001, "hips_height_largest": 0.57}


def said(result, copy=None, source=None, tracks=TRACKS):
    metrics = {"result": NOTHING | result, "rotation_copy": NOTHING | (copy or {}), "source": source or {}}
    return verdict(metrics, {"source": {}, "rotation_copy": {}, "result": tracks})


def test_a_good_run():
    assert said(GOOD, {"contact_error": 0.041}, {"foot_skate": 0.001}) == (
        "Contacts kept 4.1 times better than by copied rotations; feet do not skate; hips height kept within "
        "0.6 % of a leg; largest direction error: Neck, 12 degrees at frame 1."
    )


@pytest.mark.parametrize(
    ("result", "copy", "words"),
    [
        (None, None, "The source has no self-contacts;"),
        (0.01, 0.0105, "Contacts kept as well as by copied rotations;"),
        (0.0005, 0.001, "Contacts kept as well as by copied rotations;"),
        (0.03, 0.01, "Contacts kept worse than by copied rotations;"),
        (0.0, 0.05, "Contacts kept more than 100 times better than by copied rotations;"),
    ],
)
def test_contacts(result, copy, words):
    assert said(GOOD | {"contact_error": result}, {"contact_error": copy}).startswith(words)


@pytest.mark.parametrize(
    ("result", "source", "words"),
    [
        (None, None, "no foot is planted in the source"),
        (0.1, 0.1, "feet skate no more than in the source"),
        (0.2, 0.1, "feet skate more than in the source"),
    ],
)
def test_feet(result, source, words):
    assert f"; {words};" in said(GOOD | {"foot_skate": result}, source={"foot_skate": source})


@pytest.mark.parametrize(("error", "words"), [(9.14, "9.1"), (12.4, "12"), (99.6, "100"), (104.3, "104")])
def test_degrees_are_plain_numbers(error, words):
    turned = TRACKS | {"direction_error": Track(np.array([[error]]), parts=("Neck",))}
    assert f"Neck, {words} degrees at frame 0." in said(GOOD, tracks=turned)


def test_what_rests_less_than_in_the_copy_is_not_praised():
    text = said(GOOD | {"foot_skate": 0.05}, {"foot_skate": 0.02}, {"foot_skate": 0.05})
    assert "; feet skate more than with copied rotations;" in text
    assert text.endswith(" Within limits, but worse than copied rotations: foot skate.")
    supported = {"support_skate": 0.01, "support_height": 0.9}
    text = said(GOOD | supported, {"support_skate": 0.01, "support_height": 0.1}, {"support_skate": 0.01})
    assert "; hands, knees or other supports stay in place less than with copied rotations;" in text


def test_limbs_that_sink_into_the_body_are_named_with_their_frame():
    deep = TRACKS | {"skin_depth": Track(np.array([[0.0, 0.1], [0.0, 2.34]]), parts=("left hand", "right hand"))}
    text = said(GOOD | {"skin_depth": 2.34}, tracks=deep)
    assert "; right hand sinks up to 2.3 % of the height into the body at frame 1; feet" in text
    assert text.endswith(" Check: skin inside.")
    assert "; skin stays outside; feet" in said(GOOD | {"skin_depth": 0.2}, tracks=deep)
    assert "; skin stays outside, within 0.4 % of the height; feet" in said(GOOD | {"skin_depth": 0.4}, tracks=deep)
    assert "skin" not in said(GOOD)


@pytest.mark.parametrize(
    ("gap", "words"),
    [
        (None, "The source has no self-contacts;"),
        (0.02, "Skin touches as in the source, within 0.1 % of the height;"),
        (0.5, "Skin touches as in the source, within 0.5 % of the height;"),
        (0.6, "A hand or forearm misses what it touches by 0.6 % of the height on average;"),
        (1.6, "A hand or forearm misses what it touches by 1.6 % of the height on average;"),
    ],
)
def test_contacts_of_skins(gap, words):
    deep = TRACKS | {"skin_depth": Track(np.zeros((2, 2)), parts=("left hand", "right hand"))}
    assert said(GOOD | {"skin_depth": 0.0, "skin_gap": gap}, tracks=deep).startswith(words)


def test_hips_that_are_off_are_named_with_their_frame_and_are_over_the_limit():
    text = said(GOOD | {"hips_height_largest": 12.2})
    assert "hips height off by up to 12 % of a leg at frame 1" in text
    assert text.endswith(" Check: largest hips height.")
    text = said(GOOD | {"hips_height_largest": 3.2, "hips_height": 3.0})
    assert "hips height off by up to 3 % of a leg at frame 1" in text
    assert text.endswith(" Check: hips height.")
    assert "hips height kept within 7.2 % of a leg" in said(GOOD | {"hips_height_largest": 7.2, "hips_height": 1.0})


def test_nothing_measured_claims_nothing():
    empty = {"direction_error": Track(np.zeros((3, 0))), "hips_height": Track(np.zeros((3, 0)))}
    assert said({}, tracks=empty) == "The source has no self-contacts; no foot is planted in the source."


def test_metrics_over_their_limits_are_named_once():
    text = said(GOOD | {"foot_pitch": 9.0, "pop": 2.0}, {"foot_pitch": 1.0})
    assert text.endswith(". Check: foot pitch, pops.")
