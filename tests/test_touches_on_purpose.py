"""Which parts of a body touch on purpose, and which contacts are those of skins."""

import numpy as np
import pytest
from bodies import HERO, SAMPLES, person
from scipy.spatial.transform import Rotation

from distretarget import Body, Motion, load_target, read_bvh
from distretarget.baseline.rotation_copy import RootScale
from distretarget.measure.touches import hanging_parts
from distretarget.numerics.vectors import normalised
from distretarget.objectives.activation import ContactSettings
from distretarget.objectives.clip import raised_arms
from distretarget.objectives.contact_pairs import ContactSearch
from distretarget.pipeline.performer import Transfer, match_performer
from distretarget.skin.capsules import SEGMENTS

BODY = Body.of(person())
ROLES = BODY.anatomy.roles


@pytest.mark.parametrize(("forwards", "expected"), [(0.0, 0.0), (90.0, 1.0)])
def test_a_forearm_beside_the_trunk_is_there_anyway_and_one_before_it_on_purpose(forwards, expected):
    """The elbow is bent by 100 degrees with the hand at the hips, and points aside or forwards."""
    rest = BODY.skeleton.rest_positions
    line = normalised(rest[ROLES["leftUpperArm"]] - rest[ROLES["hips"]])
    turn = Rotation.from_rotvec(np.radians(-forwards) * line)
    rotations = BODY.skeleton.unturned[None].copy()
    rotations[0, ROLES["leftUpperArm"]] = (turn * Rotation.from_euler("Z", -60, degrees=True)).as_quat()
    rotations[0, ROLES["leftLowerArm"]] = Rotation.from_euler("Z", -100, degrees=True).as_quat()
    motion = Motion(BODY.skeleton, rest[:1], rotations, "0.0333333")
    on_purpose = raised_arms(BODY, motion)[0]
    assert on_purpose[ROLES["leftHand"]] == 1.0
    assert on_purpose[ROLES["leftLowerArm"]] == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize(("seconds", "on_purpose"), [(0.6, False), (2.0, True)])
def test_hanging_hands_are_in_front_on_purpose_for_longer_than_they_swing(seconds, on_purpose):
    """The left arm hangs, and is turned forwards by 35 degrees and to the middle by 20 for some time."""
    frame_time, front = 1.0 / 30.0, np.zeros(90, bool)
    front[20 : 20 + round(seconds / frame_time)] = True
    hangs = Rotation.from_euler("Z", -90, degrees=True)
    before = Rotation.from_euler("YX", [-20, -35], degrees=True) * hangs
    rotations = np.tile(BODY.skeleton.unturned, (90, 1, 1))
    rotations[:, ROLES["leftUpperArm"]] = np.where(front[:, None], before.as_quat(), hangs.as_quat())
    motion = Motion(BODY.skeleton, np.tile(BODY.skeleton.rest_positions[0], (90, 1)), rotations, str(frame_time))
    np.testing.assert_allclose(raised_arms(BODY, motion)[:, ROLES["leftHand"]], front if on_purpose else 0.0, atol=0.05)
    hanging, _ = hanging_parts(BODY, motion, BODY.arms[0])
    np.testing.assert_array_equal(hanging, ~front if on_purpose else True)


def test_joints_of_parts_whose_skins_can_touch_make_no_contact():
    match = match_performer(Transfer(read_bvh(SAMPLES / "hands_on_hips.bvh"), load_target(HERO)))
    clip, skin = match.performer(RootScale.even(1.0)).clip, match.skins.target
    segments = {frozenset(SEGMENTS[n] for n in pair) for pair in skin.balls.pairs.tolist()}
    pairs = ContactSearch.of(clip, ContactSettings()).pairs
    left = {frozenset(SEGMENTS[skin.of_joint[joint]] for joint in pair) for pair in zip(pairs.a, pairs.b, strict=True)}
    assert frozenset(("left hand", "belly")) in segments
    assert left
    assert not left & segments
