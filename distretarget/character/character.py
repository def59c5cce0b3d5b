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
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.tree_repairs import Reparented, reparented
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
    """A skeleton whose joints are nodes of a file, in its tree or, after repairs, in another one."""

    in_file: Skeleton  # the root and all nodes below, in the bind pose, in the world of the file [file units]
    nodes: NDArray[np.intp]  # the nodes above the root, from the top, then the node of each joint
    shown: Nodes  # these nodes with their transforms in the file
    binds: Array  # (nodes, 4), their world rotations in the bind pose, Q; those above the root as in the file
    locals: Array  # (nodes, 4), their rotations relative to the parent in the bind pose, b
    scales: Array  # (nodes,), their scales in the world; negative where they mirror
    origin: Array  # (3,), the position of the node above the root; 0 if there is none [file units]
    warnings: tuple[str, ...]  # a line on each thing in the file that is lost
    repairs: tuple[Reparented, ...] = ()  # of the skeleton in the file, each of what the one before made

    @property
    def skeleton(self) -> Skeleton:
        """The skeleton with all repairs."""
        return self.repairs[-1].skeleton if self.repairs else self.in_file

    @property
    def joint_nodes(self) -> NDArray[np.intp]:
        """(joints,), the node of each joint of the skeleton."""
        nodes = self.nodes[self._above :]
        for repair in self.repairs:
            nodes = nodes[repair.joints]
        return nodes

    @property
    def bind_transforms(self) -> Mapping[int, Array]:
        """The world transform, (4, 4), of each of the nodes in the bind pose, the skeleton's rest pose."""
        transforms = replace(self.shown, rotations=self.locals).transforms
        places = self.in_file.rest_positions + self.in_file.offsets[0]
        for node, parent in enumerate(self.shown.parents.tolist()):
            if parent >= 0:
                transforms[node] = transforms[parent] @ transforms[node]
            if node >= self._above:
                transforms[node, :3, 3] = places[node - self._above]
        return dict(zip(self.nodes.tolist(), transforms, strict=True))

    @property
    def _above(self) -> int:
        """The number of nodes above the root."""
        return len(self.nodes) - len(self.in_file)

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
        joints = len(self.in_file)
        rotations, moved = np.empty((frames, joints, 4)), np.empty((frames, joints, 3))
        for first in range(0, frames, max(BLOCK // count, 1)):
            block = slice(first, first + max(BLOCK // count, 1))
            rotations[block], moved[block] = self._local(animation, block)
        if not extent(moved) <= LARGEST:
            raise FileError("", f"its animation leads beyond {LARGEST:g}; expected smaller translations")
        offsets = self.in_file.offsets  # the translations of joints that are at them but for rounding
        away = [lengths(moved[:, joint] - offset).max(initial=0.0) for joint, offset in enumerate(offsets)]
        still = np.array(away) < SAME_PLACE * extent(self.in_file.rest_positions)
        still[0] = False
        moved[:, still] = offsets[still]
        motion = Motion.of_translations(self.in_file, moved, rotations, animation.frame_time_text)
        for repair in self.repairs:
            motion = repair.motion(motion)
        return motion

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
        """Return a motion of the skeleton as an animation of the nodes that turn or move. Joints that are repaired to
        hang from others get keys of translation.
        """
        trees = [self.in_file, *(repair.skeleton for repair in self.repairs)]
        for repair, tree in reversed([*zip(self.repairs, trees, strict=False)]):
            motion = _in_tree(tree, motion, repair.joints)
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
        moving = away > SAME_PLACE * extent(self.in_file.rest_positions)
        nodes, posed = self.nodes[joints].tolist(), frozenset(self.nodes.tolist())
        moves = {nodes[joint]: translations[:, joint] for joint in np.flatnonzero(moving)}
        turns = {nodes[joint]: rotations[:, joint] for joint in np.flatnonzero(turning)}
        return Animation(name, len(motion), motion.frame_time_text, moves, turns, posed=posed)

    def in_single_precision(self, motion: Motion) -> Motion:
        """Return a motion rounded to float32 as in the file, where the path is relative to the node above the root."""
        parent, scale = self._parent_binds[self._above], self._parent_scales[self._above]
        path = parent.inv().apply(motion.root_positions - self.origin) / scale
        return replace(single_precision(motion), root_positions=parent.apply(in_float32(path) * scale) + self.origin)


def _in_tree(skeleton: Skeleton, motion: Motion, bones: NDArray[np.intp]) -> Motion:
    """The motion of a skeleton whose joints `bones`, (joints,), are the joints of another motion in the world. Each of
    the others moves with the nearest bone above it.
    """
    joints = {bone: joint for joint, bone in enumerate(bones.tolist())}
    lines = [skeleton.to_root(bone)[1:] for bone in joints]
    parents = np.array([line[0] if line else -1 for line in lines])
    bearers = np.array([next((joints[bone] for bone in line if bone in joints), -1) for line in lines])
    rest = np.vstack([skeleton.rest_positions + skeleton.offsets[0], np.zeros(3)])
    offsets = rest[parents] - rest[np.append(bones, -1)[bearers]]
    still, world = np.tile(IDENTITY, (len(motion), 1, 1)), motion.world_rotations
    above = Rotation.from_quat(np.concatenate([world, still], axis=1)[:, bearers])
    places = np.concatenate([motion.positions, np.zeros((len(motion), 1, 3))], axis=1)[:, bearers]
    places = places + above.apply(np.broadcast_to(offsets, places.shape))
    rotations = np.tile(skeleton.rest_rotations, (len(motion), 1, 1))
    translations = np.tile(skeleton.offsets, (len(motion), 1, 1))
    rotations[:, bones] = (above.inv() * Rotation.from_quat(world)).as_quat()
    translations[:, bones] = above.inv().apply(motion.positions - places)
    return Motion.of_translations(skeleton, translations, rotations, motion.frame_time_text)


def deform_bones(skeleton: Skeleton) -> Reparented | None:
    """Return the skeleton with deform bones (`DEF-`) as joints if it has them among controls; None if it has not."""
    tree = {} if skeleton.humanoid else dict(deform_tree(skeleton.names, skeleton.parents.tolist()))
    if not tree:
        return None
    if sum(parent < 0 for parent in tree.values()) > 1:
        tree = {bone: max(parent, 0) for bone, parent in tree.items()} | {0: -1}
    turns = {bone: tuple(each for each in skeleton.channels[bone] if each in ROTATION_CHANNELS) for bone in tree}
    root = next(bone for bone, parent in tree.items() if parent < 0)
    return reparented(skeleton, tree, turns | {root: (*POSITION_CHANNELS, *turns[root])})


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
