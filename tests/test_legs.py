"""Legs, found by the tree of joints alone or by the parts of a body."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import CORPUS, needs_corpus, other_lengths, person

from distretarget import Skeleton, read_bvh
from distretarget.body.legs import find_legs, leg_length, tree_legs


def names_of_legs(skeleton):
    return sorted(
        (skeleton.names[leg.hip], skeleton.names[leg.ankle], skeleton.names[leg.toe]) for leg in tree_legs(skeleton)
    )


def test_legs_of_the_papers_skeleton():
    body = person()
    expected = [("LeftHip", "LeftAnkle", "LeftToe"), ("RightHip", "RightAnkle", "RightToe")]
    assert names_of_legs(body) == expected
    assert leg_length(body, tree_legs(body)) == pytest.approx(0.435 + 0.453)


def test_legs_of_a_rest_pose_that_lies_along_one_axis():
    body = person()
    lying = body.with_offsets(body.lengths[:, None] * [1.0, 0, 0])
    assert [ankle for _, ankle, _ in names_of_legs(lying)] == ["LeftAnkle", "RightAnkle"]


@needs_corpus
@pytest.mark.parametrize(
    ("file", "legs"),
    [
        (
            "cmu_mb/02_01.bvh",
            [("LeftUpLeg", "LeftFoot", "LeftToeBase"), ("RightUpLeg", "RightFoot", "RightToeBase")],
        ),
        ("cmu_daz/02_01.bvh", [("lThigh", "lFoot", "lFoot_End"), ("rThigh", "rFoot", "rFoot_End")]),
        ("animated_drawings/dab.bvh", [("LeftUpLeg", "LeftFoot"), ("RightUpLeg", "RightFoot")]),
        ("animated_drawings/jesse_dance.bvh", [("LeftUpLeg", "LeftFoot"), ("RightUpLeg", "RightFoot")]),
        ("makehuman/tpose.bvh", [("upperleg01.L", "foot.L"), ("upperleg01.R", "foot.R")]),
        ("pybvh/bvh_test2.bvh", [("LeftHip", "LeftAnkle"), ("RightHip", "RightAnkle")]),
    ],
)
def test_legs_of_real_rigs(file, legs):
    found = names_of_legs(read_bvh(CORPUS / file).rigid_skeleton)
    assert [leg[: len(legs[0])] for leg in found] == legs


def test_a_chain_has_no_legs():
    chain = Skeleton(("a", "b", "c"), [-1, 0, 1], [[0, 0, 0], [0, 2, 0], [1, 0, 0]], ((),) * 3, [False] * 3)
    assert tree_legs(chain) is None
    assert find_legs(chain, None) is None


def test_legs_are_found_on_bodies_of_any_proportion():
    for seed in range(10):
        body = other_lengths(replace(person()), seed)
        halves = np.array(body.lengths)
        for joint, name in enumerate(body.names):
            if name.startswith("Right"):
                halves[joint] = halves[body.index("Left" + name[5:])]
        body = body.with_lengths(halves)
        assert {body.names[leg.hip] for leg in tree_legs(body)} <= {"LeftHip", "RightHip", "Hips"}
