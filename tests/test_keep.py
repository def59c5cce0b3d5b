"""Conditions on the metrics of clips: what they may say, what they mean, and what happens to clips that fail them."""

import pytest

from distretarget.batch.results import Condition
from distretarget.errors import SettingsError

CLIP = {
    "frames": 100,
    "warnings": ["one"],
    "metrics": {
        "contact_error": 0.02,
        "pop": 0.0,
        "foot_skate": 0.3,
        "skin_depth": None,
        "contact_error_copy": 0.05,
        "foot_skate_source": 0.2,
    },
}


@pytest.mark.parametrize(
    "text",
    [
        "contact_error < 0.03",
        "contact_error < 0.03 and pop == 0",
        "pops == 0",
        "contact_error < contact_error_copy",
        "not contact_error > 0.03",
        "foot_skate <= foot_skate_source or foot_skate < 1",
        "0.01 < contact_error < 0.03",
        "frames >= 100 and warnings != 0",
        "(pop > 3 or contact_error <= 0.02) and not frames < 1e2",
        "skin_depth < 1",  # not measured
        "not skin_depth < 1",
        "skin_depth < 1 and pop == 0",
    ],
)
def test_a_clip_is_kept_if_its_condition_is_not_false(text):
    assert Condition(text).fault(CLIP) == ""


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("contact_error < 0.01", "contact_error is 0.02, expected contact_error < 0.01"),
        ("contact_error < 0.01 and pop == 0", "contact_error is 0.02, expected contact_error < 0.01"),
        (
            "foot_skate < foot_skate_source and frames > 200",
            "foot_skate is 0.3, foot_skate_source is 0.2, expected foot_skate < foot_skate_source; "
            "frames is 100, expected frames > 200",
        ),
        ("pops > 0 or frames < 1", "pop is 0, frames is 100, expected pops > 0 or frames < 1"),
        ("not pop == 0", "pop is 0, expected not pop == 0"),
        ("skin_depth < 1 and pop > 0", "pop is 0, expected pop > 0"),
    ],
)
def test_the_part_that_fails_is_named_with_its_metrics(text, fault):
    assert Condition(text).fault(CLIP) == fault


@pytest.mark.parametrize(
    "text",
    [
        "",
        "contact_error",
        "contact_error <",
        "contact_error = 1",
        "1 + 1 == 2",
        "__import__('os').system('true') == 0",
        "pop in (1, 2)",
        "pop is 0",
        "pop == 'a'",
        "pop == True",
        "(lambda: 1)() == 1",
        "pop == 0; pop",
        "contact_eror < 1",
        "pop == 0\0",
        "not " * 300 + "pop == 0",
    ],
)
def test_nothing_but_comparisons_of_metrics_is_a_condition(text):
    with pytest.raises(SettingsError, match="keep"):
        Condition(text)


def test_names_that_are_nearly_right_are_suggested():
    with pytest.raises(SettingsError, match="did you mean 'contact_error'"):
        Condition("contact_eror < 1")
