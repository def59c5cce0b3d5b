"""The parts of a body, found without names."""

import numpy as np
import pytest
from animals import rig_of
from bodies import CORPUS, mirrored, moved, nameless, needs_corpus, person, posed, reordered, swaying, tree_of
from built_rigs import BUILDS, with_axes
from characters import PERSON
from disguises import sample, with_twists
from scipy.spatial.transform import Rotation

from distretarget import Body, read_bvh
from distretarget.body.anatomy import SIDES
from distretarget.body.shape import by_shape

TURN = Rotation.from_rotvec([1.0, -2.0, 0.7])


def bones_of(skeleton):
    parents = [skeleton.names[parent] if parent >= 0 else "" for parent in skeleton.parents]
    return dict(zip(skeleton.names, zip(parents, skeleton.offsets, strict=True), strict=True))


def in_order(bones):
    """The rig with parents before children."""
    done = {}
    while len(done) < len(bones):
        done |= {name: bone for name, bone in bones.items() if name not in done and bone[0] in (*done, "")}
    return rig_of(done)


def person_with(bones):
    """A person with other or more bones."""
    return in_order(bones_of(person()) | bones)


def without(*words):
    """A person's bones without those whose names contain one of the words."""
    return {name: bone for name, bone in bones_of(person()).items() if not any(word in name for word in words)}


def sided(bones):
    """{name: (parent, offset)} on the left side, and its mirror image with Right for Left."""
    right = {
        name.replace("Left", "Right"): (parent.replace("Left", "Right"), np.multiply(offset, [-1, 1, 1]))
        for name, (parent, offset) in bones.items()
    }
    return bones | right


def named(skeleton, anatomy):
    return {role: skeleton.names[joint] for role, joint in anatomy.roles.items()}


def renumbered(skeleton, seed):
    """The skeleton with children in another order and meaningless names, and the old number of each joint."""
    other, order = reordered(skeleton, seed)
    return nameless(other), order


def lying(skeleton):
    """The skeleton with all bones along X."""
    return skeleton.with_offsets(skeleton.lengths[:, None] * [1.0, 0, 0])


def stretched(**turns):
    """A person who walks along Z, joints turned."""
    return posed(person(), turns, np.linspace([0, 1, 0], [0, 1, 2], 8))


# Bodies


def test_a_person():
    body = person()
    anatomy = by_shape(body)
    assert named(body, anatomy) == PERSON
    assert [body.names[joint] for joint in anatomy.spine] == ["Chest", "Chest2", "Chest3"]
    assert [body.names[joint] for joint in anatomy.neck] == ["Neck"]
    assert (anatomy.convention, anatomy.method) == ("", "shape")


@pytest.mark.parametrize("seed", range(5))
def test_names_and_order_say_nothing(seed):
    body, order = renumbered(person(), seed)
    found = by_shape(body)
    assert {role: order[joint] for role, joint in found.roles.items()} == by_shape(person()).roles


@pytest.mark.parametrize("seed", range(3))
def test_a_rest_pose_along_one_axis_and_a_motion(seed):
    motion = stretched(LeftKnee=np.array([0.3, 0, 0]), RightElbow=np.array([0.2, 1.0, 0]))
    body, order = renumbered(lying(person()), seed)
    anatomy = by_shape(body, motion.positions[:, order])
    assert {role: order[joint] for role, joint in anatomy.roles.items()} == by_shape(person()).roles


def test_a_rest_pose_along_one_axis_alone_leaves_the_sides_to_the_order_of_the_file():
    body = person()
    names = named(body, by_shape(lying(body)))
    assert names["leftUpperLeg"] == "RightHip"  # the file has the right side first
    assert names["leftUpperArm"] == "RightShoulder"
    assert {role: names[role] for role in ("hips", "head", "neck")} == {"hips": "Hips", "head": "Head", "neck": "Neck"}


def test_a_mirror_swaps_the_sides():
    motion = mirrored(swaying(person(), angle=0.3))
    expected = by_shape(person()).mirrored.roles
    assert by_shape(motion.skeleton).roles == expected
    assert by_shape(lying(motion.skeleton), motion.positions).roles == expected
    motion = swaying(person(), angle=0.3)
    expected = by_shape(lying(person()), motion.positions).roles
    assert expected == by_shape(person()).roles
    other = moved(motion, TURN, shift=(3, 4, 5), scale=100.0)
    assert by_shape(other.skeleton, other.positions).roles == expected
    assert by_shape(lying(other.skeleton), other.positions).roles == expected
    rest = person().with_offsets(TURN.apply(np.array(person().offsets)))
    assert by_shape(rest).roles == expected


STRAIGHT_FEET = sided({"LeftToe": ("LeftAnkle", (0, -0.1, 0)), "LeftToe_End": ("LeftToe", (0, -0.1, 0))})


@pytest.mark.parametrize("front", [1, -1])
def test_knees_show_the_sides_where_feet_do_not(front):
    turns = {f"{side}Hip": np.array([-front * 0.6, 0, 0]) for side in ("Left", "Right")}
    turns |= {f"{side}Knee": np.array([front * 0.6, 0, 0]) for side in ("Left", "Right")}
    motion = posed(person_with(STRAIGHT_FEET), turns, np.zeros((3, 3)))
    names = named(motion.skeleton, by_shape(motion.skeleton, motion.positions))
    assert names["leftUpperLeg"] == ("LeftHip" if front > 0 else "RightHip")
    assert names["leftHand"] == ("LeftWrist" if front > 0 else "RightWrist")


@pytest.mark.parametrize("front", [1, -1])
def test_the_direction_of_walking_shows_the_sides_where_legs_do_not(front):
    motion = posed(person_with(STRAIGHT_FEET), {}, np.linspace([0, 1, 0], [0, 1, 3.0 * front], 10))
    names = named(motion.skeleton, by_shape(motion.skeleton, motion.positions))
    assert names["leftUpperLeg"] == ("LeftHip" if front > 0 else "RightHip")


TWISTS = sided(
    {
        "LeftElbow": ("LeftArmTwist2", (0.09, 0, 0)),
        "LeftArmTwist": ("LeftShoulder", (0.09, 0, 0)),
        "LeftArmTwist2": ("LeftArmTwist", (0.09, 0, 0)),
        "LeftForeTwist": ("LeftElbow", (0.13, 0, 0)),
        "LeftWrist": ("LeftForeTwist", (0.13, 0, 0)),
        "LeftShinTwist": ("LeftKnee", (0, -0.2, 0)),
        "LeftAnkle": ("LeftShinTwist", (0, -0.253, 0)),
    }
)
HAND = sided(
    {f"LeftPalm{k}": ("LeftWrist", (0.08, 0, 0.02 * k)) for k in range(4)}
    | {f"LeftFinger{k}": (f"LeftPalm{k}", (0.05, 0, 0)) for k in range(4)}
    | {f"LeftTip{k}": (f"LeftFinger{k}", (0.04, 0, 0)) for k in range(4)}
    | {"LeftThumb": ("LeftWrist", (0.03, -0.02, 0.05)), "LeftThumb2": ("LeftThumb", (0.04, 0, 0.03))}
)
FACE = sided({"LeftEye": ("Head", (0.03, 0.08, 0.08)), "LeftBrow": ("Head", (0.03, 0.1, 0.09))}) | {
    "Jaw": ("Head", (0, 0.01, 0.03)),
    "Tongue": ("Jaw", (0, 0, 0.03)),
    "Tongue2": ("Tongue", (0, 0, 0.03)),
}
HAIR = {
    "Tail1": ("Head", (0, 0.15, -0.1)),
    "Tail2": ("Tail1", (0, -0.2, 0)),
    "Tail3": ("Tail2", (0, -0.2, 0)),
    "Tail4": ("Tail3", (0, -0.2, 0)),
}
BRAIDS = sided(
    {f"LeftBraid{k}": (f"LeftBraid{k - 1}" if k else "Head", (0.04, -0.08 if k else 0.05, 0)) for k in range(7)}
)
WINGS = sided(
    {f"LeftWing{k}": (f"LeftWing{k - 1}" if k else "Chest2", (0.5, 0.1, -0.2 if k == 0 else 0)) for k in range(4)}
)
SHAPES = {
    "twist joints": TWISTS,
    "fingers": HAND,
    "a face": FACE,
    "fingers and a face": HAND | FACE,
    "a jaw alone": {"Jaw": ("Head", (0, -0.03, 0.06))},
    "hair": HAIR,
    "hair and a face": HAIR | FACE,
    "braids": BRAIDS,
    "wings": WINGS,
    "breasts": sided({"LeftBreast": ("Chest3", (0.08, 0, 0.1)), "LeftBreast_End": ("LeftBreast", (0, 0, 0.05))}),
    "a tail": {f"Tail{k}": (f"Tail{k - 1}" if k else "Hips", (0, 0, -0.15)) for k in range(8)},
    "a backpack": {"Pack": ("Chest3", (0, 0, -0.2)), "PackTop": ("Pack", (0, 0.1, 0))},
    "a skirt": sided({f"LeftSkirt{k}": (f"LeftSkirt{k - 1}" if k else "Hips", (0.05, -0.15, 0)) for k in range(4)}),
    "the top of the head": {"HeadTop": ("Head", (0, 0.19, 0)), "HeadTop_End": ("HeadTop", (0, 0.01, 0))},
    "twist helpers beside the bones": sided(
        {"LeftArmHelper": ("LeftShoulder", (0.13, 0, 0)), "LeftForeHelper": ("LeftElbow", (0.13, 0, 0))}
    ),
    "a heel": sided({"LeftHeel": ("LeftAnkle", (0, -0.05, -0.04))}),
    "a sword": {"Sword": ("RightWrist", (-0.08, 0, 0.05)), "Sword_End": ("Sword", (0, 0, 0.9))},
}


@pytest.mark.parametrize("bones", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("alone", [True, False])
def test_what_else_a_body_has_changes_nothing(bones, alone):
    body = person_with(bones)
    if alone:
        assert named(body, by_shape(body)) == PERSON
        return
    motion = posed(
        body,
        {"LeftKnee": np.array([0.4, 0, 0]), "LeftElbow": np.array([0, -0.9, 0]), "Neck": np.array([0.1, 0, 0])},
        np.linspace([0, 1, 0], [0, 1, 1], 4),
    )
    assert named(body, by_shape(lying(body), motion.positions)) == PERSON


# Other trees of the same body


def test_a_thigh_in_two_pieces_begins_above_both():
    twists = sided({"LeftThighTwist": ("LeftHip", (0, -0.2, 0)), "LeftKnee": ("LeftThighTwist", (0, -0.235, 0))})
    body = person_with(twists)
    assert named(body, by_shape(body)) == PERSON


@pytest.mark.parametrize("parts", [("Elbow", "Knee"), ("Knee",), ("Elbow", "Wrist", "Knee")])
def test_a_thigh_in_two_pieces_above_a_whole_shin_is_one(parts):
    """Daz has a twist joint in the thigh and none in the shin."""
    skeleton = with_twists(sample("walk")[:1], parts).skeleton
    anatomy = Body.of(nameless(skeleton)).anatomy
    assert named(skeleton, anatomy) == named(skeleton, Body.of(skeleton).anatomy)


@pytest.mark.parametrize("build", BUILDS)
@pytest.mark.parametrize("clip", ["walk", "squat", "wave"])
def test_twist_joints_of_a_rig_that_lies_at_rest_are_no_elbows_and_knees(clip, build):
    """The motion shows which bones are in line."""
    motion = with_twists(sample(clip))
    lying = with_axes(motion, build(Body.of_motion(motion)))
    known = Body.of_motion(motion).anatomy
    assert named(lying.skeleton, by_shape(lying.rigid_skeleton, lying.positions)) == named(motion.skeleton, known)


def test_collar_bones_from_the_neck_and_legs_from_the_spine():
    bones = bones_of(person())
    bones |= sided(
        {"LeftCollar": ("Neck", (0.03, 0, 0)), "LeftShoulder": ("LeftCollar", (0.15, -0.02, 0))}
        | {"LeftHip": ("Chest", (0.1, -0.1, 0))}
    )
    body = in_order(bones)
    anatomy = by_shape(body)
    names = named(body, anatomy)
    assert [body.names[joint] for joint in anatomy.neck] == ["Neck"]
    assert [body.names[joint] for joint in anatomy.spine] == ["Chest2", "Chest3"]
    assert names.pop("hips") == "Chest"
    assert names.items() >= {role: name for role, name in PERSON.items() if role.startswith(SIDES)}.items()


def test_a_floor_root_with_helpers_above_the_hips():
    bones = {"Floor": ("", (0, 0, 0)), "Hips": ("Floor", (0, 0.99, 0)), "Aim": ("Floor", (0, 0, 0))}
    bones |= sided({"LeftAimFoot": ("Aim", (0.1, 0.1, 0)), "LeftAimHand": ("Aim", (0.7, 1.4, 0))})
    body = person_with(bones)
    assert named(body, by_shape(body)) == PERSON


def test_joints_that_coincide():
    bones = sided({"LeftHipJoint": ("Hips", (0, 0, 0)), "LeftHip": ("LeftHipJoint", (0.1, 0, 0))})
    bones |= sided({"LeftCollar": ("Chest3", (0, 0, 0)), "LeftShoulder": ("LeftCollar", (0.2, 0.07, 0))})
    bones |= {"LowerBack": ("Hips", (0, 0, 0)), "Chest": ("LowerBack", (0, 0.16, 0))}
    bones |= {"LowerNeck": ("Chest3", (0, 0, 0)), "Neck": ("LowerNeck", (0, 0.07, 0))}
    body = person_with(bones)
    anatomy = by_shape(body)
    assert named(body, anatomy) == PERSON | {"neck": "LowerNeck", "spine": "LowerBack", "chest": "Chest"}
    assert len(anatomy.spine) == 4


def test_what_is_absent_is_left_out():
    bones = without("Toe", "Neck", "Collar") | {"Head": ("Chest3", (0, 0.3, 0))}
    bones |= sided({"LeftShoulder": ("Chest3", (0.2, 0.05, 0)), "LeftAnkle_End": ("LeftAnkle", (0, -0.05, 0.1))})
    body = in_order(bones)
    absent = {"neck", *(f"{side}{role}" for side in SIDES for role in ("Shoulder", "Toes"))}
    assert named(body, by_shape(body)) == {role: name for role, name in PERSON.items() if role not in absent}
    body = in_order(without("_End"))
    assert named(body, by_shape(body)) == PERSON


# Bodies that are not human


def chain(name, parent, *offsets):
    """{name0: (parent, offset), ...}, each joint below the one before."""
    return {f"{name}{k}": (f"{name}{k - 1}" if k else parent, offset) for k, offset in enumerate(offsets)}


def limbs(tops, offsets):
    """Equal chains below the root that begin at different places."""
    return {
        name: bone for k, top in enumerate(tops) for name, bone in chain(f"Limb{k}x", "Root", top, *offsets).items()
    }


ROOT = {"Root": ("", (0, 0, 0))}
LEG = [(0.1, -0.1, 0), (0, -0.4, 0.02), (0, -0.4, -0.02), (0, -0.05, 0.1)]
HORSE = (
    ROOT
    | sided(chain("LeftHind", "Root", *LEG))
    | chain("Spine", "Root", (0, 0.05, 0.3), (0, 0, 0.4), (0, 0, 0.3))
    | sided(chain("LeftFore", "Spine2", *LEG))
    | chain("Neck", "Spine2", (0, 0.1, 0.1), (0, 0.2, 0.2), (0, 0.1, 0.1))
    | chain("Tail", "Root", *[(0, 0, -0.2)] * 4)
)
OTHERS = {
    "a horse": HORSE,
    "a chain": ROOT | chain("Link", "Root", *[(0, -0.3, 0)] * 12),
    "one joint": ROOT,
    "a star": ROOT
    | limbs(TURN.apply([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0]]), [[0.1, 0.2, 0.3]] * 2),
    "a table": ROOT | limbs([(1, 0, 1), (1, 0, -1), (-1, 0, 1), (-1, 0, -1)], [(0, -1, 0), (0, -1, 0), (0, -0.1, 0)]),
    "a hand": ROOT | limbs([(0.08, 0, 0.02 * k) for k in range(5)], [(0.04, 0, 0), (0.03, 0, 0), (0.02, 0, 0)]),
    "a face": ROOT | {"Head": ("Root", (0, 0.1, 0))} | FACE,
    "a person without arms": without("Collar", "Shoulder", "Elbow", "Wrist"),
    "a person without legs": without("LeftHip", "RightHip", "Knee", "Ankle", "Toe"),
    "a person without a head": without("Neck", "Head"),
}


@pytest.mark.parametrize("bones", OTHERS.values(), ids=OTHERS)
def test_what_is_no_human_body(bones):
    assert by_shape(in_order(bones)) is None


def test_a_horse_in_motion_is_no_human_body_whatever_its_rest_pose():
    horse = in_order(HORSE)
    positions = posed(horse, {"Spine1": np.array([0.2, 0, 0])}, np.zeros((5, 3))).positions
    assert by_shape(horse, positions) is None
    assert by_shape(lying(horse), positions) is None


def test_random_trees_are_no_human_bodies():
    draw = np.random.default_rng(0)
    for _ in range(200):
        count = int(draw.integers(2, 40))
        parents = np.array([-1, *(draw.integers(max(0, k - 4), k) for k in range(1, count))])
        assert by_shape(tree_of(draw.normal(size=(count, 3)), parents=parents)) is None
    assert by_shape(lying(person()), np.empty((0, len(person()), 3))) is not None


# Real rigs


@needs_corpus
@pytest.mark.parametrize(
    "file",
    [
        "animated_drawings/dab.bvh",
        "animated_drawings/jesse_dance.bvh",
        "cmu_daz/02_01.bvh",
        "cmu_mb/02_01.bvh",
        "makehuman/walk1.bvh",
        "pybvh/bvh_test3.bvh",
    ],
)
def test_real_rigs_whose_rest_pose_lies_along_one_axis_in_any_order(file):
    motion = read_bvh(CORPUS / file)
    body, order = renumbered(lying(motion.rigid_skeleton), 1)
    found = by_shape(body, motion.positions[:, order])
    expected = by_shape(motion.rigid_skeleton, motion.positions)
    assert {role: order[joint] for role, joint in found.roles.items()} == expected.roles
