"""Characters whose bones that deform the mesh stand among controls: their skeleton is that of these bones alone.

A rig that Rigify has generated in Blender has three copies of each bone: DEF- deforms the mesh, ORG- is the original,
and MCH- belongs to the mechanism. In Blender constraints hold the DEF- bones together, and a file has no constraints.
Their own tree is that of the originals: "DEF-thigh.L" hangs from "ORG-spine", so from "DEF-spine". A file without the
originals does not show it; then the bones hang as they do in Rigify's rigs of people.

Other rigs have feet that hang from the root beside the body, since IK moved them there; they hang from the shins.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.beside import Tree, in_tree, limbs_on_body
from distretarget.character.character import IDENTITY, Character
from distretarget.character.nodes import Animation
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array
from distretarget.skeleton import POSITION_CHANNELS, ROTATION_CHANNELS

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


@dataclass(frozen=True, eq=False)
class DeformCharacter(Character):
    """A character whose skeleton has some of its nodes, in another tree than the file's.

    Controls stay as the file shows them. So that the mesh does not tear, a bone that hangs from a control in the file
    gets keys of its translation as well.
    """

    whole: Character  # with all nodes as joints
    bones: NDArray[np.intp]  # (joints,), the joints of the whole character that are joints of this one

    @property
    def joint_nodes(self) -> NDArray[np.intp]:
        """(joints,), the node of each joint of the skeleton."""
        return self.whole.joint_nodes[self.bones]

    @property
    def bind_transforms(self) -> Mapping[int, Array]:
        """The transform in the world, (4, 4), of each of the file's nodes that matter in the bind pose."""
        return self.whole.bind_transforms

    def motion(self, animation: Animation, size: int) -> Motion:
        """Return an animation of the nodes as a motion of the skeleton; arguments and errors as in `Character`."""
        return Tree(self.skeleton, self.bones).motion(self.whole.motion(animation, size))

    def animation(self, motion: Motion, name: str) -> Animation:
        """Return a motion of the skeleton as an animation of the nodes that turn or move."""
        skeleton = self.whole.skeleton
        above, places = self._above_in_file(motion)
        rotations = np.tile(skeleton.unturned, (len(motion), 1, 1))
        translations = np.tile(skeleton.offsets, (len(motion), 1, 1))
        rotations[:, self.bones] = (above.inv() * Rotation.from_quat(motion.world_rotations)).as_quat()
        translations[:, self.bones] = above.inv().apply(motion.positions - places)
        moved = Motion.of_translations(skeleton, translations, rotations, motion.frame_time_text)
        return self.whole.animation(moved, name)

    def _above_in_file(self, motion: Motion) -> tuple[Rotation, Array]:
        """The rotation in the world of the node from which each bone hangs in the file, and its place, (frames, joints,
        3); these nodes move with the nearest bone above them, or not at all.
        """
        skeleton = self.whole.skeleton
        joints = {bone: joint for joint, bone in enumerate(self.bones.tolist())}
        lines = [skeleton.line(bone)[1:] for bone in joints]
        parents = np.array([line[0] if line else -1 for line in lines])
        bearers = np.array([next((joints[bone] for bone in line if bone in joints), -1) for line in lines])
        rest = np.vstack([skeleton.rest_positions + skeleton.offsets[0], np.zeros(3)])
        offsets = rest[parents] - rest[np.append(self.bones, -1)[bearers]]
        still = np.tile(IDENTITY, (len(motion), 1, 1))
        above = Rotation.from_quat(np.concatenate([motion.world_rotations, still], axis=1)[:, bearers])
        places = np.concatenate([motion.positions, np.zeros((len(motion), 1, 3))], axis=1)[:, bearers]
        return above, places + above.apply(np.broadcast_to(offsets, places.shape))


def with_deform_bones(character: Character) -> Character:
    """Return the character whose skeleton is that of the bones that deform, where the file has them among controls;
    else the same.
    """
    whole = character.skeleton
    tree = {} if whole.humanoid else dict(deform_tree(whole.names, whole.parents.tolist()))
    if not tree:
        return character
    if sum(parent < 0 for parent in tree.values()) > 1:
        tree = {bone: max(parent, 0) for bone, parent in tree.items()} | {0: -1}
    turns = {bone: tuple(each for each in whole.channels[bone] if each in ROTATION_CHANNELS) for bone in tree}
    root = next(bone for bone, parent in tree.items() if parent < 0)
    return _by(character, in_tree(whole, tree, turns | {root: (*POSITION_CHANNELS, *turns[root])}))


def with_limbs_on_body(character: Character) -> Character:
    """Return the character in whose skeleton feet and hands hang from shin and forearm, where in the file they hang
    beside the body; else the same.
    """
    tree = limbs_on_body(character.skeleton)
    return _by(character, tree) if tree else character


def _by(character: Character, tree: Tree) -> DeformCharacter:
    """The character by the joints of a tree."""
    same = {entry.name: getattr(character, entry.name) for entry in fields(character)}
    return DeformCharacter(**same | {"skeleton": tree.skeleton}, whole=character, bones=tree.joints)


def deform_tree(names: Sequence[str], parents: Sequence[int]) -> Mapping[int, int]:
    """Return the deform bone above each deform bone (`DEF-`), -1 for none. Empty for a rig without deform bones, or one
    in which they are a tree by themselves.

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
