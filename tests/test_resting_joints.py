"""Joints other than the feet's that rest: which, their places, how they get there, and the root's path meanwhile."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import LEG, PERSON, lengthened, matched, posed

from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.anatomy import Regions
from distretarget.objectives.clip import Clip
from distretarget.objectives.foot_lock import find_foot_lock
from distretarget.objectives.resting_joints import RestingJoints, find_resting_joints, root_shift, with_resting_joints
from distretarget.objectives.supports import no_supports

FRAMES = 120
ONE_SHOT = np.zeros(FRAMES, np.intp)
OFF = np.array([0.3, -0.2, 0.1])
ARM = 0.273 + 0.258 + 0.17


def resting(rests, off=OFF):
    """One joint that belongs `off` from the copy while it rests."""
    places = np.broadcast_to(off, (FRAMES, 1, 3)).copy()
    return RestingJoints(joints=np.array([0]), rests=rests[:, None], places=places)


class Still:
    """A clip in which the copy does not move, of a body with legs of length 1 and one joint in a region."""

    frame_time, leg = 1 / 60, 1.0

    def __init__(self, shots=ONE_SHOT, region="left hand"):
        self.shots = shots
        self.regions = Regions((region,), np.array([0]), np.ones((1, 1), bool))

    def copy_on_path(self, joints):
        return np.zeros((FRAMES, 1, 3))[:, joints]

    def __len__(self):
        return FRAMES


def feet_at_rest(rests):
    feet = no_supports(FRAMES)
    return SimpleNamespace(feet=2, weights=np.repeat(rests[:, None].astype(float), 2, axis=1), joints=feet.joints)


@pytest.mark.parametrize(("region", "share"), [("left hand", 1 / 2), ("hips", 10 / 11)])
def test_feet_at_rest_count_as_in_place_and_a_seat_counts_most(region, share):
    always = np.ones(FRAMES, bool)
    shift = root_shift(Still(region=region), feet_at_rest(always), resting(always))
    np.testing.assert_allclose(shift, [share * OFF] * FRAMES)


@pytest.mark.parametrize("frame_time", [1 / 60, 1 / 30])
def test_the_root_takes_about_half_a_second_from_feet_to_hands(frame_time):
    """A root that follows at once makes the whole body lurch when a hand touches the floor."""
    clip, on_hands = Still(), np.arange(FRAMES) >= FRAMES // 2
    clip.frame_time = frame_time
    shift = root_shift(clip, feet_at_rest(~on_hands), resting(on_hands)) @ OFF / (OFF @ OFF)
    on_the_way = np.count_nonzero((shift > 0.1) & (shift < 0.9)) * frame_time
    assert 0.4 < on_the_way < 0.7


def test_in_flight_the_root_neither_waits_nor_hurries():
    """Its path bends freely where nothing rests: it is under way before the feet leave, and after the hands land."""
    frames = np.arange(FRAMES)
    shift = root_shift(Still(), feet_at_rest(frames < 30), resting(frames >= 90)) @ OFF / (OFF @ OFF)
    assert np.diff(shift).max() < 0.95 / 60  # straight from place to place in the 60 frames of flight it takes 1 / 60


def test_shots_do_not_draw_at_each_other():
    shots = (np.arange(FRAMES) >= 60).astype(np.intp)
    shift = root_shift(Still(shots), feet_at_rest(shots == 0), resting(shots == 1))
    np.testing.assert_allclose(shift[:60], 0)
    np.testing.assert_allclose(shift[60:], [OFF] * 60)


@pytest.mark.parametrize(
    ("distance", "seconds"), [(0.0, 0.32), (0.2, 0.8), (9.0, 1.2)], ids=["in place", "near", "far"]
)
def test_a_joint_that_is_far_from_its_place_takes_longer_to_get_there(distance, seconds):
    """At half a leg per second, but for no less than a third of a second, and for no more than 1.2 seconds."""
    rests = np.arange(FRAMES) >= 90
    held = with_resting_joints(Still(), no_supports(FRAMES), resting(rests, off=distance * OFF / np.linalg.norm(OFF)))
    weights = held.weights[:, 0]
    assert np.all(np.diff(weights) >= 0)
    np.testing.assert_allclose(weights[rests], 1.0)
    assert np.count_nonzero(weights[~rests]) * Still.frame_time == pytest.approx(seconds, abs=0.04)


def test_how_far_a_joint_is_from_its_place_is_the_mean_of_its_rest():
    """One frame in which the copy is far off does not draw the joint to its place long before it rests."""
    rests, off = np.arange(FRAMES) >= 90, np.full((FRAMES, 1), 0.2) * [1.0, 0.0, 0.0]
    off[100] *= 10.0
    spoilt = replace(resting(rests), places=off[:, None])
    weights = [
        with_resting_joints(Still(), no_supports(FRAMES), each).weights
        for each in (spoilt, resting(rests, off=np.array([0.2 * (29 + 10) / 30, 0.0, 0.0])))
    ]
    np.testing.assert_array_equal(*weights)


def lying(depth=0.0, forearm=0.0, frames=40):
    """A person flat on the back with arms out, the left hand `depth` below the body [leg lengths], and the forearm
    raised by an angle [rad], (frames,).
    """
    turns = {"Hips": np.array([-np.pi / 2, 0, 0]), "LeftShoulder": np.array([0, np.arcsin(depth * LEG / ARM), 0])}
    turns["LeftElbow"] = np.outer(np.broadcast_to(-np.asarray(forearm), frames), [0, 1, 0])
    return posed(PERSON, turns, np.tile([0.0, 1.0, 0.0], (frames, 1)))


def resting_of(clip):
    return find_resting_joints(clip, find_foot_lock(clip), "body")


@pytest.mark.parametrize(("depth", "lies"), [(0.05, True), (0.2, True), (0.3, False)])
def test_a_body_lies_on_its_flesh(depth, lies):
    """Joints of trunk and head are inside it, up to a quarter of a leg above what the body lies on; those of limbs are
    not.
    """
    resting = resting_of(Clip.of(matched(lying(depth), PERSON), RootScale.even(1.0)))
    names = {PERSON.names[joint] for joint in resting.joints}
    assert ({"Hips", "Chest", "Chest2"} <= names) == lies
    assert ("Head" in names) == lies
    assert "LeftWrist_End" in names
    assert ("RightElbow" in names) == (depth < 0.1)


def test_an_elbow_on_the_floor_is_as_far_from_the_hand_there_as_in_the_copy():
    """So an arm that rests on both keeps its shape. The hand leaves the floor later, while the body moves on."""
    frames = np.arange(80)
    source = lying(forearm=np.clip((frames - 40) / 10, 0, 1) * np.pi / 2, frames=80)
    clip = Clip.of(matched(source, lengthened(PERSON, {"Wrist": 1.3})), RootScale.even(1.0))
    clip = clip.raised(np.outer(frames * 0.01, [1.0, 0.0, 0.0]))
    resting = resting_of(clip)
    columns = [resting.joints.tolist().index(PERSON.index(name)) for name in ("LeftElbow", "LeftWrist")]
    both, elbow = resting.rests[:, columns].all(axis=1), resting.rests[:, columns[0]]
    assert 30 < both.sum() < 50 < elbow.sum()
    off = (resting.places - clip.copy_on_path(resting.joints))[both].mean(axis=0)
    np.testing.assert_allclose(*off[columns][:, [0, 2]], atol=1e-5)
