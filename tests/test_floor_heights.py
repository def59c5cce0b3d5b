"""How low joints may be: the floor where the source's lowest joint is, and where it was just before."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES

from distretarget import load_target, read_bvh
from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.resting import REST_HEIGHT
from distretarget.objectives.floor import find_floor
from distretarget.pipeline.performer import match_performer

CRAWL = read_bvh(SAMPLES / "supports" / "crawl.bvh")
UP = 30.0  # [cm]


def floor_of(source, target):
    """The clip, and the floor while something rests in all frames."""
    clip = match_performer(source, load_target(SAMPLES / target)).performer(RootScale.even(1.0)).clip
    return clip, find_floor(clip, np.ones((len(source), 1)))


def lifted(frames):
    """The crawl, higher in some frames."""
    path = np.array(CRAWL.root_positions)
    path[frames, 1] += UP
    return replace(CRAWL, root_positions=path)


def test_a_joint_that_nothing_drives_may_be_as_low_as_the_lowest_joint_of_the_source():
    clip, floor = floor_of(CRAWL, "rigs/mixamo_t.json")
    followers = np.isin(floor.joints, clip.undriven_joints)
    lowest = CRAWL.positions[..., 1].min()
    heights = floor.heights * clip.unit
    assert followers.sum() > 30
    np.testing.assert_allclose(heights[:, followers].min(), lowest, atol=1e-9)
    assert (heights[:, followers] <= CRAWL.positions[..., 1].min(axis=1)[:, None] + 1e-9).all()


@pytest.mark.parametrize("frames", [slice(100, 101), slice(100, 103)])
def test_the_floor_does_not_jump_with_a_body_that_does(frames):
    _, floor = floor_of(CRAWL, "child.json")
    clip, jumping = floor_of(lifted(frames), "child.json")
    rise = (jumping.heights - floor.heights[:, np.isin(floor.joints, jumping.joints)]) * clip.unit
    assert rise.max() < REST_HEIGHT * clip.leg_lengths[1] + 1e-9
