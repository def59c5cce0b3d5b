"""The pose in which a body is aligned: its rest pose, or a T-pose, the same for all clips of a rig."""

import itertools
from functools import cache

import numpy as np
import pytest
from bodies import SAMPLES, WAYS, person, posed, turned
from sample_rigs import CONVENTIONS, rig
from scipy.spatial.transform import Rotation

from distretarget import MatchingError, read_bvh, retarget
from distretarget.body.anatomy import LEG
from distretarget.body.axes import Directions, axis_vector
from distretarget.body.body import Body
from distretarget.body.neutral import bend_axes
from distretarget.body.reference_pose import FOOT_PITCH, t_pose
from distretarget.numerics.vectors import normalised

UP = np.array([0.0, 1.0, 0.0])
SIDES = {"left": 1.0, "right": -1.0}

ways = pytest.mark.parametrize("way", WAYS, ids=[f"way{k}" for k in range(len(WAYS))])


@cache
def without_a_rest_pose():
    """A walk on a body whose bones all lie along one axis at rest."""
    return retarget(read_bvh(SAMPLES / "walk.bvh"), rig("lafan1", "X")).motion


def assert_t_pose(body, world):
    """Trunk up along Y, legs down, arms out to the sides, left along X, feet ahead along Z."""
    left, up, forward = np.eye(3)
    way = Directions(body.anatomy, body.skeleton.posed(world))
    spine = [*body.anatomy.spine, *body.anatomy.neck, body.anatomy.roles["head"]]
    bones = normalised(np.diff(way.positions[spine], axis=0))
    np.testing.assert_allclose(bones, np.tile(up, (len(bones), 1)), atol=1e-9)
    for side, sign in SIDES.items():
        for upper, lower in itertools.pairwise((f"{side}UpperArm", f"{side}LowerArm", f"{side}Hand")):
            np.testing.assert_allclose(way.bone(upper, lower), sign * left, atol=1e-9)
        for upper, lower in itertools.pairwise((f"{side}UpperLeg", f"{side}LowerLeg", f"{side}Foot")):
            np.testing.assert_allclose(way.bone(upper, lower), -up, atol=1e-9)
        foot = np.cos(FOOT_PITCH) * forward - np.sin(FOOT_PITCH) * up
        np.testing.assert_allclose(way.bone(f"{side}Foot", f"{side}Toes"), foot, atol=1e-9)


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("pose", "TA")
def test_a_rest_pose_in_which_a_person_stands_is_its_own_reference(convention, pose):
    body = rig(convention, pose)
    np.testing.assert_array_equal(Body.of(body).reference.rotations, body.unturned)


def test_a_body_that_is_no_person_keeps_its_rest_pose():
    np.testing.assert_array_equal(Body(person(), None).reference.rotations, person().unturned)


@pytest.mark.parametrize("along", [["X"], ["Y"], ["Y", "-Y"], ["Z", "-X"]])
@pytest.mark.parametrize("seed", range(5))
def test_a_body_whose_rest_pose_shows_no_left_is_retargeted_all_the_same(along, seed):
    body = rig("mixamo", "T")
    bones = np.random.default_rng(seed).choice([axis_vector(axis) for axis in along], len(body))
    flat = body.with_offsets(body.lengths[:, None] * bones)
    axes = Directions(Body.of(flat).anatomy, flat.rest_positions).axes
    np.testing.assert_allclose(Rotation.from_matrix(axes).as_matrix(), axes, atol=1e-12)
    walk = read_bvh(SAMPLES / "walk.bvh")[:5]
    if Body.of(flat).on_all_fours:
        with pytest.raises(MatchingError, match="on all fours"):
            retarget(walk, flat)
    else:
        assert np.isfinite(retarget(walk, flat).motion.positions).all()


def test_shoulders_show_left_where_the_hip_joints_lie_along_the_spine():
    body = rig("lafan1", "X")
    offsets = np.array(body.offsets)
    for name, sign in (("LeftUpLeg", 1.0), ("RightUpLeg", -1.0)):
        offsets[body.index(name)] = sign * body.offsets[body.index("Spine")]
    flat = Body.of(body.with_offsets(offsets))
    assert not flat.stands_at_rest
    width = flat.reference.directions.across("UpperArm")
    np.testing.assert_allclose(normalised(width), [1.0, 0.0, 0.0], atol=0.01)


def test_without_a_motion_bones_along_one_axis_become_a_t_pose():
    body = Body.of(rig("lafan1", "X"))
    assert_t_pose(body, body.reference.rotations)


@pytest.mark.parametrize("convention", ["mixamo", "xsens", "lafan1"])
@ways
def test_a_t_pose_faces_along_z_however_the_rest_pose_lies(convention, way):
    body = Body.of(turned(rig(convention, "A"), way))
    assert_t_pose(body, t_pose(body.skeleton, body.at_rest, None))


def test_elbows_and_knees_bend_about_the_axes_across_them():
    bend = np.linspace(0.2, 1.2, 10)[:, None]
    turns = {f"{side}Knee": bend * [1, 0, 0] for side in ("Left", "Right")}
    turns |= {"LeftElbow": bend * [0, -1, 0], "RightElbow": bend * [0, 1, 0]}
    motion = posed(person(), turns, np.zeros((10, 3)))
    anatomy = Body.of_motion(motion).anatomy
    axes = bend_axes(anatomy, motion)
    bends = {"left": [0, -1, 0], "right": [0, 1, 0]}
    expected = {f"{side}{part}": [1, 0, 0] for side in SIDES for part in LEG[:3]}
    expected |= {f"{side}{part}": bends[side] for side in SIDES for part in ("UpperArm", "LowerArm")}
    assert axes.keys() == {anatomy.roles[role] for role in expected}
    for role, axis in expected.items():
        np.testing.assert_allclose(axes[anatomy.roles[role]], axis, atol=1e-9)


def test_limbs_that_hardly_bend_have_no_axis():
    motion = posed(person(), {"LeftKnee": np.array([0.5, 0, 0])}, np.zeros((5, 3)))
    anatomy = Body.of_motion(motion).anatomy
    assert bend_axes(anatomy, motion).keys() == {anatomy.roles[f"left{part}"] for part in LEG[:3]}
