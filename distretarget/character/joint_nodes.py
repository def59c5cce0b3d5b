"""Which nodes of a file are joints of its character."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from distretarget.body.conventions import NamedTree
from distretarget.body.named_anatomy import by_tree
from distretarget.character.nodes import Nodes, Scene
from distretarget.errors import FileError, counted, quoted

MOST_JOINTS = 4096  # of a character, with the nodes above: skeletons have matrices of joints x joints


def joint_nodes(scene: Scene) -> tuple[list[int], list[int], tuple[str, ...]]:
    """Return the nodes above the root, from the top, and those that are joints, parents before children; and a warning
    if the file has other skeletons as well.

    Joints are the nodes that skins use, and the bones of a humanoid, and those between them. Without skins and humanoid
    they are those with names of the parts of a body, or else those that an animation turns.
    A FileError if there are none, or too many, or if they hang from no common node.
    """
    nodes = scene.nodes
    wanted, left_out = _wanted(scene)
    above, carried = [_meeting(wanted, nodes)], _carried(wanted, nodes)
    while (parent := nodes.parents.item(above[-1])) >= 0:
        above.append(parent)
    are_above = set(above[1:])
    joints = [node for node in nodes.top_down if carried[node] and node not in are_above]
    if len(joints) + len(are_above) > MOST_JOINTS:
        counts = f"{counted(len(joints), 'joint')} and {counted(len(are_above), 'node')} above"
        raise FileError(scene.path, f"its skeleton has {counts}; expected at most {MOST_JOINTS}")
    return above[:0:-1], joints, left_out


def _carried(some: Iterable[int], nodes: Nodes) -> list[int]:
    """How many of some nodes each node of the forest carries, itself included."""
    parents, counts = nodes.parents.tolist(), [0] * len(nodes)
    for node in some:
        counts[node] = 1
    for node in reversed(nodes.top_down):
        if parents[node] >= 0:
            counts[parents[node]] += counts[node]
    return counts


def _meeting(some: Collection[int], nodes: Nodes) -> int:
    """The lowest node from which all of some different nodes hang; -1 if there is none."""
    counts = _carried(some, nodes)
    return next((node for node in reversed(nodes.top_down) if counts[node] == len(some)), -1)


def _branches(above: int, nodes: Nodes) -> list[int]:
    """For each node, that just below `above` on its line; the node itself for `above`; else the top of its line."""
    parents, branches = nodes.parents.tolist(), list(range(len(nodes)))
    for node in nodes.top_down:
        if parents[node] not in (-1, above) and node != above:
            branches[node] = branches[parents[node]]
    return branches


def _wanted(scene: Scene) -> tuple[list[int], tuple[str, ...]]:
    """The nodes that are joints for certain, and a warning of those that are left out: other skeletons in the file,
    whose skins share no branch with the humanoid's or, without one, with the largest.
    """
    groups = [list(scene.humanoid.values()), *(skin.joints.tolist() for skin in scene.skins)]
    if not any(groups):
        groups = [_named(scene.nodes) or [*(scene.animation.rotations if scene.animation else ())]]
    every = list(dict.fromkeys(node for group in groups for node in group))
    if not every:
        found = "has no skin, no VRM humanoid, and no nodes with the names of a body"
        raise FileError(scene.path, f"{found}; expected a character")
    skeletons = _skeletons(groups, _branches(_meeting(every, scene.nodes), scene.nodes))
    chosen = next((each for each in skeletons if groups[0] and groups[0][0] in each), max(skeletons, key=len))
    others = [scene.nodes.names[next(iter(each))] for each in skeletons if each is not chosen]
    if _meeting(chosen, scene.nodes) < 0:
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


def _named(nodes: Nodes) -> list[int]:
    """The nodes that have the names of the parts of a body."""
    if not 0 < len(nodes) <= MOST_JOINTS:
        return []
    tree = nodes.among(nodes.top_down)
    anatomy = by_tree(NamedTree(tree.names, tuple(tree.parents.tolist()), (False,) * len(tree)))
    return [nodes.top_down[place] for place in anatomy.roles.values()] if anatomy else []
