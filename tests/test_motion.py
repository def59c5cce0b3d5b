"""A motion holds what a recording is, and refuses what none is."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import person, swaying
from scipy.spatial.transform import Rotation

from distretarget import Target, retarget
from distretarget.errors import MotionError
from distretarget.motion import Motion, MovingBones, is_frame_time
from distretarget.numerics.kinematics import forward_kinematics

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


def test_rotations_of_few_digits_are_normalised():
    short = replace(MOTION, rotations=MOTION.rotations.astype(np.float32))
    assert np.abs(np.linalg.norm(short.rotations, axis=-1) - 1.0).max() < 1e-15
    assert replace(MOTION, rotations=MOTION.rotations + 0.0).rotations.tobytes() == MOTION.rotations.tobytes()
    again = Motion(MOTION.skeleton, MOTION.root_positions, short.rotations, MOTION.frame_time_text)
    assert retarget(again, Target(MOTION.skeleton, {}, "")).motion.rotations.shape == MOTION.rotations.shape


@pytest.mark.parametrize("rotations", [0.0 * MOTION.rotations, 2.0 * MOTION.rotations, np.nan * MOTION.rotations])
def test_rotations_are_unit_quaternions(rotations):
    with pytest.raises(MotionError, match="the rotation of 'Hips' in frame 0 is not a unit quaternion"):
        replace(MOTION, rotations=rotations)


def test_what_is_no_array_and_no_kind_of_rotation():
    with pytest.raises(MotionError, match="rotations is not an array of numbers"):
        replace(MOTION, rotations=[[1], [2, 3]])
    with pytest.raises(MotionError, match=r"frame_time_text is 0\.01"):
        replace(MOTION, frame_time_text=0.01)
    with pytest.raises(MotionError, match="rotations is 'euler'; expected one of 'quaternion', 'matrix', '6d'"):
        MOTION.to_dict("euler")


@pytest.mark.parametrize("frames", [slice(1, None), slice(None, None, 2), slice(0, 0), np.array([2, 0, 2])], ids=str)
def test_some_frames_of_a_motion_are_where_they_are_in_the_whole(frames):
    whole, some = MOTION.positions, MOTION[frames].positions
    np.testing.assert_array_equal(some, whole[frames])
    assert MOTION[frames].frame_time == MOTION.frame_time


@pytest.mark.parametrize("joints", [[], [0], [3, 2], [2, 2], [[1]], [1.0], "a", [None]], ids=str)
def test_moving_bones_are_those_of_joints_below_the_root_in_order(joints):
    with pytest.raises(MotionError, match="expected numbers of joints from 1, in ascending order"):
        MovingBones(joints, np.zeros((3, np.size(joints), 3)))


def test_only_bones_that_do_not_keep_their_offset_are_held():
    body = MOTION.skeleton
    translations, knee = MOTION.translations, body.index("LeftKnee")
    assert MOTION.moving is None
    translations[1, knee] *= 1.2
    stretched = Motion.of_translations(body, translations, MOTION.rotations, "0.02")
    np.testing.assert_array_equal(stretched.moving.joints, [knee])
    np.testing.assert_array_equal(stretched.translations, translations)
    np.testing.assert_array_equal(stretched.root_positions, MOTION.root_positions)
    for joint in range(len(body)):
        np.testing.assert_array_equal(stretched.translations_of(joint), translations[:, joint])
    np.testing.assert_array_equal(stretched[1:].translations, translations[1:])
    expected = forward_kinematics(body.parents, translations, MOTION.world_rotations)
    np.testing.assert_array_equal(stretched.positions, expected)


def test_bones_that_move_in_other_frames_than_the_motion_has_are_refused():
    bones = MovingBones(np.array([2]), np.zeros((2, 1, 3)))
    with pytest.raises(MotionError, match=r"moving has 2 frames of joints \[2\]; expected 3 frames of joints below 2"):
        replace(MOTION, moving=bones)
    with pytest.raises(MotionError, match="2 frames of root_positions, 3 of rotations"):
        replace(MOTION, root_positions=MOTION.root_positions[1:])


@pytest.mark.parametrize("angles", [40.0, [[10.0], [-70.0], [180.0]]])
def test_all_joints_turn_with_the_world(angles):
    turn = Rotation.from_euler("x", angles, degrees=True)
    expected = np.stack([turn.apply(joint) for joint in MOTION.positions.swapaxes(0, 1)], axis=1)
    np.testing.assert_allclose(MOTION.in_turned_world(turn).positions, expected, atol=1e-12)
