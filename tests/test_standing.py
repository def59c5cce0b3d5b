"""Feet of characters on the floor of their file: as high as in the bind pose when they stand flat."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import HERO, SAMPLES

from distretarget import Body, Options, diff, load_target, read_bvh, retarget


def soles(target, motion):
    """How high the lowest joint of the feet is above the floor, (frames,), and in the bind pose."""
    skeleton = target.skeleton
    feet = [joint for joint, name in enumerate(skeleton.names) if "Foot" in name or "Toe" in name]
    bind = (skeleton.rest_positions + skeleton.offsets[0])[feet, 1].min()
    return motion.positions[:, feet, 1].min(axis=1), bind


@pytest.mark.parametrize("rise", [0.0, -4.0, 9.0])
@pytest.mark.parametrize("clip", ["walk", "clap", "squat"])
def test_flat_feet_are_as_high_as_in_the_bind_pose(clip, rise):
    source = read_bvh(SAMPLES / f"{clip}.bvh")[:120]
    source = replace(source, root_positions=np.add(source.root_positions, [0.0, rise, 0.0]))
    target = load_target(HERO)
    result = retarget(source, target, Options(skin="none"))
    heights, bind = soles(target, result.motion)
    assert np.median(heights) == pytest.approx(bind, abs=0.002)
    assert result.metrics["result"]["foot_height"] < 0.2
    assert diff(source, result.motion).metrics["result"]["foot_height"] < 0.2


def test_a_clip_without_a_floor_stays_where_it_is():
    source = read_bvh(SAMPLES / "clap.bvh")[:40]
    source = replace(source, root_positions=np.add(source.root_positions, [0.0, 60.0, 0.0]))
    target = load_target(HERO)
    result = retarget(source, target)
    np.testing.assert_array_equal(result.source.root_positions, source.root_positions)


def test_other_targets_have_no_floor():
    target = load_target(HERO)
    bare = replace(target.skeleton, floor_at_zero=False)
    source = read_bvh(SAMPLES / "clap.bvh")[:40]
    np.testing.assert_array_equal(retarget(source, bare).source.root_positions, source.root_positions)


def test_legs_without_length_are_no_legs():
    skeleton = load_target(HERO).skeleton
    legs = [joint for joint, name in enumerate(skeleton.names) if name.endswith(("Leg", "Foot")) and "Up" not in name]
    offsets = np.array(skeleton.offsets)
    offsets[legs] = 0.0
    body = Body.of(skeleton.with_offsets(offsets))
    assert body.legs is None
    assert body.unit > 0
