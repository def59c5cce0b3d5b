"""Directions, axes, regions and stated parts of bodies: hands with their fingers, and nothing else."""

from __future__ import annotations

import itertools
import pickle
from dataclasses import replace

import numpy as np
import pytest
from animals import dog
from bodies import WAYS, body_of, nameless, person, posed, sample_target, swaying, turned, with_bone
from named_bodies import tree
from scipy.spatial.transform import Rotation
from zoo import CONVENTIONS, rig

from distretarget import retarget
from distretarget.body.anatomy import find_regions
from distretarget.body.axes import Directions, axis_vector, nearest_axis, squared, upright
from distretarget.body.body import Body
from distretarget.body.recognition import by_names
from distretarget.cli.skeleton import recognised
from distretarget.errors import SkeletonError
from distretarget.matching.matching import match
from distretarget.skeleton import AXES

PEOPLE = [person(), *(rig(convention, pose) for convention, pose in itertools.product(CONVENTIONS, "TA"))]

ways = pytest.mark.parametrize("way", WAYS, ids=[f"way{k}" for k in range(len(WAYS))])


def directions(body, positions=None):
    return Directions(Body.of(body).anatomy, body.rest_positions if positions is None else positions)


def without(body, *roles):
    """The directions of a body at rest whose anatomy lacks some parts."""
    whole = directions(body).anatomy
    left = {role: joint for role, joint in whole.roles.items() if not role.endswith(roles)}
    return Directions(replace(whole, roles=left), body.rest_positions)


@ways
def test_the_axes_of_a_body_turn_with_it(way):
    for body in PEOPLE[:3]:
        axes, there = (directions(b).axes for b in (body, turned(body, way)))
        np.testing.assert_allclose(there, way.as_matrix() @ axes, atol=1e-12)
        np.testing.assert_allclose(axes[:, 0], [1, 0, 0], atol=1e-6)
        assert axes[1, 1] > 0.98
        assert axes[2, 2] > 0.98


def test_a_person_who_stands_points_up_along_trunk_and_legs():
    for body in PEOPLE:
        up = axis_vector(body.up or "Y")
        way = directions(body)
        assert way.is_whole
        assert min(way.trunk @ up, -way.legs @ up, way.up @ up) > 0.97
        assert way.stretch > 165
        np.testing.assert_allclose(way.left, [1, 0, 0], atol=1e-6)


@pytest.mark.parametrize("angle", [0, 30, 90, 120])
def test_stretch_is_the_angle_between_trunk_and_legs(angle):
    body = person()
    plain = directions(body).stretch
    bend = {f"{side}Hip": np.radians([-angle, 0, 0]) for side in ("Left", "Right")}
    found = directions(body, posed(body, bend, np.zeros((3, 3))).positions).stretch
    np.testing.assert_allclose(found, plain - angle, atol=3)
    assert found.shape == (3,)


def test_many_postures_have_the_directions_of_each():
    body = person()
    positions = swaying(body).positions
    many = directions(body, positions)
    for name in ("trunk", "legs", "up", "left", "axes", "stretch"):
        each = [getattr(directions(body, posture), name) for posture in positions]
        np.testing.assert_allclose(getattr(many, name), each, atol=1e-12)
    np.testing.assert_allclose(many.axes.transpose(0, 2, 1) @ many.axes, np.tile(np.eye(3), (20, 1, 1)), atol=1e-12)


def test_up_is_that_of_the_part_that_is_there():
    trunk = without(person(), "Leg", "Foot", "Toes")
    legs = without(person(), "Arm", "Hand")
    legs = replace(legs, anatomy=replace(legs.anatomy, spine=(), neck=()))
    for way in (trunk, legs):
        assert not way.is_whole
    np.testing.assert_allclose(trunk.up, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(legs.up, [0, 1, 0], atol=1e-12)
    np.testing.assert_array_equal(legs.trunk, np.zeros(3))
    np.testing.assert_array_equal(trunk.legs, np.zeros(3))


def test_the_nearest_axis_of_an_axis_is_itself():
    for axis in AXES:
        assert nearest_axis(axis_vector(axis)) == (axis, 1.0)
        assert nearest_axis(0.5 * axis_vector(axis) + [0.1, -0.1, 0.1])[0] == axis


@pytest.mark.parametrize("sign", [-1, 1])
def test_axes_near_those_of_the_file_become_them(sign):
    turns = ("x", 20 * sign), ("y", 8 * sign)
    lean, heading = (Rotation.from_euler(*turn, degrees=True).as_matrix() for turn in turns)
    np.testing.assert_allclose(upright(lean), np.eye(3), atol=1e-12)
    np.testing.assert_allclose(squared(lean), np.eye(3), atol=1e-12)
    np.testing.assert_allclose(upright(heading), heading, atol=1e-12)
    np.testing.assert_allclose(squared(heading), np.eye(3), atol=1e-12)


@pytest.mark.parametrize("turn", [("x", -40), ("x", 40), ("y", -12), ("y", 12)])
def test_axes_far_from_those_of_the_file_stay(turn):
    axes = Rotation.from_euler(*turn, degrees=True).as_matrix()
    np.testing.assert_allclose(squared(axes), axes, atol=1e-12)


@ways
def test_squared_axes_are_a_rotation(way):
    for change in (upright, squared):
        axes = change(way.as_matrix())
        np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1.0)


def _region(body: Body, name: str) -> str:
    number = body.regions.of_joint[body.skeleton.index(name)]
    return body.regions.names[number] if number >= 0 else ""


def test_regions_of_a_person():
    body = body_of(person())
    regions = {
        "LeftWrist": "left hand",
        "LeftWrist_End": "left hand",
        "RightElbow": "right forearm",
        "RightShoulder": "right upper arm",
        "LeftCollar": "trunk",
        "Chest2": "trunk",
        "Head_End": "head",
        "LeftHip": "hips",
        "LeftKnee": "left shin",
        "LeftToe_End": "left foot",
    }
    assert {name: _region(body, name) for name in regions} == regions
    assert body.regions.names[:3] == ("left hand", "right hand", "head")
    regions = body_of(person()).regions
    joined = {
        frozenset((regions.names[a], regions.names[b])) for a, b in zip(*np.nonzero(regions.neighbours), strict=True)
    }
    assert {frozenset(("left hand", "left forearm")), frozenset(("hips", "right shin"))} <= joined
    assert frozenset(("left hand", "right hand")) not in joined
    assert (regions.neighbours == regions.neighbours.T).all()
    assert regions.neighbours.diagonal().all()
    body = person()
    offsets = np.array(with_bone(body, "Sword", "LeftWrist").offsets)
    offsets[-1] = [0.9, 0.0, 0.0]
    assert _region(body_of(with_bone(body, "Sword", "LeftWrist").with_offsets(offsets)), "Sword") == ""


def test_root_on_the_floor_twist_joints_and_handles_are_no_part_of_the_body() -> None:
    body = body_of(sample_target("rigs/unreal_a").skeleton)
    assert _region(body, "index_03_l_End") == "left hand"
    assert _region(body, "thigh_l") == _region(body, "pelvis") == "hips"
    for name in ("root", "ik_hand_l", "ik_foot_root", "upperarm_twist_01_l", "calf_twist_01_r"):
        assert _region(body, name) == ""


@pytest.mark.parametrize("parent", ["LeftElbow", "Head", "Hips", "Chest3"])
def test_sleeves_hair_skirts_and_props_are_no_part_of_the_body(parent: str) -> None:
    body = body_of(with_bone(with_bone(person(), "Cloth1", parent), "Cloth2", "Cloth1"))
    assert _region(body, "Cloth1") == _region(body, "Cloth2") == ""


def test_without_an_anatomy_every_limb_is_a_region() -> None:
    regions = find_regions(dog(), None, above_hips=(0,))
    assert regions.of_joint[0] == -1
    assert (regions.of_joint[1:] >= 0).all()
    assert len(regions.names) >= 4


# The joints are named for the bones of VRM that they are, but for the first letter; "x" are no bones of it.
BONES = (
    "-hips(x1>-spine>-chest(-neck>x2>-head(-leftEye|-jaw)|"
    "-leftShoulder>-leftUpperArm>-leftLowerArm>-leftHand(-leftThumbMetacarpal>-leftThumbProximal>-leftThumbDistal|"
    "-leftIndexProximal>-leftIndexIntermediate>-leftIndexDistal)|-rightUpperArm>x3>-rightLowerArm>-rightHand)|"
    "-leftUpperLeg>-leftLowerLeg>-leftFoot>-leftToes|-rightUpperLeg>-rightLowerLeg>-rightFoot)"
)


def stated(text, without=()):
    """The skeleton of `tree` whose humanoid states the joints that begin with "-", except some, with other names."""
    body = tree(text)
    bones = [(name[1:], joint) for joint, name in enumerate(body.names) if name.startswith("-")]
    names = tuple(f"LeftArm{joint}" for joint in range(len(body)))
    return replace(body, names=names, humanoid=tuple(pair for pair in bones if pair[0] not in without))


def test_the_humanoid_alone_says_which_joint_is_which_part():
    body = stated(BONES)
    anatomy, joints = by_names(body), dict(body.humanoid)
    fingers = {
        **{f"leftThumb{k}": f"leftThumb{bone}" for k, bone in enumerate(("Metacarpal", "Proximal", "Distal"), 1)},
        **{f"leftIndex{k}": f"leftIndex{bone}" for k, bone in enumerate(("Proximal", "Intermediate", "Distal"), 1)},
    }
    expected = {bone: bone for bone in joints if "Eye" not in bone and bone != "jaw"} | fingers
    for finger in fingers.values():
        del expected[finger]
    assert anatomy.roles == {role: joints[bone] for role, bone in expected.items()}
    assert (anatomy.spine, anatomy.neck) == ((joints["spine"], joints["chest"]), (joints["neck"],))
    assert anatomy.method == "humanoid"
    assert recognised(Body.of(body)) == "joints as the humanoid in the file says"


@pytest.mark.parametrize("lost", [("neck",), ("head",), ("leftShoulder",), ("leftHand",), ("leftToes", "rightFoot")])
def test_bones_that_are_not_stated_have_no_role(lost):
    roles, less = by_names(stated(BONES)).roles, by_names(stated(BONES, lost)).roles
    fingers = {role for role in roles if role[-1].isdigit() and "leftHand" in lost}
    assert less == {role: joint for role, joint in roles.items() if role not in {*lost, *fingers}}


@pytest.mark.parametrize("lost", [("hips",), ("leftUpperArm", "rightLowerLeg")])
def test_too_few_bones_are_no_body_whatever_the_names(lost):
    body = stated(BONES, lost)
    assert by_names(body) is None
    assert by_names(replace(body, names=tree(BONES.replace("-", "")).names)) is None


def test_a_bone_that_hangs_elsewhere_has_no_role():
    body = stated(BONES)
    joints = dict(body.humanoid)
    joints["leftToes"], joints["jaw"] = joints["jaw"], joints["leftToes"]
    assert "leftToes" not in by_names(replace(body, humanoid=tuple(joints.items()))).roles


def test_it_stays_with_the_skeleton():
    body = stated(BONES)
    for copy in (body.with_offsets(body.offsets + 1), replace(body, up="Z"), pickle.loads(pickle.dumps(body))):
        assert copy.humanoid == body.humanoid
        assert by_names(copy) == by_names(body)


def test_a_body_with_other_names_moves_as_with_its_own():
    motion = swaying(person(), 12)
    body = person()
    roles = by_names(body).roles
    bare = replace(nameless(body), humanoid=tuple(roles.items()))
    plain, made = retarget(motion, body), retarget(motion, bare)
    assert {*match(Body.of_motion(motion), Body.of(bare)).method} <= {"names", "tip", ""}
    np.testing.assert_array_equal(made.motion.rotations, plain.motion.rotations)


@pytest.mark.parametrize(
    ("humanoid", "message"),
    [
        ("hips", "not made of pairs"),
        ((("hips",),), "not made of pairs"),
        ((("hips", 1.5),), "not made of pairs"),
        ((("hips", 999),), "not made of pairs"),
        ((("hips", -1),), "not made of pairs"),
        ((("hips", 0), ("hips", 1)), "has 'hips' twice"),
        ((("hips", 0), ("head", 0)), "has 0 twice"),
        (((7, 0, 1),), "not made of pairs"),
    ],
)
def test_what_is_no_humanoid_is_refused(humanoid, message):
    with pytest.raises(SkeletonError, match=message):
        replace(tree(BONES), humanoid=humanoid)
