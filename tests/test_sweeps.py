"""What regions fell short of their places in a sweep is made up for in the next."""

import numpy as np

from distretarget.ik.springs import Springs
from distretarget.scene.sweeps import MOST_SHORTFALL, with_shortfall

REGIONS = np.array([0, 1, 1, 2])
PLACES = np.array([[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]])


def springs(places=PLACES, stiffness=(1.0, 1.0, 1.0)):
    """Springs of joints 1, 2 (one region) and 3 (another), in one frame."""
    A = np.array(stiffness)[None, :, None, None] * np.eye(3)
    return Springs(np.array([1, 2, 3]), np.full(3, -1), places[None], A)


def reached(off):
    """The positions of all joints, off their places by so much."""
    return np.concatenate([np.zeros((1, 3)), PLACES + off])[None]


def test_a_region_is_drawn_further_by_what_it_fell_short():
    short = np.array([[0.0, -0.004, 0.0], [0.0, -0.004, 0.0], [0.002, 0.0, 0.0]])
    further = with_shortfall(springs(), springs(), reached(short), REGIONS)
    np.testing.assert_allclose(further.rest[0], PLACES - short)


def test_what_joints_of_a_region_fall_short_against_each_other_is_left():
    against = np.array([[0.0, 0.5, 0.0], [0.0, -0.5, 0.0], [0.0, 0.0, 0.0]])
    further = with_shortfall(springs(), springs(), reached(against), REGIONS)
    np.testing.assert_allclose(further.rest[0], PLACES, atol=1e-12)


def test_stiff_joints_decide():
    short = np.array([[0.0, -0.004, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    before = springs(stiffness=(3.0, 1.0, 1.0))
    further = with_shortfall(before, before, reached(short), REGIONS)
    np.testing.assert_allclose(further.rest[0, :, 1] - 1.0, [0.003, 0.003, 0.0])


def test_what_is_out_of_reach_is_not_torn_at():
    far = np.array([[0.0, 0.0, -3.0]] * 3)
    further = with_shortfall(springs(), springs(), reached(far), REGIONS)
    np.testing.assert_allclose(further.rest[0] - PLACES, [[0.0, 0.0, MOST_SHORTFALL]] * 3)


def test_where_nothing_draws_nothing_changes():
    none = springs(stiffness=(0.0, 0.0, 0.0))
    further = with_shortfall(none, none, reached(np.full((3, 3), 0.5)), REGIONS)
    np.testing.assert_array_equal(further.rest, none.rest)
