"""The sample character: equal to the script's output, a whole mesh, and moved as it should be."""

import gltf_player
import make_samples
import numpy as np
import pytest
import sample_character
from bodies import HERO, SAMPLES

from distretarget import load_target, read_bvh, retarget, write_motion

HEIGHT = 1.774  # [m]


@pytest.fixture(scope="module")
def hero():
    return gltf_player.load(HERO)


def primitives(document, buffer):
    """The arrays of each part of the mesh: points, normals, joints, weights and triangles."""
    for primitive in document["meshes"][0]["primitives"]:
        names = ("POSITION", "NORMAL", "JOINTS_0", "WEIGHTS_0")
        found = [gltf_player.values(document, buffer, primitive["attributes"][name]) for name in names]
        triangles = gltf_player.values(document, buffer, primitive["indices"]).astype(int).reshape(-1, 3)
        yield *found, triangles


def test_the_script_makes_this_character(tmp_path, hero):
    """Assert the same parts, and equal numbers up to the last decimals, which machines may round differently."""
    make_samples.write_characters(tmp_path)
    made = gltf_player.load(tmp_path / "hero.glb")
    nodes, expected = (document["nodes"] for document, _ in (made, hero))
    assert [node["name"] for node in nodes] == [node["name"] for node in expected]
    shown, wanted = (gltf_player.worlds(*each, None, np.zeros(1)) for each in (made, hero))
    np.testing.assert_allclose(shown, wanted, atol=1e-5)
    for arrays, kept in zip(primitives(*made), primitives(*hero), strict=True):
        for values, other, tolerance in zip(arrays, kept, (2e-5, 1e-3, 0, 3 / 255, 0), strict=True):
            np.testing.assert_allclose(values, other, rtol=0, atol=tolerance)


def test_it_is_small():
    assert HERO.stat().st_size < 150_000


def test_the_surface_is_closed_and_looks_outwards(hero):
    for points, normals, _, _, triangles in primitives(*hero):
        edges = np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
        assert set(map(tuple, edges.tolist())) == set(map(tuple, edges[:, ::-1].tolist()))
        a, b, c = np.moveaxis(points[triangles], 1, 0)
        across = np.cross(b - a, c - a)
        assert np.einsum("ti,ti->", a, across) > 0
        assert np.mean(np.einsum("ti,ti->t", across, normals[triangles].sum(axis=1)) > 0) > 0.99


def test_weights_add_up_and_belong_to_the_side(hero):
    document, buffer = hero
    names = np.array([document["nodes"][node]["name"] for node in document["skins"][0]["joints"]])
    for points, _, joints, weights, _ in primitives(document, buffer):
        np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
        for side, sign in (("Left", 1), ("Right", -1)):
            other = np.char.startswith(names, side)[joints.astype(int)] & (weights > 0)
            assert not other[sign * points[:, 0] < -0.03].any()


def test_it_rests_in_its_bind_pose_on_the_floor(hero):
    points = np.concatenate([points for points, *_ in primitives(*hero)])
    moved = gltf_player.skinned(*hero, gltf_player.worlds(*hero, None, np.zeros(1)))
    np.testing.assert_allclose(np.concatenate(moved, axis=1)[0], points, atol=1e-5)
    assert np.ptp(points[:, 1]) == pytest.approx(HEIGHT, abs=0.005)
    assert points[:, 1].min() == pytest.approx(0, abs=0.005)


def test_joints_are_where_the_script_has_them():
    skeleton, made = load_target(HERO).skeleton, sample_character.joints()
    places = dict(zip(skeleton.names, skeleton.rest_positions, strict=True))
    assert {*places} == {*made.names}
    np.testing.assert_allclose([places[name] for name in made.names], 0.01 * (made.places - made.places[0]), atol=1e-5)


def test_a_clap_needs_no_look_and_the_soles_stay_on_the_floor(tmp_path):
    result = retarget(read_bvh(SAMPLES / "clap.bvh"), load_target(HERO))
    assert not result.warnings
    write_motion(tmp_path / "clap.glb", result.motion, HERO)
    document, buffer = gltf_player.load(tmp_path / "clap.glb")
    placed = gltf_player.worlds(document, buffer, "clap", result.motion.frame_time * np.arange(len(result.motion)))
    lowest = np.min([points[..., 1].min(axis=1) for points in gltf_player.skinned(document, buffer, placed)], axis=0)
    np.testing.assert_allclose(lowest, 0, atol=0.02)
