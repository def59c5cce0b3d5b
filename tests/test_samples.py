"""The sample clips: the script makes them, they move as their names say, and what rests in them stands still."""

import re
import subprocess
import sys
from functools import cache

import make_samples
import numpy as np
import pytest
from bodies import SAMPLES, sample, sample_target
from sample_supports import FLOOR, SUPPORTED
from scipy.spatial.transform import Rotation
from table_one import table_one

from distretarget import read_bvh, retarget

CLIPS = sorted([*SAMPLES.glob("*.bvh"), *SAMPLES.glob("supports/*.bvh")])
HEEL = (0.0, -6.5, -5.0)  # from the ankle of a foot that stands [cm]
NUMBER = re.compile(r"-?\d+\.\d+")

clips = pytest.mark.parametrize("path", CLIPS, ids=lambda path: path.stem)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The samples, freshly written."""
    folder = tmp_path_factory.mktemp("made")
    make_samples.write_samples(folder)
    make_samples.write_characters(folder)
    return folder


def written(folder):
    """The clips and props in a folder, by their paths from there."""
    return {path.relative_to(folder) for path in folder.rglob("*") if path.suffix in (".bvh", ".obj")}


def joint(motion, name):
    return motion.positions[:, motion.skeleton.index(name)]


def heading(motion):
    """(frames,), how far the hips have turned to the left since the first frame [degrees]."""
    across = joint(motion, "LeftHip") - joint(motion, "RightHip")
    angle = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    return angle - angle[0]


def test_the_script_makes_these_samples(made):
    """Assert equal words, and equal numbers up to the last decimal, which machines may round differently."""
    assert written(made) == written(SAMPLES)
    for path in written(made):
        text, kept = (made / path).read_text(), (SAMPLES / path).read_text()
        assert NUMBER.sub("#", text) == NUMBER.sub("#", kept)
        numbers, expected = (np.array(NUMBER.findall(words), float) for words in (text, kept))
        np.testing.assert_allclose(numbers, expected, rtol=0, atol=1.01e-6)


def test_the_script_makes_the_same_bytes_in_another_process(made, tmp_path):
    subprocess.run([sys.executable, make_samples.__file__, tmp_path], check=True)
    for path in [*written(made), "hero.glb"]:
        assert (made / path).read_bytes() == (tmp_path / path).read_bytes()


@clips
def test_the_body_is_that_of_table_one(path):
    skeleton, paper = read_bvh(path).skeleton, table_one()
    joints = ~skeleton.end_sites
    lengths = dict(zip(np.array(skeleton.names)[joints], skeleton.lengths[joints], strict=True))
    assert lengths == pytest.approx(dict(zip(paper.names, 100 * paper.lengths, strict=True)))


@clips
def test_no_foot_is_below_the_floor(path):
    motion = read_bvh(path)
    assert motion.positions[..., 1].min() > 0
    for side in ("Left", "Right"):
        ankle = motion.skeleton.index(f"{side}Ankle")
        heel = motion.positions[:, ankle] + Rotation.from_quat(motion.world_rotations[:, ankle]).apply(HEEL)
        assert heel[:, 1].min() > -0.01


def test_claps_turns_and_bodies_are_what_they_are_called():
    motion = sample("clap")
    shoulder, wrist = map(motion.skeleton.index, ("LeftShoulder", "LeftWrist"))
    arm = motion.skeleton.paths_from(shoulder)[wrist]
    gap = np.linalg.norm(joint(motion, "LeftWrist") - joint(motion, "RightWrist"), axis=1)
    assert gap.min() / arm == pytest.approx(0.04, abs=0.002)
    source = sample("turn")
    result = retarget(source, sample_target("child").skeleton).motion
    assert heading(source)[-1] == pytest.approx(360, abs=0.01)
    assert heading(result)[-1] == pytest.approx(360, abs=0.1)
    body = sample("walk").skeleton
    longer = sample_target("long_spine").for_source(body).skeleton
    spine = body.paths_from(0)[body.index("Neck")]
    assert longer.paths_from(0)[longer.index("Neck")] == pytest.approx(1.6 * spine)


LAST_DIGIT = 1e-4  # how far a joint moves at most by the rounding of all angles above it [cm]
ACCELERATION = 12000.0  # largest of a joint, of the toes of a kicking leg [cm/s²]
TURN = 25.0  # largest of a joint from frame to frame [degrees]
JUMP = 90.0  # of an Euler angle from frame to frame; one that jumps changes by 180 or 360 [degrees]
ELBOW, KNEE = 150.0, 160.0  # largest bend [degrees]
FOREARM = 110.0  # largest roll of the forearm to either side [degrees]

samples = pytest.mark.parametrize("name", SUPPORTED)


@cache
def clip(name):
    return sample(f"supports/{name}")


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
