"""Fingers by the names of their joints."""

import pytest
from named_bodies import BODY, ROLES, needs_names, published, roles, tree


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
