"""Animations put into a glTF file, which otherwise stays as it is, to the byte (glTF 2.0 specification, 3.11)."""

from __future__ import annotations

import base64
import mimetypes
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

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
)
from distretarget.io.gltf_animation import Mode, Numbers, animation_entries
from distretarget.io.json_node import Fields, Node, without_collection
from distretarget.io.json_text import Edit, Member, added, changed, compact, edited, members

Parts = Sequence[bytes | memoryview]
Top = Mapping[str, Member]
"""The members of a document."""

ALIGNED = 4  # accessors of floats, and chunks, begin at multiples of this [bytes]
LARGEST_GLB = 2**32 - 1  # the header has no room for more [bytes]
OCTETS = "application/octet-stream"


@dataclass(frozen=True, eq=False)
class _Room:
    """Where new numbers go: at the end of the binary chunk of a GLB, or into a buffer of their own.

    Attributes:
        buffer: the number of the buffer.
        held: what it holds already.
        extends: whether it is in the file already.
        in_chunk: whether the result has it in its binary chunk.
    """

    buffer: int
    held: memoryview
    extends: bool
    in_chunk: bool

    @classmethod
    def of(cls, gltf: Gltf, as_binary: bool) -> _Room:
        buffers, binary = gltf.entries("buffers"), gltf.binary
        if binary is not None and buffers and "uri" not in (first := buffers[0].entries()):
            first.need("byteLength").whole()
            return cls(0, binary, extends=True, in_chunk=as_binary)
        return cls(len(buffers), memoryview(b""), extends=False, in_chunk=as_binary and not buffers)


def animated(
    gltf: Gltf,
    animations: Sequence[Animation],
    nodes: Nodes,
    mode: Mode = "add",
    as_binary: bool = True,
    embedded: Callable[[Node], bytes] | None = None,
) -> Parts:
    """Return the content of the file with animations, in parts.

    Args:
        gltf: the file.
        animations: to put into it.
        nodes: all of the file, as it shows them.
        mode: whether they are added to those in the file, or replace them.
        as_binary: whether to write a GLB.
        embedded: reads the file that a URI names, to put it into this one; None to leave the URIs.

    Raises:
        FileError: it would be too large for a GLB.
    """
    room = _Room.of(gltf, as_binary)
    counts = [len(gltf.entries(key)) for key in ("bufferViews", "accessors")]
    numbers = Numbers(room.buffer, _aligned(len(room.held)), *counts)
    entries = [*animation_entries(gltf, animations, numbers, nodes, mode)]
    content: Parts = [room.held, *_padding(room.held, b"\0"), bytes(numbers.content)]
    with without_collection():
        top = {str(each.key): each for each in members(gltf.text, 0)}
    edits = [
        _listed(gltf.text, top, "bufferViews", numbers.views),
        _listed(gltf.text, top, "accessors", numbers.accessors),
        _listed(gltf.text, top, "animations", entries, replaces=mode == "replace"),
        *_buffer(gltf.text, top, room, content),
        *_without_matrices(gltf, top, animations, nodes),
        *(_embedding(gltf, top, embedded) if embedded else ()),
    ]
    document = edited(gltf.text, edits).encode()
    return _glb(gltf, document, content if room.in_chunk else None) if as_binary else [document]


def _listed(text: str, top: Top, key: str, entries: Sequence[Mapping[str, object]], replaces: bool = False) -> Edit:
    """The edit that adds entries to a list of the document, or replaces it; a new list comes last."""
    texts = [compact(entry) for entry in entries]
    if key not in top:
        end = max(each.end for each in top.values())
        return Edit(end, end, f',"{key}":[{",".join(texts)}]')
    if replaces:
        return Edit(top[key].value, top[key].end, f"[{','.join(texts)}]")
    return added(text, top[key].value, texts)


def _buffer(text: str, top: Top, room: _Room, content: Parts) -> Iterator[Edit]:
    """The edits that give the buffer with the new numbers its length and, outside a binary chunk, its content."""
    new: dict[str, object] = {"byteLength": sum(map(len, content))}
    if not room.in_chunk:
        new["uri"] = data_uri(content)
    if not room.extends:
        yield _listed(text, top, "buffers", [new])
        return
    yield changed(text, next(members(text, top["buffers"].value)), new)


def _without_matrices(gltf: Gltf, top: Top, animations: Sequence[Animation], nodes: Nodes) -> Iterator[Edit]:
    """The edits that replace the matrices of nodes that move by translation, rotation and scale."""
    moving = {node for animation in animations for node in (*animation.rotations, *animation.translations)}
    for entry, node in _entries(gltf, top, "nodes"):
        number = int(entry.key)
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
                yield changed(gltf.text, entry, {"uri": data_uri([embedded(fields["uri"])], kind)})


def _entries(gltf: Gltf, top: Top, key: str) -> Iterator[tuple[Member, Fields]]:
    """The entries of a list of the document, with their values."""
    if key in top:
        for entry, node in zip(members(gltf.text, top[key].value), gltf.entries(key), strict=True):
            yield entry, node.entries()


def data_uri(content: Parts, kind: str = OCTETS) -> str:
    """Return a content, in parts, as a data URI."""
    return f"{DATA_URI}{kind};base64,{base64.b64encode(b''.join(content)).decode('ascii')}"


def _glb(gltf: Gltf, document: bytes, content: Parts | None) -> Parts:
    """A GLB with a document, and with a binary chunk if there is one; all other chunks are as they were."""
    had_binary = gltf.binary is not None
    chunks: list[tuple[int, Parts]] = [(JSON_CHUNK, [document, *_padding(document, b" ")])]
    if content is not None:
        chunks.append((BINARY_CHUNK, content))
    chunks += [(kind, [chunk]) for kind, chunk in gltf.chunks[2 if had_binary and content is not None else 1 :]]
    size = HEADER.size + sum(CHUNK_HEADER.size + sum(map(len, chunk)) for _, chunk in chunks)
    if size > LARGEST_GLB:
        raise FileError(gltf.path, "with this animation it would be larger than 4 GB, the most of a GLB")
    parts: list[bytes | memoryview] = [HEADER.pack(MAGIC, 2, size)]
    for kind, chunk in chunks:
        parts += [CHUNK_HEADER.pack(sum(map(len, chunk)), kind), *chunk]
    return parts


def _aligned(size: int) -> int:
    return -(-size // ALIGNED) * ALIGNED


def _padding(content: bytes | memoryview, filler: bytes) -> list[bytes]:
    """What makes a chunk of a content as long as it has to be."""
    return [filler * (_aligned(len(content)) - len(content))]
