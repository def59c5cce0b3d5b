"""How low joints may be: the floor where the source's lowest joint is, and where it was just before."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES

from distretarget import load_target, read_bvh
from distretarget.baseline.rotation_copy import RootScale
from distretarget.objectives.floor_heights import with_floor_heights
from distretarget.objectives.settings import DEFAULT_SETTINGS
from distretarget.objectives.supports import no_supports
from distretarget.pipeline.performer import matched_performer

CRAWL = read_bvh(SAMPLES / "supports" / "crawl.bvh")
UP = 30.0  # [cm]


def floor_of(source, target):
    """The matching, and the floor while something rests in all frames."""
    prepared = matched_performer(source, load_target(SAMPLES / target)).prepared(RootScale.even(1.0))
    matching, frames = prepared.performer.matching, len(source)
    rests = no_supports(frames).with_others(
        np.array([0]), np.array([0]), np.ones((frames, 1)), np.zeros((frames, 1, 3))
    )
    return matching, with_floor_heights(rests, matching, prepared.problem, prepared.scale, DEFAULT_SETTINGS).floor


def lifted(frames):
    """The crawl, higher in some frames."""
    path = np.array(CRAWL.root_positions)
    path[frames, 1] += UP
    return replace(CRAWL, root_positions=path)


def test_a_joint_that_nothing_drives_may_be_as_low_as_the_lowest_joint_of_the_source():
    matching, floor = floor_of(CRAWL, "rigs/mixamo_t.json")
    followers = np.isin(floor.joints, matching.followers_but_feet)
    lowest = CRAWL.positions[..., 1].min()
    heights = floor.heights * matching.target.unit
    assert followers.sum() > 30
    np.testing.assert_allclose(heights[:, followers].min(), lowest, atol=1e-9)
    assert (heights[:, followers] <= CRAWL.positions[..., 1].min(axis=1)[:, None] + 1e-9).all()


@pytest.mark.parametrize("frames", [slice(100, 101), slice(100, 103)])
def test_the_floor_does_not_jump_with_a_body_that_does(frames):
    _, floor = floor_of(CRAWL, "child.json")
    matching, jumping = floor_of(lifted(frames), "child.json")
    unit = matching.target.unit
    rise = (jumping.heights - floor.heights[:, np.isin(floor.joints, jumping.joints)]) * unit
    assert rise.max() < DEFAULT_SETTINGS.rest_height * matching.leg_lengths[1] + 1e-9
