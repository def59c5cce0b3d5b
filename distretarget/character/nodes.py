"""The content of character files, glTF or FBX: a forest of nodes, skins, and animations, sampled at a constant rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.character.animations import frame_count, frame_times, is_on_grid, own_rate
from distretarget.errors import FileError, cut
from distretarget.motion import LONGEST_FRAME
from distretarget.numerics.kinematics import children_of, depth_first_order
from distretarget.numerics.vectors import Array, lengths, normalised
from distretarget.skeleton import SMALLEST

INFLUENCES = 8  # bones per vertex that count, those with the largest weights
BLOCK = 65536  # frames that are sampled at once
FREE_SAMPLES = 1_000_000  # even the smallest file may have this many samples [frames x curves]


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of a file and their transforms without an animation, relative to their parents."""

    names: tuple[str, ...]  # maybe empty or not unique
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
        """Return some of the nodes, in this order; nodes whose parent is not among them have none."""
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
    """The joints of a skin and their inverse bind matrices, which map column vectors from the mesh's space to that of
    each joint in the bind pose; zeros for joints without one; None if the file states none, so that its pose is the
    bind pose.
    """

    joints: NDArray[np.intp]  # (joints,), nodes
    inverse_binds: Array | None  # (joints, 4, 4)
    meshes: tuple[int, ...] = ()  # the nodes of meshes with this skin


@dataclass(frozen=True, eq=False)
class Animation:
    """An animation, sampled at a constant frame rate; values are relative to the parent."""

    name: str  # as in the file; may be empty
    frames: int
    frame_time_text: str  # the time between frames [s]
    translations: Mapping[int, Array] = field(default_factory=dict)  # of moving nodes, (frames, 3) each [file units]
    rotations: Mapping[int, Array] = field(default_factory=dict)  # of turning nodes, (frames, 4) each, x y z w
    scales: Mapping[int, Array] = field(default_factory=dict)  # (frames, 3) each
    weights: Mapping[int, Array] = field(default_factory=dict)  # of morph targets, (frames, targets) each
    extras: Mapping[str, object] = field(default_factory=dict)  # further data of the file, copied
    posed: frozenset[int] = frozenset()  # the nodes that it poses; those without keys keep their pose in the file


@dataclass(frozen=True, eq=False)
class CharacterScene:
    """The content of a character file that its motion needs."""

    path: str | Path  # for errors
    nodes: Nodes
    skins: tuple[SkinBinding, ...]
    humanoid: Mapping[str, int]  # the node of each bone by VRM 1.0's names, such as "leftUpperArm"; empty without VRM
    animations: tuple[str, ...]  # the names, in the order of the file; maybe empty or not unique
    animation: Animation | None  # the chosen one, or the only one
    faces_negative_z: bool = False  # whether its characters face -Z, as in VRM 0
    notes: tuple[str, ...] = ()  # a line on each thing in it that is not read
    units: str | None = "m"  # of the nodes' translations; None if the file does not state it
    up: str | None = "Y"  # None if the file does not state it


@dataclass(frozen=True, eq=False)
class Curve:
    """The keys of one property of a node; each key of a "CUBICSPLINE" has in-tangent, value and out-tangent."""

    times: Array  # (keys,), in ascending order [s]
    keys: Array  # (keys, 1 or 3, numbers)
    interpolation: str  # between keys: "LINEAR", "STEP" or "CUBICSPLINE"

    def at(self, times: Array, rotates: bool) -> Array:
        """(times, numbers), the values at times [s], held before the first and after the last key; unit quaternions."""
        values = self.keys[:, self.keys.shape[1] // 2]
        after = np.clip(np.searchsorted(self.times, times, side="right"), 1, max(len(self.times) - 1, 1))
        before, after = after - 1, np.minimum(after, len(self.times) - 1)
        span = self.times[after] - self.times[before]
        passed = np.clip(times - self.times[before], 0.0, span)
        share = np.divide(passed, span, out=np.zeros(len(times)), where=span > 0)
        if self.interpolation == "STEP":
            result = np.where((share >= 1.0)[:, None], values[after], values[before])
        elif self.interpolation == "CUBICSPLINE":
            result = self._cubic(before, after, share, span)
        elif rotates:  # by the shorter rotation
            first, last = (Rotation.from_quat(values[each]) for each in (before, after))
            turn = (first.inv() * last).as_rotvec()
            result = np.asarray((first * Rotation.from_rotvec(share[:, None] * turn)).as_quat())
        else:
            result = values[before] + share[:, None] * (values[after] - values[before])
        if not rotates:
            return result
        usual = values[before]  # where a spline passes through 0
        return normalised(np.where((lengths(result) > SMALLEST * lengths(usual))[:, None], result, usual))

    def _cubic(self, before: NDArray[np.intp], after: NDArray[np.intp], share: Array, span: Array) -> Array:
        """Hermite's spline, glTF 2.0 specification, appendix C.5."""
        t, d = share[:, None], span[:, None]
        start, out = self.keys[before, 1], self.keys[before, 2]
        into, end = self.keys[after, 0], self.keys[after, 1]
        t2, t3 = t * t, t * t * t
        return np.asarray(
            (2 * t3 - 3 * t2 + 1) * start
            + d * (t3 - 2 * t2 + t) * out
            + (-2 * t3 + 3 * t2) * end
            + d * (t3 - t2) * into
        )


def sampled(
    path: str | Path, name: str, curves: Mapping[str, Mapping[int, Curve]], fps: float | None, most: int
) -> Animation:
    """Return an animation's curves sampled at `fps`, else at the rate of its keys, or if that is too much at evenly
    spaced keys. A FileError if nothing is animated, or too long for a file of `most` bytes.
    """
    every = [curve for of_nodes in curves.values() for curve in of_nodes.values()]
    if not every:
        raise FileError(path, f"nothing moves in its animation {cut(name)!r}")
    times = np.unique(np.concatenate([*{id(curve.times): curve.times for curve in every}.values()]))
    rate, most = fps or own_rate(times), max(most, FREE_SAMPLES) // len(every)
    if fps is None and frame_count(times, rate) > most:
        step = float(np.diff(times).mean())
        rate = 1.0 / step if step <= LONGEST_FRAME and is_on_grid(times, 1.0 / step) else rate
    if frame_count(times, rate) > most:
        duration = f"{times[-1] - times[0]:.6g} s"
        raise FileError(path, f"its animation {cut(name)!r} is {duration} long; at {rate:g} frames/s that is too much")
    at = frame_times(times, rate)
    blocks = [at[first : first + BLOCK] for first in range(0, len(at), BLOCK)]
    values = {
        kind: {
            node: np.concatenate([curve.at(block, kind == "rotation") for block in blocks])
            for node, curve in of_nodes.items()
        }
        for kind, of_nodes in curves.items()
    }
    return Animation(name, len(at), f"{1 / rate:.9g}", values["translation"], values["rotation"], values["scale"])
