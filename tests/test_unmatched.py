"""What follows nothing, in words: by parts of the body, and the rest in one line."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, body_of, sample_target, with_bone
from named_bodies import tree

from distretarget.matching.matching import find_matching
from distretarget.matching.unmatched import others_without_source, parts_without_source

MIXAMO = sample_target("rigs/mixamo_t").skeleton


def told(source, target, explicit=None):
    matching = find_matching(body_of(source), body_of(target), explicit)
    return [*parts_without_source(matching)], [*others_without_source(matching)]


def none_of(*names):
    return {f"mixamorig:{side}{name}": None for name in names for side in ("Left", "Right")}


def test_a_body_that_follows_in_all_its_parts_needs_no_line():
    assert told(PERSON, PERSON) == ([], [])


@pytest.mark.parametrize(
    ("explicit", "line"),
    [
        ({}, "fingers of the target follow nothing"),
        (none_of("Shoulder"), "shoulders and fingers of the target follow nothing"),
        ({"mixamorig:LeftShoulder": None}, "left shoulder and fingers of the target follow nothing"),
        (none_of("Hand"), "hands and fingers of the target follow nothing"),
        (none_of("Arm", "ForeArm", "Hand", "ToeBase"), "arms, hands, fingers and toes of the target follow nothing"),
        ({"mixamorig:RightToeBase": None}, "fingers and right toes of the target follow nothing"),
        (none_of("Arm"), "2 arm joints and fingers of the target follow nothing"),
        ({"mixamorig:Head": None}, "fingers and head of the target follow nothing"),
    ],
)
def test_parts_are_named_as_wholes_or_with_a_number(explicit, line):
    assert told(PERSON, MIXAMO, explicit)[0] == [line]


def test_a_single_part_follows_nothing():
    assert told(PERSON, PERSON, {"LeftCollar": None})[0] == ["left shoulder of the target follows nothing"]


def test_joints_of_face_hair_and_twist_are_counted_in_a_line_of_their_own():
    target = PERSON
    for name in ("Hair1", "Hair2", "Jaw", "LeftElbowTwist"):
        target = with_bone(target, name, "LeftElbow" if "Twist" in name else "Head")
    line = "4 other joints of the target follow their parents: 'Hair1', 'Hair2', 'Jaw' and 1 more"
    assert told(PERSON, target) == ([], [line])


def test_what_is_no_human_body_has_no_parts():
    line = "1 joint of the target follows its parent: 'end'"
    assert told(tree("a>b>c>d"), tree("a>b>c>d(end|other>tail)"), {"other": "c", "tail": "d"}) == ([], [line])


def test_arms_that_are_not_recognised_are_told():
    """Arms with other names, and shorter than a person's, so that the shape does not show them either."""
    arms = [j for name in ("LeftCollar", "RightCollar") for j in PERSON.subtree(PERSON.index(name))]
    offsets = np.array(PERSON.offsets)
    offsets[arms] *= 0.05
    names = tuple(f"b{joint}" if joint in arms else name for joint, name in enumerate(PERSON.names))
    parts, others = told(PERSON, replace(PERSON, names=names, offsets=offsets))
    assert parts[0] == "left arm and right arm of the target not recognised, so still: a map says which joints they are"
    assert others == ["8 other joints of the target follow their parents: 'b6', 'b7', 'b8' and 5 more"]
