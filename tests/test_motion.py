"""Motions: what they refuse, frames by number, and what notebooks and `help` show."""

import pydoc
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES, person, swaying
from scipy.spatial.transform import Rotation

import distretarget as d
from distretarget import Target, retarget
from distretarget.errors import MotionError
from distretarget.motion import Motion, MovingBones, is_frame_time
from distretarget.numerics.kinematics import joint_positions
from distretarget.stick_figures import likely_up, stick_figures

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


def test_some_frames_are_retargeted_alike_whether_positions_were_asked_for_before():
    asked, not_asked = (swaying(person(), frames=9) for _ in range(2))
    assert asked.positions.shape == (9, len(asked.skeleton), 3)
    results = [retarget(motion[::2], person()).motion.positions for motion in (asked, not_asked)]
    np.testing.assert_array_equal(*results)


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
    expected = joint_positions(body.parents, translations[:, 0], translations, MOTION.world_rotations)
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
    np.testing.assert_allclose(MOTION.rotated_about_origin(turn).positions, expected, atol=1e-12)


def pictures(page):
    """The coordinates of all bones in the pictures of a page, (bones, 2, 2)."""
    root = ET.fromstring(f"<page>{page}</page>")
    lines = [line for path in root.iter("path") for line in path.attrib["d"].split("M")[1:]]
    return np.array([[list(map(float, end.split())) for end in line.split("L")] for line in lines])


def test_a_motion_a_skeleton_and_a_result_have_pictures():
    clip = d.read_bvh(SAMPLES / "clap.bvh")
    result = d.retarget(clip, d.load_target(SAMPLES / "long_arms.json"))
    bones = len(clip.skeleton) - 1
    assert len(pictures(clip.skeleton._repr_html_())) == bones
    assert len(pictures(clip[:3]._repr_html_())) == 3 * bones
    page = result._repr_html_()
    assert len(pictures(page)) == 7 * bones
    assert result.verdict in page
    assert "contact error" in page
    assert "<svg" not in clip[:0]._repr_html_()


@pytest.mark.parametrize("up", ["Y", "Z", "-Y"])
def test_heads_are_on_top_in_pictures(up):
    parents, posture = np.array([-1, 0]), np.zeros((2, 3))
    posture[1, "XYZ".index(up[-1])] = -1.7 if up[0] == "-" else 1.7
    (foot, head), *_ = pictures(stick_figures(parents, posture[None], likely_up(posture, up), "<a> & b"))
    assert head[1] < foot[1]


def test_one_frame_by_its_number_and_all_in_turn():
    clip = swaying(person(), frames=4)
    np.testing.assert_array_equal(clip[-1].rotations, clip.rotations[3:])
    assert len(clip[np.int64(1)]) == 1
    assert [len(frame) for frame in clip] == [1, 1, 1, 1]
    for wrong in (4, -5, "a"):
        with pytest.raises(IndexError):
            clip[wrong]


@pytest.mark.parametrize("name", d.__all__)
def test_help_shows_no_addresses(name):
    assert " at 0x" not in pydoc.render_doc(getattr(d, name))


def test_settings_show_what_differs_from_the_defaults():
    assert repr(d.Options()) == "Options()"
    assert repr(d.Options(skin="none")) == "Options(skin='none')"
    assert repr(d.ContactSettings(reach=0.1)) == "ContactSettings(reach=0.1)"
