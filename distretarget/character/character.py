"""Characters: a skeleton whose joints are nodes of a file; conversion of node transforms to its motion and back.

A node's axes are arbitrary, and so are its parent's; a joint of the skeleton has no rotation in the bind pose, as in
BVH. Let Q_j be the rotation of node j in the world in the bind pose, b_j and r_j its rotations relative to
its parent p, in the bind pose and in a frame. Then the rotation of the joint is q_j = Q_p (r_j b_j^-1) Q_p^-1, and that
of the node r_j = Q_p^-1 q_j Q_p b_j. Uniform scales drop out, and so does mirroring, a scale of -1.

A rig that Rigify has generated in Blender has three copies of each bone: DEF- deforms the mesh, ORG- is the original,
and MCH- belongs to the mechanism. In Blender constraints hold the DEF- bones together, which a file does not have. So
they get the tree of the originals: "DEF-thigh.L", which hangs from "ORG-spine", gets the parent "DEF-spine". In a
file without originals they get the parents that they have in Rigify's rigs of people. Feet that hang from the root, as
in rigs with baked IK, are attached to the shins.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.tree_repairs import Reparented, attached_limbs, reparented
from distretarget.character.nodes import Animation, Nodes
from distretarget.errors import FileError
from distretarget.motion import Motion, in_float32, single_precision
from distretarget.numerics.rotations import continuous
from distretarget.numerics.vectors import Array, extent, lengths
from distretarget.skeleton import LARGEST, POSITION_CHANNELS, ROTATION_CHANNELS, Skeleton

IDENTITY = [0.0, 0.0, 0.0, 1.0]

BLOCK = 65536  # poses that are computed at once [frames x joints]
FREE_POSES = 1_000_000  # even the smallest file may have this many poses of joints [frames x joints]
SAME_PLACE = 1e-6  # a node that moves less than this needs no keys of its translation [body sizes]
SAME_TURN = 1e-12  # a node needs no keys of its rotation if 1 - |dot product of quaternions| stays below this
DEFORMS, ORIGINAL = "DEF-", "ORG-"
NUMBER = re.compile(r"_\d+$")  # at the end of all names in Sketchfab's files
# The parents of bones in Rigify's rigs of people, by the first word of the name; that of bones of the face is the last
# joint of the spine.
HANGS_FROM = {
    **dict.fromkeys(("pelvis", "thigh"), "spine"),
    **dict.fromkeys(("shoulder", "breast"), "spine.003"),
    "upper_arm": "shoulder",
}
OF_FACE = {"forehead", "temple", "brow", "lid", "ear", "tongue", "chin", "jaw", "cheek", "nose", "lip", "teeth", "eye"}
SIDE_LETTERS = ("L", "R")


@dataclass(frozen=True, eq=False)
class Character:
    """A skeleton whose joints are nodes of a file."""

    skeleton: Skeleton  # in the bind pose, in the world of the file [file units]
    nodes: NDArray[np.intp]  # the nodes above the root, from the top, then the node of each joint
    shown: Nodes  # these nodes with their transforms in the file
    binds: Array  # (nodes, 4), their world rotations in the bind pose, Q; those above the root as in the file
    locals: Array  # (nodes, 4), their rotations relative to the parent in the bind pose, b
    scales: Array  # (nodes,), their scales in the world; negative where they mirror
    origin: Array  # (3,), the position of the node above the root; 0 if there is none [file units]
    warnings: tuple[str, ...]  # a line on each thing in the file that is lost

    @property
    def joint_nodes(self) -> NDArray[np.intp]:
        """(joints,), the node of each joint of the skeleton."""
        return self.nodes[self._above :]

    @property
    def bind_transforms(self) -> Mapping[int, Array]:
        """The world transform, (4, 4), of each of the nodes in the bind pose, the skeleton's rest pose."""
        transforms = replace(self.shown, rotations=self.locals).transforms
        places = self.skeleton.rest_positions + self.skeleton.offsets[0]
        for node, parent in enumerate(self.shown.parents.tolist()):
            if parent >= 0:
                transforms[node] = transforms[parent] @ transforms[node]
            if node >= self._above:
                transforms[node, :3, 3] = places[node - self._above]
        return dict(zip(self.nodes.tolist(), transforms, strict=True))

    @property
    def _above(self) -> int:
        """The number of nodes above the root."""
        return len(self.nodes) - len(self.skeleton)

    @property
    def _parent_binds(self) -> Rotation:
        """(nodes,), the world rotation of each node's parent in the bind pose."""
        return Rotation.from_quat(np.vstack([self.binds, IDENTITY])[self.shown.parents])

    @property
    def _parent_scales(self) -> Array:
        """(nodes,), the scale of each node's parent in the world."""
        return np.append(self.scales, 1.0)[self.shown.parents]

    def motion(self, animation: Animation, size: int) -> Motion:
        """Return an animation of the nodes as a motion; a FileError if a file of `size` bytes cannot be so long."""
        frames, count = animation.frames, len(self.nodes)
        if frames * count > max(FREE_POSES, size):
            raise FileError("", f"{frames} frames of {count} joints are too many for a file of {size} bytes")
        joints = len(self.skeleton)
        rotations, moved = np.empty((frames, joints, 4)), np.empty((frames, joints, 3))
        for first in range(0, frames, max(BLOCK // count, 1)):
            block = slice(first, first + max(BLOCK // count, 1))
            rotations[block], moved[block] = self._local(animation, block)
        if not extent(moved) <= LARGEST:
            raise FileError("", f"its animation leads beyond {LARGEST:g}; expected smaller translations")
        offsets = self.skeleton.offsets  # the translations of joints that are at them but for rounding
        away = [lengths(moved[:, joint] - offset).max(initial=0.0) for joint, offset in enumerate(offsets)]
        still = np.array(away) < SAME_PLACE * extent(self.skeleton.rest_positions)
        still[0] = False
        moved[:, still] = offsets[still]
        return Motion.of_translations(self.skeleton, moved, rotations, animation.frame_time_text)

    def _local(self, animation: Animation, block: slice) -> tuple[Array, Array]:
        """Rotations and translations of joints from their parents, (frames, joints, 4 and 3), in a block of frames."""
        frames = min(block.stop, animation.frames) - block.start
        rotations = np.tile(self.shown.rotations, (frames, 1, 1))
        translations = np.tile(self.shown.translations, (frames, 1, 1))
        for values, moving in ((rotations, animation.rotations), (translations, animation.translations)):
            for place, node in enumerate(self.nodes.tolist()):
                if node in moving:
                    values[:, place] = moving[node][block]
        parents = self._parent_binds
        turned = parents * Rotation.from_quat(rotations) * Rotation.from_quat(self.locals).inv() * parents.inv()
        rotations, moved = turned.as_quat(), parents.apply(translations) * self._parent_scales[:, None]
        for place in range(1, self._above + 1):  # the root moves with the nodes above it
            above = Rotation.from_quat(rotations[:, place - 1])
            moved[:, place] = moved[:, place - 1] + above.apply(moved[:, place])
            rotations[:, place] = (above * Rotation.from_quat(rotations[:, place])).as_quat()
        shown = parents.apply(self.shown.translations) * self._parent_scales[:, None]
        moved[:, self._above] += self.origin - shown[: self._above].sum(axis=0)  # not 0 where a scale is uneven
        return rotations[:, self._above :], moved[:, self._above :]

    def animation(self, motion: Motion, name: str) -> Animation:
        """Return a motion of the skeleton as an animation of the nodes that turn or move."""
        joints = slice(self._above, None)
        parents, scales = self._parent_binds[joints], self._parent_scales[joints, None]
        own = Rotation.from_quat(self.locals[joints])
        turned = parents.inv() * Rotation.from_quat(motion.rotations) * parents * own
        rotations, translations = continuous(turned.as_quat()), motion.translations
        translations[:, 0] -= self.origin
        translations = parents.inv().apply(translations) / scales
        cosines = np.abs((rotations * self.shown.rotations[joints]).sum(axis=2))
        away = (lengths(translations - self.shown.translations[joints]) * np.abs(scales[:, 0])).max(axis=0)
        turning = (1.0 - cosines).max(axis=0) > SAME_TURN
        moving = away > SAME_PLACE * extent(self.skeleton.rest_positions)
        nodes, posed = self.joint_nodes.tolist(), frozenset(self.nodes.tolist())
        moves = {nodes[joint]: translations[:, joint] for joint in np.flatnonzero(moving)}
        turns = {nodes[joint]: rotations[:, joint] for joint in np.flatnonzero(turning)}
        return Animation(name, len(motion), motion.frame_time_text, moves, turns, posed=posed)

    def in_single_precision(self, motion: Motion) -> Motion:
        """Return a motion rounded to float32 as in the file, where the path is relative to the node above the root."""
        parent, scale = self._parent_binds[self._above], self._parent_scales[self._above]
        path = parent.inv().apply(motion.root_positions - self.origin) / scale
        return replace(single_precision(motion), root_positions=parent.apply(in_float32(path) * scale) + self.origin)


@dataclass(frozen=True, eq=False)
class DeformCharacter(Character):
    """A character whose joints are some of the nodes, in another tree; bones below controls get keys of translation."""

    whole: Character  # the character with all nodes as joints
    bones: NDArray[np.intp]  # (joints,), the joint of the whole character that each joint is

    @property
    def joint_nodes(self) -> NDArray[np.intp]:
        """(joints,), the node of each joint of the skeleton."""
        return self.whole.joint_nodes[self.bones]

    @property
    def bind_transforms(self) -> Mapping[int, Array]:
        """The `bind_transforms` of the whole character."""
        return self.whole.bind_transforms

    def motion(self, animation: Animation, size: int) -> Motion:
        """Return an animation of the nodes as a motion of the skeleton; arguments and errors as in `Character`."""
        return Reparented(self.skeleton, self.bones).motion(self.whole.motion(animation, size))

    def animation(self, motion: Motion, name: str) -> Animation:
        """Return a motion of the skeleton as an animation of the nodes that turn or move."""
        skeleton = self.whole.skeleton
        above, places = self._above_in_file(motion)
        rotations = np.tile(skeleton.rest_rotations, (len(motion), 1, 1))
        translations = np.tile(skeleton.offsets, (len(motion), 1, 1))
        rotations[:, self.bones] = (above.inv() * Rotation.from_quat(motion.world_rotations)).as_quat()
        translations[:, self.bones] = above.inv().apply(motion.positions - places)
        moved = Motion.of_translations(skeleton, translations, rotations, motion.frame_time_text)
        return self.whole.animation(moved, name)

    def _above_in_file(self, motion: Motion) -> tuple[Rotation, Array]:
        """World rotations and positions of each bone's parent in the file, which moves with the nearest bone above."""
        skeleton = self.whole.skeleton
        joints = {bone: joint for joint, bone in enumerate(self.bones.tolist())}
        lines = [skeleton.to_root(bone)[1:] for bone in joints]
        parents = np.array([line[0] if line else -1 for line in lines])
        bearers = np.array([next((joints[bone] for bone in line if bone in joints), -1) for line in lines])
        rest = np.vstack([skeleton.rest_positions + skeleton.offsets[0], np.zeros(3)])
        offsets = rest[parents] - rest[np.append(self.bones, -1)[bearers]]
        still = np.tile(IDENTITY, (len(motion), 1, 1))
        above = Rotation.from_quat(np.concatenate([motion.world_rotations, still], axis=1)[:, bearers])
        places = np.concatenate([motion.positions, np.zeros((len(motion), 1, 3))], axis=1)[:, bearers]
        return above, places + above.apply(np.broadcast_to(offsets, places.shape))


def with_deform_bones(character: Character) -> Character:
    """Return the character with deform bones (`DEF-`) as joints if the file has them among controls; else the same."""
    whole = character.skeleton
    tree = {} if whole.humanoid else dict(deform_tree(whole.names, whole.parents.tolist()))
    if not tree:
        return character
    if sum(parent < 0 for parent in tree.values()) > 1:
        tree = {bone: max(parent, 0) for bone, parent in tree.items()} | {0: -1}
    turns = {bone: tuple(each for each in whole.channels[bone] if each in ROTATION_CHANNELS) for bone in tree}
    root = next(bone for bone, parent in tree.items() if parent < 0)
    return _reparented(character, reparented(whole, tree, turns | {root: (*POSITION_CHANNELS, *turns[root])}))


def with_attached_limbs(character: Character) -> Character:
    """Return the character with feet and hands attached to shins and forearms if they are not in the file."""
    tree = attached_limbs(character.skeleton)
    return _reparented(character, tree) if tree else character


def _reparented(character: Character, tree: Reparented) -> DeformCharacter:
    """The character with a reparented skeleton."""
    same = {entry.name: getattr(character, entry.name) for entry in fields(character)}
    return DeformCharacter(**same | {"skeleton": tree.skeleton}, whole=character, bones=tree.joints)


def deform_tree(names: Sequence[str], parents: Sequence[int]) -> Mapping[int, int]:
    """Return the parent deform bone (`DEF-`) of each, -1 for none; empty if there are none, or the tree has these."""
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
    """The deform bone, by `known`, of the nearest known ancestor that stands for another bone; -1 without one."""
    above = parents[bone]
    while above >= 0 and known.get(above, bone) == bone:
        above = parents[above]
    return known[above] if above >= 0 else -1


def _usual_parent(name: str, names: Iterable[str]) -> str:
    """The parent of a bone in Rigify's rigs of people, both without prefix; empty for none."""
    word, *marks = name.split(".")
    if word in OF_FACE:
        return max((other for other in names if other.startswith("spine")), default="")
    parent = HANGS_FROM.get(word, "")
    return ".".join([parent, *(mark for mark in marks if mark in SIDE_LETTERS)]) if parent == "shoulder" else parent
