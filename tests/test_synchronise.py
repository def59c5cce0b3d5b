"""Clips that belong together get the same frames."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import person, swaying

from distretarget import MotionError
from distretarget.synchronise import aligned, started


def swayed():
    return swaying(person(), frames=21)


def test_nothing_is_changed_that_need_not_be():
    motion = swayed()
    (same,) = aligned([started(motion, 0.0)], cut=False, resample=True)
    assert same is motion


def test_starts_and_cuts_leave_the_common_frames():
    motion = swayed()
    late, early = aligned([started(motion, 5 * motion.frame_time), motion], cut=True, resample=False)
    assert len(late) == len(early) == 16
    np.testing.assert_array_equal(late.positions, motion.positions[5:])
    np.testing.assert_array_equal(early.positions, motion.positions[:16])


def test_resampled_frames_lie_on_the_motion():
    motion = swayed()
    half = motion.resampled(str(motion.frame_time / 2))
    assert len(half) == 41
    np.testing.assert_allclose(half.positions[::2], motion.positions, atol=1e-9)
    between = (motion.positions[:-1] + motion.positions[1:]) / 2
    assert np.abs(half.positions[1::2] - between).max() < 0.01
    back = half.resampled(motion.frame_time_text)
    np.testing.assert_allclose(back.positions, motion.positions, atol=1e-9)


def test_a_start_after_the_end_is_refused():
    with pytest.raises(MotionError, match=r"lasts 2\.1 s; start before that"):
        started(replace(swayed(), frame_time_text="0.1"), 5.0)
