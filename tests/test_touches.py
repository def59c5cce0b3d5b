"""What touches: hands that pass by and arms that hang touch nothing, and when touches begin, end and are judged."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, person, sample, sample_target
from scipy.spatial.transform import Rotation

from distretarget import Body, Motion
from distretarget.baseline.rotation_copy import RootScale
from distretarget.measure.metrics import BY_KEY, Track, middle_thirds
from distretarget.measure.skin_touches import PASSES_BY, SPEED_SPAN, hanging_parts, passing, relative_speeds
from distretarget.numerics.vectors import normalised
from distretarget.objectives.activation import ContactSettings
from distretarget.objectives.clip import raised_arms
from distretarget.objectives.contact_pairs import ContactSearch
from distretarget.objectives.contact_zones import ContactZones
from distretarget.objectives.skin import how_touching
from distretarget.objectives.sliding import BRUSHES, PARTS_OF, SLIDES, stillness
from distretarget.pipeline.performer import Performer, Transfer, match_performer
from distretarget.skin.capsules import GROUP, SEGMENTS

GAP = BY_KEY["skin_gap"]


@pytest.mark.parametrize(
    ("touch", "judged"), [(1, [0]), (2, [0, 1]), (3, [0, 1, 2]), (4, [1, 2]), (7, [2, 3, 4]), (11, [3, 4, 5, 6, 7])]
)
def test_the_middle_third_of_a_touch_is_judged(touch, judged):
    counts = np.zeros((20, 1), int)
    counts[5 : 5 + touch] = 2
    within = middle_thirds(counts)
    assert np.flatnonzero(within).tolist() == [5 + frame for frame in judged]
    assert within.max() == 2


def test_each_limb_and_each_touch_has_its_own_middle():
    counts = np.array([[1, 0]] * 4 + [[0, 0]] + [[1, 1]] * 4)
    assert (
        middle_thirds(counts).tolist()
        == np.array([[0, 0], [1, 0], [1, 0], [0, 0], [0, 0], [0, 0], [1, 1], [1, 1], [0, 0]]).tolist()
    )


def test_a_clap_that_meets_is_right_however_far_hands_are_apart_before_and_after():
    off = np.array([[5.0], [3.0], [1.0], [0.1], [0.0], [0.1], [1.0], [3.0], [5.0], [9.0]])
    tracks = {"skin_gap": Track(off, off < 9.0, ("left hand",))}
    assert GAP.of_clip(tracks) == pytest.approx((1.0 + 0.1 + 0.0 + 0.1 + 1.0) / 5)
    assert GAP.worst(tracks) == (2, "left hand")
    assert np.isfinite(GAP.over_time(tracks, 10)).tolist() == [False, False, *[True] * 5, False, False, False]
    off = np.array([[5.0], [4.0], [4.0], [4.0], [5.0]])
    assert GAP.of_clip({"skin_gap": Track(off, off > 0)}) == pytest.approx(4.0)


BODY = Body.of(PERSON)
HIPS, HAND = BODY.roles["hips"], BODY.roles["leftHand"]
FRAME_TIME = 1.0 / 60.0
FRAMES = 60


def spinning(angles):
    """The rest pose, turned about the vertical by angles, (frames,) [rad]."""
    rotations = np.tile(PERSON.rest_rotations, (len(angles), 1, 1))
    rotations[:, 0] = Rotation.from_euler("Y", np.asarray(angles)[:, None]).as_quat()
    return Motion(PERSON, np.tile(PERSON.rest_positions[0], (len(angles), 1)), rotations, f"{FRAME_TIME:.9f}")


def test_the_speed_of_a_hand_is_that_as_seen_from_the_part():
    turning, frames = spinning(np.linspace(0, 2.0, FRAMES)), np.arange(10, 50)
    on = np.full(len(frames), HIPS)
    np.testing.assert_allclose(relative_speeds(turning, frames, np.full(len(frames), HAND), on), 0, atol=1e-9)
    as_seen_from_the_hand = relative_speeds(turning, frames, on, np.full(len(frames), HAND))
    np.testing.assert_allclose(as_seen_from_the_hand, 0, atol=1e-9)


def waving(angles):
    """The left arm, raised to the side, turned about the vertical by angles, (frames,) [rad]."""
    motion = spinning(np.zeros(len(angles)))
    rotations = np.array(motion.rotations)
    rotations[:, BODY.roles["leftUpperArm"]] = Rotation.from_euler("Y", np.asarray(angles)[:, None]).as_quat()
    return replace(motion, rotations=rotations)


def test_a_hand_that_comes_back_is_slow_and_one_that_goes_on_as_fast_as_known():
    arm = PERSON.rest_positions[HAND] - PERSON.rest_positions[BODY.roles["leftUpperArm"]]
    radius, rate = np.hypot(arm[0], arm[2]), 3.0  # [rad/s]
    times = (np.arange(FRAMES) - 30) * FRAME_TIME
    one = np.array([30]), np.array([HAND]), np.array([HIPS])
    reach = round(SPEED_SPAN / FRAME_TIME) * FRAME_TIME
    wave = radius * np.sin(rate * reach) / reach
    assert relative_speeds(waving(rate * times), *one)[0] == pytest.approx(wave, rel=1e-6)
    assert relative_speeds(waving(rate * np.abs(times)), *one)[0] == pytest.approx(0.0, abs=1e-9)


def test_touches_pass_by_if_they_are_fast_on_average_while_they_last():
    fast, slow = 1.2 * PASSES_BY / 100.0, 0.5 * PASSES_BY / 100.0
    rows = np.array([0, 1, 2, 5, 6, 0, 1])
    of = np.array([0, 0, 0, 0, 0, 1, 1])
    speed = np.array([fast, slow, slow, fast, fast, slow, slow])
    passes = passing(speed, rows, of, height=1.0)
    np.testing.assert_array_equal(passes, [False, False, False, True, True, False, False])
    np.testing.assert_array_equal(passing(2.0 * speed, rows, of, height=2.0), passes)
    alone = relative_speeds(spinning([0.3]), np.array([0]), np.array([HAND]), np.array([HIPS]))
    np.testing.assert_array_equal(alone, [0.0])


@pytest.fixture(scope="module")
def skin():
    still = Motion(PERSON, PERSON.rest_positions[:1], PERSON.rest_rotations[None], f"{FRAME_TIME:.9f}")
    return match_performer(Transfer(still, sample_target("hero"))).skins.source


ZONES = ContactZones.of(np.array([SEGMENTS.index("left hand")]), np.array([GROUP[SEGMENTS.index("belly")]]))


def stay(skin, motion, cut=None):
    """How far a left hand that is near the trunk all the time stays there, (frames,)."""
    shots = np.zeros(len(motion), int)
    if cut is not None:
        shots[cut:] = 1
    near = how_touching(ZONES, np.zeros((len(motion), 1)))
    return stillness(skin, motion, skin.posed(motion), ZONES, near, shots)[:, 0]


def test_what_turns_with_the_body_stays(skin):
    assert PARTS_OF
    np.testing.assert_allclose(stay(skin, spinning(np.linspace(0.0, 9.0, FRAMES))), 1.0)


@pytest.mark.parametrize(("speed", "expected"), [(0.5 * SLIDES, 1.0), (2.0 * BRUSHES, 0.0)])
def test_a_hand_that_stays_in_the_world_slides_by_as_fast_as_the_trunk_turns(skin, speed, expected):
    """The arm turns back as the trunk turns; the hand is about an arm's length and half the shoulders off its axis."""
    radius = np.linalg.norm(PERSON.rest_positions[HAND] - PERSON.rest_positions[HIPS]) / skin.unit
    turning = spinning(speed / radius * FRAME_TIME * np.arange(FRAMES))
    rotations = np.array(turning.rotations)
    rotations[:, BODY.roles["leftUpperArm"]] = Rotation.from_quat(turning.rotations[:, 0]).inv().as_quat()
    assert stay(skin, replace(turning, rotations=rotations))[FRAMES // 2] == pytest.approx(expected, abs=0.05)


def test_a_cut_is_no_movement(skin):
    jump = np.where(np.arange(FRAMES) < 30, 0.0, 1.0)
    assert stay(skin, waving(jump)).min() < 1.0
    np.testing.assert_array_equal(stay(skin, waving(jump), cut=30), 1.0)


STANDING = Body.of(person())
ROLES = STANDING.anatomy.roles


@pytest.mark.parametrize(("forwards", "expected"), [(0.0, 0.0), (90.0, 1.0)])
def test_a_forearm_beside_the_trunk_is_there_anyway_and_one_before_it_on_purpose(forwards, expected):
    """The elbow is bent by 100 degrees with the hand at the hips, and points aside or forwards."""
    rest = STANDING.skeleton.rest_positions
    line = normalised(rest[ROLES["leftUpperArm"]] - rest[ROLES["hips"]])
    turn = Rotation.from_rotvec(np.radians(-forwards) * line)
    rotations = STANDING.skeleton.rest_rotations[None].copy()
    rotations[0, ROLES["leftUpperArm"]] = (turn * Rotation.from_euler("Z", -60, degrees=True)).as_quat()
    rotations[0, ROLES["leftLowerArm"]] = Rotation.from_euler("Z", -100, degrees=True).as_quat()
    motion = Motion(STANDING.skeleton, rest[:1], rotations, "0.0333333")
    on_purpose = raised_arms(STANDING, motion)[0]
    assert on_purpose[ROLES["leftHand"]] == 1.0
    assert on_purpose[ROLES["leftLowerArm"]] == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize(("seconds", "on_purpose"), [(0.6, False), (2.0, True)])
def test_hanging_hands_are_in_front_on_purpose_for_longer_than_they_swing(seconds, on_purpose):
    """The left arm hangs, and is turned forwards by 35 degrees and to the middle by 20 for some time."""
    frame_time, front = 1.0 / 30.0, np.zeros(90, bool)
    front[20 : 20 + round(seconds / frame_time)] = True
    hangs = Rotation.from_euler("Z", -90, degrees=True)
    before = Rotation.from_euler("YX", [-20, -35], degrees=True) * hangs
    rotations = np.tile(STANDING.skeleton.rest_rotations, (90, 1, 1))
    rotations[:, ROLES["leftUpperArm"]] = np.where(front[:, None], before.as_quat(), hangs.as_quat())
    motion = Motion(
        STANDING.skeleton,
        np.tile(STANDING.skeleton.rest_positions[0], (90, 1)),
        rotations,
        str(frame_time),
    )
    np.testing.assert_allclose(
        raised_arms(STANDING, motion)[:, ROLES["leftHand"]], front if on_purpose else 0.0, atol=0.05
    )
    hanging, _ = hanging_parts(STANDING, motion, STANDING.arms[0])
    np.testing.assert_array_equal(hanging, ~front if on_purpose else True)


def test_joints_of_parts_whose_skins_can_touch_make_no_contact():
    match = match_performer(Transfer(sample("hands_on_hips"), sample_target("hero")))
    clip, skin = Performer.of(match, RootScale.even(1.0)).clip, match.skins.target
    segments = {frozenset(SEGMENTS[n] for n in pair) for pair in skin.balls.pairs.tolist()}
    pairs = ContactSearch.of(clip, ContactSettings()).pairs
    left = {frozenset(SEGMENTS[skin.of_joint[joint]] for joint in pair) for pair in zip(pairs.a, pairs.b, strict=True)}
    assert frozenset(("left hand", "belly")) in segments
    assert left
    assert not left & segments
