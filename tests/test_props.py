"""Props: they keep their shape, follow the hands that hold them, and stand where they stood."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, moved, with_bone
from sample_scenes import SCENES, standing_prop
from scipy.spatial.transform import Rotation

from distretarget import (
    Grip,
    Motion,
    MotionError,
    Prop,
    SettingsError,
    SkeletonError,
    load_target,
    prop_of,
    retarget_scene,
)


@cache
def drummer():
    (motion,) = SCENES["drum_on_table"]().performers.values()
    return motion


@cache
def child():
    return load_target(SAMPLES / "child.json").for_source(drummer().skeleton).skeleton


def with_stick(motion):
    """The performer with a stick fixed to the right hand."""
    skeleton = with_bone(motion.skeleton, "Stick", "RightWrist")
    skeleton = with_bone(skeleton, "StickTip", "Stick")
    skeleton = skeleton.with_offsets([*motion.skeleton.offsets, [-8.0, 0.0, 0.0], [-30.0, 5.0, 10.0]])
    rotations = np.concatenate([motion.rotations, np.tile([0.0, 0.0, 0.0, 1.0], (len(motion), 2, 1))], axis=1)
    return Motion(skeleton, motion.root_positions, rotations, motion.frame_time_text)


def test_a_prop_is_a_motion_of_its_own():
    source = with_stick(drummer())
    stick = prop_of(source, "Stick")
    assert stick.skeleton.names == ("Stick", "StickTip")
    np.testing.assert_allclose(stick.positions, source.positions[:, -2:], atol=1e-9)


def test_a_prop_stays_in_the_hand_that_holds_it():
    source = with_stick(drummer())
    stick = Prop(name="stick", motion=prop_of(source, "Stick"), held_by=(Grip(0, "RightWrist"),))
    done = retarget_scene([source], [child()], [stick])
    (body,), (prop,) = done.results, done.props
    hand = body.motion.skeleton.index("RightWrist")
    grip = np.linalg.norm(prop.motion.positions[:, 0] - body.motion.positions[:, hand], axis=1)
    np.testing.assert_allclose(grip, prop.scale * 8.0, rtol=1e-5)
    in_hand = (
        Rotation.from_quat(body.motion.world_rotations[:, hand])
        .inv()
        .apply(prop.motion.positions[:, 1] - body.motion.positions[:, hand])
    )
    assert np.ptp(in_hand, axis=0).max() < 1e-5 * body.matching.target.height


def test_a_prop_that_nobody_holds_stands_still_in_its_own_size():
    box = Prop(name="box", motion=standing_prop("box", np.array([[40, 0, 60], [60, 0, 60], [50, 30, 60]])), scale=1.0)
    points = box.motion.positions[0]
    done = retarget_scene([drummer()], [child()], [box])
    (prop,) = done.props
    assert len(prop.motion) == len(drummer())
    assert np.ptp(prop.motion.positions, axis=0).max() == 0
    scale = done.world_scale
    middle = points.mean(axis=0)
    expected = points - middle + middle * [scale, 1.0, scale]
    np.testing.assert_allclose(prop.motion.positions[0], expected, atol=1e-9)


@pytest.mark.parametrize("performer", [0, 1])
def test_a_prop_may_have_the_scale_of_either_performer(performer):
    """The number names the performer whose size the prop follows, such as the one whose chair it is."""
    box = Prop(name="box", motion=standing_prop("box", np.array([[0, 0, 90], [20, 0, 90]])), scale=performer)
    sources = [drummer(), moved(drummer(), Rotation.identity(), shift=(400.0, 0.0, 0.0))]
    done = retarget_scene(sources, [child(), drummer().skeleton], [box])
    small, large = (one.root_scale for one in done.results)
    assert small < 0.7 * large
    assert done.props[0].scale == pytest.approx((small, large)[performer])
    size = np.linalg.norm(np.subtract(*done.props[0].motion.positions[0]))
    assert size == pytest.approx(20 * (small, large)[performer])


def test_a_scene_with_a_prop_that_is_turned_has_the_same_result():
    scene = SCENES["staff"]()
    (source,), (staff,) = scene.performers.values(), scene.props
    turn, shift = Rotation.from_euler("Y", 110, degrees=True), (200.0, 0.0, 50.0)
    done = retarget_scene([source], [child()], [staff])
    elsewhere = retarget_scene(
        [moved(source, turn, shift)], [child()], [replace(staff, motion=moved(staff.motion, turn, shift))]
    )
    for one, other in ((done.results[0], elsewhere.results[0]), (done.props[0], elsewhere.props[0])):
        expected = turn.apply(one.motion.positions.reshape(-1, 3)) + done.world_scale * np.array(shift)
        assert np.abs(expected - other.motion.positions.reshape(-1, 3)).max() < 1e-4 * child().path_lengths.max()


def test_props_that_cannot_be_are_refused():
    prop = Prop(name="box", motion=standing_prop("box", np.ones((1, 3))))
    for wrong, error, words in (
        ({"scale": 3}, SettingsError, "scale of performer 3"),
        ({"held_by": (Grip(2, "RightWrist"),)}, SettingsError, "held by performer 2"),
        ({"held_by": (Grip(0, "RightWrst"),)}, SkeletonError, "RightWrist"),
        ({"held_by": (Grip(0, "Stick"),)}, SettingsError, "drives no joint"),
    ):
        with pytest.raises(error, match=words):
            retarget_scene([with_stick(drummer())], [child()], [replace(prop, **wrong)])
    for scale in (0.0, -1.0, "big", True):
        with pytest.raises(SettingsError, match="the scale of 'box'"):
            replace(prop, scale=scale)


@pytest.mark.parametrize("held_by", [(), (Grip(0, "RightWrist"),)], ids=["free", "held"])
def test_props_too_large_to_compute_with_are_refused(held_by):
    box = standing_prop("box", np.array([[40.0, 0.0, 60.0], [60.0, 0.0, 60.0]]))
    prop = Prop(name="box", motion=box, scale=1e12, held_by=held_by)
    with pytest.raises(MotionError, match=r"'box' reaches beyond 1e\+12 with a scale of 1e\+12; choose a smaller"):
        retarget_scene([drummer()], [child()], [prop])
    for far in (1e13, 1e300):
        with pytest.raises(MotionError, match=r"'box' has positions beyond 1e\+12"):
            Prop(name="box", motion=replace(box, root_positions=far * np.ones((1, 3))), held_by=held_by)
