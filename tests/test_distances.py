"""The distance problem: the exact facts of the paper's skeleton, coincident joints, bodies in other units."""

import numpy as np
import pytest
from bodies import other_lengths, paths_of, person, tree_of
from table_one import table_one

from distretarget.distances import distance_problem


def problem_of(source, target):
    return distance_problem(source, target, np.arange(len(target)))


def test_priorities_of_the_paper():
    body = table_one()
    pi = problem_of(body, other_lengths(body)).priorities
    pairs = pi[np.triu_indices(22, 1)]
    assert len(pairs) == 231
    assert pairs.min() == pytest.approx(1 / 6)
    for joint in range(1, 22):
        assert pi[joint, body.parents[joint]] == 1.0
    assert pi[body.index("RightWrist"), body.index("LeftWrist")] == pytest.approx(5 / 12)
    assert pi[body.index("RightWrist"), body.index("RightToe")] == pairs.min()
    np.testing.assert_array_equal(pi, pi.T)


def test_path_lengths_turn_source_distances_into_target_distances():
    source = table_one()
    target = other_lengths(source)
    problem = problem_of(source, target)
    apart = ~np.eye(22, dtype=bool)
    expected = paths_of(target)[apart] / paths_of(source)[apart] / target.longest_path
    np.testing.assert_allclose(problem.ratio[apart], expected)


def test_the_ratio_does_not_depend_on_units():
    source = table_one()
    target = other_lengths(source)
    in_cm = target.with_offsets(100 * target.offsets)
    np.testing.assert_allclose(problem_of(source, in_cm).ratio, problem_of(source, target).ratio, rtol=1e-12)


def with_zero_bones(body, joints):
    offsets = np.array(body.offsets)
    offsets[[body.index(joint) for joint in joints]] = 0.0
    return body.with_offsets(offsets)


def test_joints_that_coincide_on_both_bodies_are_one_point():
    body = with_zero_bones(person(), ["LeftHip", "RightHip", "Head_End"])
    problem = problem_of(body, other_lengths(body))
    gone = {body.index(joint) for joint in ("LeftHip", "RightHip", "Head_End")}
    assert set(problem.targets) == set(range(len(body))) - gone
    knees = [list(problem.targets).index(body.index(f"{side}Knee")) for side in ("Left", "Right")]
    largest = 2 / (problem.priorities[problem.priorities > 0].min())
    assert problem.priorities[knees[0], 0] == 1.0
    assert problem.priorities[knees[0], knees[1]] == pytest.approx((largest - 3 + 2) / largest)


def test_a_bone_that_only_the_target_has_gets_no_priority():
    target = table_one()
    source = with_zero_bones(target, ["LeftHip"])
    problem = problem_of(source, target)
    hip = target.index("LeftHip")
    assert len(problem) == 22
    assert problem.priorities[0, hip] == 0.0
    assert problem.priorities[hip, target.index("LeftKnee")] == 1.0
    assert np.all(np.isfinite(problem.ratio))


def test_unmatched_joints_are_no_points():
    body = person()
    drivers = np.arange(len(body))
    drivers[body.end_sites] = -1
    problem = distance_problem(body, other_lengths(body), drivers)
    assert len(problem) == 22
    assert problem.priorities[np.triu_indices(22, 1)].min() == pytest.approx(1 / 6)


def test_two_joints_are_enough():
    body = tree_of([[0, 0, 0], [0, 2, 0]])
    problem = problem_of(body, body)
    np.testing.assert_array_equal(problem.priorities, [[0, 1], [1, 0]])
    np.testing.assert_allclose(problem.ratio, [[0, 0.5], [0.5, 0]])
