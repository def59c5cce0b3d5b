"""Rigs that hold the bones that deform the mesh among controls: from which of them each of them hangs.

A rig that Rigify has generated in Blender has three copies of each bone: DEF- deforms the mesh, ORG- is the original,
and MCH- belongs to the mechanism. In Blender constraints hold the DEF- bones together, and a file has no constraints.
Their own tree is that of the originals: "DEF-thigh.L" hangs from "ORG-spine", so from "DEF-spine".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

DEFORMS, ORIGINAL = "DEF-", "ORG-"
NUMBER = re.compile(r"_\d+$")  # at the end of all names in Sketchfab's files


def deform_tree(names: Sequence[str], parents: Sequence[int]) -> Mapping[int, int]:
    """Return the parent of each bone that deforms among these, -1 for those that hang from none, by bone; empty for
    rigs without them, and for those in which each hangs from its parent among them already.

    Args:
        names: of the bones.
        parents: the parent of each, -1 for none; in any order.
    """
    plain = [NUMBER.sub("", name) for name in names] if all(map(NUMBER.search, names)) else names
    deforming = {name.removeprefix(DEFORMS): bone for bone, name in enumerate(plain) if name.startswith(DEFORMS)}
    bones = set(deforming.values())
    originals = {
        bone: deforming[name.removeprefix(ORIGINAL)]
        for bone, name in enumerate(plain)
        if name.startswith(ORIGINAL) and name.removeprefix(ORIGINAL) in deforming
    }

    def first_above(bone: int, known: Mapping[int, int]) -> int:
        above = parents[bone]
        while above >= 0 and known.get(above, bone) == bone:
            above = parents[above]
        return known[above] if above >= 0 else -1

    own = {bone: bone for bone in bones}
    shown, tree = ({bone: first_above(bone, known) for bone in sorted(bones)} for known in (own, own | originals))
    return {} if shown == tree else tree
