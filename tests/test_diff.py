"""Two clips or scenes against each other, whose metrics and gaps are known by construction."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import (
    ALONG,
    APART,
    LEG,
    PERSON,
    SAMPLES,
    UP,
    clapping,
    lengthened,
    moved,
    nameless,
    other_lengths,
    person,
    posed,
    sample,
    sample_target,
    standing,
    swaying,
    with_bone,
)
from sample_scenes import SCENES
from scipy.spatial.transform import Rotation

from distretarget import Motion, MotionError, SettingsError, diff, diff_scenes, retarget
from distretarget.baseline.world import World
from distretarget.errors import MapError, MatchingError
from distretarget.measure.gaps import TOUCH_DISTANCE, ScenePart, measure_gap
from distretarget.report.clip_page import run_diff
from distretarget.scene.scene_file import load_scene


def travelling(speed, frames=30):
    """The person carried along the floor at a speed [leg lengths/s]."""
    return standing(APART, frames, np.outer(np.arange(frames) * 0.02 * speed * LEG, ALONG))


def bent(degrees, frames=30):
    """A person whose left forearm turns while the hand keeps its rotation."""
    turn = np.radians(degrees) * UP
    return standing(APART | {"LeftElbow": turn, "LeftWrist": -turn}, frames)


def gap(motion):
    """(frames,), the distance of the wrists."""
    left, right = (motion.positions[:, motion.skeleton.index(f"{side}Wrist")] for side in ("Left", "Right"))
    return np.linalg.norm(left - right, axis=1)


def held(wide, frames=12):
    """Hands together in front, the wrists so far apart [m]."""
    closed, open_ = np.arccos(-0.1726 / 0.258), np.radians(60)
    fore = np.arccos((wide / 2 - 0.23 - 0.273 * np.cos(np.radians(100))) / 0.258)
    return clapping(np.full(frames, (fore - open_) / (closed - open_)))


def timed(frames, frame_time):
    """Two seconds of one smooth motion."""
    return replace(swaying(PERSON, frames), frame_time_text=frame_time)


def test_a_forearm_turned_by_10_degrees():
    result = diff(bent(0), bent(10))
    errors = result.tracks["direction_error"].values
    np.testing.assert_allclose(errors.max(axis=1), 10)
    np.testing.assert_allclose(errors.sum(axis=1), 10, atol=1e-5)
    np.testing.assert_allclose(result.tracks["turn"].values, 0, atol=1e-6)
    assert result.notes == ()


def test_feet_that_slide_faster():
    result = diff(travelling(0.02), travelling(0.05))
    assert result.comparison.stance.all()
    np.testing.assert_allclose(result.comparison.source_tracks["foot_skate"].values, 0.02)
    np.testing.assert_allclose(result.tracks["foot_skate"].values, 0.05)
    np.testing.assert_allclose(result.stress, 0, atol=1e-12)


def test_hands_that_part_by_4_cm():
    a, b = held(0.02), held(0.06)
    np.testing.assert_allclose([gap(a), gap(b)], [[0.02] * 12, [0.06] * 12])
    result = diff(a, b)
    hands = result.comparison.contacts.touches[0]
    assert hands.name == "left hand - right hand"
    assert len(hands.frames) == 12
    path = PERSON.paths_from(hands.u)[hands.v]
    found = [hands.distance_source, hands.distance_result, hands.error]
    np.testing.assert_allclose(found, np.array([0.02, 0.06, 0.04]) / path)


def test_contact_error_of_regions_and_of_frames_agree():
    a, b = clapping(np.sin(np.linspace(0, np.pi, 20)) ** 2), clapping(np.sin(np.linspace(0, 3, 20)) ** 2)
    contacts = diff(a, b).comparison.contacts
    assert sum(len(touch.frames) for touch in contacts.touches) == contacts.counts.sum() > 0
    errors = sum(touch.error * len(touch.frames) for touch in contacts.touches)
    assert errors == pytest.approx((contacts.track.values * contacts.counts).sum())


def test_symmetric_metrics_do_not_change_when_a_and_b_are_exchanged():
    a, b = swaying(PERSON, seed=1), swaying(PERSON, seed=2)
    ab, ba = diff(a, b), diff(b, a)
    for key in ("stress", "direction_error"):
        np.testing.assert_allclose(ab.tracks[key].values, ba.tracks[key].values)
    for one, other in ((ab, ba), (ba, ab)):
        np.testing.assert_allclose(one.tracks["jerk"].values, other.comparison.source_tracks["jerk"].values)
    assert ab.stress.min() > 0


def test_size_and_place_do_not_matter():
    motion = swaying(PERSON)
    larger = moved(motion, Rotation.identity(), (3, 0, 1), 2.5)
    result = diff(motion, larger)
    for key in ("stress", "direction_error"):
        np.testing.assert_allclose(result.tracks[key].values, 0, atol=1e-5)
    np.testing.assert_allclose(result.tracks["jerk"].values, result.comparison.source_tracks["jerk"].values)
    result = diff(swaying(PERSON), swaying(other_lengths(PERSON)))
    np.testing.assert_allclose(result.tracks["direction_error"].values, 0, atol=1e-5)
    assert result.stress.min() > 0


@pytest.mark.parametrize(
    ("a", "b"), [((121, "0.016666667"), (241, "0.008333333")), ((241, "0.0083333"), (61, "0.03333333"))]
)
def test_other_frame_rates(a, b):
    result = diff(timed(*a), timed(*b))
    assert len(result) == pytest.approx(b[0], abs=2)
    assert result.a.frame_time == result.b.frame_time == float(b[1])
    assert "A was resampled from" in result.notes[0]
    assert result.stress.max() < 1e-4
    assert result.tracks["direction_error"].values.max() < 0.05


def test_frame_times_that_differ_in_digits_only_are_the_same():
    result = diff(timed(20, "0.0333333"), timed(20, "0.033333"))
    assert result.notes == ()
    assert result.stress.max() < 1e-12
    motion = swaying(person(), frames=600)
    slow, fast = (replace(motion, frame_time_text=text) for text in ("0.0417083", "0.0416667"))
    other = slow.resampled("0.0416667")
    assert diff(slow, other).tracks["direction_error"].values.mean() < 0.1
    assert "A was resampled" in diff(slow, other).notes[0]
    assert not diff(slow[:9], fast).notes[1:]


def test_the_longer_one_is_cut():
    motion = swaying(PERSON)
    for a, b in ((motion, motion[:7]), (motion[:7], motion)):
        result = diff(a, b)
        assert len(result) == len(result.a) == len(result.stress) == 7
        assert result.notes == (f"A has {len(a)} frames and B has {len(b)}; the first 7 were compared",)
        assert result.stress.max() < 1e-12


def test_no_contacts():
    result = diff(standing(APART), bent(5))
    assert not result.comparison.contacts.counts.any()
    assert result.comparison.contacts.touches == ()
    clap = clapping(np.sin(np.linspace(0, np.pi, 20)) ** 2)
    result = diff(clap, replace(clap, skeleton=lengthened(PERSON, {"Elbow": 1.3})))
    assert result.comparison.contacts.error.sum() > 0
    np.testing.assert_allclose(result.tracks["direction_error"].values, 0, atol=1e-5)


def touching(result):
    """The joints that may touch."""
    candidates = result.comparison.contacts.candidates
    return np.union1d(candidates.u, candidates.v)


def test_a_joint_that_one_of_them_has():
    tailed = with_bone(PERSON, "Tail", "Hips")
    result = diff(swaying(PERSON), swaying(tailed))
    assert result.matching.drivers[tailed.index("Tail")] == -1
    assert len(tailed) - 1 not in touching(result)
    motion = swaying(PERSON)
    swapped = diff(motion, motion, {"LeftElbow": None})
    assert swapped.matching.drivers[PERSON.index("LeftElbow")] == -1
    assert PERSON.index("LeftElbow") not in touching(swapped)


def test_z_up_against_y_up():
    motion = sample("squat")
    result = diff(motion, World("Y", "Z", "replaced").turned(motion))
    assert result.notes == ("A was turned: Y is up in A, Z in B",)
    np.testing.assert_allclose(result.up, [0, 0, 1])
    np.testing.assert_allclose(result.tracks["direction_error"].values, 0, atol=1e-5)
    np.testing.assert_allclose(result.metrics["result"]["foot_height"], 0.0, atol=1e-9)


def test_a_root_offset_that_is_added():
    motion = sample("walk")[:40]
    offsets = np.array(motion.skeleton.offsets)
    offsets[0] = [0, motion.root_positions[:, 1].mean(), 0]
    path = motion.root_positions - offsets[0]
    added = replace(motion, skeleton=motion.skeleton.with_offsets(offsets), root_positions=path)
    for a, b in ((motion, added), (added, motion)):
        np.testing.assert_allclose(diff(a, b).metrics["result"]["foot_height"], 0.0, atol=1e-9)


@pytest.mark.parametrize("rig", ["mixamo_a", "unreal_t"])
def test_a_retargeted_clip_has_the_metrics_of_its_run(rig):
    source = sample("clap")[:30]
    run = retarget(source, sample_target(f"rigs/{rig}").skeleton)
    result = diff(source, run.motion)
    np.testing.assert_array_equal(result.matching.drivers, run.matching.drivers)
    np.testing.assert_allclose(result.stress, run.written_stress)
    assert result.tracks["direction_error"].values.mean() < 10


def test_what_cannot_be_compared():
    motion = swaying(PERSON)
    with pytest.raises(MotionError, match="A has no frames"):
        diff(motion[:0], motion)
    with pytest.raises(MotionError, match="B has positions beyond"):
        diff(motion, replace(motion, root_positions=motion.root_positions * 1e101))
    with pytest.raises(MotionError, match="no bone of B has a length"):
        diff(motion, moved(motion, Rotation.identity(), scale=0.0))
    with pytest.raises(MapError, match="Tail"):
        diff(motion, motion, {"Tail": "Hips"})
    block = posed(PERSON.with_offsets(PERSON.offsets), {}, np.zeros((3, 3)))
    strange = replace(block, skeleton=nameless(PERSON))
    with pytest.raises(MatchingError):
        diff(motion, strange, {f"j{k}": None for k in range(len(PERSON))})


def test_resampling_a_steady_motion_keeps_it_steady():
    times = np.arange(11) * 0.1
    motion = posed(PERSON, {"LeftHip": np.outer(times, UP)}, np.outer(times, ALONG), "0.1")
    other = motion.resampled("0.03")
    wanted = np.arange(34) * 0.03
    assert len(other) == 34
    np.testing.assert_allclose(other.root_positions, np.outer(wanted, ALONG), atol=1e-12)
    turns = Rotation.from_quat(other.rotations[:, PERSON.index("LeftHip")]).as_rotvec()
    np.testing.assert_allclose(turns, np.outer(wanted, UP), atol=1e-12)


@pytest.mark.parametrize(("text", "frames"), [("0.1", 11), ("0.05", 21), ("0.2", 6), ("0.3", 4), ("2", 1)])
def test_resampling_keeps_within_the_clip(text, frames):
    motion = posed(PERSON, {}, np.outer(np.arange(11) * 0.1, ALONG), "0.1")
    other = motion.resampled(text)
    assert len(other) == frames
    assert other.frame_time_text == text
    np.testing.assert_allclose(other.root_positions[-1], (frames - 1) * float(text) * ALONG, atol=1e-12)


def test_rotations_are_resampled_the_short_way():
    turns = np.radians([[0, 170, 0], [0, 190, 0]])
    motion = posed(PERSON, {"Hips": turns}, np.zeros((2, 3)), "0.1")
    between = Rotation.from_quat(motion.resampled("0.05").world_rotations[1, 0]).magnitude()
    assert np.degrees(between) == pytest.approx(180)


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
    tipped = [World("Y", "Z", "replaced").turned(motion) for motion in handshake()]
    performers = [diff(a, b, a_up="Y", b_up="Z") for a, b in zip(handshake(), tipped, strict=True)]
    assert diff_scenes(performers).mean_gaps[2] == pytest.approx(0, abs=1e-9)
    twice = [scaled(motion, 2.0) for motion in handshake()]
    found = measured(handshake(), twice)
    assert found.world_scale == pytest.approx(2)
    assert found.mean_gaps[2] == pytest.approx(0, abs=1e-9)
    assert measured(handshake(), twice, world_scale=4).gaps[0].b == pytest.approx(found.gaps[0].a / 2)


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
