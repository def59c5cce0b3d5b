"""Characters of any kind: their skeleton is the bind pose, and a plain player shows a written motion as it is."""

from itertools import pairwise

import gltf_player
import numpy as np
import pytest
from bodies import sample, sample_target, swaying
from characters import ARMATURE, Bones, Performance, box_mesh, character
from scipy.spatial.transform import Rotation

from distretarget import load_target, write_motion

BONES = [
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
    bones = BONES[draw.integers(len(BONES))]
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


@pytest.mark.parametrize("seed", range(24))
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
