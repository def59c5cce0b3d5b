"""Limbs that have to pass through a body may overlap it about the passage, and do not swing far beyond it."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, posed
from test_displacement import BODY, skin_of
from test_limb_bends import REACH, frames_of

from distretarget.ik.limb_bends import TAU, bends
from distretarget.objectives.body_skin import BodySkin
from distretarget.objectives.passages import FADES, overlap_of_passages
from distretarget.skin.displacement import displacements
from distretarget.skin.limbs import bent

RATE, COUNT = 60.0, 120
SKIN = skin_of()
LEFT, RIGHT, BELLY = range(3)  # capsules
ASIDE = 0.1  # how far the left hand has to be displaced on either side [body units]


def overlaps(path, start=None, shots=None, rate=RATE):
    """How much more the left hand and the right one may overlap the belly, while the left one follows a path about the
    middle of the belly [body units].
    """
    count = len(path)
    ends = np.zeros((count, 3, 2, 3))
    ends[:, LEFT], ends[:, RIGHT] = path[:, None], [5.0, 0.0, 0.0]
    d = np.zeros((count, len(SKIN.limbs), 2, 3))
    d[:, SKIN.displaced.limbs[LEFT], 1] = np.sign(path) * [0.0, 0.0, ASIDE] if start is None else start
    shots = np.zeros(count, np.intp) if shots is None else shots
    more = overlap_of_passages(SKIN, ends, np.zeros((count, len(SKIN.balls.pairs))), d, shots, 1.0 / rate)
    with_belly = [np.isin(SKIN.balls.pairs, np.flatnonzero(segment)).all(axis=1) for segment in _pairs()]
    return [more[:, on].max(axis=1) for on in with_belly]


def _pairs():
    segments, count = SKIN.capsules.segments, SKIN.balls.pairs.max() + 1
    return [np.isin(np.arange(count), segments[[hand, BELLY]]) for hand in (LEFT, RIGHT)]


def across(count=COUNT):
    """The hand is before the belly, and from the middle frame on behind it."""
    path = np.zeros((count, 3))
    path[:, 2] = np.where(np.arange(count) < count // 2, 1.0, -1.0) * 0.3
    return path


def test_a_hand_that_passes_through_may_overlap_for_a_while_before_and_after_by_no_more_than_it_is_displaced():
    left, right = overlaps(across())
    near = np.abs(np.arange(COUNT) - 0.5 * (COUNT - 1)) / RATE / TAU
    np.testing.assert_allclose(left[near < 0.5 * FADES - 0.2], ASIDE)
    assert not left[near > FADES + 0.2].any()
    assert (np.diff(left[: COUNT // 2]) >= 0).all()
    np.testing.assert_allclose(left, left[::-1], atol=1e-12)
    assert not right.any()


def test_a_hand_on_one_side_in_need_of_none_on_the_other_may_overlap_on_the_first_alone():
    start = np.zeros((COUNT, 3))
    start[COUNT // 2 :, 2] = -ASIDE
    left, _ = overlaps(across(), start)
    assert not left[: COUNT // 2].any()
    assert left[COUNT // 2] == pytest.approx(ASIDE)


def test_displacements_that_are_the_same_on_both_sides_let_nothing_overlap():
    assert not overlaps(across(), np.tile([ASIDE, 0.0, 0.0], (COUNT, 1)))[0].any()


def test_a_hand_that_goes_round_or_stays_inside_or_jumps_at_a_cut_does_not_pass_through():
    angle = np.linspace(0.0, np.pi, COUNT)[:, None]
    round_it = 0.5 * np.hstack([np.sin(angle), 0.0 * angle, np.cos(angle)])
    assert not overlaps(round_it)[0].any()
    assert not overlaps(np.tile([0.0, 0.0, 0.02], (COUNT, 1)), np.sign(across()) * ASIDE)[0].any()
    assert not overlaps(across(), shots=(np.arange(COUNT) >= COUNT // 2).astype(np.intp))[0].any()


@pytest.mark.parametrize("rate", [30.0, 120.0])
def test_the_frame_rate_hardly_matters(rate):
    times = np.arange(COUNT) / RATE
    other, _ = overlaps(across(round(COUNT * rate / RATE)), rate=rate)
    there = np.interp(times, np.arange(len(other)) / rate, other)
    assert np.abs(there - overlaps(across())[0]).max() < 0.35 * ASIDE


def test_a_hand_that_passes_through_swings_less_far_and_moves_less_suddenly():
    swing = -1.75 - 0.75 * np.tanh((np.arange(COUNT) - 0.5 * COUNT) / 4.0)
    turns = {"LeftShoulder": swing[:, None] * [0.0, 1.0, 0.0], "LeftElbow": np.tile([0.0, -1.4, 0.0], (COUNT, 1))}
    motion = posed(PERSON, turns, np.tile([0.0, 0.9, 0.0], (COUNT, 1)))
    middle = motion.positions[COUNT // 2, PERSON.index("LeftWrist")] - motion.positions[0, PERSON.index("Chest")]
    capsules = SKIN.capsules
    ends, radii = capsules.ends.copy(), capsules.radii.copy()
    ends[BELLY], radii[BELLY] = middle + np.outer([-1.0, 1.0], [0.0, 1.0, 0.0]), 0.28  # a pillar
    skin = BodySkin.of(BODY, replace(capsules, ends=ends, radii=radii))
    frames, shots = frames_of(skin, motion), np.zeros(COUNT, np.intp)
    alone = [displacements(skin.balls, skin.displaced, *(each[[n]] for each in frames[:4]))[0] for n in range(COUNT)]
    start = np.concatenate(alone)  # out of the belly by the shortest way
    arms, zones = np.array([limb.is_arm for limb in skin.limbs]), np.arange(len(skin.balls.pairs))

    def solved(more):
        now = frames._replace(soft=frames.soft + more)
        return bends(skin.balls, skin.displaced, zones, now, arms, start, shots, 1.0 / RATE, REACH)

    sudden = solved(0.0)
    after = skin.posed(bent(motion, skin.limbs, skin.unit * sudden))
    slow = solved(overlap_of_passages(skin, after, frames.soft, start, shots, 1.0 / RATE))
    steps, sizes = (
        [np.linalg.norm(each, axis=-1).max() for each in both]
        for both in ((np.diff(sudden, axis=0), np.diff(slow, axis=0)), (sudden, slow))
    )
    assert steps[1] < 0.5 * steps[0]
    assert sizes[1] < 0.9 * sizes[0]
