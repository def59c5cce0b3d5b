"""The regions of bodies: hands with their fingers, and nothing that is not part of the body."""

from __future__ import annotations

import numpy as np
import pytest
from animals import dog
from bodies import SAMPLES, body_of, person, with_bone

from distretarget import load_target
from distretarget.body.anatomy import find_regions
from distretarget.body.body import Body


def _region(body: Body, name: str) -> str:
    number = body.regions.of_joint[body.skeleton.index(name)]
    return body.regions.names[number] if number >= 0 else ""


def test_regions_of_a_person() -> None:
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


def test_root_on_the_floor_twist_joints_and_handles_are_no_part_of_the_body() -> None:
    body = body_of(load_target(SAMPLES / "rigs" / "unreal_a.json").skeleton)
    assert _region(body, "index_03_l_End") == "left hand"
    assert _region(body, "thigh_l") == _region(body, "pelvis") == "hips"
    for name in ("root", "ik_hand_l", "ik_foot_root", "upperarm_twist_01_l", "calf_twist_01_r"):
        assert _region(body, name) == ""


@pytest.mark.parametrize("parent", ["LeftElbow", "Head", "Hips", "Chest3"])
def test_sleeves_hair_skirts_and_props_are_no_part_of_the_body(parent: str) -> None:
    body = body_of(with_bone(with_bone(person(), "Cloth1", parent), "Cloth2", "Cloth1"))
    assert _region(body, "Cloth1") == _region(body, "Cloth2") == ""


def test_a_sword_in_the_hand_is_no_part_of_it_from_the_length_of_a_forearm_on() -> None:
    body = person()
    offsets = np.array(with_bone(body, "Sword", "LeftWrist").offsets)
    offsets[-1] = [0.9, 0.0, 0.0]
    assert _region(body_of(with_bone(body, "Sword", "LeftWrist").with_offsets(offsets)), "Sword") == ""


def test_neighbours_are_regions_joined_by_a_bone() -> None:
    regions = body_of(person()).regions
    joined = {
        frozenset((regions.names[a], regions.names[b])) for a, b in zip(*np.nonzero(regions.neighbours), strict=True)
    }
    assert {frozenset(("left hand", "left forearm")), frozenset(("hips", "right shin"))} <= joined
    assert frozenset(("left hand", "right hand")) not in joined
    assert (regions.neighbours == regions.neighbours.T).all()
    assert regions.neighbours.diagonal().all()


def test_without_an_anatomy_every_limb_is_a_region() -> None:
    regions = find_regions(dog(), None, above_hips=(0,))
    assert regions.of_joint[0] == -1
    assert (regions.of_joint[1:] >= 0).all()
    assert len(regions.names) >= 4
