"""Retargeting whole clips: properties that hold for every motion; and results that are wrong are not written."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES, matched, mirrored, moved, other_lengths, person, swaying
from program import run
from scipy.spatial.transform import Rotation

from distretarget import Motion, Options, retarget
from distretarget.baseline.rotation_copy import RootScale
from distretarget.errors import MotionError
from distretarget.numerics.parallel import BLOCK_FRAMES
from distretarget.objectives.clip import Clip
from distretarget.pipeline.performer import check_finite, check_places

BODY = person()


def size(skeleton):
    return skeleton.longest_path


def test_the_result_turns_and_moves_with_the_source():
    motion, target = swaying(BODY), other_lengths(BODY)
    turn, shift = Rotation.from_euler("y", 123, degrees=True), np.array([4.0, 0, -2])
    result = retarget(motion, target)
    turned = retarget(moved(motion, turn, tuple(shift)), target)
    expected = np.einsum("ij,fpj->fpi", turn.as_matrix(), result.motion.positions) + result.root_scale * shift
    np.testing.assert_allclose(turned.motion.positions, expected, atol=1e-5 * size(target))


def test_a_mirrored_source_gives_the_mirrored_result():
    motion, target = swaying(BODY), other_lengths(BODY)
    result = retarget(motion, target).motion.positions
    flipped = retarget(mirrored(motion), target.with_offsets([-1, 1, 1] * target.offsets)).motion.positions
    np.testing.assert_allclose(flipped, [-1, 1, 1] * result, atol=1e-5 * size(target))


def test_a_full_turn_turns_the_result():
    frames = 60
    still = swaying(BODY, frames=1, angle=0.3)
    turns = Rotation.from_euler("y", np.linspace(0, 360, frames)[:, None], degrees=True)
    rotations = np.repeat(still.rotations, frames, axis=0)
    rotations[:, 0] = (turns * Rotation.from_quat(rotations[:, 0])).as_quat()
    motion = Motion(BODY, np.repeat(still.root_positions, frames, axis=0), rotations, "0.02")
    positions = retarget(motion, other_lengths(BODY)).motion.positions
    hips = positions[:, BODY.index("LeftHip")] - positions[:, BODY.index("RightHip")]
    heading = np.unwrap(np.arctan2(hips[:, 0], hips[:, 2]))
    np.testing.assert_allclose(heading - heading[0], np.radians(np.linspace(0, 360, frames)), atol=1e-4)


def test_joints_with_fewer_channels_are_written_as_far_as_these_go():
    channels = tuple(c[:1] if name == "LeftElbow" else c for name, c in zip(BODY.names, BODY.channels, strict=True))
    target = replace(other_lengths(BODY), channels=channels)
    motion = swaying(BODY)
    written = retarget(motion, target).motion
    elbow = Rotation.from_quat(written.rotations[:, BODY.index("LeftElbow")]).as_rotvec()
    np.testing.assert_allclose(elbow[:, :2], 0, atol=1e-12)
    full = retarget(motion, other_lengths(BODY)).motion
    np.testing.assert_allclose(written.root_positions, full.root_positions, atol=1e-9)
    ankle = BODY.index("RightAnkle")
    np.testing.assert_allclose(written.positions[:, ankle], full.positions[:, ankle], atol=1e-3)


def test_a_given_root_scale_is_used():
    motion = swaying(BODY)
    result = retarget(motion, BODY, Options(root_scale=2.0))
    np.testing.assert_allclose(result.motion.root_positions, 2 * motion.root_positions)


@pytest.mark.parametrize(("objective", "frames"), [("contact", 3000), ("paper", BLOCK_FRAMES + 1)])
def test_progress_counts_every_frame(objective, frames):
    seen = []
    retarget(swaying(BODY, frames), BODY, Options(objective=objective), progress=seen.append)
    assert sum(seen) == frames
    assert len(seen) > 1


def test_motions_that_cannot_be_retargeted_are_refused():
    motion = swaying(BODY)
    with pytest.raises(MotionError, match="no frames"):
        retarget(motion[:0], BODY)
    with pytest.raises(MotionError, match="no bone of the target has a length"):
        retarget(motion, BODY.with_offsets(0 * BODY.offsets))
    with pytest.raises(MotionError, match="no bone of the target has a length"):
        retarget(motion, BODY.with_offsets(1e-15 * BODY.offsets))
    with pytest.raises(MotionError, match="beyond"):
        retarget(moved(motion, Rotation.identity(), (1e150, 0, 0)), BODY)


MOTION = swaying(person(), frames=4)
CLIP = Clip.of(matched(MOTION, MOTION.skeleton), RootScale.even(1.0))
FAR = 4.0 * CLIP.unit


def shifted(joint, frame, way):
    """The motion with one joint elsewhere in one frame."""
    translations = MOTION.translations
    translations[frame, MOTION.skeleton.index(joint)] += way
    return Motion.of_translations(MOTION.skeleton, translations, MOTION.rotations, MOTION.frame_time_text)


def test_positions_that_are_not_finite_or_too_large():
    with pytest.raises(MotionError, match="frame 1 of the result is wrong: 'Hips' is nowhere"):
        check_finite(shifted("Hips", 1, np.nan))
    with pytest.raises(MotionError, match=r"frame 3 .* 'Hips' is beyond .*; use other units, or a smaller root scale"):
        check_finite(shifted("Hips", 3, 1e13))
    check_finite(MOTION)
    check_places(MOTION, CLIP)
    with pytest.raises(MotionError, match="the result has 3 frames, the source 4"):
        check_places(MOTION[:3], CLIP)


@pytest.mark.parametrize(("joint", "heights"), [("Hips", 2), ("LeftAnkle", 3)])
def test_hips_and_feet_that_fly_off(joint, heights):
    with pytest.raises(MotionError, match=f"frame 1 .* '{joint}' is more than {heights} heights away"):
        check_places(shifted(joint, 1, [FAR, 0, 0]), CLIP)


def test_nothing_is_written_where_the_solver_fails(tmp_path, monkeypatch):

    def solve_wrongly(_body, _clip, _given, _tolerance, v, *_):
        v[:] = np.nan

    monkeypatch.setattr("distretarget.objectives.contact.solve_contact_frames", solve_wrongly)
    done = run(SAMPLES / "clap.bvh", SAMPLES / "long_arms.json", "-o", tmp_path / "out.bvh")
    assert done.returncode == 1
    assert "clap.bvh: " in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
