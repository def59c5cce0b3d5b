"""Metrics and directions of bones, on clips whose metrics are known by construction."""

from functools import cache, partial

import numpy as np
import pytest
from bodies import (
    APART,
    PERSON,
    UP,
    clapping,
    lengthened,
    matched,
    moved,
    posed,
    standing,
    swaying,
    tree_of,
)
from scipy.spatial.transform import Rotation

from distretarget import Motion, Options, Skeleton, retarget
from distretarget.measure.comparison import Reference, direction_error, expected_directions, shared_bones
from distretarget.measure.metrics import clip_metrics

TIME = 0.02


def chain(lengths):
    """A chain along x."""
    return tree_of(np.outer([0, *lengths], [1.0, 0, 0]), "abcdefgh"[: len(lengths) + 1])


def squared(last, frames=4):
    """Four bones of a square; the last has the given length, and e coincides with a if that is 1."""
    quarter = np.array([0.0, 0.0, np.pi / 2])
    return posed(chain([1, 1, 1, last]), dict.fromkeys("bcd", quarter), np.zeros((frames, 3)))


def compared(source, result, up=UP):
    return Reference(source, matched(source.rigid_skeleton, result.skeleton), up).compare(result)


def of_clip(comparison):
    """The metrics of the clip, those of the source with a suffix."""
    source = {f"{key}_source": value for key, value in clip_metrics(comparison.source_tracks).items()}
    return clip_metrics(comparison.tracks) | source


def test_direction_error_is_the_angle_between_bones():
    source = squared(1.0)
    turned = moved(source, Rotation.from_euler("z", 10, degrees=True))
    metrics = compared(source, turned)
    np.testing.assert_allclose(metrics.tracks["direction_error"].values, np.full((4, 4), 10.0))
    np.testing.assert_allclose(metrics.tracks["turn"].values, 0.0, atol=1e-9)
    opposite = moved(source, Rotation.from_euler("z", 180, degrees=True))
    np.testing.assert_allclose(compared(source, opposite).tracks["direction_error"].values, 180.0)


def test_direction_error_of_one_joint_is_that_of_the_bones_below_it():
    source = standing(APART)
    result = standing(APART | {"LeftElbow": np.radians([0, 0, 40.0])})
    metrics = compared(source, result)
    assert metrics.tracks["direction_error"].values.shape == (30, len(PERSON) - 1)
    errors = dict(zip(PERSON.names[1:], metrics.tracks["direction_error"].values[3], strict=True))
    bent = {"LeftWrist": 40.0, "LeftWrist_End": 40.0}
    assert errors == pytest.approx(dict.fromkeys(PERSON.names[1:], 0.0) | bent, abs=1e-6)
    assert of_clip(metrics)["direction_error_p99"] == pytest.approx(40.0)
    assert of_clip(metrics)["direction_error"] == pytest.approx(80 / (len(PERSON) - 1))


def test_jerk_is_the_third_difference_over_the_size_of_the_body():
    frames = np.arange(12)
    source = posed(chain([1, 2, 1]), {}, np.outer(0.01 * frames**3, [0.6, 0.8, 0]), str(TIME))
    metrics = compared(source, source)
    np.testing.assert_allclose(metrics.tracks["jerk"].values, np.full(9, 0.06 / (4 * TIME**3)))
    even = posed(chain([1, 2, 1]), {}, np.outer(frames**2, [1.0, 0, 0]), str(TIME))
    np.testing.assert_allclose(compared(even, even).tracks["jerk"].values, 0.0, atol=1e-6)


def test_turn_is_how_much_more_a_joint_turns_than_in_the_source():
    frames = np.arange(10)
    slow, fast = (standing(APART | {"LeftElbow": np.outer(np.radians(a) * frames, UP)}, 10) for a in (2, 5))
    metrics = compared(slow, fast)
    turned = [PERSON.index(name) for name in ("LeftElbow", "LeftWrist", "LeftWrist_End")]
    assert metrics.tracks["turn"].values.shape == (9, len(PERSON))
    np.testing.assert_allclose(metrics.tracks["turn"].values[:, turned], 3.0 / 60 / TIME)
    np.testing.assert_allclose(np.delete(metrics.tracks["turn"].values, turned, axis=1), 0.0, atol=1e-6)
    assert of_clip(compared(slow, fast))["turn"] == pytest.approx(3.0 / 60 / TIME)
    assert of_clip(compared(fast, slow))["turn"] == pytest.approx(0.0, abs=1e-6)


@cache
def pair():
    source = clapping(np.sin(np.linspace(0, np.pi, 40)) ** 2)
    return source, retarget(source, lengthened(PERSON, {"Wrist": 1.5, "Knee": 0.8}), Options(supports="free"))


def assert_same(values, expected):
    missing = {key for key, value in expected.items() if value is None}
    assert {key for key, value in values.items() if value is None} == missing
    for key in expected.keys() - missing:
        assert values[key] == pytest.approx(expected[key], rel=1e-6, abs=1e-6), key


SIDEWAYS = Rotation.from_euler("x", 90, degrees=True)
MOVED = {  # of source and result, and what is up then
    "units": (
        partial(moved, turn=Rotation.identity(), scale=39.37),
        partial(moved, turn=Rotation.identity(), scale=0.01),
        UP,
    ),
    "place and heading": (*[partial(moved, turn=Rotation.from_euler("y", 70, degrees=True), shift=(3, 0, -5))] * 2, UP),
    "axis that is up": (*[partial(moved, turn=SIDEWAYS)] * 2, SIDEWAYS.apply(UP)),
}


@pytest.mark.parametrize("what", MOVED)
def test_metrics_do_not_depend_on(what):
    source, result = pair()
    expected = of_clip(compared(source, result.motion))
    assert min(expected[name] for name in ("contact_error", "direction_error")) > 0
    move_source, move_result, up = MOVED[what]
    assert_same(of_clip(compared(move_source(source), move_result(result.motion), up)), expected)


def test_joints_that_are_no_part_of_the_body_count_for_nothing():
    source, result = pair()
    expected = of_clip(compared(source, result.motion))
    body = result.motion.skeleton
    tail = Skeleton(
        names=(*body.names, "Tail", "Tail_End"),
        parents=[*body.parents, 0, len(body)],
        offsets=[*body.offsets, (0, 0, -0.2), (0, 0, -0.2)],
        channels=(*body.channels, ("Zrotation", "Xrotation", "Yrotation"), ()),
        end_sites=[*body.end_sites, False, True],
    )
    wagging = np.zeros((40, 2, 3))
    wagging[:, 0, 1] = np.sin(np.arange(40))
    rotations = np.concatenate([result.motion.rotations, Rotation.from_rotvec(wagging).as_quat()], axis=1)
    translations = np.concatenate([result.motion.translations, np.tile(tail.offsets[-2:], (40, 1, 1))], axis=1)
    matching = matched(source.skeleton, tail)
    np.testing.assert_array_equal(matching.drivers, [*range(len(PERSON)), -1, -1])
    metrics = Reference(source, matching, UP).compare(Motion.of_translations(tail, translations, rotations, "0.02"))
    values = of_clip(metrics)
    assert_same(values, expected)
    assert metrics.tracks["turn"].values.shape == (39, len(body))


def test_joints_that_coincide_for_good_count_once():
    source = squared(1.0)
    body = chain([1, 1, 1, 1.4, 0])
    result = posed(body, dict.fromkeys("bcd", np.array([0, 0, np.pi / 2])), np.zeros((4, 3)))
    longer = posed(chain([1, 1, 1, 1, 0]), dict.fromkeys("bcd", np.array([0, 0, np.pi / 2])), np.zeros((4, 3)))
    metrics, expected = compared(longer, result), compared(source, squared(1.4))
    assert_same(of_clip(metrics), of_clip(expected))


def errors(source, result):
    """The mean error of each bone by the name of its lower joint."""
    matching = matched(source, result.skeleton)
    bones = shared_bones(matching)
    values = direction_error(expected_directions(source, matching), result, bones)
    assert values.shape == (len(source), len(PERSON) - 1)
    return dict(zip(PERSON.names[1:], values.mean(axis=0), strict=True))


def rebuilt(turns):
    """The person with the rest directions of some bones turned about z [degrees], by the name of the lower joint."""
    offsets = np.array(PERSON.offsets)
    for name, degrees in turns.items():
        joint = PERSON.index(name)
        offsets[joint] = Rotation.from_euler("z", degrees, degrees=True).apply(offsets[joint])
    return PERSON.with_offsets(offsets)


def test_bones_of_another_build_are_no_error_on_the_rotation_copy():
    """Sloping collar bones and shoulders, a bent neck: the rotations of the source belong to these bones too."""
    body = rebuilt({"LeftCollar": 20, "LeftShoulder": -15, "RightShoulder": 15, "Head": 10, "Chest2": 5})
    source = swaying(PERSON)
    found = errors(source, retarget(source, body).rotation_copy)
    assert max(found.values()) == pytest.approx(0.0, abs=1e-6)


def test_a_bone_of_another_build_is_measured_from_its_own_direction():
    body = rebuilt({"LeftShoulder": -15})
    source = swaying(PERSON, angle=0.0)
    shoulder, turn = body.index("LeftCollar"), np.radians([0, 0, 15.0])
    found = errors(source, posed(body, {"LeftCollar": turn}, source.root_positions, source.frame_time_text))
    assert found["LeftShoulder"] == pytest.approx(15.0)
    assert body.parents[body.index("LeftShoulder")] == shoulder


def test_arms_and_legs_point_as_the_sources_do():
    """An A-pose body whose arms hang where the source's are spread is off by the angle between them."""
    body = rebuilt({"LeftElbow": -40, "RightElbow": 40})
    source = swaying(PERSON, angle=0.0)
    found = errors(source, posed(body, {}, source.root_positions, source.frame_time_text))
    assert found["LeftElbow"] == pytest.approx(40.0)
    assert found["LeftKnee"] == pytest.approx(0.0, abs=1e-6)
    assert max(errors(source, retarget(source, body).rotation_copy).values()) == pytest.approx(0.0, abs=1e-6)
