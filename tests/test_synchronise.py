"""Clips of one scene get the same frames."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import person, swaying

from distretarget import MotionError, diff, read_motion, retarget_scene, write_bvh
from distretarget.scene.scene_file import started, synchronised


def swayed():
    return swaying(person(), frames=21)


def test_nothing_is_changed_that_need_not_be():
    motion = swayed()
    (same,) = synchronised([started(motion, 0.0)], cut=False, resample=True)
    assert same is motion


def test_starts_and_cuts_leave_the_common_frames():
    motion = swayed()
    late, early = synchronised([started(motion, 5 * motion.frame_time), motion], cut=True, resample=False)
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


def slow_and_fast():
    """Two frames 1000 s apart, and two frames 0.00001 s apart."""
    motion = swaying(person(), frames=2)
    return replace(motion, frame_time_text="1000"), replace(motion, frame_time_text="0.00001")


def test_clips_are_cut_before_they_are_resampled():
    slow, fast = slow_and_fast()
    assert [len(motion) for motion in synchronised([fast, slow], cut=True, resample=True)] == [2, 2]
    assert len(diff(slow, fast).a) == 2
    with pytest.raises(MotionError, match="clip 2 has 100000001 frames of 1e-05 s, and clip 1 has 2; cut them"):
        synchronised([fast, slow], cut=False, resample=True)


def test_resampling_does_not_make_many_frames_of_few(tmp_path):
    slow, _ = slow_and_fast()
    with pytest.raises(
        MotionError, match=r"1,000,001 frames of 0\.001 s; expected at most 20 for each of its 2 frames"
    ):
        slow.resampled("0.001")
    write_bvh(tmp_path / "slow.bvh", slow)
    with pytest.raises(MotionError, match=r"slow\.bvh: lasts 1000 s"):
        read_motion(tmp_path / "slow.bvh", fps=1000.0)


@pytest.mark.parametrize("frames", [(1, 1), (1, 4), (4, 1), (4, 2)])
def test_a_cut_leaves_the_frames_of_the_shortest_down_to_one(frames):
    motions = [swayed()[:count] for count in frames]
    assert {len(motion) for motion in synchronised(motions, cut=True, resample=True)} == {min(frames)}
    motions = [started(motion, 0.0) for motion in motions]
    assert len(retarget_scene(synchronised(motions, cut=True, resample=False), [person()] * 2).results) == 2
