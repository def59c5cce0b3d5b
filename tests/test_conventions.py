"""Naming conventions by the names of joints, and bodies whose shape shows the limbs that names do not."""

import re
from dataclasses import replace

import pytest
from bodies import SAMPLES
from named_bodies import BODY, ROLES, needs_names, published, roles, tree

from distretarget.body.anatomy import ARM, FINGERS, LEG
from distretarget.body.body import Body
from distretarget.body.conventions import convention_of, vocabulary
from distretarget.body.recognition import by_names
from distretarget.io.target_file import load_target


def test_names_of_new_bones_of_blender_may_stand_before_some_names():
    found = roles(tree(re.sub("(?=Hips|Spine>|Neck|Head)", "Bone.", BODY)))
    assert found == {role: re.sub("^(?=Hips|Spine$|Neck|Head)", "Bone.", name) for role, name in ROLES.items()}


@needs_names
@pytest.mark.parametrize(
    ("convention", "title"),
    [
        ("mixamo", "Mixamo"),
        ("humanik_motionbuilder", "HumanIK (MotionBuilder)"),
        ("rokoko_bvh_export", "Rokoko"),
        ("rokoko_newton", "Rokoko Newton"),
        ("lafan1", "LAFAN1"),
        ("perception_neuron_axis", "Perception Neuron"),
        ("cmu_motionbuilder", "CMU, MotionBuilder-friendly"),
        ("cmu_maxfriendly", "CMU, 3ds Max-friendly"),
        ("cmu_daz_friendly", "CMU, Daz-friendly"),
        ("second_life", "Poser, Second Life"),
        ("daz_genesis8", "Daz Genesis 3, 8"),
        ("xsens_mvn", "Xsens MVN"),
        ("bandai_namco", "Bandai Namco"),
        ("vrm_humanoid_1_0", "VRM"),
        ("smpl", "SMPL"),
        ("smplx", "SMPL"),
        ("smpl_bvh_fbx_names", "SMPL"),
        ("unreal_mannequin_ue4", "Unreal Engine 4"),
        ("unreal_mannequin_ue5", "Unreal Engine 5"),
        ("biped_3dsmax", "3ds Max Biped"),
        ("character_creator", "Character Creator"),
        ("vicon_blade", "Vicon Blade"),
        ("makehuman_default", "MakeHuman"),
        ("makehuman_cmu", "MakeHuman, CMU"),
    ],
)
def test_the_convention_is_recognised(convention, title):
    body = published(convention)
    assert convention_of(body) == by_names(body).convention == title


def soma_hand(side):
    fingers = "|".join(
        ">".join(f"{side}Hand{finger}{bone}" for bone in (1, 2, 3, 4, "End"))
        for finger in ("Index", "Middle", "Ring", "Pinky")
    )
    return f"({side}HandThumb1>{side}HandThumb2>{side}HandThumb3>{side}HandThumbEnd|{fingers})"


def soma(side, hand):
    arm = f"{side}Shoulder>{side}Arm>{side}ForeArm>{side}Hand{hand}"
    return arm, f"{side}Leg>{side}Shin>{side}Foot>{side}ToeBase>{side}ToeEnd"


@pytest.mark.parametrize("above", ["", "Root>"])
def test_soma_whose_thigh_is_called_leg(above):
    arms, legs = zip(*(soma(side, soma_hand(side)) for side in ("Left", "Right")), strict=True)
    head = "Neck1>Neck2>Head(HeadEnd|Jaw|LeftEye|RightEye)"
    body = tree(f"{above}Hips(Spine1>Spine2>Chest({head}|{'|'.join(arms)})|{'|'.join(legs)})")
    assert len(body) == 77 + bool(above)
    assert convention_of(body) == "SOMA"
    found = roles(body)
    assert found["hips"] == "Hips"
    assert [found[f"left{part}"] for part in ("UpperLeg", "LowerLeg", "Foot", "Toes")] == [
        "LeftLeg",
        "LeftShin",
        "LeftFoot",
        "LeftToeBase",
    ]
    assert [found[f"rightIndex{bone}"] for bone in (0, 1, 2, 3)] == [f"RightHandIndex{bone}" for bone in (1, 2, 3, 4)]
    assert [found[f"rightThumb{bone}"] for bone in (1, 2, 3)] == [f"RightHandThumb{bone}" for bone in (1, 2, 3)]


def test_100style_has_the_names_of_xsens():
    arm = "{0}Collar>{0}Shoulder>{0}Elbow>{0}Wrist"
    leg = "{0}Hip>{0}Knee>{0}Ankle>{0}Toe"
    sides = ("Right", "Left")
    upper = "|".join(["Neck>Head", *map(arm.format, sides)])
    body = tree(f"Hips(Chest>Chest2>Chest3>Chest4({upper})|{'|'.join(map(leg.format, sides))})")
    assert convention_of(body) == "Xsens MVN"
    assert roles(body)["leftUpperLeg"] == "LeftHip"


def test_words_of_the_data_make_no_convention_twice():
    conventions = vocabulary().conventions
    names = {(convention.title, frozenset(convention.parts)) for convention in conventions}
    assert len(names) == len(conventions)  # a title may stand for several generations of a rig
    assert all({"hips", "head", *ARM[1:], *LEG[:3]} <= set(convention.parts.values()) for convention in conventions)


RIGS = {path.stem: load_target(path).skeleton for path in sorted((SAMPLES / "rigs").glob("*_t.json"))}
LIMBS = {"arms": ("Shoulder", "UpperArm", "LowerArm", "Hand"), "legs": ("UpperLeg", "LowerLeg", "Foot", "Toes")}


def unnamed(body, roles):
    """The body whose joints of these roles have names that mean nothing."""
    joints = {by_names(body).roles[role] for role in roles if role in by_names(body).roles}
    return replace(body, names=tuple(f"b{j}" if j in joints else name for j, name in enumerate(body.names)))


@pytest.mark.parametrize("sides", [("left", "right"), ("left",), ("right",)])
@pytest.mark.parametrize("limbs", LIMBS)
@pytest.mark.parametrize("name", RIGS)
def test_limbs_without_names_are_found_by_shape(name, limbs, sides):
    body = RIGS[name]
    whole = Body.of(body).anatomy
    lost = unnamed(body, [side + part for side in sides for part in LIMBS[limbs]])
    found = Body.of(lost).anatomy
    long = [side + part for side in ("left", "right") for part in ("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")]
    assert {role: found.roles[role] for role in long} == {role: whole.roles[role] for role in long}
    assert (found.spine, found.method) == (whole.spine, "shape")


def test_names_alone_count_where_they_show_all_limbs():
    for body in RIGS.values():
        assert Body.of(body).anatomy is by_names(body)


@pytest.mark.parametrize(
    "words",
    [
        ("Daumen", "Zeigefinger", "Mittelfinger", "Ringfinger", "KleinerFinger"),
        ("Pulgar", "Índice", "Medio", "Anular", "Meñique"),
        ("Pouce", "Index", "Majeur", "Annulaire", "Auriculaire"),
        ("拇指", "食指", "中指", "无名指", "小指"),
    ],
    ids=["German", "Spanish", "French", "Chinese"],
)
def test_names_show_the_fingers_of_a_body_that_its_shape_shows(words):
    body = RIGS["mixamo_t"]
    fingers = {role: joint for role, joint in by_names(body).roles.items() if role[-1].isdigit()}
    names = [f"b{joint}" for joint in range(len(body))]
    for role, joint in fingers.items():
        side = "left" if role.startswith("left") else "right"
        finger = FINGERS.index(role.removeprefix(side)[:-1])
        names[joint] = f"{words[finger]}{role[-1]}_{side[0].upper()}"
    found = Body.of(replace(body, names=tuple(names))).anatomy
    assert found.method == "shape"
    assert {role: found.roles.get(role) for role in fingers} == fingers
