"""References from one joint of a skeleton file to another."""

import pytest
from bodies import person

from distretarget.io.target_file import joints_meant

NAMES = ("Hips", "Left", "Hand", "Right", "Hand")
PARENTS = (-1, 0, 1, 0, 3)


def test_the_key_of_a_joint_means_it_alone():
    body = person()
    parents = body.parents.tolist()
    assert [joints_meant(key, body.names, parents) for key in body.keys] == [[joint] for joint in range(len(body))]


@pytest.mark.parametrize(
    ("reference", "meant"),
    [
        ("Hand", [2, 4]),
        ("Left/Hand", [2]),
        ("Hips/Right/Hand", [4]),
        ("ft/Hand", []),
        ("Hips/Hand", []),
        ("/Hand", []),
        ("", []),
    ],
)
def test_parents_tell_joints_of_one_name_apart(reference, meant):
    assert joints_meant(reference, NAMES, PARENTS) == meant


def test_only_the_joints_so_far_are_meant():
    assert joints_meant("Hand", NAMES, PARENTS[:3]) == [2]


def test_a_whole_path_means_its_joint_though_a_part_of_another_path_looks_the_same():
    assert joints_meant("a/b", ("a", "b", "a", "b"), (-1, 0, 1, 2)) == [1]
