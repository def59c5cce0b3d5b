"""Naming conventions, bodies whose shape shows the limbs that names do not, and joints of unexpected names."""

import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from bodies import SAMPLES, sample_target
from character_rigs import Rig
from named_bodies import BODY, ROLES, needs_names, published, roles, tree

from distretarget import DistretargetError, retarget
from distretarget.body.anatomy import ARM, FINGERS, LEG
from distretarget.body.body import Body
from distretarget.body.conventions import convention_of, vocabulary
from distretarget.body.recognition import by_names
from distretarget.io.bvh import parse_bvh
from distretarget.io.input_file import InputFile
from distretarget.io.reading import load_target, parse_target


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


SOMA = Rig(
    "Hips=hips(Spine1>Spine2>Chest(Neck1>Neck2>Head(HeadEnd|Jaw|LeftEye|RightEye)|{@Shoulder>@Arm>@ForeArm>@Hand("
    "@HandThumb1=Thumb1>@HandThumb2=Thumb2>@HandThumb3=Thumb3>@HandThumbEnd|"
    + "|".join(
        f"@Hand{name}1={finger}0>@Hand{name}2={finger}1>@Hand{name}3={finger}2>@Hand{name}4={finger}3>@Hand{name}End"
        for name, finger in zip(("Index", "Middle", "Ring", "Pinky"), FINGERS[1:], strict=True)
    )
    + ")})|{@Leg=UpperLeg>@Shin=LowerLeg>@Foot=Foot>@ToeBase=Toes>@ToeEnd})",
    ("Left", "Right"),
)


@pytest.mark.parametrize("above", ["", "Root>"])
def test_soma_whose_thigh_is_called_leg(above):
    body = tree(above + SOMA.text)
    assert len(body) == 77 + bool(above)
    assert convention_of(body) == "SOMA"
    found = roles(body)
    assert {role: [found[role]] for role in SOMA.roles} == SOMA.roles


def test_100style_has_the_names_of_xsens():
    limbs = "Chest4(Neck>Head|{@Collar>@Shoulder>@Elbow>@Wrist})|{@Hip>@Knee>@Ankle>@Toe}"
    body = tree(Rig(f"Hips(Chest>Chest2>Chest3>{limbs})", ("Right", "Left")).text)
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


SHORT = 3  # frames
TEXT = (SAMPLES / "walk.bvh").read_text()
NAMES = re.findall(r"(?:ROOT|JOINT) (\w+)", TEXT)
HIERARCHY, FRAMES = TEXT.split("Frames: ")
HEAD, *ROWS = FRAMES.splitlines()[1:]
LEGS = [name for name in NAMES if re.search("Hip|Knee|Ankle|Toe", name)]
TARGET = sample_target("child")


def renamed(names):
    """The first frames of a walk with other names of joints, by their own."""
    hierarchy = re.sub(r"(ROOT|JOINT) (\w+)", lambda found: f"{found[1]} {names.get(found[2], found[2])}", HIERARCHY)
    return parse_bvh("\n".join([f"{hierarchy}Frames: {SHORT}", HEAD, *ROWS[:SHORT]]), "walk.bvh")


def is_faulty(clip):
    """Whether a clip becomes neither a finite result with metrics nor an error of one line."""
    try:
        result = retarget(clip, TARGET)
        metrics, warnings = result.metrics, [*result.warnings]
    except DistretargetError as refused:
        return "\n" in str(refused)  # an error of several lines is a fault
    return not (np.isfinite(result.motion.positions).all() and metrics) or "nan" in " ".join(warnings)


@pytest.mark.parametrize("count", [1, 2])
def test_joints_with_unknown_names_do_no_harm(count):
    chosen = [*combinations(NAMES, count)][:: 1 if count == 1 else 5]
    assert not [names for names in chosen if is_faulty(renamed({name: f"Foo{k}" for k, name in enumerate(names)}))]


def test_two_joints_of_the_legs_may_have_each_others_names():
    assert not [pair for pair in combinations(LEGS, 2) if is_faulty(renamed(dict(zip(pair, pair[::-1], strict=True))))]


def test_hips_below_each_other_and_targets_at_no_place_do_no_harm():
    """The hips give no axis across the body; the frames of a target with an impossible one are not used."""
    below = re.sub(r"(JOINT (?:Left|Right)Hip\s*\{\s*OFFSET).*", r"\1 0 -5 0", HIERARCHY)
    head, rows = f"{below}Frames: 2\n{HEAD}\n", ROWS[:2]
    assert not is_faulty(parse_bvh(head + "\n".join(rows), "below.bvh"))
    far = parse_target(InputFile("\n".join([head + f"1e308 {rows[0].partition(' ')[2]}", rows[1]]).encode(), "far.bvh"))
    assert far.motion is None
