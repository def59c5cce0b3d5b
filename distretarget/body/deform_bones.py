"""Rigs that hold the bones that deform the mesh among controls: from which of them each of them hangs.

A rig that Rigify has generated in Blender has three copies of each bone: DEF- deforms the mesh, ORG- is the original,
and MCH- belongs to the mechanism. In Blender constraints hold the DEF- bones together, and a file has no constraints.
Their own tree is that of the originals: "DEF-thigh.L" hangs from "ORG-spine", so from "DEF-spine". A file without the
originals does not show it; then the bones hang as they do in Rigify's rigs of people.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

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
