"""Which nodes of a file are joints of its character."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from distretarget.body.conventions import NamedTree
from distretarget.body.named_anatomy import by_tree
from distretarget.character.nodes import Nodes, Scene
from distretarget.errors import FileError, counted, quoted

MOST_JOINTS = 4096  # of a character, with the nodes above: skeletons have matrices of joints x joints


def joint_nodes(scene: Scene, order: Sequence[int]) -> tuple[list[int], list[int], tuple[str, ...]]:
    """Return the nodes above the root, from the top, and those that are joints, parents before children; and a warning
    if the file has other skeletons as well. `order` has all nodes, parents before children.

    Joints are the nodes that skins use, and the bones of a humanoid, and those between them. Without skins and humanoid
    they are those with names of the parts of a body, or else those that an animation turns.

    Raises:
        FileError: the file has no such nodes, or too many, or they hang from no common node.
    """
    parents = scene.nodes.parents.tolist()
    wanted, left_out = _wanted(scene, order, parents)
    above, carried = [], _carried(wanted, order, parents)
    node = parents[_meeting(wanted, order, parents)]
    while node >= 0:
        above.append(node)
        node = parents[node]
    are_above = set(above)
    joints = [node for node in order if carried[node] and node not in are_above]
    if len(joints) + len(above) > MOST_JOINTS:
        counts = f"{counted(len(joints), 'joint')} and {counted(len(above), 'node')} above"
        raise FileError(scene.path, f"its skeleton has {counts}; expected at most {MOST_JOINTS}")
    return above[::-1], joints, left_out


def _carried(nodes: Iterable[int], order: Sequence[int], parents: Sequence[int]) -> list[int]:
    """How many of some nodes each node of the forest carries, itself included."""
    counts = [0] * len(parents)
    for node in nodes:
        counts[node] = 1
    for node in reversed(order):
        if parents[node] >= 0:
            counts[parents[node]] += counts[node]
    return counts


def _meeting(nodes: Collection[int], order: Sequence[int], parents: Sequence[int]) -> int:
    """The lowest node from which all of some different nodes hang; -1 if there is none."""
    counts = _carried(nodes, order, parents)
    return next((node for node in reversed(order) if counts[node] == len(nodes)), -1)


def _branches(above: int, order: Sequence[int], parents: Sequence[int]) -> list[int]:
    """For each node, that just below `above` on its line; the node itself for `above`; else the top of its line."""
    branches = list(range(len(parents)))
    for node in order:
        if parents[node] not in (-1, above) and node != above:
            branches[node] = branches[parents[node]]
    return branches


def top_down(parents: NDArray[np.intp]) -> list[int]:
    """Return all nodes, each followed by those below it, in the order of the file."""
    children: dict[int, list[int]] = defaultdict(list)
    for node, parent in enumerate(parents.tolist()):
        children[parent].append(node)
    order, stack = [], children[-1][::-1]
    while stack:
        order.append(stack.pop())
        stack.extend(reversed(children[order[-1]]))
    return order


def _wanted(scene: Scene, order: Sequence[int], parents: Sequence[int]) -> tuple[list[int], tuple[str, ...]]:
    """The nodes that are joints for certain, and a warning of those that are left out: other skeletons in the file,
    whose skins share no branch with the humanoid's or, without one, with the largest.
    """
    groups = [list(scene.humanoid.values()), *(skin.joints.tolist() for skin in scene.skins)]
    if not any(groups):
        turning = list(scene.animation.rotations) if scene.animation else []
        groups = [_named(scene.nodes, order) or turning]
    every = list(dict.fromkeys(node for group in groups for node in group))
    if not every:
        found = "has no skin, no VRM humanoid, and no nodes with the names of a body"
        raise FileError(scene.path, f"{found}; expected a character")
    skeletons = _skeletons(groups, _branches(_meeting(every, order, parents), order, parents))
    chosen = next((each for each in skeletons if groups[0] and groups[0][0] in each), max(skeletons, key=len))
    others = [scene.nodes.names[next(iter(each))] for each in skeletons if each is not chosen]
    if _meeting(chosen, order, parents) < 0:
        raise FileError(scene.path, "the joints of its skin hang from no common node; expected a single skeleton")
    notes = [f"{counted(len(others), 'other skeleton')} in the file stays as it is: {quoted(others)}"] if others else []
    return [node for node in every if node in chosen], tuple(notes)


def _skeletons(groups: Sequence[Sequence[int]], branches: Sequence[int]) -> list[dict[int, None]]:
    """Groups of nodes, joined where they have nodes on the same branch; their nodes as the keys of dictionaries, in
    order.
    """
    groups = [group for group in groups if group]
    pairs = [(number, branches[node]) for number, group in enumerate(groups) for node in group]
    numbers, shared = np.array(pairs).T
    size = len(groups) + len(branches)
    graph = coo_array((np.ones(len(pairs), bool), (numbers, len(groups) + shared)), shape=(size, size))
    joined: dict[int, dict[int, None]] = {}
    for group, label in zip(groups, connected_components(graph, directed=False)[1].tolist(), strict=False):
        joined.setdefault(label, {}).update(dict.fromkeys(group))
    return list(joined.values())


def _named(nodes: Nodes, order: Sequence[int]) -> list[int]:
    """The nodes that have the names of the parts of a body."""
    if not 0 < len(nodes) <= MOST_JOINTS:
        return []
    places = {node: place for place, node in enumerate(order)}
    parents = tuple(places.get(nodes.parents.item(node), -1) for node in order)
    anatomy = by_tree(NamedTree(tuple(nodes.names[node] for node in order), parents, (False,) * len(order)))
    return [order[place] for place in anatomy.roles.values()] if anatomy else []
