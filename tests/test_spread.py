"""Few of many points."""

import numpy as np

from distretarget.numerics.vectors import spread_out


def test_the_ends_of_a_line_come_first_then_its_middle():
    line = np.linspace(0, 1, 101)[:, None]
    assert spread_out(line, 3).tolist() == [0, 100, 50]


def test_few_points_are_all_kept():
    assert sorted(spread_out(np.eye(3), 10).tolist()) == [0, 1, 2]
