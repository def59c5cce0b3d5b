"""The path of the root follows what the body rests on, and stays as it is where only feet rest."""

from types import SimpleNamespace

import numpy as np
import pytest

from distretarget.objectives.resting_joints import RestingJoints, root_shift
from distretarget.objectives.supports import no_supports

FRAMES = 120
ONE_SHOT = np.zeros(FRAMES, np.intp)
OFF = np.array([0.3, -0.2, 0.1])


def resting(rests, off=OFF, in_trunk=False):
    """One joint that belongs `off` from the copy while it rests."""
    places = np.broadcast_to(off, (FRAMES, 1, 3)).copy()
    return RestingJoints(
        joints=np.array([0]),
        regions=np.array([0]),
        in_trunk=np.array([in_trunk]),
        rests=rests[:, None],
        places=places,
    )


class Still:
    """A clip in which the copy does not move."""

    frame_time = 1 / 60

    def __init__(self, shots=ONE_SHOT):
        self.shots = shots

    def copy_on_path(self, joints):
        return np.zeros((FRAMES, 1, 3))[:, joints]

    def __len__(self):
        return FRAMES


def feet_at_rest(rests):
    feet = no_supports(FRAMES)
    return SimpleNamespace(feet=2, weights=np.repeat(rests[:, None].astype(float), 2, axis=1), joints=feet.joints)


def test_the_root_goes_where_the_only_support_asks_for():
    always = np.ones(FRAMES, bool)
    np.testing.assert_allclose(root_shift(Still(), feet_at_rest(~always), resting(always)), [OFF] * FRAMES)


@pytest.mark.parametrize(("in_trunk", "share"), [(False, 1 / 2), (True, 10 / 11)])
def test_feet_at_rest_count_as_in_place_and_a_seat_counts_most(in_trunk, share):
    always = np.ones(FRAMES, bool)
    shift = root_shift(Still(), feet_at_rest(always), resting(always, in_trunk=in_trunk))
    np.testing.assert_allclose(shift, [share * OFF] * FRAMES)


def test_the_root_leads_smoothly_from_feet_to_hands():
    on_hands = np.arange(FRAMES) >= 70
    shift = root_shift(Still(), feet_at_rest(np.arange(FRAMES) < 50), resting(on_hands))
    np.testing.assert_allclose(shift[:30], 0, atol=0.03)
    np.testing.assert_allclose(shift[-20:], [OFF] * 20, atol=0.03)
    steps = np.linalg.norm(np.diff(shift, axis=0), axis=1)
    assert steps.max() < 4 * np.linalg.norm(OFF) / 40


@pytest.mark.parametrize("frame_time", [1 / 60, 1 / 30])
def test_the_root_takes_about_half_a_second_from_feet_to_hands(frame_time):
    """A root that follows at once makes the whole body lurch when a hand touches the floor."""
    clip, on_hands = Still(), np.arange(FRAMES) >= FRAMES // 2
    clip.frame_time = frame_time
    shift = root_shift(clip, feet_at_rest(~on_hands), resting(on_hands)) @ OFF / (OFF @ OFF)
    on_the_way = np.count_nonzero((shift > 0.1) & (shift < 0.9)) * frame_time
    assert 0.4 < on_the_way < 0.7


def test_shots_do_not_draw_at_each_other():
    shots = (np.arange(FRAMES) >= 60).astype(np.intp)
    shift = root_shift(Still(shots), feet_at_rest(shots == 0), resting(shots == 1))
    np.testing.assert_allclose(shift[:60], 0)
    np.testing.assert_allclose(shift[60:], [OFF] * 60)
