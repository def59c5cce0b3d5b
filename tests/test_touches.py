"""Touches: their middle is judged, so that hands which meet a moment early or late are not off."""

import numpy as np
import pytest

from distretarget.measure.metrics import BY_KEY, Track, middles

GAP = BY_KEY["skin_gap"]


@pytest.mark.parametrize(
    ("touch", "judged"), [(1, [0]), (2, [0, 1]), (3, [0, 1, 2]), (4, [1, 2]), (7, [2, 3, 4]), (11, [3, 4, 5, 6, 7])]
)
def test_the_middle_third_of_a_touch_is_judged(touch, judged):
    counts = np.zeros((20, 1), int)
    counts[5 : 5 + touch] = 2
    within = middles(counts)
    assert np.flatnonzero(within).tolist() == [5 + frame for frame in judged]
    assert within.max() == 2


def test_each_limb_and_each_touch_has_its_own_middle():
    counts = np.array([[1, 0]] * 4 + [[0, 0]] + [[1, 1]] * 4)
    assert (
        middles(counts).tolist()
        == np.array([[0, 0], [1, 0], [1, 0], [0, 0], [0, 0], [0, 0], [1, 1], [1, 1], [0, 0]]).tolist()
    )


def test_a_clap_that_meets_is_right_however_far_hands_are_apart_before_and_after():
    off = np.array([[5.0], [3.0], [1.0], [0.1], [0.0], [0.1], [1.0], [3.0], [5.0], [9.0]])
    tracks = {"skin_gap": Track(off, off < 9.0, ("left hand",))}
    assert GAP.of_clip(tracks) == pytest.approx((1.0 + 0.1 + 0.0 + 0.1 + 1.0) / 5)
    assert GAP.worst(tracks) == (2, "left hand")
    assert np.isfinite(GAP.over_time(tracks, 10)).tolist() == [False, False, *[True] * 5, False, False, False]


def test_a_clap_that_does_not_meet_is_off():
    off = np.array([[5.0], [4.0], [4.0], [4.0], [5.0]])
    assert GAP.of_clip({"skin_gap": Track(off, off > 0)}) == pytest.approx(4.0)
