"""What a hand holds is not the body: a sword changes neither capsules, nor the motion, nor its figures."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bodies import HERO, SAMPLES

from distretarget import load_target, read_bvh, retarget
from distretarget.body.bare import bare_mesh
from distretarget.body.body import Body
from distretarget.pipeline.performer import target_capsules
from distretarget.skin.mesh import Looks

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]])


@cache
def hero():
    return load_target(HERO)


def with_box(target, name, to, length, thick=0.03):
    """The target with a box that one joint moves, from that joint's place along `to` [m]."""
    mesh, joint = target.mesh(), target.skeleton.names.index(name)
    along = np.array(to) / np.linalg.norm(to)
    aside = np.cross(along, [0.1, 0.9, 0.3])
    aside /= np.linalg.norm(aside)
    axes = np.stack([length * along, thick * aside, thick * np.cross(along, aside)])
    count, corners = len(mesh.vertices), target.skeleton.rest_positions[joint] + CORNERS @ axes
    joints, weights = (np.zeros((len(corners), mesh.joints.shape[1]), kind) for kind in (np.intp, float))
    joints[:], weights[:, 0] = joint, 1.0
    boxed = replace(
        mesh,
        vertices=np.vstack([mesh.vertices, corners]),
        joints=np.vstack([mesh.joints, joints]),
        weights=np.vstack([mesh.weights, weights]),
        triangles=np.vstack([mesh.triangles, FACES + count]),
        looks=Looks((), np.full(len(mesh.triangles) + len(FACES), -1), np.zeros((count + len(corners), 2))),
    )
    return replace(target, mesh=lambda: boxed)


def bare(target):
    return bare_mesh(Body.of(target.skeleton, target.motion), target.mesh())


def test_a_body_that_holds_nothing_keeps_its_mesh():
    assert bare(hero()) is hero().mesh()


@pytest.mark.parametrize("name", ["RightHand", "LeftHand"])
def test_a_sword_that_moves_with_the_hand_is_left_out_and_shown(name):
    armed = with_box(hero(), name, [0.0, 0.3, 1.0], 0.9)
    mesh = bare(armed)
    for field in ("vertices", "joints", "weights", "triangles"):
        np.testing.assert_array_equal(getattr(mesh, field), getattr(hero().mesh(), field))
    assert len(mesh.looks.of_triangle) == len(mesh.triangles)
    assert mesh.whole is armed.mesh()


@pytest.mark.parametrize(("name", "length"), [("RightHand", 0.15), ("Spine2", 0.9), ("RightForeArm", 0.15)])
def test_a_glove_a_bracelet_and_what_the_back_carries_are_parts_of_the_body(name, length):
    worn = with_box(hero(), name, [0.0, 0.3, 1.0], length)
    assert bare(worn) is worn.mesh()


def test_a_sword_changes_neither_capsules_nor_the_clap():
    armed = with_box(hero(), "RightHand", [0.0, 0.3, 1.0], 0.9)
    plain, held = target_capsules(hero()), target_capsules(armed)
    np.testing.assert_array_equal(plain.radii, held.radii)
    np.testing.assert_array_equal(plain.ends, held.ends)
    clap = read_bvh(SAMPLES / "clap.bvh")
    without, result = retarget(clap, hero()), retarget(clap, armed)
    np.testing.assert_array_equal(result.motion.rotations, without.motion.rotations)
    assert result.metrics == without.metrics
