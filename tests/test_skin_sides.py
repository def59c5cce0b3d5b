"""On which sides limbs leave bodies: as a search through all ways, and alike in both directions of time."""

from itertools import product

import numpy as np
import pytest
from bodies import sample, sample_target

from distretarget import retarget
from distretarget.skin.displacement import cheaper


def cost(taken, forwards, backwards, change):
    """What a way through both costs."""
    d = np.where(np.array(taken)[:, None, None, None], backwards, forwards)
    changes = [((forwards[t] - backwards[t]) ** 2).sum() for t in range(1, len(taken)) if taken[t] != taken[t - 1]]
    return (d**2).sum() + change * sum(changes)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("change", [0.0, 0.3, 2.0, 100.0])
def test_the_way_found_is_the_cheapest_of_all(seed, change):
    forwards, backwards = (
        np.random.default_rng(seed).normal(size=(2, 8, 2, 2, 3)) * np.linspace(1.0, 2.0, 8)[:, None, None, None]
    )
    taken = cheaper(forwards, backwards, change)
    least = min(cost(way, forwards, backwards, change) for way in product([False, True], repeat=8))
    assert cost(taken, forwards, backwards, change) == pytest.approx(least)


def test_where_both_agree_a_change_costs_nothing():
    forwards = np.ones((9, 1, 2, 3))
    backwards = forwards.copy()
    backwards[2], forwards[6] = 0.5, 0.5  # each is shorter once; between they are the same
    taken = cheaper(forwards, backwards, 10.0)
    assert taken[2]
    assert not taken[6]


@pytest.mark.parametrize("clip", ["clap", "hands_on_hips"])
def test_a_clip_played_backwards_bends_the_same_limbs(clip):
    motion = sample(clip)[:200]
    one, other = (retarget(each, sample_target("hero")).motion.positions for each in (motion, motion[::-1]))
    height = np.ptp(one[0], axis=0).max()
    assert np.abs(one - other[::-1]).max() < 0.01 * height
