"""Pops: jumps of a result, of which the rotation copy is calm, or goes on moving as before."""

import numpy as np
import pytest
from bodies import LEG, PERSON, body_of, posed, with_bone

from distretarget.measure.metrics import BY_KEY, Track
from distretarget.measure.pops import find_pops


def carried(path, body=PERSON, frame_time="0.0166666667"):
    """A body carried along x by a path [leg lengths]."""
    return posed(body, {}, np.outer(np.asarray(path) * LEG, [1.0, 0, 0]), frame_time)


def jumps_of(copy, result, body=PERSON):
    return find_pops(copy, result, body_of(body), body_of(body).shots_of(copy))


@pytest.mark.parametrize(
    ("copy_step", "step", "pops"),
    [(0.0, 0.05, True), (0.0, 0.03, False), (0.014, 0.05, True), (0.02, 0.05, False), (0.05, 0.05, False)],
)
def test_a_pop_is_far_and_not_in_the_copy(copy_step, step, pops):
    found = jumps_of(carried([0, copy_step, copy_step]), carried([0, step, step]))
    assert found.shape == (2, len(PERSON))
    assert not found[1].any()
    np.testing.assert_allclose(found[0], 100 * step if pops else 0.0, rtol=1e-6)


def test_pops_are_counted_by_frames():
    found = jumps_of(carried([0] * 5), carried([0, 0.1, 0.1, 0.2, 0.2]))
    assert BY_KEY["pop"].of_clip({"pop": Track(found)}) == 2
    np.testing.assert_array_equal(BY_KEY["pop"].over_time({"pop": Track(found)}, 5), [1, 0, 1, 0, np.nan])


def test_steps_are_over_the_same_time_at_any_frame_rate():
    assert not jumps_of(carried([0, 0], frame_time="0.0333333"), carried([0, 0.07], frame_time="0.0333333")).any()
    assert jumps_of(carried([0, 0], frame_time="0.0083333"), carried([0, 0.03], frame_time="0.0083333")).any()


def test_what_is_no_part_of_the_body_does_not_pop():
    body = with_bone(PERSON, "Tail", "Hips")
    assert body_of(body).regions.of_joint[-1] == -1
    turns = {"Tail": np.array([[0.0, 0, 0], [np.pi / 2, 0, 0]])}
    longer = with_bone(body, "Tip", "Tail")
    result = posed(longer, turns, np.zeros((2, 3)))
    assert not jumps_of(posed(longer, {}, np.zeros((2, 3))), result, longer).any()


def test_no_joint_pops_at_a_cut():
    """Nor does one that happens to be in the same place before and after it, as the hips of a body turned about are."""
    about = {"Hips": np.array([[0.0, 0, 0], [0, 0, 0], [0, np.pi, 0], [0, np.pi, 0]])}
    copy, step = posed(PERSON, about, np.zeros((4, 3))), np.outer([0, 0, 0.05, 0.05], [LEG, 0, 0])
    assert not jumps_of(copy, posed(PERSON, about, step)).any()
    assert jumps_of(posed(PERSON, {}, np.zeros((4, 3))), posed(PERSON, {}, step)).any()


def test_one_frame_has_no_pops():
    found = jumps_of(carried([0]), carried([0]))
    assert found.shape == (0, len(PERSON))
    assert BY_KEY["pop"].of_clip({"pop": Track(found)}) is None


WALKED = 0.05 * np.arange(10.0)  # too fast for a pop in calm


def pops_of(path, frame_time="0.0166666667"):
    """The frames in which a body pops whose path should be `WALKED`, and goes elsewhere by a path [leg lengths]."""
    copy, result = (carried(each, frame_time=frame_time) for each in (WALKED, WALKED + path))
    found = jumps_of(copy, result)
    assert found.shape == (9, len(PERSON))
    return np.flatnonzero(found.any(axis=1)).tolist()


@pytest.mark.parametrize(
    ("path", "frames"),
    [
        (np.zeros(10), []),
        (np.repeat([0.0, 0.05], 5), [4]),
        (np.repeat([0.0, 0.03], 5), []),
        (np.repeat([0.05, 0.0], [1, 9]), [0]),
        (np.repeat([0.0, 0.05], [9, 1]), [8]),
        (np.where(np.arange(10) == 5, 0.06, 0.0), [4, 5]),  # there and back
        (0.06 * np.arange(10.0), []),  # as far in every frame
        (np.array([0, 0, 0.02, 0.04, 0.06, 0.11, 0.13, 0.15, 0.17, 0.17]), []),  # twice as far as in those around
    ],
)
def test_a_pop_is_far_and_sudden_though_the_joint_moves(path, frames):
    assert pops_of(path) == frames


def test_a_jump_of_the_source_is_no_pop_of_the_result():
    jump = np.repeat([0.0, 0.1], 5)
    copy, result = carried(WALKED / 10 + jump), carried(WALKED / 10 + 1.5 * jump)
    assert not jumps_of(copy, result).any()
    assert not jumps_of(carried(WALKED / 10 + 0.5 * jump), result).any()
    assert np.flatnonzero(jumps_of(carried(WALKED / 10), result).any(axis=1)).tolist() == [4]


def test_pops_take_the_same_time_at_any_frame_rate():
    step = np.repeat([0.0, 0.05], 5)
    assert pops_of(0.7 * step, "0.0083333") == [4]
    assert pops_of(1.4 * step, "0.0333333") == []


def test_nothing_pops_at_a_cut_or_in_one_frame():
    about = {"Hips": np.repeat([[0.0, 0, 0], [0, np.pi, 0]], 4, axis=0)}
    step = np.outer(np.repeat([0.0, 0.1], 4), [LEG, 0, 0])
    copy, result = posed(PERSON, about, np.zeros((8, 3))), posed(PERSON, about, step)
    assert not jumps_of(copy, result).any()
    assert jumps_of(posed(PERSON, {}, np.zeros((8, 3))), posed(PERSON, {}, step)).any()
    assert jumps_of(carried([0]), carried([0])).shape == (0, len(PERSON))
