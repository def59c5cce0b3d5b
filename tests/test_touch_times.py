"""When touches begin and end: known answers on rows of frames."""

import numpy as np
import pytest
from bodies import HERO, SAMPLES

from distretarget import Builds, load_build, load_target, read_bvh, retarget
from distretarget.measure.touches import AROUND, around, off_times

TIMES = np.arange(100) / 100.0  # [s]


def flags(*spans):
    return np.array([any(first <= frame < end for first, end in spans) for frame in range(len(TIMES))])


@pytest.mark.parametrize(
    ("result", "begin", "end"),
    [
        ([(30, 60)], 0, 0),
        ([(35, 60)], 50, 0),  # late
        ([(25, 70)], 50, 100),  # early, and too long
        ([(30, 40), (50, 60)], 0, 0),  # a gap between is no begin
        ([(40, 50)], 100, 100),
    ],
)
def test_begins_and_ends_are_off_by_what_is_known(result, begin, end):
    off, counts = off_times(TIMES, flags((30, 60)), flags(*result))
    np.testing.assert_array_equal(np.flatnonzero(counts), [30, 59])
    np.testing.assert_allclose(off[[30, 59]], [begin, end], atol=1e-9)


def test_a_touch_that_is_never_kept_has_no_time():
    off, counts = off_times(TIMES, flags((30, 60)), flags((70, 80)))
    assert not counts.any()
    assert not off.any()


def test_what_happens_beyond_the_clip_is_not_known():
    _, counts = off_times(TIMES, flags((0, 20), (90, 100)), flags((0, 20), (90, 100)))
    np.testing.assert_array_equal(np.flatnonzero(counts), [19, 90])


def test_frames_around_a_touch_are_those_that_are_near_in_time():
    near = around(TIMES, flags((50, 60))[:, None])
    np.testing.assert_array_equal(np.flatnonzero(near[:, 0])[[0, -1]], [50 - 100 * AROUND, 59 + 100 * AROUND])


def test_touches_on_the_same_body_begin_and_end_as_in_the_source():
    hero, file = load_target(HERO), load_build(HERO)
    motion = retarget(read_bvh(SAMPLES / "clap.bvh")[40:160], hero).motion
    metrics = retarget(motion, hero, builds=Builds(source=file)).metrics["rotation_copy"]
    assert metrics["touch_missed"] == 0.0
    assert metrics["touch_time"] < 10.0  # of frames of 16.7 ms; where hands nearly touch, rounding decides
