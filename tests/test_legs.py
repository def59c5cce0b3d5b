"""Legs, up and height, found without names."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import CORPUS, needs_corpus, other_lengths, person, swaying
from scipy.spatial.transform import Rotation

from distretarget import Skeleton, read_bvh
from distretarget.body.legs import find_legs, height, leg_length, up_axis
from distretarget.matching.matching import match
from distretarget.solve.stance import root_scale


def names_of_legs(skeleton):
    return sorted(
        (skeleton.names[leg.hip], skeleton.names[leg.ankle], skeleton.names[leg.toe]) for leg in find_legs(skeleton)
    )


def test_legs_of_the_papers_skeleton():
    body = person()
    expected = [("LeftHip", "LeftAnkle", "LeftToe"), ("RightHip", "RightAnkle", "RightToe")]
    assert names_of_legs(body) == expected
    assert leg_length(body, find_legs(body)) == pytest.approx(0.435 + 0.453)


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


@needs_corpus
@pytest.mark.parametrize(
    ("file", "up"),
    [
        ("cmu_mb/02_01.bvh", [0, 1, 0]),
        ("animated_drawings/dab.bvh", [0, 0, 1]),
        ("animated_drawings/jesse_dance.bvh", [0, 1, 0]),
    ],
)
def test_up_of_real_clips(file, up):
    motion = read_bvh(CORPUS / file)
    np.testing.assert_array_equal(up_axis(motion.positions, find_legs(motion.rigid_skeleton)), up)


def test_up_is_a_signed_axis():
    body = person()
    turned = body.with_offsets(Rotation.from_euler("x", 90, degrees=True).apply(np.array(body.offsets)))
    np.testing.assert_array_equal(up_axis(turned.rest_positions[None], find_legs(turned)), [0, 0, 1])
    assert height(turned) == pytest.approx(height(body))


def test_bodies_without_legs_have_a_height_and_a_root_scale():
    chain = Skeleton(("a", "b", "c"), [-1, 0, 1], [[0, 0, 0], [0, 2, 0], [1, 0, 0]], ((),) * 3, [False] * 3)
    assert find_legs(chain) is None
    assert height(chain) == 2.0
    assert root_scale(match(chain, chain.with_offsets(3 * chain.offsets))) == pytest.approx(3.0)


def test_root_scale_is_the_ratio_of_leg_lengths():
    body = person()
    factors = np.ones(len(body))
    for side in ("Left", "Right"):
        factors[[body.index(f"{side}Knee"), body.index(f"{side}Ankle")]] = 0.6
        factors[body.index(f"{side}Elbow")] = 3.0
    target = body.with_lengths(body.lengths * factors)
    assert root_scale(match(body, target)) == pytest.approx(0.6)


def test_legs_are_found_on_bodies_of_any_proportion():
    for seed in range(10):
        body = other_lengths(replace(person()), seed)
        halves = np.array(body.lengths)
        for joint, name in enumerate(body.names):
            if name.startswith("Right"):
                halves[joint] = halves[body.index("Left" + name[5:])]
        body = body.with_lengths(halves)
        assert {body.names[leg.hip] for leg in find_legs(body)} <= {"LeftHip", "RightHip", "Hips"}
        assert up_axis(swaying(body, angle=0.2).positions, find_legs(body))[1] == 1.0
