"""What a body kneels and sits on: how far its skin reaches below its joints, and that it rests on its skin."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, SAMPLES, UP, posed
from capsule_bodies import capsule_surface, mesh_of

from distretarget import Motion, Options, load_target, read_bvh, retarget
from distretarget.body.body import Body
from distretarget.matching.undersides import Underside, Undersides
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.target import Target

BODY = Body.of(PERSON)
KNEES = np.array([BODY.anatomy.roles[f"{side}LowerLeg"] for side in ("left", "right")])
SHINS = np.array([SEGMENTS.index(f"{side} shin") for side in ("left", "right")])
RADII = np.array([0.05, 0.08])
"""Of the left and the right knee [m]."""


def knees():
    """Balls about the knees: as a mesh, and as capsules."""
    tiny = np.array([[0.0, 0.0, 0.0], [1e-9, 0.0, 0.0]])
    surfaces = [
        (joint, capsule_surface(PERSON.rest_positions[joint] + tiny, [radius] * 2, 41, 40))
        for joint, radius in zip(KNEES, RADII, strict=True)
    ]
    return mesh_of(surfaces), Capsules(KNEES, np.zeros((2, 2, 3)), np.array([RADII, RADII]).T, SHINS)


@pytest.mark.parametrize("meshed", [True, False])
def test_a_ball_about_a_knee_reaches_its_radius_below_it_however_the_knee_is_turned(meshed):
    mesh, capsules = knees()
    underside = Underside(BODY, capsules, mesh if meshed else None)
    turns = {"Hips": np.outer(np.linspace(0, 3, 7), [1.0, 0.5, 0.2]), "LeftKnee": np.array([1.2, 0.3, 0.0])}
    below = underside.below(posed(PERSON, turns, np.zeros((7, 3))), KNEES, UP)
    np.testing.assert_allclose(below, np.broadcast_to(RADII, (7, 2)), rtol=0.06 if meshed else 1e-9)


def test_skin_that_several_joints_move_is_where_linear_blend_skinning_puts_it():
    mesh, capsules = knees()
    joints = np.column_stack([mesh.joints, PERSON.parents[mesh.joints]])
    mesh = type(mesh)(mesh.vertices, joints, np.full(joints.shape, 0.5), mesh.triangles)
    motion = posed(PERSON, {"LeftKnee": np.array([1.2, 0.3, 0.0])}, np.zeros((1, 3)))
    own = np.flatnonzero(mesh.joints[:, 0] == KNEES[0])
    found = motion.positions[0, KNEES[0]] @ UP - (mesh.posed(motion, own) @ UP).min()
    below = Underside(BODY, capsules, mesh).below(motion, KNEES[:1], UP)
    np.testing.assert_allclose(below, found, rtol=0.06)


def test_the_lowest_vertex_of_a_foot_is_the_lowest_of_all_however_foot_and_toes_are_turned():
    rng = np.random.default_rng(0)
    ankle = BODY.anatomy.roles["leftFoot"]
    joints = PERSON.subtree(ankle)
    mesh = mesh_of(
        [
            (joint, capsule_surface(PERSON.rest_positions[joint] + 0.1 * rng.normal(size=(2, 3)), [0.03, 0.05], 9, 8))
            for joint in joints
        ]
    )
    underside = Underside(BODY, knees()[1], mesh)
    motion = posed(PERSON, {PERSON.names[joint]: rng.normal(size=(20, 3)) for joint in joints}, np.zeros((20, 3)))
    lowest = (mesh.posed(motion) @ UP).min(axis=1)
    np.testing.assert_allclose(underside.lowest_of_foot(motion, ankle, UP), lowest, atol=1e-6)
    assert len(underside.foot(ankle)) < len(mesh.vertices)


def test_a_joint_without_skin_has_none_below():
    elbow = np.array([BODY.anatomy.roles["leftLowerArm"]])
    motion = Motion(PERSON, np.zeros((1, 3)), PERSON.unturned[None], "0.02")
    assert Underside(BODY, *knees()[::-1]).below(motion, elbow, UP) == 0.0


# ---- in a run


def lowest_knee(thigh, shin):
    """(frames,), the height of the lowest skin of the right knee over that of the feet's joints [legs], and how high
    the knee is, while the child kneels on it with legs of these radii [cm].
    """
    child = load_target(SAMPLES / "child.json").skeleton
    roles = Body.of(child).anatomy.roles
    parts = {"UpperLeg": thigh, "LowerLeg": shin}
    radii = {roles[side + part]: radius for side in ("left", "right") for part, radius in parts.items()}
    result = retarget(read_bvh(SAMPLES / "supports" / "kneel.bvh")[::4], Target(child, {}, "child", radii=radii))
    knee, supports = roles["rightLowerLeg"], result.supports
    on = supports.weights[:, supports.joints.tolist().index(knee)] >= 0.99
    below = Undersides.of(result.matching, (result.skins.source.capsules, result.skins.target.capsules), None)
    height = result.motion.positions[on, knee] @ UP
    skin = height - below.target.below(result.motion, np.array([knee]), UP)[on, 0]
    return (skin + below.soles[1]) / Body.of(child).leg_length, height / Body.of(child).leg_length


def test_thick_knees_kneel_higher_and_thin_ones_lower_and_neither_sinks_in_or_hovers():
    thin, normal, thick = (lowest_knee(*radii) for radii in ((3.0, 2.0), (7.0, 5.0), (14.0, 11.0)))
    assert thin[1].mean() < normal[1].mean() - 0.005
    assert normal[1].mean() < thick[1].mean() - 0.02
    for skin, _ in (thin, normal, thick):
        assert -0.02 < skin.mean() < 0.04


def test_without_skin_nothing_changes():
    child, source = load_target(SAMPLES / "child.json"), read_bvh(SAMPLES / "supports" / "kneel.bvh")[::8]
    thick = Target(child.skeleton, {}, "child", radii={1: 20.0})
    with_none, of_stick = retarget(source, thick, Options(skin="none")), retarget(source, child)
    np.testing.assert_array_equal(with_none.motion.rotations, of_stick.motion.rotations)
    np.testing.assert_array_equal(with_none.motion.translations, of_stick.motion.translations)


def test_the_height_of_a_support_is_right_up_to_where_its_skin_is_as_high():
    source = read_bvh(SAMPLES / "supports" / "kneel.bvh")[::8]
    child = load_target(SAMPLES / "child.json").skeleton
    knee = Body.of(child).anatomy.roles["rightLowerLeg"]
    result = retarget(source, Target(child, {}, "child", radii={knee: 11.0}))
    assert result.metrics["result"]["support_height"] < 1
    assert replace(result, baseline=replace(result.baseline, skins=None)).metrics["result"]["support_height"] > 2
