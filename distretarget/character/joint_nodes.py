"""Which nodes of a file are joints of its character, and from which of them bones that deform the mesh hang.

A rig that Rigify has generated in Blender has three copies of each bone: DEF- deforms the mesh, ORG- is the original,
and MCH- belongs to the mechanism. In Blender constraints hold the DEF- bones together, and a file has no constraints.
Their own tree is that of the originals: "DEF-thigh.L" hangs from "ORG-spine", so from "DEF-spine". A file without the
originals does not show it; then the bones hang as they do in Rigify's rigs of people.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from distretarget.body.conventions import NamedTree
from distretarget.body.named_anatomy import by_tree
from distretarget.character.nodes import Nodes, Scene
from distretarget.errors import FileError, counted, quoted

MOST_JOINTS = 4096  # of a character, with the nodes above: skeletons have matrices of joints x joints
DEFORMS, ORIGINAL = "DEF-", "ORG-"
NUMBER = re.compile(r"_\d+$")  # at the end of all names in Sketchfab's files

# From what bones hang in Rigify's rigs of people, by word; those of the face hang from the last joint of the spine.
HANGS_FROM = {
    **dict.fromkeys(("pelvis", "thigh"), "spine"),
    **dict.fromkeys(("shoulder", "breast"), "spine.003"),
    "upper_arm": "shoulder",
}
FACE = {"forehead", "temple", "brow", "lid", "ear", "tongue", "chin", "jaw", "cheek", "nose", "lip", "teeth", "eye"}
SIDES = ("L", "R")


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


def deform_tree(names: Sequence[str], parents: Sequence[int]) -> Mapping[int, int]:
    """Return the parent of each bone that deforms among these, -1 for those that hang from none, by bone; empty for
    rigs without them, and for those without originals in which each hangs from its parent among them already.

    Args:
        names: of the bones.
        parents: the parent of each, -1 for none; in any order.
    """
    plain = [NUMBER.sub("", name) for name in names] if all(map(NUMBER.search, names[1:])) else names
    deforming = {name.removeprefix(DEFORMS): bone for bone, name in enumerate(plain) if name.startswith(DEFORMS)}
    own = {bone: bone for bone in sorted(deforming.values())}
    originals = {
        bone: deforming[name.removeprefix(ORIGINAL)]
        for bone, name in enumerate(plain)
        if name.startswith(ORIGINAL) and name.removeprefix(ORIGINAL) in deforming
    }
    shown, tree = ({bone: _above(bone, parents, known) for bone in own} for known in (own, own | originals))
    for name, bone in deforming.items():
        if tree[bone] < 0:
            tree[bone] = deforming.get(_usual_parent(name, deforming), -1)
    return {} if shown == tree and not originals else tree


def _above(bone: int, parents: Sequence[int], known: Mapping[int, int]) -> int:
    """The bone for which the next known one above a bone stands; -1 without one."""
    above = parents[bone]
    while above >= 0 and known.get(above, bone) == bone:
        above = parents[above]
    return known[above] if above >= 0 else -1


def _usual_parent(name: str, names: Iterable[str]) -> str:
    """The name of the bone from which one with this name hangs in Rigify's rigs of people; empty if it hangs from none
    there. All names are without prefix.
    """
    word, *marks = name.split(".")
    if word in FACE:
        return max((other for other in names if other.startswith("spine")), default="")
    parent = HANGS_FROM.get(word, "")
    return ".".join([parent, *(mark for mark in marks if mark in SIDES)]) if parent == "shoulder" else parent
