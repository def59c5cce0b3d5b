"""The contact objective on whole clips: near joints stay near, others do not change, errors do not spread."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import PERSON, clapping, lengthened, posed, sample, sample_target
from scipy.spatial.transform import Rotation

from distretarget import Options, retarget
from distretarget.baseline.rotation_copy import RootScale, root_path
from distretarget.body.body import Body
from distretarget.ik.spg import Reason
from distretarget.objectives.activation import ContactSettings
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact import solve_contact

WRISTS = PERSON.index("LeftWrist"), PERSON.index("RightWrist")
CLAP = np.sin(np.linspace(0, np.pi, 120)) ** 2


@cache
def target(name):
    return sample_target(name).for_source(sample("walk").rigid_skeleton).skeleton


@cache
def sample_on(name, body):
    return retarget(sample(name), target(body)).motion.positions


def gap(motion):
    """(frames,), D of the wrists."""
    left, right = WRISTS
    distances = np.linalg.norm(motion.positions[:, left] - motion.positions[:, right], axis=1)
    return distances / motion.skeleton.paths_from(left)[right]


def apart(result, expected, skeleton):
    """(frames,), how far joints are from where they are expected [heights of the body]."""
    return np.abs(result - expected).max(axis=(1, 2)) / Body.of(skeleton).height


@pytest.mark.parametrize("factors", [{"Wrist": 1.5}, {"Knee": 0.7, "Hip": 1.4}, {"Chest2": 1.6, "Elbow": 0.6}])
def test_without_near_pairs_and_with_free_feet_it_is_the_rotation_copy(factors):
    source, body = clapping(np.zeros(30)), lengthened(PERSON, factors)
    result = retarget(source, body, Options(supports="free"))
    np.testing.assert_allclose(result.motion.world_rotations, result.rotation_copy.world_rotations, atol=1e-12)
    path = root_path(result.rotation_copy, result.matching, RootScale.even(result.root_scale))
    np.testing.assert_allclose(result.motion.root_positions, path, atol=1e-12)
    np.testing.assert_array_equal(result.effort.iterations, 0)


@pytest.mark.parametrize(
    "factors", [{"Wrist": 1.5}, {"Elbow": 0.7, "Wrist": 1.5}, {"Shoulder": 1.3, "Elbow": 1.3}, {"Collar": 1.2}]
)
def test_hands_that_meet_meet_on_other_arms(factors):
    source = clapping(CLAP)
    result = retarget(source, lengthened(PERSON, factors))
    touch = np.argmax(CLAP)
    assert gap(result.motion)[touch] == pytest.approx(gap(source)[touch], rel=0.3)
    assert gap(result.rotation_copy)[touch] > 2 * gap(source)[touch]
    assert np.all(result.effort.reasons == Reason.CONVERGED)


def test_hands_that_meet_leave_the_legs_alone():
    result = retarget(clapping(CLAP), lengthened(PERSON, {"Wrist": 1.5}), Options(supports="free"))
    turns = np.abs(np.einsum("fji,fji->fj", result.motion.world_rotations, result.rotation_copy.world_rotations))
    angles = np.degrees(2 * np.arccos(np.minimum(turns, 1))).max(axis=0)
    assert angles[[PERSON.index(name) for name in ("LeftHip", "RightHip", "LeftKnee", "Hips")]].max() < 0.5
    assert angles[PERSON.index("LeftElbow")] > 3


def test_the_left_and_the_right_of_a_symmetric_motion_do_the_same():
    positions = retarget(clapping(CLAP), lengthened(PERSON, {"Wrist": 1.5}), Options(skin="none")).motion.positions
    left, right = (
        positions[:, [PERSON.index(side + "Elbow"), wrist]]
        for side, wrist in zip(("Left", "Right"), WRISTS, strict=True)
    )
    np.testing.assert_allclose(left, right * [-1, 1, 1], atol=1e-5)


@pytest.mark.parametrize(
    ("name", "body", "bound", "cut"),
    [
        ("clap", "long_arms", 3e-4, 50),
        ("walk", "child", 3e-4, 50),
        ("squat", "giant", 1e-3, 100),
    ],
)
def test_a_second_after_a_cut_the_result_is_that_of_the_whole_clip(name, body, bound, cut):
    source = sample(name)
    second = round(1 / source.frame_time)
    later = source[cut:]
    after = retarget(later, target(body)).motion.positions
    off = apart(after, sample_on(name, body)[cut:], target(body))
    assert off[second:].max() < bound
    earlier = source[:-cut]
    before = retarget(earlier, target(body)).motion.positions
    off = apart(before, sample_on(name, body)[:-cut], target(body))
    assert off[:-second].max() < bound


def with_a_garbage_frame(source, frame, joints):
    rotations = np.array(source.rotations)
    rotations[frame, joints] = Rotation.random(len(joints), rng=np.random.default_rng(0)).as_quat()
    return replace(source, rotations=rotations)


SPOILT = [("clap", "long_arms"), ("walk", "child"), ("squat", "long_spine")]


@pytest.mark.parametrize("still", [False, True], ids=["joints that turn", "all joints"])
@pytest.mark.parametrize(("name", "body"), SPOILT)
def test_a_garbage_frame_in_the_source_does_not_spread(name, body, still):
    source = sample(name)
    turning = np.ptp(source.rotations, axis=0).max(axis=1) > 1e-6
    joints = np.flatnonzero(~source.skeleton.end_sites if still else turning)
    frame = len(source) // 2
    spoilt = retarget(with_a_garbage_frame(source, frame, joints), target(body)).motion.positions
    off = apart(spoilt, sample_on(name, body), target(body))
    assert off[frame] > 0.1
    off[frame] = 0.0
    assert off.max() < 0.005
    reach = round(2 * ContactSettings().blend / source.frame_time) + 3
    off[frame - reach : frame + reach + 1] = 0.0
    assert off.max() < 2e-4


def test_motions_at_double_frame_rate_are_the_same_motions():
    slow, fast = (clapping(np.sin(np.linspace(0, np.pi, n)) ** 2, str(2 / (n - 1))) for n in (121, 241))
    body = lengthened(PERSON, {"Wrist": 1.5})
    coarse, fine = (retarget(source, body).motion.positions for source in (slow, fast))
    assert apart(fine[::2], coarse, body).max() < 0.01


def test_a_still_pose_with_contacts_is_still():
    source = posed(
        PERSON,
        {"LeftShoulder": [0, -1.9, 0], "RightShoulder": [0, 1.9, 0], "LeftKnee": [0.5, 0, 0]},
        np.tile([0, 0.9, 0], (40, 1)),
    )
    positions = retarget(source, lengthened(PERSON, {"Elbow": 1.3, "Knee": 0.8})).motion.positions
    assert np.ptp(positions, axis=0).max() < 1e-4


def test_a_straight_knee_bends_smoothly_as_its_foot_is_raised_bit_by_bit():
    standing = clapping(np.zeros(60))
    found = retarget(standing, PERSON)
    clip, supports = Clip.of(found.matching, RootScale.even(1.0)), found.supports
    places = supports.places.copy()
    places[:, :2, 1] += np.linspace(0.0, 0.03, 60)[:, None] * clip.leg_lengths[1]  # the left foot's
    v = solve_contact(clip, replace(supports, places=places), ContactSettings()).v
    turns = np.linalg.norm(v, axis=2).max(axis=1)
    assert turns[-1] > 0.1
    assert np.diff(turns).max() < 3 * turns[-1] / 60
