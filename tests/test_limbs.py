"""Legs and fingers, by the tree of joints, by names, and by the parts of a body."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from animals import dog
from bodies import CORPUS, SAMPLES, bent_chain, needs_corpus, person, sample_target, tree_of
from named_bodies import BODY, ROLES, needs_names, published, roles, tree

from distretarget import DistretargetError, read_bvh
from distretarget.body.body import Body
from distretarget.body.limbs import _longest_pair, are_alike, find_legs, foot_bone, leg_length, tree_legs
from distretarget.io.reading import load_target

RIGS = sorted((SAMPLES / "rigs").glob("*.json"))
FIVE_TOES = (
    "makehuman-benchmark",
    "makehuman-face-poseunits",
    "makehuman-tpose",
)  # tree and names take different joints
ANKLE_IN_FOOT = "pybvh-bvh_test3"  # RightForeFoot is the ankle by the tree


def names_of_legs(skeleton):
    return sorted(
        (skeleton.names[leg.hip], skeleton.names[leg.ankle], skeleton.names[leg.toe]) for leg in tree_legs(skeleton)
    )


def test_legs_of_the_papers_skeleton():
    body = person()
    expected = [("LeftHip", "LeftAnkle", "LeftToe"), ("RightHip", "RightAnkle", "RightToe")]
    assert names_of_legs(body) == expected
    assert leg_length(body, tree_legs(body)) == pytest.approx(0.435 + 0.453)
    body = person()
    lying = body.with_offsets(body.lengths[:, None] * [1.0, 0, 0])
    assert [ankle for _, ankle, _ in names_of_legs(lying)] == ["LeftAnkle", "RightAnkle"]
    expected = [(f"{side}Femur", f"{side}Hindpaw", f"{side}Hindpaw_End") for side in ("Left", "Right")]
    assert names_of_legs(dog()) == expected


# ---- by the parts of a body


def by_anatomy(skeleton):
    body = Body.of(skeleton)
    return find_legs(skeleton, body.anatomy)


def joints_by_side(legs, parts=("hip", "ankle", "toe")):
    """The joints of both legs, in either order."""
    return {tuple(getattr(leg, part) for part in parts) for leg in legs}


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_the_parts_and_the_tree_of_a_rig_show_the_same_legs(path):
    skeleton = load_target(path).skeleton
    assert joints_by_side(by_anatomy(skeleton)) == joints_by_side(tree_legs(skeleton))


def test_legs_of_an_anatomy_are_left_before_right():
    body = person()
    left, right = by_anatomy(body)
    assert [body.names[joint] for joint in left.joints] == ["LeftHip", "LeftAnkle", "LeftToe"]
    assert [body.names[joint] for joint in right.joints] == ["RightHip", "RightAnkle", "RightToe"]
    assert body.names[body.common_ancestor(leg.hip for leg in (left, right))] == "Hips"


def test_a_body_that_lacks_a_leg_has_no_legs():
    body = person()
    anatomy = Body.of(body).anatomy
    for role in ("leftFoot", "rightUpperLeg"):
        roles = {name: joint for name, joint in anatomy.roles.items() if name != role}
        assert find_legs(body, replace(anatomy, roles=roles)) is None
    chain = bent_chain()
    assert tree_legs(chain) is None
    assert find_legs(chain, None) is None


def test_a_foot_points_to_the_toes():
    body = sample_target("rigs/mixamo_t").skeleton
    foot, toe = foot_bone(body, Body.of(body).anatomy, "left")
    assert (body.names[foot], body.names[toe]) == ("mixamorig:LeftFoot", "mixamorig:LeftToeBase")
    body = sample_target("rigs/xsens_t").skeleton
    offsets = np.array(body.offsets)
    offsets[[joint for joint, name in enumerate(body.names) if "Toe" in name]] = 0.0
    bare = body.with_offsets(offsets)
    assert foot_bone(bare, Body.of(bare).anatomy, "left") is None
    assert all(leg.toe == leg.ankle for leg in by_anatomy(bare))


@needs_corpus
@pytest.mark.parametrize("path", sorted(CORPUS.rglob("*.bvh")), ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_the_parts_and_the_tree_of_real_files_show_the_same_legs(path):
    try:
        body = Body.of_motion(read_bvh(path))
    except DistretargetError:
        pytest.skip("no file that can be read")
    if body.anatomy is None or body.legs is None:
        pytest.skip("no human legs")
    name, tree = f"{path.parent.name}-{path.stem}", tree_legs(body.skeleton)
    parts = ("hip", "ankle") if name in FIVE_TOES else ("hip", "ankle", "toe")
    agree = joints_by_side(body.legs, parts) == joints_by_side(tree, parts)
    assert agree == (name != ANKLE_IN_FOOT)
    if name in FIVE_TOES:
        assert joints_by_side(body.legs) != joints_by_side(tree)
    if name == ANKLE_IN_FOOT:
        ankles = {body.skeleton.names[leg.ankle] for leg in tree}
        assert "RightForeFoot" in ankles


@pytest.mark.parametrize("seed", range(20))
def test_the_longest_pair_is_that_of_a_comparison_of_all(seed):
    """Chains of two to four joints on one root, of any length."""
    draw, chains, parents = np.random.default_rng(seed), [], [-1]
    for _ in range(30):
        chains.append(list(range(len(parents), len(parents) + draw.integers(2, 5))))
        parents += [0, *chains[-1][:-1]]
    body = tree_of(draw.uniform(0.5, 1.5, (len(parents), 1)) * [0.0, 1.0, 0.0], parents=parents)
    pairs = [(-body.lengths[a].sum(), a, b) for a, b in combinations(chains, 2) if are_alike(body, a, b)]
    expected = min(pairs, key=lambda pair: pair[0], default=None)
    found = _longest_pair(body, body.children[0])
    assert [(-size, a, b) for size, a, b in found] == ([expected] if expected else [])


@needs_names
def test_palms_that_carry_two_fingers_and_a_forefoot():
    found = roles(published("forefoot_palm_style"))
    assert found["leftToes"] == "LeftForeFoot"
    for finger, name in (("Index", "Index"), ("Ring", "Ring"), ("Little", "Pinky")):
        chain = [f"LeftHand{name}", *(f"LeftHand{name}{i}" for i in range(1, 4))]
        assert [found[f"left{finger}{i}"] for i in range(4)] == chain
    assert "leftMiddle0" not in found
    assert found["leftThumb1"] == "LeftHandThumb1"


@pytest.mark.parametrize(
    ("fingers", "expected"),
    [
        ("LeftHandIndex1>LeftHandIndex2>LeftHandIndex3>LeftHandIndex4", ("Index", 1, [0, 1, 2])),
        ("LeftInHandIndex>LeftHandIndex1>LeftHandIndex2>LeftHandIndex3", ("Index", 0, [0, 1, 2, 3])),
        ("LeftHandRing>LeftHandRing1>LeftHandRing2>LeftHandRing3", ("Ring", 0, [0, 1, 2, 3])),
        ("index_metacarpal_l>index_01_l>index_02_l>index_03_l", ("Index", 0, [0, 1, 2, 3])),
        ("LeftFinger5Metacarpal>LeftFinger5Proximal>LeftFinger5Medial>LeftFinger5Distal", ("Little", 0, [0, 1, 2, 3])),
        ("LeftFinger1Metacarpal>LeftFinger1Proximal>LeftFinger1Distal>LeftFinger1Tip", ("Thumb", 1, [0, 1, 2])),
        ("leftThumbMetacarpal>leftThumbProximal>leftThumbDistal", ("Thumb", 1, [0, 1, 2])),
        ("lCarpal1>lIndex1>lIndex2>lIndex3", ("Index", 0, [0, 1, 2, 3])),
        ("lMid1>lMid2", ("Middle", 1, [0, 1])),
        ("palm.02.L>f_middle.01.L>f_middle.02.L>f_middle.03.L", ("Middle", 0, [0, 1, 2, 3])),
        ("b_l_thumb0>b_l_thumb1>b_l_thumb2>b_l_thumb3", ("Thumb", 0, [0, 1, 2, 3])),
    ],
)
def test_fingers_count_from_the_knuckle(fingers, expected):
    finger, first, places = expected
    chain = fingers.split(">")
    found = roles(tree(BODY.replace("LeftHand", f"LeftHand>{fingers}")))
    bones = {f"left{finger}{number}": chain[place] for number, place in enumerate(places, start=first)}
    assert found == ROLES | bones


def test_numbered_fingers_begin_with_the_thumb():
    biped = "(L Finger0>L Finger01>L Finger02|L Finger1>L Finger11>L Finger12|L Finger4>L Finger41>L Finger42)"
    found = roles(tree(BODY.replace("LeftHand", f"LeftHand{biped}")))
    assert (found["leftThumb1"], found["leftThumb2"], found["leftThumb3"]) == ("L Finger0", "L Finger01", "L Finger02")
    assert (found["leftIndex1"], found["leftIndex3"]) == ("L Finger1", "L Finger12")
    assert found["leftLittle2"] == "L Finger41"
