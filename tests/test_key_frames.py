"""Key frames of clips, and values interpolated between them."""

import numpy as np
import pytest

from distretarget.numerics.time_series import KeyFrames

ONE, TWO = np.zeros(50, np.intp), np.repeat([0, 1], [21, 29])


@pytest.mark.parametrize("shots", [ONE, TWO])
@pytest.mark.parametrize("rate", [24.0, 60.0, 120.0])
def test_lines_are_interpolated_exactly_up_to_the_last_key_frame_of_a_shot(shots, rate):
    keys, frames = KeyFrames.of(shots, 1.0 / rate, 30.0), np.arange(50.0)
    line = np.stack([frames, -2.0 * frames], axis=1)
    between = keys.between(line[keys.numbers])
    last = np.array([keys.numbers[shots[keys.numbers] == shot].max() for shot in shots])
    np.testing.assert_allclose(between, np.where((frames <= last)[:, None], line, line[last]), atol=1e-12)


def test_a_clip_of_fewer_frames_has_all_of_them_as_key_frames():
    assert KeyFrames.of(ONE, 1.0 / 24.0, 30.0).are_keys.all()


def test_a_part_of_a_clip_has_the_same_key_frames_and_its_first():
    keys = KeyFrames.of(TWO, 1.0 / 120.0, 30.0)
    part = keys[6:40]
    assert {*part.numbers + 6} == {6, *(n for n in keys.numbers if 6 <= n < 40)}
