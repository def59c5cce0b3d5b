"""Edits of clips: cut out, faster, mirrored, turned, and as loops."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES, paths_of, person, sample, sample_target, swaying, tree_of
from program import run, succeeded
from scipy.spatial.transform import Rotation

from distretarget import (
    Edits,
    Motion,
    MotionError,
    Options,
    SettingsError,
    at_speed,
    load_target,
    looped,
    mirrored,
    read_bvh,
    retarget,
    trimmed,
    turned,
    write_bvh,
)
from distretarget.pipeline.edits import carry_of
from distretarget.skeleton import Skeleton

SIDES = re.compile("Left|Right")
WALK = sample("walk")


def size(motion):
    return np.ptp(motion.positions[0], axis=0).max()


def other_side(skeleton: Skeleton):
    """The joint of the other name for each joint."""
    names = [SIDES.sub(lambda found: "Right" if found[0] == "Left" else "Left", name) for name in skeleton.names]
    return [skeleton.index(name) for name in names]


@pytest.mark.parametrize(
    ("start", "end", "frames"),
    [
        (None, None, (0, 249)),
        (1.0, 2.0, (60, 121)),
        ("60f", "120f", (60, 121)),
        ("10f", None, (10, 249)),
        (None, "3f", (0, 4)),
        (0.0, 0.0, (0, 1)),
        (None, 100.0, (0, 249)),
    ],
)
def test_frames_from_one_time_to_another_are_kept(start, end, frames):
    part = trimmed(WALK, start, end)
    np.testing.assert_array_equal(part.rotations, WALK.rotations[slice(*frames)])
    assert part.frame_time_text == WALK.frame_time_text


@pytest.mark.parametrize(("start", "end"), [(2.0, 1.0), (100.0, None), ("400f", None)])
def test_where_there_is_no_frame_an_error_says_how_long_the_clip_is(start, end):
    with pytest.raises(MotionError, match=r"has no frame from .* s; it lasts 4\.13"):
        trimmed(WALK, start, end)
    assert len(mirrored(WALK[:0])) == 0


@pytest.mark.parametrize("edit", [{"start": "x"}, {"end": -1.0}, {"speed": 0.0}, {"turn": np.nan}, {"mirror": 1}])
def test_values_that_are_none_are_refused(edit):
    with pytest.raises(SettingsError, match=next(iter(edit))):
        Edits(**edit)


def test_a_mirrored_a_turned_and_a_faster_body_are_where_they_are_to_be():
    sides = other_side(WALK.skeleton)
    np.testing.assert_allclose(
        mirrored(WALK).positions, WALK.positions[:, sides] * [-1.0, 1.0, 1.0], atol=1e-9 * size(WALK)
    )
    expected = Rotation.from_euler("Y", 90, degrees=True).apply(WALK.positions.reshape(-1, 3))
    np.testing.assert_allclose(turned(WALK, 90.0).positions.reshape(-1, 3), expected, atol=1e-9 * size(WALK))
    fast = at_speed(WALK, 2.0)
    assert fast.frame_time_text == WALK.frame_time_text
    np.testing.assert_allclose(fast.positions, WALK.positions[::2], atol=1e-6 * size(WALK))


@pytest.mark.parametrize("seed", range(3))
def test_mirrored_twice_is_the_same_also_where_sides_differ(seed):
    body = person()
    lengths = body.lengths * np.random.default_rng(seed).uniform(0.7, 1.4, len(body))
    motion = swaying(body.with_lengths(lengths), seed=seed)
    np.testing.assert_allclose(mirrored(mirrored(motion)).positions, motion.positions, atol=1e-9 * paths_of(body).max())


@pytest.mark.parametrize("target", ["child.json", "rigs/unreal_a.json", "rigs/mixamo_t.json"])
def test_mirror_and_turn_may_come_before_or_after_retargeting(target):
    body = load_target(SAMPLES / target)
    skeleton = body.skeleton
    seen = [joint for joint, name in enumerate(skeleton.names) if not name.startswith("ik_")]
    for edit in (mirrored, lambda motion: turned(motion, 73.0)):
        before, after = retarget(edit(WALK), body).motion, edit(retarget(WALK, body).motion)
        off = np.abs(before.positions - after.positions)[:, seen].max()
        assert off < 1e-3 * size(after)


def test_a_loop_of_a_body_that_stays_closes():
    squat = sample("squat")
    loop = looped(squat)
    steps = np.linalg.norm(np.diff(loop.positions, axis=0), axis=2)
    assert np.linalg.norm(loop.positions[0] - loop.positions[-1], axis=1).max() < 1.5 * steps[[0, -1]].max()
    middle = slice(len(squat) // 3, -len(squat) // 3)
    np.testing.assert_allclose(loop.positions[middle], squat.positions[middle], atol=1e-9 * size(squat))


def test_a_walk_goes_on_from_round_to_round():
    part = trimmed(WALK, "60f", "130f")
    loop = looped(part)
    on = (part.positions[-1, 0] - part.positions[0, 0]) * [1.0, 0.0, 1.0]
    turn = Rotation.from_quat(part.rotations[-1, 0]) * Rotation.from_quat(part.rotations[0, 0]).inv()
    heading = Rotation.from_rotvec(turn.as_rotvec() * [0.0, 1.0, 0.0])
    place = part.root_positions[0]
    following = heading.apply(loop.positions[:2].reshape(-1, 3) - place).reshape(2, -1, 3) + place + on
    seam = np.concatenate([loop.positions[-2:], following])
    speeds = np.diff(seam, axis=0)
    usual = np.linalg.norm(np.diff(part.positions, axis=0), axis=2).max()
    assert np.linalg.norm(speeds, axis=2).max() < 1.5 * usual
    jolts = np.linalg.norm(np.diff(speeds, axis=0), axis=2).max()
    assert jolts < 2.0 * np.linalg.norm(np.diff(part.positions, 2, axis=0), axis=2).max()


def hopping(heights):
    """The body, whose root is at these heights."""
    body = person()
    places = body.rest_positions[0] + np.outer(heights, [0.0, 1.0, 0.0])
    return Motion(body, places, np.tile(body.rest_rotations, (len(heights), 1, 1)), "0.0333333")


def test_what_is_a_loop_already_stays():
    heights = 0.1 * np.sin(2 * np.pi * np.arange(60) / 60)
    loop = looped(hopping(heights))
    step = np.abs(np.diff(heights)).max()
    np.testing.assert_allclose(loop.root_positions[:, 1] - person().rest_positions[0, 1], heights, atol=0.02 * step)


def test_both_sides_of_a_seam_have_one_speed():
    heights = 0.1 * np.abs(np.sin(np.pi * np.arange(60) / 60))  # down before the seam, up after it
    made = looped(hopping(heights)).root_positions[:, 1]
    before, after = ((each[-1] - each[-2], each[1] - each[0]) for each in (heights, made))
    assert before[1] - before[0] > 0.009
    assert abs(after[1] - after[0]) < 0.2 * (before[1] - before[0])
    assert abs(made[0] - made[-1]) < 0.002


@pytest.mark.parametrize("skew", [0.0, 0.02])
def test_mirror_and_retargeting_commute_as_far_as_the_sides_of_the_source_are_alike(skew):
    body, target = person(), sample_target("child")
    lengths = body.lengths * np.where([name.startswith("Left") for name in body.names], 1.0 + skew, 1.0)
    motion = swaying(body.with_lengths(lengths), seed=1)
    before, after = retarget(mirrored(motion), target).motion, mirrored(retarget(motion, target).motion)
    off = np.abs(before.positions - after.positions).max() / size(after)
    assert off < 2.0 * skew + 1e-6


@pytest.mark.parametrize("clip", ["clap", "hands_on_hips"])
def test_skin_of_a_body_whose_sides_are_alike_treats_them_alike(clip):
    target, motion = sample_target("hero"), sample(clip)
    before, after = retarget(mirrored(motion), target).motion, mirrored(retarget(motion, target).motion)
    without = retarget(motion, target, Options(skin="none")).motion
    bent = np.abs(mirrored(without).positions - after.positions).max()
    assert np.abs(before.positions - after.positions).max() < 1e-4 * bent


def test_a_loop_takes_four_frames_and_a_mirror_a_human_body():
    with pytest.raises(MotionError, match="at least 4"):
        looped(WALK[:3])
    motion = swaying(tree_of(np.eye(3)), 5)
    with pytest.raises(MotionError, match="left and right"):
        mirrored(motion)


def test_the_command_makes_what_the_functions_make(tmp_path):
    path, out = tmp_path / "walk.bvh", tmp_path / "out.bvh"
    write_bvh(path, WALK)
    target = str(SAMPLES / "child.json")
    edits = ["--start", "20f", "--end", "2.5", "--mirror", "--turn", "40", "--speed", "0.8", "--loop"]
    succeeded(path, target, "-o", out, *edits)
    edited = looped(turned(mirrored(at_speed(trimmed(read_bvh(path), "20f", 2.5), 0.8)), 40.0))
    expected = retarget(edited, load_target(target), Options()).motion
    np.testing.assert_allclose(read_bvh(out).positions, expected.positions, atol=1e-4 * size(WALK))


def test_a_batch_retargets_again_what_is_edited_otherwise(tmp_path):
    (tmp_path / "in").mkdir()
    write_bvh(tmp_path / "in" / "walk.bvh", WALK[:40])
    command = ["batch", str(tmp_path / "in"), str(SAMPLES / "child.json"), "-o", str(tmp_path / "out"), "--jobs", "1"]
    for edits, converted in (([], 1), (["--mirror"], 1), (["--mirror"], 0)):
        assert f"{converted} converted" in succeeded(*command, *edits).stdout


@pytest.fixture(scope="module")
def waltz():
    """Two dancers, the second of whom has the axes of her rest pose turned, so that she faces elsewhere in it."""
    lead, follower = (read_bvh(SAMPLES / "scenes" / "waltz" / f"{name}.bvh") for name in ("lead", "follower"))
    turn, skeleton = Rotation.from_euler("y", 70, degrees=True), follower.skeleton
    rotations = (Rotation.from_quat(follower.rotations.reshape(-1, 4)) * turn.inv()).as_quat()
    local = (turn * Rotation.from_quat(rotations)).as_quat().reshape(follower.rotations.shape)
    local[:, 0] = rotations.reshape(local.shape)[:, 0]
    turned_rest = replace(skeleton, offsets=turn.apply(np.array(skeleton.offsets)))
    same = replace(follower, skeleton=turned_rest, rotations=local)
    np.testing.assert_allclose(same.positions, follower.positions, atol=1e-6 * size(follower))
    return lead, same


def apart(one, other):
    """(frames, joints, joints), how far the joints of two dancers are apart."""
    return np.linalg.norm(one.positions[:, :, None] - other.positions[:, None], axis=3)


def test_dancers_that_are_turned_or_mirrored_stay_as_far_apart(waltz):
    before = apart(*waltz)
    turned_by = Rotation.from_euler("y", 40, degrees=True)
    for one, motion in zip(Edits(turn=40.0).together(waltz), waltz, strict=True):
        np.testing.assert_allclose(
            one.positions,
            turned_by.apply(motion.positions.reshape(-1, 3)).reshape(one.positions.shape),
            atol=1e-6 * size(motion),
        )
    mirror = Edits(mirror=True)
    sides = [other_side(motion.skeleton) for motion in waltz]
    np.testing.assert_allclose(
        apart(*mirror.together(waltz)), before[:, sides[0]][:, :, sides[1]], atol=0.01 * size(waltz[0])
    )
    for again, motion in zip(mirror.together(mirror.together(waltz)), waltz, strict=True):
        np.testing.assert_allclose(again.positions, motion.positions, atol=1e-6 * size(motion))


def test_dancers_are_cut_and_sped_up_alike_and_go_on_from_round_to_round_together(waltz):
    lead, follower = Edits(end="60f", speed=2.0).together(waltz)
    assert len(lead) == len(follower) == 31
    np.testing.assert_allclose(apart(lead, follower)[5], apart(*waltz)[10], atol=1e-6 * size(waltz[0]))
    part = Edits(end="60f").together(waltz)
    turn, shift = carry_of(part[0])
    for dancer, motion in zip(Edits(end="60f", loop=True).together(waltz), part, strict=True):
        ahead = turn.apply(dancer.positions[0]) + shift
        steps = np.linalg.norm(np.diff(motion.positions, axis=0), axis=2).max()
        assert np.linalg.norm(ahead - dancer.positions[-1], axis=1).max() < 1.5 * steps


def test_props_turn_with_their_performers_and_are_not_mirrored(waltz):
    staff, table = (tree_of([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) for _ in range(2))
    moving, still = swaying(staff, len(waltz[0])), swaying(table, 1)
    before = np.linalg.norm(waltz[0].positions - moving.positions[:, :1], axis=2)
    *dancers, staff, table = Edits(turn=90.0, end="9f", loop=True).together(waltz, [moving, still])
    assert [len(each) for each in (*dancers, staff, table)] == [10, 10, 10, 1]
    middle = np.linalg.norm(dancers[0].positions - staff.positions[:, :1], axis=2)[5]
    assert middle == pytest.approx(before[5], abs=0.02 * size(waltz[0]))
    np.testing.assert_allclose(
        table.positions[0, 0], Rotation.from_euler("y", 90, degrees=True).apply(still.positions[0, 0])
    )
    with pytest.raises(SettingsError, match="props have no left and right"):
        Edits(mirror=True).together(waltz, [still])


def test_a_scene_is_edited_by_its_options_and_by_its_file(tmp_path):
    folder = SAMPLES / "scenes" / "waltz"
    scene = json.loads((folder / "scene.json").read_text())
    for performer in scene["performers"]:
        for key in ("source", "target"):
            performer[key] = str((folder / performer[key]).resolve())
    how = {"end": "50f", "speed": 2, "mirror": True, "turn": 30, "loop": True}
    (tmp_path / "scene.json").write_text(json.dumps(scene | how))
    files = [each["source"] for each in scene["performers"]]
    targets = [word for each in scene["performers"] for word in ("-t", each["target"])]
    options = ["--end", "50f", "--speed", "2", "--mirror", "--turn", "30", "--loop"]
    for name, words in (("file", [str(tmp_path / "scene.json")]), ("options", [*files, *targets, *options])):
        succeeded("scene", *words, "-o", tmp_path / name)
    results = [sorted(path.read_bytes() for path in (tmp_path / name).iterdir()) for name in ("file", "options")]
    assert results[0] == results[1]
    assert len(read_bvh(next((tmp_path / "file").glob("*.bvh")))) == 26


@pytest.mark.parametrize("given", ["x", "-1", "f", "nan"])
def test_a_time_that_is_none_is_told_in_a_line(tmp_path, given):
    ran = run(SAMPLES / "walk.bvh", SAMPLES / "child.json", "-o", tmp_path / "o.bvh", "--start", given)
    assert ran.returncode != 0
    assert "expected seconds, or a frame such as 90f" in ran.stderr
    assert not (tmp_path / "o.bvh").exists()
