"""What files of characters hold, glTF and FBX alike: a forest of nodes, the skins on them, and animations of nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.numerics.kinematics import children_of, depth_first_order
from distretarget.numerics.vectors import Array

INFLUENCES = 8  # the bones that move a vertex most; others do not count


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of a file and the transforms that they show without an animation, relative to their parents."""

    names: tuple[str, ...]  # they may be empty or the same
    parents: NDArray[np.intp]  # (nodes,), -1 for none; parents may come after their children
    translations: Array  # (nodes, 3) [file units]
    rotations: Array  # (nodes, 4), unit quaternions x y z w
    scales: Array  # (nodes, 3), along the axes of the node

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def top_down(self) -> list[int]:
        """All nodes, each followed by those below it, in the order of the file."""
        children = children_of([-1, *(self.parents + 1).tolist()])  # with a root above all, node 0
        return [node - 1 for node in depth_first_order(children)[1:]]

    @cached_property
    def transforms(self) -> Array:
        """(nodes, 4, 4), relative to the parents."""
        result = np.tile(np.eye(4), (len(self), 1, 1))
        result[:, :3, :3] = Rotation.from_quat(self.rotations).as_matrix() * self.scales[:, None]
        result[:, :3, 3] = self.translations
        return result

    @cached_property
    def world(self) -> Array:
        """(nodes, 4, 4), in the world of the file; not always finite where scales are extreme."""
        world = self.transforms.copy()
        with np.errstate(all="ignore"):
            for node in self.top_down:
                if (parent := self.parents[node]) >= 0:
                    world[node] = world[parent] @ world[node]
        return world

    def among(self, line: Sequence[int]) -> Nodes:
        """Return some of the nodes, numbered in their order; those whose parent is not among them have none."""
        places = {node: place for place, node in enumerate(line)}
        return Nodes(
            names=tuple(self.names[node] for node in line),
            parents=np.array([places.get(self.parents.item(node), -1) for node in line]),
            translations=self.translations[line],
            rotations=self.rotations[line],
            scales=self.scales[line],
        )


@dataclass(frozen=True, eq=False)
class SkinBinding:
    """The nodes that move a mesh, and where they were when it was bound to them.

    Inverse bind matrices lead from the space of the mesh to that of each joint in the bind pose; vectors are columns.
    They are None where the file states none: the bind pose is what the nodes show; zeros where it states none for a
    joint.
    """

    joints: NDArray[np.intp]  # (joints,), nodes
    inverse_binds: Array | None  # (joints, 4, 4)
    meshes: tuple[int, ...] = ()  # the nodes at which meshes with this skin hang


@dataclass(frozen=True, eq=False)
class Animation:
    """An animation, sampled at frames that are equally far apart; values are relative to the parent."""

    name: str  # as in the file; may be empty
    frames: int
    frame_time_text: str  # the time between frames [s]
    translations: Mapping[int, Array] = field(default_factory=dict)  # of moving nodes, (frames, 3) each [file units]
    rotations: Mapping[int, Array] = field(default_factory=dict)  # of turning nodes, (frames, 4) each, x y z w
    scales: Mapping[int, Array] = field(default_factory=dict)  # (frames, 3) each
    extras: Mapping[str, object] = field(default_factory=dict)  # what else is kept with it
    posed: frozenset[int] = frozenset()  # the nodes that it decides on; without keys they stay as the file shows them


@dataclass(frozen=True, eq=False)
class CharacterScene:
    """The content of a file of characters that matters to a motion."""

    path: str | Path  # for errors
    nodes: Nodes
    skins: tuple[SkinBinding, ...]
    humanoid: Mapping[str, int]  # the node of each bone by VRM 1.0's names, such as "leftUpperArm"; empty without VRM
    animations: tuple[str, ...]  # the names, in the order of the file; they may be empty or the same
    animation: Animation | None  # the one that was asked for, or the only one
    looks_back: bool = False  # whether its characters look to -Z, as in VRM 0
    notes: tuple[str, ...] = ()  # what of it is not read, a line each
    units: str | None = "m"  # of the nodes' translations; None if the file does not state it
    up: str | None = "Y"  # None if the file does not state it
