"""Parts of the body as the humanoid in the file states them, whatever the joints are called."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from bodies import nameless, person, swaying
from named_bodies import tree

from distretarget import retarget
from distretarget.body.body import Body
from distretarget.body.recognition import by_names
from distretarget.cli.skeleton import recognised
from distretarget.errors import SkeletonError
from distretarget.matching.matching import match

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
