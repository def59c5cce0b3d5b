"""The sample clips with known supports: what rests stands still, nothing is under the floor, limbs bend naturally."""

from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES
from sample_supports import FLOOR, SUPPORTED
from scipy.spatial.transform import Rotation

from distretarget import read_bvh

LAST_DIGIT = 1e-4  # how far a joint moves at most by the rounding of all angles above it [cm]
ACCELERATION = 12000.0  # largest of a joint, of the toes of a kicking leg [cm/s²]
TURN = 25.0  # largest of a joint from frame to frame [degrees]
JUMP = 90.0  # of an Euler angle from frame to frame; one that jumps changes by 180 or 360 [degrees]
ELBOW, KNEE = 150.0, 160.0  # largest bend [degrees]
FOREARM = 110.0  # largest roll of the forearm to either side [degrees]

samples = pytest.mark.parametrize("name", SUPPORTED)


@cache
def clip(name):
    return read_bvh(SAMPLES / "supports" / f"{name}.bvh")


@cache
def supports(name):
    return SUPPORTED[name]().supports


def rotations(motion, joint):
    return Rotation.from_quat(motion.rotations[:, motion.skeleton.index(joint)])


@samples
def test_supports_stand_still(name):
    motion = clip(name)
    for support in supports(name):
        assert 0 <= support.first < support.last < len(motion)
        places = motion.positions[support.first : support.last + 1, motion.skeleton.index(support.joint)]
        assert np.ptp(places, axis=0).max() < LAST_DIGIT, support
        if support.kind == FLOOR:
            assert places[0, 1] < 20, support


@samples
def test_a_support_is_as_long_as_the_joint_rests(name):
    """A joint that stands still for longer would be missing from the table."""
    motion = clip(name)
    for support in supports(name):
        place = motion.positions[:, motion.skeleton.index(support.joint)]
        for inside, outside in ((support.first, support.first - 4), (support.last, support.last + 4)):
            if 0 <= outside < len(motion):
                assert np.abs(place[outside] - place[inside]).max() > LAST_DIGIT, support


@samples
def test_nothing_is_under_the_floor(name):
    assert clip(name).positions[..., 1].min() > 1.0


@samples
def test_motion_is_smooth(name):
    motion = clip(name)
    acceleration = np.diff(motion.positions, 2, axis=0) / motion.frame_time**2
    assert np.linalg.norm(acceleration, axis=-1).max() < ACCELERATION
    for joint in motion.skeleton.names:
        rotation = rotations(motion, joint)
        assert np.degrees((rotation[:-1].inv() * rotation[1:]).magnitude()).max() < TURN, joint


@samples
def test_angles_of_the_file_are_continuous(name):
    numbers = (SAMPLES / "supports" / f"{name}.bvh").read_text().split("Frame Time:")[1].splitlines()[1:]
    channels = np.array([line.split() for line in numbers], float)
    assert np.abs(np.diff(channels[:, 3:], axis=0)).max() < JUMP


@samples
def test_knees_and_elbows_bend_the_natural_way(name):
    motion = clip(name)
    for side, mirror in (("Left", (1, 1, 1, 1)), ("Right", (1, -1, -1, 1))):
        knee = np.degrees(rotations(motion, f"{side}Knee").as_rotvec())
        np.testing.assert_allclose(knee[:, 1:], 0, atol=1e-4)
        assert knee[:, 0].min() > 0
        assert knee[:, 0].max() < KNEE
        elbow = Rotation.from_quat(rotations(motion, f"{side}Elbow").as_quat() * mirror)
        bend, roll, aside = elbow.as_euler("YXZ", degrees=True).T
        np.testing.assert_allclose(aside, 0, atol=1e-4)
        assert -bend.max() > 0
        assert -bend.min() < ELBOW
        assert np.abs(roll).max() < FOREARM


def test_the_cartwheel_goes_over_the_hands():
    """Both hands, then both feet come to the floor, one after the other, and the feet pass above the head."""
    motion, middle = clip("cartwheel"), len(clip("cartwheel")) // 2
    order = ("LeftWrist", "RightWrist", "RightAnkle", "LeftAnkle")
    rests = [[row.first for row in supports("cartwheel") if row.joint == joint] for joint in order]
    touches = [min(rests[0]), min(rests[1]), *(min(first for first in feet if first > middle) for feet in rests[2:])]
    assert touches == sorted(touches)
    head, hips, left, right = (
        motion.positions[middle, motion.skeleton.index(joint), 1]
        for joint in ("Head_End", "Hips", "LeftAnkle", "RightAnkle")
    )
    assert 0 < head < hips < min(left, right)
