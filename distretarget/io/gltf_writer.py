"""Animations put into a glTF file, which otherwise stays as it is, to the byte: glTF 2.0 specification, section
3.11.
"""

from __future__ import annotations

import base64
import mimetypes
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.character.nodes import Animation, Nodes
from distretarget.errors import FileError
from distretarget.io.gltf import (
    BINARY_CHUNK,
    CHUNK_HEADER,
    DATA_URI,
    HEADER,
    JSON_CHUNK,
    MAGIC,
    Gltf,
    dotted,
    required,
    whole,
)
from distretarget.io.json_node import Fields, Node, without_collection
from distretarget.io.json_text import Edit, Member, added, compact, edited, member, members

Animations = Literal["add", "replace"]
Parts = Sequence[bytes | memoryview]

ALIGNED = 4  # accessors of floats, and chunks, begin at multiples of this [bytes]
LARGEST_GLB = 2**32 - 1  # the header has no room for more [bytes]
KINDS = {3: "VEC3", 4: "VEC4"}
OCTETS = "application/octet-stream"
START = 1, "0"  # the times of a track with a single key: frames, and the time between them


class _Data:
    """The numbers of animations, with the accessors and views that find them in a buffer."""

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
        self.accessors.append(
            {
                "bufferView": self._first_view + len(self.views),
                "componentType": 5126,
                "count": len(values),
                "type": kind,
            }
            | entry
        )
        self.views.append(view)
        self.content += data
        return self._first_accessor + len(self.accessors) - 1


def animated(
    gltf: Gltf,
    animations: Sequence[Animation],
    nodes: Nodes,
    mode: Animations = "add",
    as_binary: bool = True,
    embedded: Callable[[Node], bytes] | None = None,
) -> list[bytes | memoryview]:
    """Return the content of the file with animations, in parts.

    Args:
        gltf: the file.
        animations: to add; the number of a name that is taken already follows it.
        nodes: all of the file, as it shows them.
        mode: whether they are added to those in the file, or replace them.
        as_binary: whether to write a GLB.
        embedded: reads the file that a URI names, to put it into this one; None to leave the URIs.

    Raises:
        FileError: it would be too large for a GLB.
    """
    text = gltf.text
    with without_collection():
        top = {str(each.key): each for each in members(text, 0)}
    lists = {key: gltf.entries(key) for key in ("buffers", "bufferViews", "accessors", "animations")}
    binary = gltf.binary
    extends = binary is not None and bool(lists["buffers"]) and "uri" not in lists["buffers"][0].entries(dotted)
    if extends:
        required(lists["buffers"][0], lists["buffers"][0].entries(dotted), "byteLength", whole)
    has_room = extends or (as_binary and not lists["buffers"])
    start = _aligned(len(binary)) if extends and binary is not None else 0
    data = _Data(0 if has_room else len(lists["buffers"]), start, len(lists["bufferViews"]), len(lists["accessors"]))
    taken = {entry.entries(dotted).read("name", Node.text, "") for entry in lists["animations"]} - {""}
    kept = lists["animations"] if mode == "add" else ()
    moved = {target for entry in kept for target in _targets(gltf, entry)}
    entries = list(_entries(animations, data, taken if mode == "add" else set(), nodes, moved))

    edits, new = [], {}
    for key, values in (("bufferViews", data.views), ("accessors", data.accessors), ("animations", entries)):
        texts = [compact(value) for value in values]
        if key in top and not (key == "animations" and mode == "replace"):
            edits.append(added(text, top[key].value, texts))
        elif key in top:
            edits.append(Edit(top[key].value, top[key].end, f"[{','.join(texts)}]"))
        else:
            new[key] = texts
    old = binary if extends and binary is not None else memoryview(b"")
    chunk: Parts = [old, *_padding(old, b"\0"), bytes(data.content)]
    edits += _embedding(text, top, gltf, embedded) if embedded else ()
    if extends:
        edits += _longer_buffer(text, top["buffers"].value, chunk, as_binary)
    else:
        uri = {} if has_room and as_binary else {"uri": data_uri(chunk)}
        entry = compact({"byteLength": len(data.content)} | uri)
        if "buffers" in top:
            edits.append(added(text, top["buffers"].value, [entry]))
        else:
            new["buffers"] = [entry]
    moving = {node for animation in animations for node in (*animation.rotations, *animation.translations)}
    edits += _without_matrices(text, top, moving, nodes)
    end = max(each.end for each in top.values())
    edits += [Edit(end, end, f',"{key}":[{",".join(texts)}]') for key, texts in new.items()]
    changed = edited(text, edits).encode()
    if not as_binary:
        return [changed]
    others = gltf.chunks[2:] if gltf.binary is not None else gltf.chunks[1:]
    chunks: list[tuple[int, Parts]] = [(JSON_CHUNK, [changed, *_padding(changed, b" ")])]
    if extends or has_room:
        chunks.append((BINARY_CHUNK, chunk))
    elif binary is not None:
        chunks.append((BINARY_CHUNK, [binary]))
    return _glb(gltf, [*chunks, *((kind, [content]) for kind, content in others)])


def _targets(gltf: Gltf, animation: Node) -> Iterator[tuple[str, int]]:
    """What an animation of the file has keys for: a path, such as "rotation", and a node."""
    for channel in animation.entries(dotted).listed("channels"):
        target = channel.entries(dotted).read("target", lambda node: node.entries(dotted), Fields())
        if "node" in target:
            yield target.read("path", Node.text, ""), gltf.index("nodes", target["node"])


def _entries(
    animations: Sequence[Animation], data: _Data, taken: set[str], nodes: Nodes, moved: set[tuple[str, int]]
) -> Iterator[dict[str, object]]:
    """The entries of animations, whose numbers go into `data`.

    Players that go from one animation to another leave what has no keys in the other as it was. So what any of the
    animations moves, by `moved` those in the file, has in each a key of its own: the transform that the node shows.
    """
    inputs: dict[tuple[int, str], int] = {}
    moved = moved | {
        (path, node)
        for animation in animations
        for path, values in (("translation", animation.translations), ("rotation", animation.rotations))
        for node in values
    }
    shown = {"translation": nodes.translations, "rotation": nodes.rotations, "scale": nodes.scales}
    for animation in animations:
        key = animation.frames, animation.frame_time_text
        if key not in inputs:
            times = (np.arange(animation.frames) * float(animation.frame_time_text)).astype("<f4").astype(float)
            inputs[key] = data.add(times, min=[times[0]], max=[times[-1]])
        tracks = [("translation", node, values) for node, values in animation.translations.items()]
        tracks += [("rotation", node, values) for node, values in animation.rotations.items()]
        samplers = [{"input": inputs[key], "output": data.add(values)} for _, _, values in tracks]
        keyed = {(path, node) for path, node, _ in tracks}
        for path, node in sorted(moved - keyed):
            if path in shown and node in animation.posed:
                if START not in inputs:
                    inputs[START] = data.add(np.zeros(1), min=[0.0], max=[0.0])
                tracks.append((path, node, shown[path][[node]]))
                samplers.append({"input": inputs[START], "output": data.add(shown[path][[node]])})
        channels = [
            {"sampler": number, "target": {"node": node, "path": path}} for number, (path, node, _) in enumerate(tracks)
        ]
        name = free_name(animation.name, taken)
        taken.add(name)
        entry: dict[str, object] = {"name": name, "channels": channels, "samplers": samplers}
        yield entry | ({"extras": dict(animation.extras)} if animation.extras else {})


def free_name(name: str, taken: set[str]) -> str:
    """Return a name that is not taken: the name itself, or followed by the first free number from 2."""
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name} {number}"
    return free


def _longer_buffer(text: str, buffers: int, chunk: Parts, as_binary: bool) -> Iterator[Edit]:
    """The edits that give the first buffer the length of a chunk and, outside a GLB, its content."""
    first = member(text, buffers, 0)
    length = first and member(text, first.value, "byteLength")
    if first is None or length is None:
        return
    yield Edit(length.value, length.end, str(sum(map(len, chunk))))
    if not as_binary:
        yield added(text, first.value, [f'"uri":{compact(data_uri(chunk))}'])


def _embedding(text: str, top: Mapping[str, Member], gltf: Gltf, embedded: Callable[[Node], bytes]) -> Iterator[Edit]:
    """The edits that put the files into the document that its buffers and images name."""
    for key in ("buffers", "images"):
        nodes = gltf.entries(key)
        for entry in members(text, top[key].value) if key in top else ():
            uri = member(text, entry.value, "uri")
            if uri is not None:
                node = nodes[int(entry.key)].entries(dotted)["uri"]
                if not node.text().startswith(DATA_URI):
                    kind = OCTETS if key == "buffers" else mimetypes.guess_type(node.text())[0] or OCTETS
                    yield Edit(uri.value, uri.end, compact(data_uri([embedded(node)], kind)))


def _without_matrices(text: str, top: Mapping[str, Member], moving: set[int], nodes: Nodes) -> Iterator[Edit]:
    """The edits that replace the matrices of nodes that move by translation, rotation and scale."""
    if "nodes" not in top:
        return
    for entry in members(text, top["nodes"].value):
        node = int(entry.key)
        matrix = member(text, entry.value, "matrix") if node in moving else None
        if matrix is not None:
            parts = {
                "translation": nodes.translations[node].tolist(),
                "rotation": nodes.rotations[node].tolist(),
                "scale": nodes.scales[node].tolist(),
            }
            others = [each for each in members(text, entry.value) if each.key in parts]
            for each in others:  # beside a matrix, against the specification
                yield Edit(each.value, each.end, compact(parts.pop(str(each.key))))
            yield Edit(matrix.start, matrix.end, compact(parts)[1:-1]) if parts else _removed(text, entry, matrix)


def _removed(text: str, entry: Member, one: Member) -> Edit:
    """The edit that removes one of several members of an entry."""
    every = list(members(text, entry.value))
    at = every.index(one)
    return Edit(every[at - 1].end, one.end, "") if at else Edit(one.start, every[1].start, "")


def data_uri(content: Parts, kind: str = OCTETS) -> str:
    """Return a content, in parts, as a data URI."""
    return f"{DATA_URI}{kind};base64,{base64.b64encode(b''.join(content)).decode('ascii')}"


def _glb(gltf: Gltf, chunks: Sequence[tuple[int, Parts]]) -> list[bytes | memoryview]:
    """A GLB, in parts."""
    size = HEADER.size + sum(CHUNK_HEADER.size + sum(map(len, content)) for _, content in chunks)
    if size > LARGEST_GLB:
        raise FileError(gltf.path, "with this animation it would be larger than 4 GB, the most of a GLB")
    parts: list[bytes | memoryview] = [HEADER.pack(MAGIC, 2, size)]
    for kind, content in chunks:
        parts += [CHUNK_HEADER.pack(sum(map(len, content)), kind), *content]
    return parts


def _aligned(size: int) -> int:
    return -(-size // ALIGNED) * ALIGNED


def _padding(content: bytes | memoryview, filler: bytes) -> list[bytes]:
    """What makes a chunk of a content as long as it has to be."""
    return [filler * (_aligned(len(content)) - len(content))]
