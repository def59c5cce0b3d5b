"""A motion refuses what no recording is."""

from dataclasses import replace

import pytest
from bodies import person, swaying

from distretarget.errors import MotionError
from distretarget.motion import is_frame_time

MOTION = swaying(person(), frames=3)


@pytest.mark.parametrize("text", ["0.01", ".0083333", "1e-5", "1000", "+2.", "1E1"])
def test_times_between_frames(text):
    assert is_frame_time(text)
    assert replace(MOTION, frame_time_text=text).frame_time == float(text)


@pytest.mark.parametrize(
    "text", ["", "0", "-1", "1e-9", "5e-324", "1e308", "1001", "nan", "inf", "1_0", " 1", "1e", "0.01\n1 2 3", "\u0661"]
)
def test_what_is_no_time_between_frames(text):
    assert not is_frame_time(text)
    with pytest.raises(MotionError, match="expected a number of seconds from 1e-05 to 1000"):
        replace(MOTION, frame_time_text=text)
