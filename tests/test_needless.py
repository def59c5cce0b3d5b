"""What a result does that its rotation copy does not: turns and shaking of a known size."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import LEG, PERSON, UP, body_of, clapping, matched, posed
from scipy.spatial.transform import Rotation
from skeleton_edits import in_axes

from distretarget.measure.comparison import Reference
from distretarget.measure.needless import AROUND, find_needless, find_shaking, find_turned

FRAMES = 120
TIME = 0.02  # between the frames of `posed` [s]
ONE_SHOT = np.zeros(FRAMES, np.intp)


def standing(turns=None, path=0.0):
    return posed(PERSON, turns or {}, np.zeros((FRAMES, 3)) + LEG * UP + path)


def turned_by(joint, degrees):
    return standing({joint: np.radians(degrees) * np.array([0.0, 0.0, 1.0])})


@pytest.mark.parametrize(("joint", "degrees"), [("Head", 30.0), ("LeftWrist", 90.0), ("Chest2", 10.0)])
def test_a_part_is_turned_by_the_angle_from_the_copy_to_the_result(joint, degrees):
    track = find_turned(standing(), turned_by(joint, degrees), body_of(standing()))
    assert joint in track.parts
    np.testing.assert_allclose(track.values[:, track.parts.index(joint)], degrees)


def needless(source, copy, result):
    reference = Reference(source, matched(source, source), UP)
    return find_needless(copy, result, body_of(source), *map(reference.compare, (copy, result)))


def test_an_arm_is_turned_without_need_unless_the_source_touches_something_with_it():
    still, out = standing(), turned_by("LeftShoulder", 20.0)
    track = needless(still, still, out)
    assert track.counts.all()
    np.testing.assert_allclose(track.values, np.tile([20.0, 0.0], (FRAMES, 1)), atol=1e-6)
    # two hands meet for a moment: both arms may turn then, and for a while before and after
    clap = clapping(np.exp(-(((np.arange(200) - 100) / 8.0) ** 2)))
    frames = np.flatnonzero(Reference(clap, matched(clap, clap), UP).compare(clap).contacts.counts)
    assert 0 < len(frames) < 40
    near = np.abs(np.arange(200)[:, None] - frames).min(axis=1) <= int(AROUND / TIME)
    np.testing.assert_array_equal(needless(clap, clap, clap).counts, np.repeat(~near[:, None], 2, axis=1))


def test_shaking_is_what_goes_on_and_no_single_jump():
    copy = standing(path=np.outer(np.arange(FRAMES) * TIME, [1.0, 0.0, 0.0]))
    there_and_back = np.outer(0.01 * LEG * (-1.0) ** np.arange(FRAMES), [0.0, 0.0, 1.0])
    shaken = replace(copy, root_positions=copy.root_positions + there_and_back)
    found = find_shaking(copy, shaken, body_of(copy), ONE_SHOT)
    np.testing.assert_allclose(found, 2.0 * (TIME * 60) ** -2, rtol=1e-6)
    jump = np.where(np.arange(FRAMES) >= 50, 1.0, 0.0)[:, None] * there_and_back[0]
    jumped = replace(copy, root_positions=copy.root_positions + jump)
    assert not find_shaking(copy, jumped, body_of(copy), ONE_SHOT).max() > 1e-9
    assert not find_shaking(copy, copy, body_of(copy), ONE_SHOT).any()


def test_a_jolt_of_the_hips_has_the_acceleration_of_its_path():
    half = 0.5 * 0.9 * (np.arange(FRAMES) * TIME) ** 2
    falling = standing(path=-np.outer(half * LEG, UP))
    compared = Reference(falling, matched(falling, falling), UP).compare(falling)
    np.testing.assert_allclose(compared.hips_acceleration, 0.9, rtol=1e-6)
    np.testing.assert_array_equal(compared.hips_acceleration, compared.hips_acceleration_source)


def test_a_trunk_that_leans_is_tilted_by_as_much_and_a_body_that_is_built_otherwise_is_not():
    upright = standing()
    lean = np.radians(12.0) * np.array([1.0, 0.0, 0.0])
    leaning = posed(PERSON, {"Hips": lean}, np.zeros((FRAMES, 3)) + LEG * UP)
    _, error = Reference(upright, matched(upright, upright), UP).compare(leaning).posture["trunk_tilt"]
    np.testing.assert_allclose(error, 12.0, atol=1e-6)
    offsets = np.array(PERSON.offsets)
    for side in ("Left", "Right"):
        offsets[PERSON.index(f"{side}Collar")] += [0.0, 0.0, -0.05]
    stooped = PERSON.with_offsets(offsets)
    turned = Rotation.from_rotvec(lean).as_rotvec()
    other = posed(stooped, {"Hips": turned}, np.zeros((FRAMES, 3)) + LEG * UP)
    _, error = Reference(leaning, matched(leaning, stooped), UP).compare(other).posture["trunk_tilt"]
    assert error.max() < 1.0


def test_a_trunk_is_not_compared_where_a_rest_pose_shows_no_standing_body():
    jumbled = in_axes(standing(), Rotation.random(len(PERSON), random_state=3))
    compared = Reference(jumbled, matched(jumbled, PERSON), UP).compare(standing())
    assert compared.posture["trunk_tilt"][1].shape == (FRAMES, 0)
