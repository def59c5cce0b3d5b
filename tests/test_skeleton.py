"""Skeletons: what they refuse, and paths, places, reaches and branches of trees against plain searches."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from bodies import tree_of
from hypothesis import given
from hypothesis import strategies as st

from distretarget import Motion, retarget
from distretarget.body.body import Body
from distretarget.body.segments import find_segments
from distretarget.distances import MOST_POINTS
from distretarget.errors import SkeletonError


def tree(parents, offsets=None, names=(), **others):
    return replace(tree_of(np.ones((len(parents), 3)) if offsets is None else offsets, names, parents), **others)


@st.composite
def trees(draw):
    """Random trees of up to 12 joints; each third offset or so is zero."""
    count = draw(st.integers(1, 12))
    parents = [-1] + [draw(st.integers(0, j - 1)) for j in range(1, count)]
    number = st.floats(-100, 100).map(lambda x: round(x, 3))
    offset = st.one_of(st.just((0.0, 0.0, 0.0)), st.tuples(number, number, number))
    return tree(parents, [draw(offset) for _ in range(count)])


def path_naive(skeleton, u, v):
    """The joints from u up to the common ancestor and down to v."""

    def up(joint):
        return [joint, *(up(skeleton.parents[joint]) if joint else [])]

    common = next(joint for joint in up(u) if joint in up(v))
    return up(u)[: up(u).index(common) + 1] + up(v)[: up(v).index(common)][::-1]


@given(trees())
def test_paths_match_a_naive_walk(skeleton):
    lengths, joints = np.linalg.norm(skeleton.offsets, axis=1), np.arange(len(skeleton))
    sizes, paths = skeleton.path_sizes(joints), skeleton.paths_among(joints)
    for u in range(len(skeleton)):
        for v in range(len(skeleton)):
            path = path_naive(skeleton, u, v)
            top = min(path)
            tau = sum(lengths[joint] for joint in path if joint != top)
            assert sizes[u, v] == len(path)
            np.testing.assert_allclose(paths[u, v], tau, rtol=1e-12, atol=1e-12)


@given(trees(), st.floats(0.1, 10))
def test_with_lengths_keeps_directions(skeleton, factor):
    other = skeleton.with_lengths(skeleton.lengths * factor)
    np.testing.assert_allclose(other.lengths, skeleton.lengths * factor, rtol=1e-12)
    np.testing.assert_allclose(other.offsets[1:], skeleton.offsets[1:] * factor, rtol=1e-12)
    np.testing.assert_array_equal(other.offsets[0], skeleton.offsets[0])


def test_with_lengths_keeps_zero_offsets_and_the_input():
    skeleton = tree([-1, 0, 1], [(1, 2, 3), (0, 0, 0), (0, 3, 4)], units="cm", up="Z")
    other = skeleton.with_lengths([0, 7, 10])
    np.testing.assert_array_equal(other.offsets, [(1, 2, 3), (0, 0, 0), (0, 6, 8)])
    np.testing.assert_array_equal(skeleton.offsets[2], (0, 3, 4))
    assert (other.units, other.up) == ("cm", "Z")


def test_lengths_paths_and_rest_positions_are_known():
    skeleton = tree([-1, 0, 1, 0], [(9, 9, 9), (0, 1, 0), (2, 0, 0), (0, 0, 3)])
    np.testing.assert_array_equal(skeleton.rest_positions, [(0, 0, 0), (0, 1, 0), (2, 1, 0), (0, 0, 3)])
    np.testing.assert_array_equal(tree([-1, 0], [(9, 9, 9), (0, 3, 4)]).lengths, [0, 5])
    skeleton, counted = tree([-1, 0, 1, 0, 3]), np.array([0, 1, 3, 4])
    np.testing.assert_array_equal(skeleton.path_sizes(np.array([2, 0, 4]), counted)[0], [1, 2, 4])
    skeleton = tree([-1, 0, 1, 1, 2, 0])
    assert skeleton.with_ancestors([4, 3]) == {0, 1, 2, 3, 4}
    assert skeleton.with_ancestors([]) == set()


def test_keys_name_parents_only_where_names_repeat():
    names = ["Hips", "Left", "Hand", "Right", "Hand", "Site", "Site"]
    skeleton = tree([-1, 0, 1, 0, 3, 2, 4], names=names)
    assert skeleton.keys == (
        *("Hips", "Left", "Left/Hand", "Right", "Right/Hand"),
        *("Left/Hand/Site", "Right/Hand/Site"),
    )
    assert [skeleton.index(key) for key in skeleton.keys] == list(range(7))
    assert tree([-1, 0], names=["Hips", "Hips"]).keys == ("Hips", "Hips/Hips")
    skeleton = tree([-1, 0], names=["Hips", "LeftForeArm"])
    with pytest.raises(SkeletonError, match="no joint 'LeftForArm'; did you mean 'LeftForeArm'"):
        skeleton.index("LeftForArm")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"parents": [-1, 0]}, "parents has shape"),
        ({"offsets": np.zeros((3, 2))}, "offsets has shape"),
        ({"end_sites": [False]}, "end_sites has shape"),
        ({"channels": ((),)}, "channels are given for 1 of 3"),
        ({"parents": [0, 0, 1]}, "needs a root"),
        ({"parents": [-1, 2, 0]}, "before their children"),
        ({"parents": [-1, 1, 0]}, "before their children"),
        ({"parents": [-1, -1, 0]}, "only the root"),
        ({"offsets": [(0, 0, 0), (0, np.nan, 0), (0, 0, 0)]}, "'joint1' is not finite"),
        ({"names": ("a", "b", "b"), "parents": [-1, 0, 0]}, "cannot be told apart: 'a/b'"),
    ],
)
def test_refusals(changes, message):
    with pytest.raises(SkeletonError, match=message):
        replace(tree([-1, 0, 1]), **changes)


def test_arrays_are_read_only_copies():
    arrays = {"parents": np.array([-1, 0]), "offsets": np.ones((2, 3)), "end_sites": np.zeros(2, bool)}
    skeleton = replace(tree([-1, 0]), **arrays)
    for name, array in arrays.items():
        with pytest.raises(ValueError, match="read-only"):
            getattr(skeleton, name)[1] = 1
        array[1] = 1 - array[1]
        assert np.all(getattr(skeleton, name)[1] != array[1])
    with pytest.raises(SkeletonError, match="needs a root"):
        tree([], np.zeros((0, 3)))
    skeleton = tree_of(np.eye(3), "abc", ends="c")
    assert repr(skeleton) == "<Skeleton of 2 joints and 1 End Sites>"


KINDS = {
    "root with children": lambda joint: 0 * joint,
    "chain": lambda joint: joint - 1,
    "binary tree": lambda joint: (joint - 1) // 2,
    "chain with twigs": lambda joint: joint - 1 - (joint % 2 == 0) * (joint > 1),
    "three chains by turns": lambda joint: max(joint - 3, 0),
}


def shaped(kind, count):
    """A skeleton of one of the kinds, some bones of length 0."""
    draw = np.random.default_rng(0)
    offsets = draw.normal(size=(count, 3)) * (draw.random((count, 1)) < 0.9)
    return tree_of(offsets, parents=[-1, *map(KINDS[kind], range(1, count))])


def paths_by_search(skeleton, start):
    """The lengths of the paths from a joint, by walking from neighbour to neighbour."""
    found, waiting = {start: 0.0}, [start]
    for joint in waiting:
        above = [skeleton.parents.item(joint)] if joint else []
        for near in (*above, *skeleton.children[joint]):
            if near not in found:
                found[near] = found[joint] + skeleton.lengths[max(joint, near)]
                waiting.append(near)
    return np.array([found[joint] for joint in range(len(skeleton))])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [1, 2, 23])
def test_paths_places_and_reaches_are_those_of_plain_searches(kind, count):
    skeleton = shaped(kind, count)
    some = np.random.default_rng(count).permutation(count)[: max(count // 2, 1)]
    lines = [skeleton.to_root(joint) for joint in range(count)]
    for joint in range(count):
        paths, below = paths_by_search(skeleton, joint), skeleton.subtree(joint)
        np.testing.assert_array_equal(skeleton.paths_from(joint), paths)
        assert skeleton.reach[joint] == pytest.approx(paths[below].max())
        assert paths[skeleton.farthest[joint]] == pytest.approx(paths[below].max())
        assert skeleton.depths[joint] == len(lines[joint]) - 1
        for other in range(count):
            common = max({*lines[joint]} & {*lines[other]})
            assert skeleton.common_ancestor([joint, other]) == common
            assert (skeleton.coincident[joint] == skeleton.coincident[other]) == (paths[other] == 0.0)
    paths = skeleton.paths_among(some)
    np.testing.assert_array_equal(paths, [paths_by_search(skeleton, joint)[some] for joint in some])
    assert skeleton.longest_path_among(some) == pytest.approx(paths.max())
    assert skeleton.depth_first == tuple(sorted(range(count), key=lambda joint: lines[joint][::-1]))


def test_the_longest_branches_are_chosen_whole():
    parents, lengths = [-1, 0, 1, 0, 3, 0, 5], [0.0, 1.0, 2.0, 4.0, 1.0, 0.5, 0.5]
    skeleton = replace(shaped("chain", 7), parents=np.array(parents), offsets=np.outer(lengths, [0.0, 1.0, 0.0]))
    for most, chosen in ((3, [0, 3, 4]), (5, [0, 1, 2, 3, 4]), (9, range(7))):
        np.testing.assert_array_equal(skeleton.on_longest_branches(np.arange(7), most), chosen)
    flat = shaped("chain with twigs", 9)
    flat = flat.with_offsets(0.0 * flat.offsets)
    np.testing.assert_array_equal(flat.farthest, np.arange(9))


@pytest.mark.parametrize("kind", ["root with children", "chain", "chain with twigs"])
def test_what_is_known_of_a_body_takes_room_for_a_few_numbers_a_joint(kind):
    def known(joints):
        body = Body.of(shaped(kind, joints))
        return body.legs, body.height, body.regions, body.handles, find_segments(body)

    known(9)  # compiles
    tracemalloc.start()
    known(2000)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2000 * 8_000  # bytes; an array of all pairs of joints has 16,000 a joint


@pytest.mark.parametrize("kind", ["root with children", "chain with twigs"])
def test_of_very_many_joints_distances_of_some_are_kept_and_measured(kind):
    body = shaped(kind, 1500)
    motion = Motion(body, np.zeros((2, 3)), np.tile(body.rest_rotations, (2, 1, 1)), "0.01")
    result = retarget(motion, body.with_lengths(1.1 * body.lengths))
    assert len(result.baseline.distances) == MOST_POINTS
    assert result.metrics["result"]["stress"] == pytest.approx(0.0, abs=1e-12)
