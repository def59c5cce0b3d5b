"""Trees of joints: orders, paths and reaches against plain searches; bodies are known without arrays of all pairs."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from bodies import tree_of

from distretarget import Motion, retarget
from distretarget.body.body import Body
from distretarget.body.segments import find_segments
from distretarget.distances import MOST_POINTS

KINDS = {
    "root with children": lambda joint: 0 * joint,
    "chain": lambda joint: joint - 1,
    "binary tree": lambda joint: (joint - 1) // 2,
    "chain with twigs": lambda joint: joint - 1 - (joint % 2 == 0) * (joint > 1),
    "three chains by turns": lambda joint: max(joint - 3, 0),
}


def tree(kind, count, seed=0):
    """A skeleton of one of the kinds, some bones of length 0."""
    draw = np.random.default_rng(seed)
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
    skeleton = tree(kind, count)
    some = np.random.default_rng(count).permutation(count)[: max(count // 2, 1)]
    lines = [skeleton.line(joint) for joint in range(count)]
    for joint in range(count):
        paths, below = paths_by_search(skeleton, joint), skeleton.subtree(joint)
        np.testing.assert_array_equal(skeleton.paths_from(joint), paths)
        assert skeleton.reach[joint] == pytest.approx(paths[below].max())
        assert paths[skeleton.farthest[joint]] == pytest.approx(paths[below].max())
        assert skeleton.depths[joint] == len(lines[joint]) - 1
        for other in range(count):
            common = max({*lines[joint]} & {*lines[other]})
            assert skeleton.meet([joint, other]) == common
            assert (skeleton.places[joint] == skeleton.places[other]) == (paths[other] == 0.0)
    paths = skeleton.paths_among(some)
    np.testing.assert_array_equal(paths, [paths_by_search(skeleton, joint)[some] for joint in some])
    assert skeleton.longest_path_among(some) == pytest.approx(paths.max())
    assert skeleton.depth_first == tuple(sorted(range(count), key=lambda joint: lines[joint][::-1]))


def test_of_joints_equally_far_the_nearest_along_the_tree_is_the_farthest():
    flat = tree("chain with twigs", 9)
    flat = flat.with_offsets(0.0 * flat.offsets)
    np.testing.assert_array_equal(flat.farthest, np.arange(9))


def test_the_longest_branches_are_chosen_whole():
    parents, lengths = [-1, 0, 1, 0, 3, 0, 5], [0.0, 1.0, 2.0, 4.0, 1.0, 0.5, 0.5]
    skeleton = replace(tree("chain", 7), parents=np.array(parents), offsets=np.outer(lengths, [0.0, 1.0, 0.0]))
    for most, chosen in ((3, [0, 3, 4]), (5, [0, 1, 2, 3, 4]), (9, range(7))):
        np.testing.assert_array_equal(skeleton.on_longest_branches(np.arange(7), most), chosen)


@pytest.mark.parametrize("kind", ["root with children", "chain", "chain with twigs"])
def test_what_is_known_of_a_body_takes_room_for_a_few_numbers_a_joint(kind):
    def known(joints):
        body = Body.of(tree(kind, joints))
        return body.legs, body.height, body.regions, body.handles, find_segments(body)

    known(9)  # compiles
    tracemalloc.start()
    known(3000)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3000 * 12_000  # bytes; an array of all pairs of joints has 24,000 a joint


@pytest.mark.parametrize("kind", ["root with children", "chain with twigs"])
def test_of_very_many_joints_distances_of_some_are_kept_and_measured(kind):
    body = tree(kind, 3000)
    motion = Motion(body, np.zeros((2, 3)), np.tile(body.unturned, (2, 1, 1)), "0.01")
    result = retarget(motion, body.with_lengths(1.1 * body.lengths))
    assert len(result.baseline.distances) == len(result.comparison.contacts.candidates.points) == MOST_POINTS
    assert result.metrics["result"]["distance_error"] == pytest.approx(0.0, abs=1e-12)
