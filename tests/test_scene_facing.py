"""Scenes of characters that look to -Z by convention, as in VRM 0, beside others that look to +Z."""

import json
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, moved
from characters import LOOKING_BACK, Bones, as_vrm0, box_mesh, character
from program import run
from scipy.spatial.transform import Rotation

from distretarget import load_target, read_bvh, read_motion, retarget, retarget_scene, write_motion

BONES = Bones.of(read_bvh(SAMPLES / "walk.bvh").skeleton)


@cache
def walks():
    walk = read_bvh(SAMPLES / "walk.bvh")[:20]
    return walk, moved(walk, Rotation.identity(), shift=(0.0, 0.0, 400.0))


@pytest.fixture
def heroes(tmp_path):
    """The files of one character that looks to -Z, and of the same that looks to +Z."""
    back = BONES.turned(LOOKING_BACK)
    return (
        as_vrm0(character(back, meshes=[box_mesh(back)])).write(tmp_path / "back.vrm"),
        character(BONES, meshes=[box_mesh(BONES)]).write(tmp_path / "ahead.glb"),
    )


def test_who_looks_to_minus_z_moves_among_others_as_who_looks_to_z(heroes):
    back, ahead = map(load_target, heroes)
    assert back.skeleton.looks_back
    mixed, alike = (retarget_scene(walks(), [one, ahead]) for one in (back, ahead))
    for one, other in zip(mixed.results, alike.results, strict=True):
        assert not one.motion.skeleton.looks_back
        # The triangles of the two files are in other orders, and so are the points on them that skins are measured at.
        np.testing.assert_allclose(one.motion.positions, other.motion.positions, atol=0.01)
    vertices = [np.unique(each.results[0].mesh.vertices.round(5), axis=0) for each in (mixed, alike)]
    np.testing.assert_allclose(*vertices, atol=1e-4)


def test_the_file_of_who_looks_to_minus_z_is_that_of_retarget(heroes, tmp_path):
    targets = [*map(load_target, heroes)]
    apart = retarget_scene(walks(), targets, world_scale=retarget(walks()[0], targets[0]).root_scale)
    write_motion(tmp_path / "scene.vrm", apart.results[0].motion, heroes[0])
    write_motion(tmp_path / "alone.vrm", retarget(walks()[0], targets[0]).motion, heroes[0])
    scene, alone = (read_motion(tmp_path / f"{name}.vrm") for name in ("scene", "alone"))
    assert scene.skeleton.looks_back
    rise = scene.positions[0, 0] - alone.positions[0, 0]  # a scene has one floor for all
    np.testing.assert_allclose(rise[[0, 2]], 0.0, atol=1e-6)
    np.testing.assert_allclose(scene.positions, alone.positions + rise, atol=1e-6)


def test_an_error_of_a_target_names_its_file(tmp_path):
    walk, child = SAMPLES / "walk.bvh", SAMPLES / "child.json"
    small = {"format": "distretarget-skeleton", "version": 1, "scale": 1e-4}
    (tmp_path / "small.json").write_text(json.dumps(small))
    done = run(
        "scene", walk, SAMPLES / "squat.bvh", "--cut", "-t", tmp_path / "small.json", "-t", child, "-o", tmp_path
    )
    assert "different units" in done.stderr
    assert "child.json" in done.stderr
