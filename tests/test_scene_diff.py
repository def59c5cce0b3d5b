"""Two scenes against each other, whose gaps are known by construction."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, moved
from sample_scenes import SCENES
from scipy.spatial.transform import Rotation

from distretarget import Motion, MotionError, SettingsError, diff, diff_scenes, retarget_scene
from distretarget.baseline.world import World
from distretarget.measure.gaps import TOUCH_DISTANCE, ScenePart, measure_gap
from distretarget.report.clip_page import run_diff
from distretarget.scene.scene_file import load_scene

SHIFT = 7.0  # [cm]


@cache
def handshake():
    return tuple(SCENES["handshake"]().performers.values())


@cache
def drummer():
    scene = SCENES["drum_on_table"]()
    (performer,) = scene.performers.values()
    (table,) = scene.props
    return performer, table.motion


def measured(a, b, **options):
    return diff_scenes([diff(one, other) for one, other in zip(a, b, strict=True)], **options)


def elsewhere(motion, shift):
    return moved(motion, Rotation.identity(), shift=shift)


def test_a_scene_against_itself_is_no_different():
    found = measured(handshake(), handshake())
    assert found.world_scale == 1
    assert found.gaps
    for gap in found.gaps:
        assert gap.a == gap.b > 0
        assert gap.error == 0
    a, b, error = found.mean_gaps
    assert a == b
    assert error == 0


def test_the_worst_frame_is_that_of_the_gap_that_is_furthest_off():
    one, other = handshake()
    shift = np.array([0.0, SHIFT, 0.0])
    (gap,) = measured((one, other), (one, elsewhere(other, shift))).gaps
    assert gap.regions == ("right hand", "right hand")
    joints = [motion.skeleton.index(key) for motion, key in zip((one, other), gap.joints, strict=True)]
    between = one.positions[:, joints[0]] - other.positions[:, joints[1]]
    before, after = np.linalg.norm(between, axis=1), np.linalg.norm(between - shift, axis=1)
    touch = before < TOUCH_DISTANCE * diff(one, one).matching.leg_lengths[0]
    assert gap.frames == touch.sum()
    assert gap.worst_frame == np.where(touch, np.abs(after - before), 0.0).argmax()


def test_joints_in_one_place_come_apart_by_the_shift():
    one, _ = handshake()
    found = measured((one, one), (one, elsewhere(one, (0.0, 0.0, SHIFT))))
    leg = found.performers[0].matching.leg_lengths[0]
    same = [gap for gap in found.gaps if gap.a == 0]
    assert same
    for gap in same:
        assert gap.b == pytest.approx(SHIFT / leg)
        assert gap.error == pytest.approx(SHIFT / leg)
        assert gap.frames == len(one)


def test_a_world_twice_as_large_has_the_same_gaps_in_the_scale_of_a():
    twice = [scaled(motion, 2.0) for motion in handshake()]
    found = measured(handshake(), twice)
    assert found.world_scale == pytest.approx(2)
    assert found.mean_gaps[2] == pytest.approx(0, abs=1e-9)
    assert measured(handshake(), twice, world_scale=4).gaps[0].b == pytest.approx(found.gaps[0].a / 2)


def scaled(motion, scale):
    skeleton = motion.skeleton.with_offsets(scale * motion.skeleton.offsets)
    return Motion.of_translations(skeleton, scale * motion.translations, motion.rotations, motion.frame_time_text)


def test_the_gaps_of_a_result_are_those_that_the_scene_tells():
    setup = load_scene(SAMPLES / "scenes" / "handshake" / "scene.json")
    scene = setup.retargeted()
    gap, found = scene.gaps[0, 1], diff_scenes([run_diff(one) for one in scene.results])
    assert found.world_scale == pytest.approx(scene.world_scale)
    a, b, error = found.mean_gaps
    assert error == pytest.approx(scene.gap_error, rel=0.02)
    assert (a, b) == pytest.approx((gap.a, gap.b))


def test_hands_leave_a_table_that_was_lowered():
    performer, table = drummer()
    lower = elsewhere(table, (0.0, -SHIFT, 0.0))
    leg = diff(performer, performer).matching.leg_lengths[0]
    found = measured([performer], [performer], props=[(table, lower)])
    assert {gap.between for gap in found.gaps} == {(0, 1)}
    assert {gap.regions[1] for gap in found.gaps} == {""}
    assert 0 < found.mean_gaps[2] <= SHIFT / leg
    assert measured([performer], [performer], props=[(table, table)]).mean_gaps[2] == 0


def test_gaps_are_in_legs_of_the_mean_length_of_both_performers():
    apart = np.array([[[0.0, 0.06, 0.0]]])
    one = ScenePart(a=np.zeros((1, 1, 3)), b=np.zeros((1, 1, 3)), keys=("hand",), leg=0.6)
    other = ScenePart(a=apart, b=4 * apart, keys=("hand",), leg=1.4)
    gap = measure_gap((0, 1), one, other, scale=2.0)
    assert (gap.a, gap.b, gap.error) == pytest.approx((0.06, 0.12, 0.06))
    prop = ScenePart(a=apart / 2, b=apart, keys=("edge",))
    assert measure_gap((0, 1), one, prop, scale=2.0).a == pytest.approx(0.03 / 0.6)


def test_the_worst_gap_is_the_one_that_1_in_100_exceeds():
    touching, open_ = np.array([0.01, 0.0, 0.0]), np.array([0.3, 0.0, 0.0])
    one = ScenePart(a=np.zeros((200, 1, 3)), b=np.zeros((200, 1, 3)), keys=("hand",), leg=1.0)
    b = np.where(np.arange(200)[:, None, None] < 5, open_, touching)
    other = ScenePart(a=np.broadcast_to(touching, b.shape), b=b, keys=("hand",), leg=1.0)
    gap = measure_gap((0, 1), one, other, scale=1.0)
    assert gap.worst == pytest.approx(0.3)
    assert gap.b == pytest.approx((5 * 0.3 + 195 * 0.01) / 200)


def test_a_gap_at_a_prop_has_the_scale_of_the_prop():
    """A table made for a body twice as large is as far from its hands as twice the gap, whatever the world's scale."""
    performer, table = drummer()
    twice = scaled(performer, 2.0), scaled(table, 2.0)
    found = measured([performer], [twice[0]], props=[(table, twice[1])], world_scale=1.0)
    assert found.gaps
    assert found.mean_gaps[2] == pytest.approx(0, abs=1e-9)


def test_a_scene_that_lies_on_its_side_is_turned_as_a_whole():
    tipped = [World("Y", "Z", "replaced").turned(motion) for motion in handshake()]
    performers = [diff(a, b, a_up="Y", b_up="Z") for a, b in zip(handshake(), tipped, strict=True)]
    assert diff_scenes(performers).mean_gaps[2] == pytest.approx(0, abs=1e-9)


def test_a_scene_retargeted_to_itself_keeps_its_gaps():
    scene = retarget_scene(handshake(), [motion.rigid_skeleton for motion in handshake()])
    assert measured(handshake(), [one.motion for one in scene.results]).mean_gaps[2] < 0.01


def test_scenes_that_cannot_be_compared_are_refused():
    one, other = handshake()
    same = diff(one, one)
    with pytest.raises(SettingsError, match="performers is empty"):
        diff_scenes([])
    with pytest.raises(SettingsError, match=r"performers\[1\]"):
        diff_scenes([same, one])
    with pytest.raises(SettingsError, match="world_scale is 0"):
        diff_scenes([same], world_scale=0)
    with pytest.raises(MotionError, match=r"performer 2 of B has a frame time of 0\.01 s"):
        diff_scenes([same, diff(other, replace(other, frame_time_text="0.01"))])
    with pytest.raises(MotionError, match="performer 2 has other axes up"):
        diff_scenes([same, diff(other, other, a_up="Z", b_up="Z")])
    with pytest.raises(MotionError, match="prop 1 has"):
        diff_scenes([same], props=[(one, drummer()[1])])
