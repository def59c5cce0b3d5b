"""References from one joint of a skeleton file to another."""

import pytest
from bodies import person

from distretarget.io.skeleton_json import joints_meant

NAMES = ("Hips", "Left", "Hand", "Right", "Hand")
PARENTS = (-1, 0, 1, 0, 3)


def meant_by(reference, names, parents):
    """The joints that a reference may mean, of those that have a parent in `parents`."""
    known = {}
    for joint, name in enumerate(names[: len(parents)]):
        known.setdefault(name, []).append(joint)
    return joints_meant(reference, names, parents, known)


def test_the_key_of_a_joint_means_it_alone():
    body = person()
    parents = body.parents.tolist()
    assert [meant_by(key, body.names, parents) for key in body.keys] == [[joint] for joint in range(len(body))]


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
    assert meant_by(reference, NAMES, PARENTS) == meant


def test_only_the_joints_so_far_are_meant():
    assert meant_by("Hand", NAMES, PARENTS[:3]) == [2]


def test_a_whole_path_means_its_joint_though_a_part_of_another_path_looks_the_same():
    assert meant_by("a/b", ("a", "b", "a", "b"), (-1, 0, 1, 2)) == [1]
