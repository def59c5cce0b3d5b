"""The sample clips: equal to the script's output, and moving as their names say."""

import re
import subprocess
import sys

import make_samples
import numpy as np
import pytest
from bodies import SAMPLES
from scipy.spatial.transform import Rotation
from table_one import table_one

from distretarget import load_target, read_bvh, retarget

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


def test_a_clap_brings_the_wrists_together():
    motion = read_bvh(SAMPLES / "clap.bvh")
    shoulder, wrist = map(motion.skeleton.index, ("LeftShoulder", "LeftWrist"))
    arm = motion.skeleton.paths_from(shoulder)[wrist]
    gap = np.linalg.norm(joint(motion, "LeftWrist") - joint(motion, "RightWrist"), axis=1)
    assert gap.min() / arm == pytest.approx(0.04, abs=0.002)


def test_the_turn_goes_once_round_on_both_bodies():
    source = read_bvh(SAMPLES / "turn.bvh")
    result = retarget(source, load_target(SAMPLES / "child.json").skeleton).motion
    assert heading(source)[-1] == pytest.approx(360, abs=0.01)
    assert heading(result)[-1] == pytest.approx(360, abs=0.1)


def test_the_long_spine_is_60_percent_longer():
    body = read_bvh(SAMPLES / "walk.bvh").skeleton
    longer = load_target(SAMPLES / "long_spine.json").for_source(body).skeleton
    spine = body.paths_from(0)[body.index("Neck")]
    assert longer.paths_from(0)[longer.index("Neck")] == pytest.approx(1.6 * spine)
