"""Figures are those of the file: of a motion in single precision, and without what a format cannot hold."""

import json
from dataclasses import replace

import numpy as np
import pytest
from bodies import HERO, sample, sample_run, sample_target
from program import succeeded

from distretarget import read_bvh, read_motion, retarget, write_bvh, write_motion
from distretarget.io.motion_writer import as_written
from distretarget.io.vrma import humanoid_bones

FAR = 1e7  # from the origin, where single precision has a step of 1 [cm]


@pytest.fixture(scope="module")
def far_walk():
    walk = sample("walk")
    return replace(walk, root_positions=walk.root_positions + np.array([FAR, 0.0, 0.0]))


def metrics_of(motion, folder, kind):
    """What a run says of a motion on the hero, and that motion as its file has it."""
    write_bvh(folder / "far.bvh", motion, overwrite=True)
    out, told = folder / f"out.{kind}", folder / "out.json"
    succeeded(folder / "far.bvh", HERO, "-o", out, "--json", told, "--overwrite")
    return json.loads(told.read_text())["metrics"]["result"]


def test_far_from_the_origin_a_character_shakes_in_its_file_and_in_its_figures(far_walk, tmp_path):
    exact = metrics_of(far_walk, tmp_path, "bvh")
    single = metrics_of(far_walk, tmp_path, "glb")
    assert single["jerk"] > 5 * exact["jerk"]
    written = read_motion(tmp_path / "out.glb")
    result = retarget(far_walk, sample_target("hero"))
    of_file = replace(result, motion=replace(written, frame_time_text=result.motion.frame_time_text))
    for key in ("jerk", "foot_skate", "foot_height", "direction_error"):
        assert single[key] == pytest.approx(of_file.metrics["result"][key], rel=1e-3)


def test_a_bvh_holds_the_motion_to_what_figures_show(far_walk, tmp_path):
    near = replace(far_walk, root_positions=far_walk.root_positions - np.array([FAR, 0.0, 0.0]))
    result = retarget(near, sample_target("rigs/mixamo_t"))
    write_bvh(tmp_path / "near.bvh", result.motion)
    written = read_bvh(tmp_path / "near.bvh")
    order = np.argsort(result.motion.skeleton.depth_first)
    np.testing.assert_allclose(written.positions[:, order], result.motion.positions, atol=1e-5)
    assert as_written(result.motion, "BVH") is result.motion


def test_single_precision_is_what_a_file_of_arrays_has(far_walk):
    held = as_written(far_walk, "arrays", "float32")
    np.testing.assert_array_equal(held.root_positions, far_walk.root_positions.astype(np.float32))
    np.testing.assert_allclose(held.rotations, far_walk.rotations, atol=1e-7)
    assert as_written(far_walk, "arrays", "float64") is far_walk


def test_a_vrm_animation_holds_the_bones_of_a_humanoid_and_the_path_of_the_hips(tmp_path):
    """The hero has a joint more in the spine than VRM; below it the world rotations are the file's."""
    result = sample_run("hands_on_hips")
    held = as_written(result.motion, "VRMA")
    bones = humanoid_bones(result.matching.target)
    joints = [*bones.values()]
    same = np.abs((held.world_rotations[:, joints] * result.motion.world_rotations[:, joints]).sum(axis=2))
    np.testing.assert_allclose(same, 1.0, atol=1e-6)
    hips = bones["hips"]
    np.testing.assert_allclose(held.positions[:, hips], result.motion.positions[:, hips], rtol=1e-5)
    others = [joint for joint in range(1, len(held.skeleton)) if joint not in joints]
    np.testing.assert_allclose(np.abs(held.rotations[:, others, 3]), 1.0, atol=1e-6)
    write_motion(tmp_path / "out.vrma", result.motion)
    file = read_motion(tmp_path / "out.vrma")
    ends = [file.skeleton.names.index("leftHand"), file.skeleton.names.index("hips")]
    reach = np.linalg.norm(file.positions[:, ends[0]] - file.positions[:, ends[1]], axis=1)
    own = np.linalg.norm(held.positions[:, bones["leftHand"]] - held.positions[:, hips], axis=1)
    np.testing.assert_allclose(reach / reach[0], own / own[0], atol=0.02)
