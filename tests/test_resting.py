"""Joints at rest: on the floor, and on anything else that stands still while the body moves."""

import numpy as np
from bodies import UP, body_of, lengthened, person, posed, tree_of
from skeleton_edits import below_root

from distretarget import Motion
from distretarget.body.resting import feet_at_rest, feet_resting, joint_speeds, still_joints
from distretarget.numerics.joint_paths import heights_of, lowest_heights

FRAMES, STEP = 100, 0.02
ONE_SHOT = np.zeros(FRAMES, np.intp)
TIME = np.arange(FRAMES) * STEP
ROOT = np.zeros((FRAMES, 3))


def two_points(base, end):
    """A motion of two joints, given by their paths (frames, 3)."""
    chain = tree_of([[0.0, 0, 0], [0, 1, 0]])
    rotations = np.tile([0.0, 0, 0, 1], (FRAMES, 2, 1))
    return Motion.of_translations(chain, np.stack([base, end - base], axis=1), rotations, str(STEP))


def along(distance):
    return np.outer(distance, [1.0, 0.0, 0.0])


def still(base, end, shots=ONE_SHOT):
    """Whether the end stands still while the base moves, (frames,)."""
    motion, joint, start = two_points(base, end), np.array([1]), np.array([0])
    return still_joints(motion, joint, start, joint_speeds(motion, joint, shots), 1.0, shots)[:, 0]


def test_a_hand_that_stays_while_the_body_moves_stands_still_and_one_that_goes_along_drifts_or_swings_does_not():
    assert still(along(0.5 * TIME), along(0.0 * TIME)).all()
    assert not still(along(0.0 * TIME), along(0.0 * TIME)).any()
    assert not still(along(0.02 * np.sin(TIME)), along(0.0 * TIME)).any()
    assert not still(along(0.09 * TIME), along(0.05 * TIME)).any()
    assert not still(along(1.4 * TIME), along(1.4 * TIME + 0.3 * np.sin(5 * TIME))).any()


def test_only_the_frames_of_the_hold_count():
    hold = (TIME > 0.5) & (TIME < 1.3)
    end = np.where(hold, 0.0, np.where(TIME <= 0.5, TIME - 0.5, TIME - 1.3))
    found = np.flatnonzero(still(along(0.5 * TIME), along(end)))
    assert abs(found[0] - 26) <= 2
    assert abs(found[-1] - 64) <= 2
    assert len(found) == found[-1] - found[0] + 1


def test_a_hold_ends_at_a_cut():
    shots = (np.arange(FRAMES) >= 50).astype(np.intp)
    base = along(np.where(shots, 0.5 * TIME, 0.0))
    found = still(base, along(0.0 * TIME), shots)
    np.testing.assert_array_equal(found, shots == 1)


def test_joints_are_as_fast_as_they_move():
    motion = two_points(along(0.2 * TIME), along(0.3 * TIME))
    speeds = joint_speeds(motion, np.array([1, 0]), ONE_SHOT)
    np.testing.assert_allclose(speeds, np.tile([0.3, 0.2], (FRAMES, 1)))


def test_low_joints_are_near_the_lowest_one():
    motion = posed(person(), {}, np.tile([0.0, 0.9, 0.0], (3, 1)))
    joints = np.arange(len(motion.skeleton))
    low = heights_of(motion.positions, joints, UP) - lowest_heights(motion.positions, UP)[:, None] < 0.1
    keys = {motion.skeleton.keys[joint] for joint in np.flatnonzero(low[0])}
    assert keys == {"LeftAnkle", "RightAnkle", "LeftToe", "RightToe", "LeftToe_End", "RightToe_End"}


def test_feet_rest_however_far_below_them_a_root_on_the_floor_is():
    skeleton = person()
    rooted = below_root(skeleton, "Reference", np.zeros(3), skeleton.channels[0])
    motion = posed(
        rooted.with_offsets(rooted.offsets + [[0.0, float(k == 1), 0.0] for k in range(len(rooted))]), {}, ROOT
    )
    body = body_of(motion)
    heights = motion.positions[0] @ UP
    for leg in body.legs:
        assert heights[leg.toe] - heights[0] > 0.1 * body.leg_length
        assert feet_at_rest(motion, leg, UP, body.leg_length).all()


def test_feet_stay_at_rest_while_long_hands_reach_below_them():
    body = body_of(lengthened(person(), {"Elbow": 3.0, "Wrist": 3.0}))
    lowered = np.outer(np.clip(TIME - 0.5, 0.0, 1.0), [0.0, 0.0, np.pi / 2])
    arms = {"LeftShoulder": -lowered, "RightShoulder": lowered}
    motion = posed(body.skeleton, arms, along(0.1 * TIME))
    leg = body.legs[0]
    assert (heights_of(motion.positions, [leg.toe], UP)[:, 0] - lowest_heights(motion.positions, UP))[-1] > 0.3
    assert (feet_resting(motion, leg, UP, body.leg_length) == 1.0).all()
    assert not (feet_resting(motion[-30:], leg, UP, body.leg_length) == 1.0).any()
