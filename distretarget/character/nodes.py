"""What files of characters hold, glTF and FBX alike: a forest of nodes, the skins on them, and animations of nodes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import FileError, closest, cut, quoted

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of a file and the transforms that they show without an animation, in the order of the file.

    Attributes:
        names: of the nodes; they may be empty or the same.
        parents: (nodes,), the parent of each node, -1 for none. Parents may come after their children.
        translations: (nodes, 3), relative to the parent [file units].
        rotations: (nodes, 4), relative to the parent, unit quaternions x y z w.
        scales: (nodes, 3), along the axes of the node.
    """

    names: tuple[str, ...]
    parents: NDArray[np.intp]
    translations: Array
    rotations: Array
    scales: Array

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, eq=False)
class Skin:
    """The nodes that move a mesh, and where they were when it was bound to them.

    Attributes:
        joints: (joints,), nodes.
        inverse_binds: (joints, 4, 4), from the space of the mesh to that of each joint in the bind pose; vectors are
            columns. None where the file does not state it: the bind pose is what the nodes show; zeros where it states
            none for a joint.
        meshes: the nodes at which meshes with this skin hang.
    """

    joints: NDArray[np.intp]
    inverse_binds: Array | None
    meshes: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Animation:
    """An animation, sampled at frames that are equally far apart.

    Attributes:
        name: as in the file; may be empty.
        frames: the number of frames.
        frame_time_text: the time between frames [s].
        translations: the moving nodes, (frames, 3) each, relative to the parent [file units].
        rotations: the turning nodes, (frames, 4) each, unit quaternions x y z w.
        scales: the nodes with scales, (frames, 3) each.
        extras: what else is kept with it.
        posed: the nodes that it decides on; those without keys stay as the file shows them.
    """

    name: str
    frames: int
    frame_time_text: str
    translations: Mapping[int, Array] = field(default_factory=dict)
    rotations: Mapping[int, Array] = field(default_factory=dict)
    scales: Mapping[int, Array] = field(default_factory=dict)
    extras: Mapping[str, object] = field(default_factory=dict)
    posed: frozenset[int] = frozenset()


@dataclass(frozen=True, eq=False)
class Scene:
    """The content of a file of characters that matters to a motion.

    Attributes:
        path: of the file, for errors.
        nodes: its nodes.
        skins: its skins.
        humanoid: the node of each bone of a VRM humanoid, by VRM 1.0's names of bones, such as "leftUpperArm"; empty
            for other files.
        animations: the names of its animations, in the order of the file; they may be empty or the same.
        animation: the one that was asked for, or the only one; None where there is none.
        looks_back: whether its characters look to -Z, as in VRM 0.
        notes: what of it is not read, a line each.
        units: of the nodes' translations; None if the file does not state it.
        up: the axis that points up; None if the file does not state it.
    """

    path: str | Path
    nodes: Nodes
    skins: tuple[Skin, ...]
    humanoid: Mapping[str, int]
    animations: tuple[str, ...]
    animation: Animation | None
    looks_back: bool = False
    notes: tuple[str, ...] = ()
    units: str | None = "m"
    up: str | None = "Y"


def choose_animation(path: str | Path, names: Sequence[str], clip: str | None) -> int | None:
    """Return the number of the animation named `clip`, or of the only one; None where a file has none and none is
    asked for. "#2" stands for the second, for animations without a name of their own.

    Raises:
        FileError: there is no such animation, or there are several and none is asked for.
    """
    times = Counter(names)
    shown = [name if name and times[name] == 1 else f"#{number}" for number, name in enumerate(names, start=1)]
    if clip is None:
        if len(names) > 1:
            listed = quoted(shown, 12)
            raise FileError(path, f"has {len(names)} animations: {listed}; choose one with --clip NAME")
        return 0 if names else None
    if clip in shown:
        return shown.index(clip)
    if clip.startswith("#") and clip[1:].isdecimal() and 0 < int(clip[1:]) <= len(names):
        return int(clip[1:]) - 1
    raise FileError(path, f"has no animation {cut(clip)!r}; {closest(clip, shown) if names else 'it has none'}")
