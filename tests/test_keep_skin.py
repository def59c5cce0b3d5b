"""Skin on a character: what touches and sinks in, through `retarget`."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import sample, sample_run, sample_target, tree_of
from capsule_bodies import capsule_surface, mesh_of

from distretarget import Motion, Options, Target, retarget
from distretarget.pipeline.performer import target_capsules

BONES_ALONE = Options(skin="none")
SIDES = ("Left", "Right")


def test_hands_part_about_as_far_between_claps_as_those_of_the_rotation_copy():
    run = sample_run("clap")
    kept, copied = (
        np.linalg.norm(
            np.subtract(*(motion.positions[:, motion.skeleton.index(f"{side}Hand")] for side in SIDES)), axis=1
        )
        for motion in (run.motion, run.rotation_copy)
    )
    assert kept[75:85].min() > 2.0 * kept[66]  # two claps, and the hands are apart between them
    np.testing.assert_allclose(kept[75:85], copied[75:85], rtol=0.2)


def test_where_nothing_is_near_nothing_changes():
    """The arms are held out to the sides, and the legs stand apart, on flat soles."""
    source = sample("turn")
    arms = [source.skeleton.index(f"{side}Shoulder") for side in ("Left", "Right")]
    still = np.tile(source.rotations[:1], (30, 1, 1))
    still[:, :, :] = [0.0, 0.0, 0.0, 1.0]
    held = type(source)(source.skeleton, source.root_positions[[0] * 30], still, source.frame_time_text)
    assert arms
    kept, alone = (retarget(held, sample_target("hero"), options).motion for options in (Options(), BONES_ALONE))
    np.testing.assert_allclose(kept.rotations, alone.rotations, atol=1e-5)  # soles of the mesh, soles of the joints
    np.testing.assert_allclose(kept.root_positions, alone.root_positions, atol=1e-5)


@pytest.mark.parametrize("name", ["squat", "turn"])
def test_capsules_thicker_than_the_mesh_move_no_limb_whose_skin_is_outside(name):
    target = sample_target("hero")
    thin = target_capsules(target)
    run = retarget(sample(name), replace(target, capsules=replace(thin, radii=1.3 * thin.radii)))
    joints = [run.motion.skeleton.index(side + part) for side in SIDES for part in ("ForeArm", "Hand")]
    kept, copied = (motion.positions - motion.positions[:, :1] for motion in (run.motion, run.rotation_copy))
    off = np.linalg.norm(kept[:, joints] - copied[:, joints], axis=2)
    assert off.max() < 0.003 * run.matching.target.height


@pytest.mark.parametrize("name", ["hands_on_hips", "clap"])
@pytest.mark.parametrize("factor", [1.0, 100.0])
def test_a_clip_of_the_same_character_keeps_its_arms(name, factor):
    """Skin that touches or is pressed in a little stays so, since both bodies are one."""
    clip = sample_run(name).motion
    again = retarget(clip.scaled(factor), sample_target("hero"))
    hands = [clip.skeleton.index(f"{side}Hand") for side in SIDES]
    off = again.motion.positions_of(hands) - clip.positions_of(hands)
    assert np.linalg.norm(off, axis=2).max() < 0.002 * again.matching.target.height


def test_a_mesh_of_no_human_has_no_thickness():
    skeleton = tree_of([[0, 1, 0]] * 3)
    mesh = mesh_of([(1, capsule_surface(skeleton.rest_positions[1:], (0.1, 0.1)))])
    still = Motion(skeleton, np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 3, 1)), "0.1")
    run = retarget(still, Target(skeleton, {}, "", mesh=lambda: mesh))
    assert run.skins is None
    np.testing.assert_allclose(run.motion.rotations, still.rotations, atol=1e-9)


def test_a_target_without_mesh_or_radii_has_no_thickness_but_that_which_is_asked_for():
    target = sample_target("child")
    kept, alone = (retarget(sample("clap"), target, options).motion for options in (Options(), BONES_ALONE))
    np.testing.assert_array_equal(kept.rotations, alone.rotations)
    target = sample_target("long_arms")
    run = retarget(sample("hands_on_hips"), target, Options(skin="average"))
    assert run.metrics["result"]["skin_depth"] < run.metrics["rotation_copy"]["skin_depth"]


def test_a_cut_and_a_single_frame_are_no_trouble():
    clip = sample("hands_on_hips")
    for frames in (slice(100, 101), slice(100, 103)):
        assert retarget(clip[frames], sample_target("hero")).metrics["result"]["skin_depth"] < 1.5


def test_the_frame_rate_hardly_matters():
    fast, slow = (retarget(sample("hands_on_hips")[::step], sample_target("hero")) for step in (1, 2))
    apart = np.linalg.norm(fast.motion.positions[::2] - slow.motion.positions, axis=2).max()
    assert apart < 0.03 * fast.matching.target.height


@pytest.mark.parametrize(("name", "depth"), [("hands_on_hips", 0.7), ("clap", 0.7), ("walk", 1.5)])
def test_hands_and_forearms_stay_outside_and_touch(name, depth):
    metrics = sample_run(name).metrics
    assert metrics["rotation_copy"]["skin_depth"] > 0.7
    assert metrics["result"]["skin_depth"] < depth
    assert metrics["result"]["foot_skate"] < 0.05
    assert (metrics["result"]["touch_missed"] or 0.0) < 15.0
