"""The parts of a body, found without names."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import CORPUS, mirrored, moved, needs_corpus, person, posed, swaying
from scipy.spatial.transform import Rotation

from distretarget import Skeleton, read_bvh
from distretarget.anatomy import SIDES
from distretarget.shape import by_shape

LIMBS = ("Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "Toes")
TURN = Rotation.from_rotvec([1.0, -2.0, 0.7])
PERSON = {
    "hips": "Hips",
    "spine": "Chest",
    "chest": "Chest2",
    "upperChest": "Chest3",
    "neck": "Neck",
    "head": "Head",
    **{
        f"{side}{role}": side.capitalize() + name
        for side in SIDES
        for role, name in zip(
            LIMBS, ("Collar", "Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle", "Toe"), strict=True
        )
    },
}


def rig(bones):
    """A skeleton from {name: (parent, offset)}; names that end in _End are End Sites."""
    names = tuple(bones)
    return Skeleton(
        names,
        np.array([names.index(parent) if parent else -1 for parent, _ in bones.values()]),
        np.array([offset for _, offset in bones.values()], float),
        ((),) * len(names),
        np.array([name.endswith("_End") for name in names]),
    )


def bones_of(skeleton):
    parents = [skeleton.names[parent] if parent >= 0 else "" for parent in skeleton.parents]
    return dict(zip(skeleton.names, zip(parents, skeleton.offsets, strict=True), strict=True))


def person_with(bones):
    """A person with other or more bones."""
    return rig(bones_of(person()) | bones)


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
    """The skeleton with children in another order and names that say nothing, and the old number of each joint."""
    draw = np.random.default_rng(seed)
    order, ready = [0], list(skeleton.children[0])
    while ready:
        order.append(ready.pop(draw.integers(len(ready))))
        ready.extend(skeleton.children[order[-1]])
    parents = [order.index(skeleton.parents[joint]) if joint else -1 for joint in order]
    return Skeleton(
        tuple(f"j{joint}" for joint in range(len(order))),
        np.array(parents),
        skeleton.offsets[order],
        tuple(skeleton.channels[joint] for joint in order),
        skeleton.end_sites[order],
    ), order


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
    assert (anatomy.convention, anatomy.found) == ("", "shape")


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
    first = "Right"  # is what the file has first
    assert names["leftUpperLeg"] == f"{first}Hip"
    assert names["leftUpperArm"] == f"{first}Shoulder"
    assert {role: names[role] for role in ("hips", "head", "neck")} == {"hips": "Hips", "head": "Head", "neck": "Neck"}


def test_scale_and_turn_change_nothing():
    motion = swaying(person(), angle=0.3)
    expected = by_shape(lying(person()), motion.positions).roles
    assert expected == by_shape(person()).roles
    other = moved(motion, TURN, shift=(3, 4, 5), scale=100.0)
    assert by_shape(other.skeleton, other.positions).roles == expected
    assert by_shape(lying(other.skeleton), other.positions).roles == expected
    rest = person().with_offsets(TURN.apply(np.array(person().offsets)))
    assert by_shape(rest).roles == expected


def test_a_mirror_swaps_the_sides():
    motion = mirrored(swaying(person(), angle=0.3))
    expected = by_shape(person()).mirrored.roles
    assert by_shape(motion.skeleton).roles == expected
    assert by_shape(lying(motion.skeleton), motion.positions).roles == expected


@pytest.mark.parametrize("forward", [1, -1])
def test_knees_tell_the_sides_where_feet_do_not(forward):
    straight = person_with({f"{side}Toe": (f"{side}Ankle", (0, -0.1, 0)) for side in ("Left", "Right")})
    turns = {f"{side}Hip": np.array([-forward * 0.6, 0, 0]) for side in ("Left", "Right")}
    turns |= {f"{side}Knee": np.array([forward * 0.6, 0, 0]) for side in ("Left", "Right")}
    motion = posed(person_with(straightened(straight)), turns, np.zeros((3, 3)))
    names = named(motion.skeleton, by_shape(motion.skeleton, motion.positions))
    assert names["leftUpperLeg"] == ("LeftHip" if forward > 0 else "RightHip")
    assert names["leftHand"] == ("LeftWrist" if forward > 0 else "RightWrist")


def straightened(skeleton):
    return {name: bone for name, bone in bones_of(skeleton).items() if "Toe" in name} | {
        f"{side}Toe_End": (f"{side}Toe", (0, -0.1, 0)) for side in ("Left", "Right")
    }


@pytest.mark.parametrize("forward", [1, -1])
def test_the_course_tells_the_sides_where_legs_do_not(forward):
    body = person_with(straightened(person_with({f"{s}Toe": (f"{s}Ankle", (0, -0.1, 0)) for s in ("Left", "Right")})))
    motion = posed(body, {}, np.linspace([0, 1, 0], [0, 1, 3.0 * forward], 10))
    names = named(body, by_shape(body, motion.positions))
    assert names["leftUpperLeg"] == ("LeftHip" if forward > 0 else "RightHip")


TWISTS = sided(
    {
        "LeftElbow": ("LeftArmTwist2", (0.09, 0, 0)),
        "LeftArmTwist": ("LeftShoulder", (0.09, 0, 0)),
        "LeftArmTwist2": ("LeftArmTwist", (0.09, 0, 0)),
        "LeftForeTwist": ("LeftElbow", (0.13, 0, 0)),
        "LeftWrist": ("LeftForeTwist", (0.13, 0, 0)),
        "LeftThighTwist": ("LeftHip", (0, -0.2, 0)),
        "LeftKnee": ("LeftThighTwist", (0, -0.235, 0)),
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
    body = in_order(bones_of(person()) | bones)
    if alone:
        assert named(body, by_shape(body)) == PERSON
        return
    motion = posed(
        body,
        {"LeftKnee": np.array([0.4, 0, 0]), "LeftElbow": np.array([0, -0.9, 0]), "Neck": np.array([0.1, 0, 0])},
        np.linspace([0, 1, 0], [0, 1, 1], 4),
    )
    assert named(body, by_shape(lying(body), motion.positions)) == PERSON


def in_order(bones):
    """The rig with parents before children."""
    done = {}
    while len(done) < len(bones):
        done |= {name: bone for name, bone in bones.items() if name not in done and bone[0] in (*done, "")}
    return rig(done)
