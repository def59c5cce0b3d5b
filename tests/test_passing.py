"""Hands that only pass by a body touch nothing: for the solver and for the measures, each by its own rule."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import HERO, PERSON
from scipy.spatial.transform import Rotation

from distretarget import Body, Motion, load_target
from distretarget.measure.touches import PASSES_BY, SPEED_SPAN, passing, speeds
from distretarget.objectives.skin import how_touching
from distretarget.objectives.sliding import BRUSHES, PARTS_OF, SLIDES, stays
from distretarget.objectives.spots import Spots
from distretarget.pipeline.performer import Transfer, match_performer
from distretarget.skin.capsules import PLACE, SEGMENTS

BODY = Body.of(PERSON)
HIPS, HAND = BODY.roles["hips"], BODY.roles["leftHand"]
FRAME_TIME = 1.0 / 60.0
FRAMES = 60


def spinning(angles):
    """The rest pose, turned about the vertical by angles, (frames,) [rad]."""
    rotations = np.tile(PERSON.unturned, (len(angles), 1, 1))
    rotations[:, 0] = Rotation.from_euler("Y", np.asarray(angles)[:, None]).as_quat()
    return Motion(PERSON, np.tile(PERSON.rest_positions[0], (len(angles), 1)), rotations, f"{FRAME_TIME:.9f}")


def test_the_speed_of_a_hand_is_that_as_seen_from_the_part():
    turning, frames = spinning(np.linspace(0, 2.0, FRAMES)), np.arange(10, 50)
    on = np.full(len(frames), HIPS)
    np.testing.assert_allclose(speeds(turning, frames, np.full(len(frames), HAND), on), 0, atol=1e-9)
    as_seen_from_the_hand = speeds(turning, frames, on, np.full(len(frames), HAND))
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
    assert speeds(waving(rate * times), *one)[0] == pytest.approx(radius * np.sin(rate * reach) / reach, rel=1e-6)
    assert speeds(waving(rate * np.abs(times)), *one)[0] == pytest.approx(0.0, abs=1e-9)


def test_touches_pass_by_if_they_are_fast_on_average_while_they_last():
    fast, slow = 1.2 * PASSES_BY / 100.0, 0.5 * PASSES_BY / 100.0
    rows = np.array([0, 1, 2, 5, 6, 0, 1])
    of = np.array([0, 0, 0, 0, 0, 1, 1])
    speed = np.array([fast, slow, slow, fast, fast, slow, slow])
    passes = passing(speed, rows, of, height=1.0)
    np.testing.assert_array_equal(passes, [False, False, False, True, True, False, False])
    np.testing.assert_array_equal(passing(2.0 * speed, rows, of, height=2.0), passes)


def test_a_clip_of_one_frame_has_no_speed():
    alone = speeds(spinning([0.3]), np.array([0]), np.array([HAND]), np.array([HIPS]))
    np.testing.assert_array_equal(alone, [0.0])


@pytest.fixture(scope="module")
def skin():
    still = Motion(PERSON, PERSON.rest_positions[:1], PERSON.unturned[None], f"{FRAME_TIME:.9f}")
    return match_performer(Transfer(still, load_target(HERO))).skins.source


SPOTS = Spots.of(np.array([SEGMENTS.index("left hand")]), np.array([PLACE[SEGMENTS.index("belly")]]))


def stay(skin, motion, cut=None):
    """How far a left hand that is near the trunk all the time stays there, (frames,)."""
    shots = np.zeros(len(motion), int)
    if cut is not None:
        shots[cut:] = 1
    near = how_touching(SPOTS, np.zeros((len(motion), 1)))
    return stays(skin, motion, skin.posed(motion), SPOTS, near, shots)[:, 0]


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
