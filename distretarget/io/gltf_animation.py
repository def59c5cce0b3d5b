"""Animations as glTF has them: entries of its JSON, and the numbers that these lead to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.character.nodes import Animation, Nodes
from distretarget.io.gltf import Gltf
from distretarget.io.json_node import Node

Mode = Literal["add", "replace"]

KINDS = {3: "VEC3", 4: "VEC4"}
START = 1, "0"  # the times of a track with a single key: frames, and the time between them


class Numbers:
    """Numbers for a buffer, with the accessors and views that find them in it."""

    def __init__(self, buffer: int, start: int, views: int, accessors: int) -> None:
        self.views: list[dict[str, object]] = []
        self.accessors: list[dict[str, object]] = []
        self.content = bytearray()
        self._buffer, self._start, self._first_view, self._first_accessor = buffer, start, views, accessors

    def add(self, values: NDArray[np.float64], **entry: object) -> int:
        """Add numbers, (keys,) or (keys, 3 or 4), as float32; return their accessor."""
        kind = "SCALAR" if values.ndim == 1 else KINDS[values.shape[1]]
        data = np.ascontiguousarray(values, "<f4").tobytes()
        start = self._start + len(self.content)
        view: dict[str, object] = {"buffer": self._buffer, "byteOffset": start, "byteLength": len(data)}
        number = self._first_view + len(self.views)
        accessor = {"bufferView": number, "componentType": 5126, "count": len(values), "type": kind}
        self.accessors.append(accessor | entry)
        self.views.append(view)
        self.content += data
        return self._first_accessor + len(self.accessors) - 1


def animation_entries(
    gltf: Gltf, animations: Sequence[Animation], numbers: Numbers, nodes: Nodes, mode: Mode
) -> Iterator[dict[str, object]]:
    """Yield the entries of animations that are added to those in a file or replace them, and add their `numbers`;
    `nodes` are all of the file. A name that is taken gets a number.

    Players that go from one animation to another leave what has no keys in the other as it was. So what any of the
    animations moves has in each a key of its own: the transform that the node shows.
    """
    kept = gltf.entries("animations") if mode == "add" else []
    taken = {entry.entries().read("name", Node.text, "") for entry in kept} - {""}
    moved = {target for entry in kept for target in _targets(gltf, entry)}
    moved |= {(path, node) for animation in animations for path, node, _ in _tracks(animation)}
    shown = {"translation": nodes.translations, "rotation": nodes.rotations, "scale": nodes.scales}
    inputs: dict[tuple[int, str], int] = {}

    def input_of(frames: int, frame_time_text: str) -> int:
        """The accessor of the times of frames."""
        if (frames, frame_time_text) not in inputs:
            times = (np.arange(frames) * float(frame_time_text)).astype("<f4").astype(float)
            inputs[frames, frame_time_text] = numbers.add(times, min=[times[0]], max=[times[-1]])
        return inputs[frames, frame_time_text]

    for animation in animations:
        tracks = [*_tracks(animation)]
        times = [input_of(animation.frames, animation.frame_time_text)] * len(tracks)
        still = sorted(moved - {(path, node) for path, node, _ in tracks})
        for path, node in still:
            if path in shown and node in animation.posed:
                tracks.append((path, node, shown[path][[node]]))
                times.append(input_of(*START))
        name = free_name(animation.name, taken)
        taken.add(name)
        yield {
            "name": name,
            "channels": [
                {"sampler": number, "target": {"node": node, "path": path}}
                for number, (path, node, _) in enumerate(tracks)
            ],
            "samplers": [
                {"input": of_times, "output": numbers.add(values)}
                for of_times, (_, _, values) in zip(times, tracks, strict=True)
            ],
        } | ({"extras": dict(animation.extras)} if animation.extras else {})


def _tracks(animation: Animation) -> Iterator[tuple[str, int, NDArray[np.float64]]]:
    """The path, node and keys of each property that an animation moves."""
    yield from (("translation", node, keys) for node, keys in animation.translations.items())
    yield from (("rotation", node, keys) for node, keys in animation.rotations.items())


def _targets(gltf: Gltf, animation: Node) -> Iterator[tuple[str, int]]:
    """What an animation of the file has keys for: a path, such as "rotation", and a node."""
    for channel in animation.entries().listed("channels"):
        target = channel.entries().inner("target")
        if "node" in target:
            yield target.read("path", Node.text, ""), gltf.index("nodes", target["node"])


def free_name(name: str, taken: set[str]) -> str:
    """Return a name that is not taken: the name itself, or followed by the first free number from 2."""
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name} {number}"
    return free
