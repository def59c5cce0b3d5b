"""Animations put into a glTF file, which otherwise stays as it is, to the byte (glTF 2.0 specification, 3.11)."""

from __future__ import annotations

import base64
import mimetypes
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Literal

import numpy as np

from distretarget.character.nodes import Animation, Nodes
from distretarget.errors import FileError
from distretarget.io.formats import GLB_MARK
from distretarget.io.gltf import BINARY_CHUNK, CHUNK_HEADER, DATA_URI, HEADER, JSON_CHUNK, Gltf
from distretarget.io.gltf_scene import gltf_nodes
from distretarget.io.json_node import Fields, Node, without_collection
from distretarget.io.json_text import Edit, Member, added, changed, compact, edited, members
from distretarget.numerics.vectors import Array

Mode = Literal["add", "replace"]
Parts = Sequence[bytes | memoryview]
Top = Mapping[str, Member]
"""The members of a document."""
Tracks = dict[tuple[str, int], Array]
"""The keys of what an animation moves, by path, such as "rotation", and node."""

ALIGNED = 4  # accessors of floats, and chunks, begin at multiples of this [bytes]
LARGEST_GLB = 2**32 - 1  # the header has no room for more [bytes]
OCTETS = "application/octet-stream"
KINDS = {3: "VEC3", 4: "VEC4"}
START = 1, "0"  # the times of a track with a single key: frames, and the time between them


class _Numbers:
    """New numbers for a file, with the accessors and views that find them. They go to the end of what the binary chunk
    of a GLB holds, or into a buffer of their own.
    """

    def __init__(self, gltf: Gltf, as_binary: bool) -> None:
        buffers, binary = gltf.entries("buffers"), gltf.binary
        self.extends = False  # a buffer of the file
        if binary is not None and buffers and "uri" not in (first := buffers[0].entries()):
            first.need("byteLength").whole()
            self.extends = True
        self.in_chunk = as_binary and (self.extends or not buffers)  # of the result
        self.views: list[dict[str, object]] = []
        self.accessors: list[dict[str, object]] = []
        self._buffer = 0 if self.extends else len(buffers)
        self._held = binary if self.extends and binary is not None else memoryview(b"")
        self._new = bytearray()
        self._first = [len(gltf.entries(key)) for key in ("bufferViews", "accessors")]
        self._times: dict[tuple[int, str], int] = {}

    @property
    def content(self) -> Parts:
        """What the buffer holds, in parts."""
        return [self._held, *_padding(self._held, b"\0"), bytes(self._new)]

    def add(self, values: Array, **entry: object) -> int:
        """Add numbers, (keys,) or (keys, 3 or 4), as float32; return their accessor."""
        data = np.ascontiguousarray(values, "<f4").tobytes()
        view, accessor = self._first[0] + len(self.views), self._first[1] + len(self.accessors)
        start = _aligned(len(self._held)) + len(self._new)
        self.views.append({"buffer": self._buffer, "byteOffset": start, "byteLength": len(data)})
        kind = "SCALAR" if values.ndim == 1 else KINDS[values.shape[1]]
        self.accessors.append({"bufferView": view, "componentType": 5126, "count": len(values), "type": kind} | entry)
        self._new += data
        return accessor

    def times(self, frames: int, frame_time_text: str) -> int:
        """Return the accessor of the times of frames, which animations share."""
        if (frames, frame_time_text) not in self._times:
            times = (np.arange(frames) * float(frame_time_text)).astype("<f4").astype(float)
            self._times[frames, frame_time_text] = self.add(times, min=[times[0]], max=[times[-1]])
        return self._times[frames, frame_time_text]


def animated(
    gltf: Gltf,
    animations: Sequence[Animation],
    mode: Mode = "add",
    as_binary: bool = True,
    embedded: Callable[[Node], bytes] | None = None,
) -> Parts:
    """Return the content of a file with animations, in parts: as a GLB, or as JSON if not `as_binary`. The mode says
    whether they are added to those in the file, or replace them. `embedded` reads the file that a URI names, to put it
    into this one; without it URIs stay. A FileError if it would be too large for a GLB.
    """
    nodes, numbers = gltf_nodes(gltf), _Numbers(gltf, as_binary)
    entries = [*_animation_entries(gltf, animations, numbers, nodes, mode)]
    content = numbers.content
    with without_collection():
        top = {str(each.key): each for each in members(gltf.text, 0)}
    edits = [
        _listed(gltf.text, top, "bufferViews", numbers.views),
        _listed(gltf.text, top, "accessors", numbers.accessors),
        _listed(gltf.text, top, "animations", entries, replaces=mode == "replace"),
        _buffer(gltf.text, top, numbers, content),
        *_without_matrices(gltf, top, animations, nodes),
        *(_embedding(gltf, top, embedded) if embedded else ()),
    ]
    document = edited(gltf.text_to_copy, edits).encode()
    return _glb(gltf, document, content if numbers.in_chunk else None) if as_binary else [document]


def _animation_entries(
    gltf: Gltf, animations: Sequence[Animation], numbers: _Numbers, nodes: Nodes, mode: Mode
) -> Iterator[dict[str, object]]:
    """Yield the entries of animations, and add their `numbers`; a name that is taken gets a number.

    Players that go from one animation to another leave what has no keys in the other as it was. So what any of the
    animations moves has in each a key of its own: the transform that the node shows.
    """
    kept = gltf.entries("animations") if mode == "add" else []
    taken = {entry.entries().read("name", Node.text, "") for entry in kept} - {""}
    moved = {target for entry in kept for target in _targets(gltf, entry)}
    moved.update(*map(_tracks, animations))
    shown = {"translation": nodes.translations, "rotation": nodes.rotations, "scale": nodes.scales}
    for animation in animations:
        tracks = _tracks(animation)
        times = dict.fromkeys(tracks, numbers.times(animation.frames, animation.frame_time_text))
        for path, node in sorted(moved - tracks.keys()):
            if path in shown and node in animation.posed:
                tracks[path, node] = shown[path][[node]]
                times[path, node] = numbers.times(*START)
        channels = [
            {"sampler": number, "target": {"node": node, "path": path}} for number, (path, node) in enumerate(tracks)
        ]
        samplers = [{"input": times[target], "output": numbers.add(keys)} for target, keys in tracks.items()]
        name = free_name(animation.name, taken)
        taken.add(name)
        entry: dict[str, object] = {"name": name, "channels": channels, "samplers": samplers}
        yield entry | ({"extras": dict(animation.extras)} if animation.extras else {})


def _tracks(animation: Animation) -> Tracks:
    tracks: Tracks = {("translation", node): keys for node, keys in animation.translations.items()}
    return tracks | {("rotation", node): keys for node, keys in animation.rotations.items()}


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


def _listed(text: str, top: Top, key: str, entries: Sequence[Mapping[str, object]], replaces: bool = False) -> Edit:
    """The edit that adds entries to a list of the document, or replaces it; a new list comes last."""
    texts = [compact(entry) for entry in entries]
    if key not in top:
        end = max(each.end for each in top.values())
        return Edit(end, end, f',"{key}":[{",".join(texts)}]')
    if replaces:
        return Edit(top[key].start, top[key].end, f"[{','.join(texts)}]")
    return added(text, top[key].start, texts)


def _buffer(text: str, top: Top, numbers: _Numbers, content: Parts) -> Edit:
    """The edit that gives the buffer with the new numbers its length and, outside a binary chunk, its content."""
    new: dict[str, object] = {"byteLength": sum(map(len, content))}
    if not numbers.in_chunk:
        new["uri"] = _data_uri(content)
    if numbers.extends:
        return changed(text, next(members(text, top["buffers"].start)), new)
    return _listed(text, top, "buffers", [new])


def _without_matrices(gltf: Gltf, top: Top, animations: Sequence[Animation], nodes: Nodes) -> Iterator[Edit]:
    """The edits that replace the matrices of nodes that move by translation, rotation and scale."""
    moving = {node for animation in animations for node in (*animation.rotations, *animation.translations)}
    for number, (entry, node) in enumerate(_entries(gltf, top, "nodes")):
        if number in moving and "matrix" in node:
            parts = {
                "translation": nodes.translations[number].tolist(),
                "rotation": nodes.rotations[number].tolist(),
                "scale": nodes.scales[number].tolist(),
            }
            yield changed(gltf.text, entry, parts, without="matrix")


def _embedding(gltf: Gltf, top: Top, embedded: Callable[[Node], bytes]) -> Iterator[Edit]:
    """The edits that put the files into the document that its buffers and images name."""
    for key in ("buffers", "images"):
        for entry, fields in _entries(gltf, top, key):
            uri = fields.read("uri", Node.text, DATA_URI)
            if not uri.startswith(DATA_URI):
                kind = OCTETS if key == "buffers" else mimetypes.guess_type(uri)[0] or OCTETS
                yield changed(gltf.text, entry, {"uri": _data_uri([embedded(fields["uri"])], kind)})


def _entries(gltf: Gltf, top: Top, key: str) -> Iterator[tuple[Member, Fields]]:
    """The entries of a list of the document, with their values."""
    if key in top:
        for entry, node in zip(members(gltf.text, top[key].start), gltf.entries(key), strict=True):
            yield entry, node.entries()


def _data_uri(content: Parts, kind: str = OCTETS) -> str:
    return f"{DATA_URI}{kind};base64,{base64.b64encode(b''.join(content)).decode('ascii')}"


def _glb(gltf: Gltf, document: bytes, content: Parts | None) -> Parts:
    """A GLB with a document, and with a binary chunk if there is one; all other chunks are as they were."""
    chunks: list[tuple[int, Parts]] = [(JSON_CHUNK, [document, *_padding(document, b" ")])]
    if content is not None:
        chunks.append((BINARY_CHUNK, content))
    replaced = 2 if gltf.binary is not None and content is not None else 1
    chunks += [(kind, [chunk]) for kind, chunk in gltf.chunks[replaced:]]
    size = HEADER.size + sum(CHUNK_HEADER.size + sum(map(len, chunk)) for _, chunk in chunks)
    if size > LARGEST_GLB:
        raise FileError(gltf.path, "with this animation it would be larger than 4 GB, the most of a GLB")
    parts: list[bytes | memoryview] = [HEADER.pack(GLB_MARK, 2, size)]
    for kind, chunk in chunks:
        parts += [CHUNK_HEADER.pack(sum(map(len, chunk)), kind), *chunk]
    return parts


def _aligned(size: int) -> int:
    return -(-size // ALIGNED) * ALIGNED


def _padding(content: bytes | memoryview, filler: bytes) -> list[bytes]:
    """What makes a chunk of a content as long as it has to be."""
    return [filler * (_aligned(len(content)) - len(content))]
