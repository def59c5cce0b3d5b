"""Parts of the body by names: published conventions exactly, and what names may differ in."""

import re
import sys

import numpy as np
import pytest
from bodies import CORPUS, needs_corpus
from character_rigs import RIGS, Rig
from named_bodies import BODY, DATA, ROLES, needs_names, published, roles, skeleton, tree

from distretarget.body.anatomy import ARM, LEG, SIDES
from distretarget.body.conventions import convention_of
from distretarget.body.recognition import by_names
from distretarget.io.bvh import read_bvh


def renamed(text, rename):
    return re.sub(r"[^()|>]+", lambda match: rename(match[0]), text)


def sided(*parts, left="left"):
    """What the roles of one side are played by, as "left" says."""
    return dict(zip([left + part for part in (*ARM, *LEG)], parts, strict=True))


@needs_names
@pytest.mark.parametrize("convention", DATA["_roles"])
def test_published_roles_are_found_exactly(convention):
    expected = {role: name for role, name in DATA["_roles"][convention].items() if name}
    found = roles(published(convention))
    assert {role: name for role, name in found.items() if not role[-1].isdigit()} == expected


@needs_names
def test_makehuman_with_its_spine_counted_downwards_and_bones_in_two():
    body = published("makehuman_default")
    found, anatomy = roles(body), by_names(body)
    arm, leg = ("clavicle.L", "upperarm01.L", "lowerarm01.L", "wrist.L"), ("upperleg01.L", "lowerleg01.L", "foot.L")
    assert found.items() >= sided(*arm, *leg, "toe3-1.L").items()
    assert found["hips"] == "root"
    assert [body.names[joint] for joint in anatomy.spine] == ["spine05", "spine04", "spine03", "spine02", "spine01"]
    assert [body.names[joint] for joint in anatomy.neck] == ["neck01", "neck02", "neck03"]
    assert [found[f"leftIndex{i}"] for i in range(4)] == ["metacarpal1.L", "finger2-1.L", "finger2-2.L", "finger2-3.L"]
    assert [found[f"leftThumb{i}"] for i in range(1, 4)] == ["finger1-1.L", "finger1-2.L", "finger1-3.L"]


@needs_names
def test_makehuman_cmu_hangs_legs_and_spine_from_the_root_and_its_stand_ins_have_no_roles():
    found = roles(published("makehuman_cmu"))
    assert (found["hips"], found["spine"], found["upperChest"]) == ("Root", "Spine1", "Spine3")
    assert (
        found.items()
        >= sided(*("Clavicle_L", "UpArm_L", "LoArm_L", "Hand_L", "UpLeg_L", "LoLeg_L", "Foot_L", "Toe_L")).items()
    )
    assert not [name for name in found.values() if name.startswith("__")]


@needs_names
def test_poser_leaves_the_dummy_out_of_the_neck():
    body = published("poser_secondlife_dummy")
    assert [body.names[joint] for joint in by_names(body).neck] == ["neck"]


@pytest.mark.parametrize("name", RIGS)
def test_every_part_of_a_rig_of_characters_is_found_and_nothing_else(name):
    """Among twist, face, hair and cloth bones."""
    rig = RIGS[name]
    body = tree(rig.text)
    anatomy = by_names(body)
    trunk = {role: [anatomy.roles[role]] for role in ("hips", "head")} | {"spine": anatomy.spine, "neck": anatomy.neck}
    limbs = {role: [joint] for role, joint in anatomy.roles.items() if role.startswith(("left", "right"))}
    found = {role: [body.names[joint] for joint in joints] for role, joints in (limbs | trunk).items()}
    assert found == {"neck": []} | rig.roles
    assert anatomy.convention == rig.title


@pytest.mark.parametrize(
    "rename",
    [
        lambda name: name,
        str.lower,
        str.upper,
        lambda name: f"mixamorig:{name}",
        lambda name: f"mixamorig7:{name}",
        lambda name: f"mixamorig_{name}",
        lambda name: f"Actor 3:{name}",
        lambda name: f"Armature/{name}",
        lambda name: f"Character1_{name}",
        lambda name: f"m_avg_{name}",
        lambda name: f"f_mosh_cmu05_0511_{name}",
        lambda name: f"DEF-{name}",
        lambda name: f"{name}_jnt",
        lambda name: f"{name}_0{len(name)}",
        lambda name: "_".join(re.findall("[A-Z][a-z]*[0-9]?", name)),
        lambda name: " ".join(re.findall("[A-Z][a-z]*[0-9]?", name)),
        lambda name: "-".join(re.findall("[A-Z][a-z]*[0-9]?", name)).lower(),
        lambda name: ".".join(re.findall("[A-Z][a-z]*[0-9]?", name)),
        lambda name: name.replace("Left", "l").replace("Right", "r"),
        lambda name: name.replace("Left", "L_").replace("Right", "R_"),
        lambda name: name.replace("Left", "L").replace("Right", "R"),
        lambda name: name.lower().replace("left", "l").replace("right", "r"),
        lambda name: name.replace("Left", "Bip01 L ").replace("Right", "Bip01 R "),
        lambda name: re.sub("(Left|Right)(.*)", r"\2\1", name),
        lambda name: re.sub("(Left|Right)(.*)", r"\2_\1", name).lower(),
        lambda name: re.sub("(L|R)(eft|ight)(.*)", r"\3_\1", name),
        lambda name: re.sub("(L|R)(eft|ight)(.*)", r"\3.\1", name),
        lambda name: re.sub("(L|R)(eft|ight)(.*)", r"\3 \1", name),
        lambda name: "rig_" + re.sub("(L|R)(eft|ight)(.*)", r"\1_\3", name) + "_bind",
    ],
)
def test_prefixes_case_separators_and_side_markers_mean_nothing_else(rename):
    assert roles(tree(renamed(BODY, rename))) == {role: rename(name) for role, name in ROLES.items()}


def test_a_known_prefix_is_dropped_where_not_all_names_have_it():
    body = BODY.replace("LeftArm", "Bip01 L UpperArm").replace("Head", "Bip001 Head(Hat>Feather|Hair1>Hair2>Hair3)")
    assert roles(tree(body)) == ROLES | {"leftUpperArm": "Bip01 L UpperArm", "head": "Bip001 Head"}


def test_unmarked_joints_have_the_side_of_their_arm():
    body = tree(BODY.replace("LeftHand", "Hand").replace("RightHand", "Hand"))
    found = roles(body)
    assert (found["leftHand"], found["rightHand"]) == ("LeftForeArm/Hand", "RightForeArm/Hand")


def test_a_letter_before_a_word_is_a_side_only_where_the_other_side_has_it_too():
    rig = Rig(
        "root=hips(lowerback=spine>upperback>thorax=upperChest(lowerneck>upperneck>head|{@clavicle=Shoulder>"
        "@humerus=UpperArm>@radius=LowerArm>@wrist=Hand(@hand|@thumb)})|{@hipjoint>@femur=UpperLeg>@tibia=LowerLeg>"
        "@foot=Foot>@toes=Toes})",
        ("l", "r"),
    )
    found = roles(tree(rig.text))
    assert {role: [found[role]] for role in rig.roles} == rig.roles


MIXTURES = {
    "kinect": Rig(
        "SpineBase(SpineMid>SpineShoulder(Neck>Head|{Shoulder@=UpperArm>Elbow@=LowerArm>Wrist@=Hand>Hand@>HandTip@})|"
        "{Hip@=UpperLeg>Knee@=LowerLeg>Ankle@=Foot>Foot@=Toes})",
        ("Left", "Right"),
    ),
    "mixture": Rig(
        "COG=hips(torso=spine>ribs=chest(neck>head|{upper_arm.@=UpperArm>forearm.@=LowerArm>wrist.@=Hand})|"
        "{@Thigh=UpperLeg>@Knee=LowerLeg>@Ankle=Foot>@Ball=Toes})",
        ("L", "R"),
    ),
    "mixture with collar bones": Rig(
        "pelvis(spine>chest(neck>head|{Clavicle_@=Shoulder>UpArm_@=UpperArm>LoArm_@=LowerArm>Hand_@=Hand})|"
        "{Hip_@=UpperLeg>Shin_@=LowerLeg>Foot_@=Foot>Toe_@=Toes})",
        ("L", "R"),
    ),
    "mikumikudance": Rig(
        "腰(上半身>上半身2=chest(首>頭|{@肩=Shoulder>@腕=UpperArm>@腕捩>@ひじ=LowerArm>@手首=Hand})|"
        "下半身({@足=UpperLeg>@ひざ=LowerLeg>@足首=Foot>@つま先=Toes}))",
        ("左", "右"),
    ),
}


@pytest.mark.parametrize("rig", MIXTURES.values(), ids=MIXTURES)
def test_known_words_in_other_combinations(rig):
    found = roles(tree(rig.text))
    limbs = [side + part for side in SIDES for part in (*ARM, *LEG)]
    assert {role: [found[role]] for role in {*limbs, *rig.roles} & found.keys()} == rig.roles


@pytest.mark.parametrize(
    ("arm", "expected"),
    [
        ("{}Shoulder>{}Arm>{}ForeArm>{}Hand", ("Shoulder", "Arm", "ForeArm", "Hand")),
        ("{}Shoulder>{}Elbow>{}Wrist>{}Hand", (None, "Shoulder", "Elbow", "Wrist")),
        ("{}Collar>{}Shoulder>{}Elbow>{}Wrist", ("Collar", "Shoulder", "Elbow", "Wrist")),
        ("{}Scapula>{}Shoulder>{}LowerArm", ("Scapula", "Shoulder", "LowerArm", None)),
    ],
)
def test_shoulder_is_what_the_rest_of_the_arm_leaves_for_it(arm, expected):
    arms = "|".join(arm.format(*[side] * 4) for side in ("Left", "Right"))
    text = f"Hips(Spine(Neck>Head|{arms})|LeftHip>LeftKnee>LeftAnkle|RightHip>RightKnee>RightAnkle)"
    found = roles(tree(text))
    assert [found.get(f"left{part}") for part in ARM] == [name and f"Left{name}" for name in expected]


def test_helpers_have_no_roles():
    body = tree(
        "root(pelvis(spine_01>spine_twist_01>spine_02(neckDummy>neck_01>head>head_end|"
        "clavicle_l>upperarm_l(upperarm_twist_01_l|lowerarm_l(lowerarm_twist_01_l|hand_l(thumb_twist_l|thumb_tip_l)))|"
        "clavicle_r>upperarm_r>lowerarm_r>hand_r)|thigh_l(thigh_twist_01_l|calf_l>foot_l(ball_l|ToeBaseShareBone_l))|"
        "thigh_r>calf_r>foot_r>ball_r)|ik_foot_root(ik_foot_l|ik_foot_r)|ik_hand_root>ik_hand_gun(ik_hand_l|ik_hand_r))"
    )
    found, anatomy = roles(body), by_names(body)
    arm, leg = ("clavicle_l", "upperarm_l", "lowerarm_l", "hand_l"), ("thigh_l", "calf_l", "foot_l", "ball_l")
    assert found.items() >= sided(*arm, *leg).items()
    assert [body.names[joint] for joint in anatomy.spine] == ["spine_01", "spine_02"]
    assert [body.names[joint] for joint in anatomy.neck] == ["neck_01"]
    assert not [name for name in found.values() if re.search("ik_|twist|Share|tip|end|Dummy", name)]


def test_end_sites_have_no_roles():
    body = tree(BODY.replace("LeftHand", "LeftHand>LeftHandIndex1>LeftHandIndex2"))
    found = roles(skeleton(body.names, body.parents, ["LeftHandIndex2"]))
    assert found == ROLES | {"leftIndex1": "LeftHandIndex1"}


@pytest.mark.parametrize(
    ("names", "gone"),
    [
        ("LeftShoulder>|RightShoulder>", {"leftShoulder", "rightShoulder"}),
        (">LeftToeBase|>RightToeBase", {"leftToes", "rightToes"}),
        (">LeftFoot>LeftToeBase|>RightFoot>RightToeBase", {"leftFoot", "rightFoot", "leftToes", "rightToes"}),
        ("Neck>", {"neck"}),
        ("Neck>Head|", {"neck", "head"}),
        ("Spine>Spine1>", {"spine", "upperChest", "chest"}),
        ("LeftUpLeg>LeftLeg>LeftFoot>LeftToeBase|", {f"left{part}" for part in LEG}),
        ("LeftShoulder>LeftArm>LeftForeArm>LeftHand|", {f"left{part}" for part in ARM}),
    ],
)
def test_missing_parts_have_no_roles_and_change_no_others(names, gone):
    text = BODY
    for part in (names,) if names.endswith("|") else names.split("|"):
        text = text.replace(part, "")
    chest = {"chest": "Spine2"} if "spine" in gone else {}
    assert roles(tree(text)) == {role: name for role, name in ROLES.items() if role not in gone} | chest


def test_a_body_without_legs_needs_named_hips():
    text = BODY[: BODY.index("|LeftUpLeg")] + ")"
    assert set(roles(tree(text))) == {role for role in ROLES if not role.endswith(LEG)}
    assert by_names(tree(text.replace("Hips", "Base"))) is None
    text = "Hips(" + BODY[BODY.index("LeftUpLeg") :]
    assert set(roles(tree(text))) == {"hips", *(role for role in ROLES if role.endswith(LEG))}


@pytest.mark.parametrize(
    ("text", "hips", "spine"),
    [
        ("Pelvis>Spine(Spine1>Neck(Head|{arms})|{legs})", "Pelvis", ["Spine", "Spine1"]),
        ("Bip(Pelvis(Spine>Spine1(Neck>Head|{arms})|{legs}))", "Pelvis", ["Spine", "Spine1"]),
        ("Hip(Pelvis({legs})|Spine(Neck>Head|{arms}))", "Hip", ["Spine"]),
        ("Reference(Hips({legs})|Spine>Chest(Neck>Head|{arms}))", "Hips", ["Spine", "Chest"]),
        ("root>body({legs}|torso(Neck>Head|{arms}))", "body", ["torso"]),
        ("Hips({legs}|Spine(Spine1>Neck>Head|{arms}))", "Hips", ["Spine", "Spine1"]),
    ],
)
def test_hips_and_spine_by_name_and_tree(text, hips, spine):
    arms = "LeftShoulder>LeftArm>LeftForeArm|RightShoulder>RightArm>RightForeArm"
    legs = "LeftUpLeg>LeftLeg|RightUpLeg>RightLeg"
    body = tree(text.format(arms=arms, legs=legs))
    anatomy = by_names(body)
    assert body.names[anatomy.roles["hips"]] == hips
    assert [body.names[joint] for joint in anatomy.spine] == spine
    assert [body.names[joint] for joint in anatomy.neck] == ["Neck"]


@pytest.mark.parametrize(
    "text",
    [
        "Hips",
        "Hips>Head",
        "Hips(LeftUpLeg>LeftLeg>LeftFoot|RightUpLeg>RightLeg>RightFoot|trunk>branch)",
        "sword>hilt>blade>tip",
        "head(jaw>chin|eye_L|eye_R|brow_L|brow_R|lip_L|lip_R)",
        "body(spine(neck>head>jaw|front_leg_L>front_hock_L>front_paw_L|front_leg_R>front_hock_R>front_paw_R)|"
        "hind_leg_L>hind_hock_L>hind_paw_L|hind_leg_R>hind_hock_R>hind_paw_R|tail1>tail2)",
        "_",
        " (-|..)",
        "L(R|左)",
        "ü>ß>позвоночник",
    ],
)
def test_none_where_names_tell_too_little(text):
    assert by_names(tree(text)) is None
    assert convention_of(tree(text)) == ""


def calls(function, *arguments):
    """How many functions are called in the course of one call."""
    seen = []
    sys.setprofile(lambda _frame, event, _argument: seen.append(event))
    try:
        function(*arguments)
    finally:
        sys.setprofile(None)
    return seen.count("call") + seen.count("c_call")


@pytest.mark.parametrize("name", ["LeftFoot", "Head", "Neck", "LeftHandIndex1", ""])
def test_the_work_grows_as_the_number_of_joints_of_one_name(name):
    def chain(joints):
        return skeleton([name] * joints, np.arange(joints) - 1)

    assert by_names(chain(300)) is None
    assert calls(by_names, chain(300)) < 4 * calls(by_names, chain(100))


REAL = {
    "animated_drawings/jumping_jacks.bvh": (
        ("LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist", "LeftHip", "LeftKnee", "LeftAnkle", "LeftToe"),
        ("Hips", "lowerback", "Chest", "Chest2", "lowerneck", "Head"),
    ),
    "animated_drawings/dab.bvh": (
        ("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase"),
        ("Hips", "Spine", "Spine1", "Spine3", "Neck", "Head"),
    ),
    "bvhio/example.bvh": (
        ("LeftCollar", "LeftUpArm", "LeftLowArm", "LeftHand", "LeftUpLeg", "LeftLowLeg", "LeftFoot", None),
        ("Hips", None, "Chest", None, "Neck", "Head"),
    ),
    "pybvh/bvh_test2.bvh": (
        ("LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist", "LeftHip", "LeftKnee", "LeftAnkle", "LeftToe"),
        ("Hips", "Chest", "Chest2", "Chest4", "Neck", "Head"),
    ),
    "synthetic_odd/odd_dup_names.bvh": (
        (None, "LeftArm", "LeftForeArm", "LeftForeArm/Hand", "LeftUpLeg", "LeftLeg", "LeftFoot", None),
        ("Hips", None, "Spine", None, "Neck", "Head"),
    ),
}


def right_of(name):
    """The right counterpart of a left joint's name."""
    return name and re.sub(r"^l(?=[A-Z])", "r", re.sub(r"([._ ])L\b", r"\1R", name.replace("Left", "Right")))


@needs_corpus
@pytest.mark.parametrize("file", REAL)
def test_real_files(file):
    limbs, trunk = REAL[file]
    expected = sided(*limbs) | sided(*map(right_of, limbs), left="right")
    expected |= dict(zip(("hips", "spine", "chest", "upperChest", "neck", "head"), trunk, strict=True))
    found = roles(read_bvh(CORPUS / file).rigid_skeleton)
    assert {role: found.get(role) for role in expected} == expected


@needs_corpus
def test_a_real_file_that_mixes_two_conventions():
    found = roles(read_bvh(CORPUS / "synthetic_odd" / "odd_names_spaces.bvh").rigid_skeleton)
    assert (found["hips"], found["head"], found["rightUpperLeg"]) == ("Bip01 Pelvis", "Bip01 Head", "RightUpLeg")
    assert (found["leftUpperArm"], found["leftLowerArm"], found["leftUpperLeg"]) == (
        "Bip01 L UpperArm",
        "LeftForeArm",
        "Bip01 L Thigh",
    )


@needs_corpus
def test_all_real_files_of_people_are_recognised():
    files = ("animated_drawings", "bvhio", "cmu_daz", "cmu_mb", "makehuman", "makehuman_old")
    bodies = [read_bvh(next((CORPUS / folder).glob("*.bvh"))).rigid_skeleton for folder in files]
    assert all(by_names(body) for body in bodies)
    assert by_names(read_bvh(CORPUS / "pybvh" / "full_precision_frame_time.bvh").rigid_skeleton) is None


NUMBERED = Rig(
    "cf_j_hips(cf_j_spine01>cf_j_spine02>cf_j_spine03(cf_j_neck>cf_j_head|{cf_j_shoulder_@>cf_j_arm00_@=UpperArm>"
    "cf_j_forearm01_@=LowerArm>cf_j_hand_@})|cf_j_waist01({cf_j_thigh00_@=UpperLeg>cf_j_leg01_@=LowerLeg>cf_j_leg03_@>"
    "cf_j_foot_@=Foot>cf_j_toes_@}))",
    ("L", "R"),
)


@pytest.mark.parametrize(
    ("before", "after"),
    [("", ""), ("cf_j_", ""), ("cf_j_", "Char_"), ("arm00", "arm1"), ("thigh00", "Thigh_01"), ("leg0", "Shin-0")],
)
def test_a_number_that_no_convention_knows_hides_no_part(before, after):
    found = roles(tree(NUMBERED.text.replace(before, after)))
    assert {role: [found[role]] for role in NUMBERED.roles} == {
        role: [name.replace(before, after)] for role, (name,) in NUMBERED.roles.items()
    }
