"""Characters of any kind: from files to skeleton and motion and back, and the sample character."""

from itertools import pairwise

import gltf_player
import make_samples
import numpy as np
import pytest
import sample_character
from bodies import HERO, sample, sample_run, sample_target, swaying
from characters import (
    ARMATURE,
    Bones,
    Performance,
    box_mesh,
    character,
)
from scipy.spatial.transform import Rotation

from distretarget import load_target, write_motion

MOTION = sample("walk")[:8]
BONES, WALK = Bones.of(MOTION.skeleton), Performance.of(MOTION)
ROLLED = BONES.along_bones(np.linspace(-2, 2, len(BONES.names)))
ASIDE = np.block(
    [[0.5 * Rotation.from_euler("Z", 30, degrees=True).as_matrix(), np.array([[1.0], [2], [3]])], [0, 0, 0, 1]]
)
KINDS = {
    "plain": {},
    "rolled": {"axes": ROLLED},
    "armature": {"axes": ROLLED, "above": ARMATURE},
    "armature, mesh outside": {"above": ARMATURE, "under": False},
    "mesh elsewhere": {"above": ARMATURE, "under": False, "mesh_world": ASIDE},
    "mesh elsewhere, points in the world": {"axes": ROLLED, "under": False, "mesh_world": ASIDE, "space": np.eye(4)},
    "matrices": {"axes": ROLLED, "above": ARMATURE, "matrices": True},
    "scales": {"axes": ROLLED, "scales": {0: 2.0, 3: 0.25, 9: 10.0}},
    "helpers": {"axes": ROLLED, "helpers": [0, 4, 12], "above": ARMATURE},
    "skins": {"meshes": [box_mesh(BONES, range(11)), box_mesh(BONES, range(11, 22))], "all_joints": False},
}


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


def test_its_surface_is_closed_its_weights_add_up_and_it_rests_on_the_floor(hero):
    for points, normals, _, _, triangles in primitives(*hero):
        edges = np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
        assert set(map(tuple, edges.tolist())) == set(map(tuple, edges[:, ::-1].tolist()))
        a, b, c = np.moveaxis(points[triangles], 1, 0)
        across = np.cross(b - a, c - a)
        assert np.einsum("ti,ti->", a, across) > 0
        assert np.mean(np.einsum("ti,ti->t", across, normals[triangles].sum(axis=1)) > 0) > 0.99
    document, buffer = hero
    names = np.array([document["nodes"][node]["name"] for node in document["skins"][0]["joints"]])
    for points, _, joints, weights, _ in primitives(document, buffer):
        np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)
        for side, sign in (("Left", 1), ("Right", -1)):
            other = np.char.startswith(names, side)[joints.astype(int)] & (weights > 0)
            assert not other[sign * points[:, 0] < -0.03].any()
    points = np.concatenate([points for points, *_ in primitives(*hero)])
    moved = gltf_player.skinned(*hero, gltf_player.worlds(*hero, None, np.zeros(1)))
    np.testing.assert_allclose(np.concatenate(moved, axis=1)[0], points, atol=1e-5)
    assert np.ptp(points[:, 1]) == pytest.approx(HEIGHT, abs=0.005)
    assert points[:, 1].min() == pytest.approx(0, abs=0.005)


def test_joints_are_where_the_script_has_them():
    skeleton, made = sample_target("hero").skeleton, sample_character.joints()
    places = dict(zip(skeleton.names, skeleton.rest_positions, strict=True))
    assert {*places} == {*made.names}
    np.testing.assert_allclose([places[name] for name in made.names], 0.01 * (made.places - made.places[0]), atol=1e-5)


def test_a_clap_needs_no_look_and_the_soles_stay_on_the_floor(tmp_path):
    result = sample_run("clap")
    assert not result.warnings
    write_motion(tmp_path / "clap.glb", result.motion, HERO)
    document, buffer = gltf_player.load(tmp_path / "clap.glb")
    placed = gltf_player.worlds(document, buffer, "clap", result.motion.frame_time * np.arange(len(result.motion)))
    lowest = np.min([points[..., 1].min(axis=1) for points in gltf_player.skinned(document, buffer, placed)], axis=0)
    np.testing.assert_allclose(lowest, 0, atol=0.02)


BODIES = [
    Bones.of(skeleton)
    for skeleton in (
        sample("walk").skeleton,
        sample_target("rigs/mixamo_t").skeleton,
        sample_target("rigs/unreal_a").skeleton,
    )
]
NAMES = ["", "x", "a/b", "Ü ", "same", "{", "  ", "mixamorig:Hips"]


def placed(draw, scale):
    """A matrix with a uniform scale."""
    turn = Rotation.from_rotvec(draw.normal(size=3)).as_matrix()
    return np.block([[scale * turn, draw.normal(size=(3, 1))], [0, 0, 0, 1]])


def any_character(draw):
    """A character of any body, size, names, axes, scales, nodes and skins, which may show another pose."""
    bones = BODIES[draw.integers(len(BODIES))]
    joints = len(bones.names)
    bones = bones.turned(Rotation.from_rotvec([0, draw.choice([0, draw.uniform(0, 6)]), 0]))
    bones = Bones(bones.names, bones.parents, bones.positions * draw.choice([1, 0.01, 100]))
    bones = bones.renamed(dict(zip(draw.choice(bones.names, 3), draw.choice(NAMES, 3), strict=True)))
    cuts = [0, *sorted(draw.choice(np.arange(1, joints), 2, replace=False)), joints]
    options = {
        "axes": [None, bones.along_bones(draw.uniform(-3, 3, joints)), Rotation.random(joints, rng=draw)],
        "above": [None, ARMATURE, placed(draw, 3.0), np.diag([100.0, 100, 100, 1])],
        "scales": [None, dict(zip(draw.choice(joints, 3).tolist(), draw.uniform(0.2, 5, 3), strict=True))],
        "helpers": [(), draw.choice(joints, 3).tolist()],
        "matrices": [False, True],
        "meshes": [(), [box_mesh(bones, range(*part)) for part in pairwise(cuts)]],
        "all_joints": [True, False],
        "under": [True, False],
        "mesh_world": [None, placed(draw, 0.5)],
        "space": [None, np.eye(4)],
    }
    made = character(bones, **{name: choices[draw.integers(len(choices))] for name, choices in options.items()})
    if draw.random() < 0.3:
        made.show(Performance.swaying(bones, 3), 1)
    if not made.matrices and draw.random() < 0.5:
        made.animate("another", Performance.swaying(bones, 3), all_translations=True)
    return made


def turns_of(matrices):
    return matrices[..., :3, :3] / np.cbrt(np.linalg.det(matrices[..., :3, :3]))[..., None, None]


@pytest.mark.parametrize("seed", range(16))
def test_any_character(seed, tmp_path):
    draw = np.random.default_rng(seed)
    made = any_character(draw)
    path = made.write(tmp_path / f"hero{draw.choice(['.glb', '.gltf'])}")
    target = load_target(path)
    skeleton, nodes = target.skeleton, target.character.nodes[-len(target.skeleton) :].tolist()
    size = np.ptp(made.bones.positions, axis=0).max()
    places = (skeleton.rest_positions + skeleton.offsets[0])[[nodes.index(node) for node in made.joints]]
    assert np.abs(places - made.bones.positions).max() < 1e-5 * size

    motion = swaying(skeleton, 4)
    write_motion(tmp_path / "out.glb", motion, path)
    document, buffer = gltf_player.load(tmp_path / "out.glb")
    worlds = gltf_player.worlds(document, buffer, "out", motion.frame_time * np.arange(len(motion)))[:, nodes]
    assert np.abs(worlds[..., :3, 3] - motion.positions).max() < 1e-5 * size
    turned = turns_of(worlds) @ turns_of(np.array(made.bind)[nodes]).swapaxes(-1, -2)
    expected = Rotation.from_quat(motion.world_rotations.reshape(-1, 4)).as_matrix().reshape(turned.shape)
    joints = [nodes.index(node) for node in made.joints]
    assert np.abs(turned - expected)[:, joints].max() < 1e-4
