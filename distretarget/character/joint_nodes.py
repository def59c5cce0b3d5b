"""Which nodes of a file are joints of its character."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from distretarget.body.conventions import NamedTree
from distretarget.body.named_anatomy import by_tree
from distretarget.character.nodes import Nodes, Scene
from distretarget.errors import FileError, counted, quoted

MOST_JOINTS = 4096  # of a character: skeletons have matrices of joints x joints


def joint_nodes(scene: Scene, order: Sequence[int]) -> tuple[list[int], list[int], tuple[str, ...]]:
    """Return the nodes above the root, from the top, and those that are joints, parents before children; and a warning
    if the file has other skeletons as well. `order` has all nodes, parents before children.

    Joints are the nodes that skins use, and the bones of a humanoid, and those between them. Without skins and humanoid
    they are those that an animation turns and those with names of the parts of a body.

    Raises:
        FileError: the file has no such nodes, or too many, or they hang from no common node.
    """
    parents = scene.nodes.parents
    lines = _Lines(parents)
    wanted, left_out = _wanted(scene, order, lines)
    root = lines.meeting(wanted)
    inner = {node for joint in wanted for node in lines.up(joint, root)}
    joints = [node for node in order if node in inner]
    if len(joints) > MOST_JOINTS:
        raise FileError(scene.path, f"its skeleton has {len(joints)} joints; expected at most {MOST_JOINTS}")
    above = lines.up(parents.item(root), -1)[::-1] if parents[root] >= 0 else []
    return above, joints, left_out


class _Lines:
    """The lines of a forest from its nodes upwards."""

    def __init__(self, parents: NDArray[np.intp]) -> None:
        self._parents = parents.tolist()

    def up(self, node: int, last: int) -> list[int]:
        """The nodes from `node` up to `last`, both included; up to the top if that is -1."""
        line = [node]
        while line[-1] != last and self._parents[line[-1]] >= 0:
            line.append(self._parents[line[-1]])
        return line

    def meeting(self, nodes: Iterable[int]) -> int:
        """The lowest node from which all nodes hang; -1 if there is none."""
        shared: list[int] | None = None
        for node in nodes:
            line = self.up(node, -1)[::-1]
            shared = line if shared is None else shared[: _common(shared, line)]
        return shared[-1] if shared else -1

    def branch(self, node: int, above: int) -> int:
        """The node just below `above` on the line of a node; the node itself if it is `above`."""
        line = self.up(node, above)
        return line[-2] if line[-1] == above and len(line) > 1 else line[-1]


def _common(first: Sequence[int], second: Sequence[int]) -> int:
    """How many entries at the beginning are the same."""
    pairs = enumerate(zip(first, second, strict=False))
    return next((place for place, (one, other) in pairs if one != other), min(len(first), len(second)))


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


def _wanted(scene: Scene, order: Sequence[int], lines: _Lines) -> tuple[list[int], tuple[str, ...]]:
    """The nodes that are joints for certain, and a warning of those that are left out: other skeletons in the file,
    whose skins share no branch with the humanoid's or, without one, with the largest.
    """
    groups = [list(scene.humanoid.values()), *(skin.joints.tolist() for skin in scene.skins)]
    if not any(groups):
        turning = list(scene.animation.rotations) if scene.animation else []
        groups = [[*turning, *_named(scene.nodes, order)]]
    every = list(dict.fromkeys(node for group in groups for node in group))
    if not every:
        found = "has no skin, no VRM humanoid, and no nodes with the names of a body"
        raise FileError(scene.path, f"{found}; expected a character")
    skeletons = _skeletons(groups, lines, lines.meeting(every))
    chosen = next((each for each in skeletons if groups[0] and groups[0][0] in each), max(skeletons, key=len))
    others = [
        scene.nodes.names[next(node for node in every if node in each)] for each in skeletons if each is not chosen
    ]
    if lines.meeting(chosen) < 0:
        raise FileError(scene.path, "the joints of its skin hang from no common node; expected a single skeleton")
    notes = [f"{counted(len(others), 'other skeleton')} in the file stays as it is: {quoted(others)}"] if others else []
    return [node for node in every if node in chosen], tuple(notes)


def _skeletons(groups: Sequence[Sequence[int]], lines: _Lines, meeting: int) -> list[set[int]]:
    """Groups of nodes, joined where they have nodes on the same branch below the node at which all meet."""
    joined: list[tuple[set[int], set[int]]] = []  # branches, and nodes
    for group in filter(None, groups):
        branches, nodes = {lines.branch(node, meeting) for node in group}, set(group)
        for others in [each for each in joined if each[0] & branches]:
            joined.remove(others)
            branches, nodes = branches | others[0], nodes | others[1]
        joined.append((branches, nodes))
    return [nodes for _, nodes in joined]


def _named(nodes: Nodes, order: Sequence[int]) -> list[int]:
    """The nodes that have the names of the parts of a body."""
    if len(nodes) > MOST_JOINTS:
        return []
    places = {node: place for place, node in enumerate(order)}
    parents = tuple(places.get(nodes.parents.item(node), -1) for node in order)
    anatomy = by_tree(NamedTree(tuple(nodes.names[node] for node in order), parents, (False,) * len(order)))
    return [order[place] for place in anatomy.roles.values()] if anatomy else []
