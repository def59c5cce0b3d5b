"""What a result does that its rotation copy does not: turns, shaking and pops of a known size."""

from dataclasses import replace
from functools import partial

import bodies
import numpy as np
import pytest
from bodies import LEG, PERSON, UP, body_of, clapping, matched, posed, with_bone
from scipy.spatial.transform import Rotation
from skeleton_edits import in_axes

from distretarget.measure.comparison import AROUND, Reference, find_arm_deviation, find_pops, find_shaking, find_turned
from distretarget.measure.metrics import BY_KEY, Track

FRAMES = 120
TIME = 0.02  # between the frames of `posed` [s]
ONE_SHOT = np.zeros(FRAMES, np.intp)


standing = partial(bodies.standing, frames=FRAMES, height=LEG)


def turned_by(joint, degrees):
    return standing({joint: np.radians(degrees) * np.array([0.0, 0.0, 1.0])})


@pytest.mark.parametrize(("joint", "degrees"), [("Head", 30.0), ("LeftWrist", 90.0), ("Chest2", 10.0)])
def test_a_part_is_turned_by_the_angle_from_the_copy_to_the_result(joint, degrees):
    track = find_turned(standing(), turned_by(joint, degrees), body_of(standing()))
    assert joint in track.parts
    np.testing.assert_allclose(track.values[:, track.parts.index(joint)], degrees)


def arm_deviation(source, copy, result):
    reference = Reference(source, matched(source, source), UP)
    return find_arm_deviation(copy, result, body_of(source), *map(reference.compare, (copy, result)))


def test_an_arm_is_turned_without_need_unless_the_source_touches_something_with_it():
    still, out = standing(), turned_by("LeftShoulder", 20.0)
    track = arm_deviation(still, still, out)
    assert track.counts.all()
    np.testing.assert_allclose(track.values, np.tile([20.0, 0.0], (FRAMES, 1)), atol=1e-6)
    # two hands meet for a moment: both arms may turn then, and for a while before and after
    clap = clapping(np.exp(-(((np.arange(200) - 100) / 8.0) ** 2)))
    frames = np.flatnonzero(Reference(clap, matched(clap, clap), UP).compare(clap).contacts.counts)
    assert 0 < len(frames) < 40
    near = np.abs(np.arange(200)[:, None] - frames).min(axis=1) <= int(AROUND / TIME)
    np.testing.assert_array_equal(arm_deviation(clap, clap, clap).counts, np.repeat(~near[:, None], 2, axis=1))


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
    for tracks in (compared.tracks, compared.source_tracks):
        np.testing.assert_allclose(tracks["hips_acceleration"].values, 0.9, rtol=1e-6)


def test_a_trunk_that_leans_is_tilted_by_as_much_and_a_body_that_is_built_otherwise_is_not():
    upright = standing()
    lean = np.radians(12.0) * np.array([1.0, 0.0, 0.0])
    leaning = posed(PERSON, {"Hips": lean}, np.zeros((FRAMES, 3)) + LEG * UP)
    tilt = Reference(upright, matched(upright, upright), UP).compare(leaning).tracks["trunk_tilt"]
    np.testing.assert_allclose(tilt.values, 12.0, atol=1e-6)
    offsets = np.array(PERSON.offsets)
    for side in ("Left", "Right"):
        offsets[PERSON.index(f"{side}Collar")] += [0.0, 0.0, -0.05]
    stooped = PERSON.with_offsets(offsets)
    turned = Rotation.from_rotvec(lean).as_rotvec()
    other = posed(stooped, {"Hips": turned}, np.zeros((FRAMES, 3)) + LEG * UP)
    tilt = Reference(leaning, matched(leaning, stooped), UP).compare(other).tracks["trunk_tilt"]
    assert tilt.values.max() < 1.0


def test_a_trunk_is_not_compared_where_a_rest_pose_shows_no_standing_body():
    jumbled = in_axes(standing(), Rotation.random(len(PERSON), random_state=3))
    compared = Reference(jumbled, matched(jumbled, PERSON), UP).compare(standing())
    assert compared.tracks["trunk_tilt"].values.shape == (FRAMES, 0)


def carried(path, body=PERSON, frame_time="0.0166666667"):
    """A body carried along x by a path [leg lengths]."""
    return posed(body, {}, np.outer(np.asarray(path) * LEG, [1.0, 0, 0]), frame_time)


def jumps_of(copy, result, body=PERSON):
    return find_pops(copy, result, body_of(body), body_of(body).shots_of(copy))


def test_pops_are_counted_by_frames():
    found = jumps_of(carried([0] * 9), carried(np.repeat([0.0, 0.1, 0.2], 3)))
    assert BY_KEY["pop"].of_clip({"pop": Track(found)}) == 2
    np.testing.assert_array_equal(BY_KEY["pop"].over_time({"pop": Track(found)}, 9), [0, 0, 1, 0, 0, 1, 0, 0, np.nan])


def test_what_is_no_part_of_the_body_does_not_pop():
    body = with_bone(PERSON, "Tail", "Hips")
    assert body_of(body).regions.of_joint[-1] == -1
    turns = {"Tail": np.array([[0.0, 0, 0], [np.pi / 2, 0, 0]])}
    longer = with_bone(body, "Tip", "Tail")
    result = posed(longer, turns, np.zeros((2, 3)))
    assert not jumps_of(posed(longer, {}, np.zeros((2, 3))), result, longer).any()


WALKED = 0.05 * np.arange(10.0)


def pops_of(path, frame_time="0.0166666667"):
    """The frames in which a body pops whose path should be `WALKED`, and goes elsewhere by a path [leg lengths]."""
    copy, result = (carried(each, frame_time=frame_time) for each in (WALKED, WALKED + path))
    found = jumps_of(copy, result)
    assert found.shape == (9, len(PERSON))
    return np.flatnonzero(found.any(axis=1)).tolist()


@pytest.mark.parametrize(
    ("path", "frames"),
    [
        (np.zeros(10), []),
        (np.repeat([0.0, 0.05], 5), [4]),
        (np.repeat([0.0, 0.03], 5), []),
        (np.repeat([0.05, 0.0], [1, 9]), [0]),
        (np.repeat([0.0, 0.05], [9, 1]), [8]),
        (np.where(np.arange(10) == 5, 0.06, 0.0), [4, 5]),  # there and back
        (0.06 * np.arange(10.0), []),  # as far in every frame
        (np.array([0, 0, 0.02, 0.04, 0.06, 0.11, 0.13, 0.15, 0.17, 0.17]), []),  # twice as far as in those around
    ],
)
def test_a_pop_is_far_and_sudden_though_the_joint_moves(path, frames):
    assert pops_of(path) == frames


def test_nothing_pops_at_a_jump_of_the_source_a_cut_or_in_one_frame_at_any_rate():
    step = np.repeat([0.0, 0.05], 5)
    assert pops_of(0.7 * step, "0.0083333") == [4]
    assert pops_of(1.4 * step, "0.0333333") == []
    jump = np.repeat([0.0, 0.1], 5)
    copy, result = carried(WALKED / 10 + jump), carried(WALKED / 10 + 1.5 * jump)
    assert not jumps_of(copy, result).any()
    assert not jumps_of(carried(WALKED / 10 + 0.5 * jump), result).any()
    assert np.flatnonzero(jumps_of(carried(WALKED / 10), result).any(axis=1)).tolist() == [4]
    about = {"Hips": np.repeat([[0.0, 0, 0], [0, np.pi, 0]], 4, axis=0)}
    step = np.outer(np.repeat([0.0, 0.1], 4), [LEG, 0, 0])
    copy, result = posed(PERSON, about, np.zeros((8, 3))), posed(PERSON, about, step)
    assert not jumps_of(copy, result).any()
    assert jumps_of(posed(PERSON, {}, np.zeros((8, 3))), posed(PERSON, {}, step)).any()
    found = jumps_of(carried([0]), carried([0]))
    assert found.shape == (0, len(PERSON))
    assert BY_KEY["pop"].of_clip({"pop": Track(found)}) is None
