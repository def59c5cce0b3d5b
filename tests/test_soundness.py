"""A result is checked before anybody writes it: the first frame that is wrong is named, and no file appears."""

import numpy as np
import pytest
from bodies import SAMPLES, matched, person, swaying
from program import run

from distretarget.baseline.rotation_copy import RootScale
from distretarget.errors import MotionError
from distretarget.motion import Motion
from distretarget.objectives.clip import Clip
from distretarget.pipeline.performer import check_finite, check_places

MOTION = swaying(person(), frames=4)
CLIP = Clip.of(matched(MOTION, MOTION.skeleton), RootScale.even(1.0))
FAR = 4.0 * CLIP.unit


def shifted(joint, frame, way):
    """The motion with one joint elsewhere in one frame."""
    translations = MOTION.translations
    translations[frame, MOTION.skeleton.index(joint)] += way
    return Motion.of_translations(MOTION.skeleton, translations, MOTION.rotations, MOTION.frame_time_text)


def test_a_sound_motion_passes():
    check_finite(MOTION)
    check_places(MOTION, CLIP)


def test_positions_that_are_not_finite_or_too_large():
    with pytest.raises(MotionError, match="frame 1 of the result is wrong: 'Hips' is nowhere"):
        check_finite(shifted("Hips", 1, np.nan))
    with pytest.raises(MotionError, match=r"frame 3 .* 'Hips' is beyond .*; use other units, or a smaller root scale"):
        check_finite(shifted("Hips", 3, 1e13))


@pytest.mark.parametrize(("joint", "heights"), [("Hips", 2), ("LeftAnkle", 3)])
def test_hips_and_feet_that_fly_off(joint, heights):
    with pytest.raises(MotionError, match=f"frame 1 .* '{joint}' is more than {heights} heights away"):
        check_places(shifted(joint, 1, [FAR, 0, 0]), CLIP)


def test_another_number_of_frames():
    with pytest.raises(MotionError, match="the result has 3 frames, the source 4"):
        check_places(MOTION[:3], CLIP)


def test_nothing_is_written_where_the_solver_fails(tmp_path, monkeypatch):

    def solve_wrongly(_body, _clip, _given, _tolerance, v, *_):
        v[:] = np.nan

    monkeypatch.setattr("distretarget.objectives.contact.solve_contact_frames", solve_wrongly)
    done = run(SAMPLES / "clap.bvh", SAMPLES / "long_arms.json", "-o", tmp_path / "out.bvh")
    assert done.returncode == 1
    assert "clap.bvh: " in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
