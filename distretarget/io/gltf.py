"""Read glTF 2.0 files (.glb, .gltf, .vrm, .vrma): their JSON, with the place of each value for errors, and accessors.

Khronos Group, "glTF 2.0 Specification", 2021. Files are not trusted: each index and length is checked, and the size of
arrays is bounded by that of the file.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
import struct
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import DistretargetError, FileError, SkeletonFileError, cut
from distretarget.io.files import is_inside, read_bytes
from distretarget.io.json_node import Fields, Node, parse_json, without_garbage_collection
from distretarget.numerics.vectors import Array, read_only

Dtype = np.dtype[np.integer] | np.dtype[np.floating]

GLB_MARK = b"glTF"
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942  # the types of chunks in a GLB
HEADER, CHUNK_HEADER = struct.Struct("<4sII"), struct.Struct("<II")
COMPONENTS: dict[int, Dtype] = {  # by the componentType of accessors
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
INDICES = (5121, 5123, 5125)  # component types of the indices of triangles and sparse accessors
FREE_NUMBERS = 4_000_000  # limit of the numbers read from a file of any size ...
PER_BYTE = 2  # ... and per byte of it; each use of an accessor counts, since channels share them
DATA_URI = "data:"
NESTED_SIZE, PAIR_SIZE = 64, 120  # memory of an empty list or object, and of a key with its value [bytes]
MEMORY_PER_BYTE, FREE_MEMORY = 7, 2**26  # limit of this memory: per byte of the JSON, and in addition [bytes]


@dataclass(eq=False)
class Gltf:
    """A glTF file, with a cache of what was read from it."""

    path: str | Path  # for errors
    chunks: tuple[tuple[int, memoryview], ...]  # (type, content) of the chunks of a GLB; of a .gltf file only the JSON
    beside: Mapping[str, bytes] = field(default_factory=dict)  # the contents of a .gltf file's buffer files by URI
    has_folder: bool = True  # whether images may be read from files beside it
    _lists: dict[str, list[Node]] = field(default_factory=dict, init=False)
    _entries: dict[tuple[str, int], Fields] = field(default_factory=dict, init=False)  # by list and index
    _accessors: dict[tuple[str, str], Array] = field(default_factory=dict, init=False)  # by place and type
    _buffers: dict[str, memoryview] = field(default_factory=dict, init=False)  # by place
    _numbers_read: int = field(default=0, init=False)  # counted again at each use of an accessor

    @cached_property
    def text(self) -> str:
        """The JSON."""
        try:
            return bytes(self.chunks[0][1]).decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise FileError(self.path, f"its JSON is not valid UTF-8: {error.reason}") from None

    @cached_property
    def text_to_copy(self) -> str:
        """The JSON, to be written to another file; a FileError if any number in it is not finite."""
        try:
            with without_garbage_collection():
                json.loads(self.text, parse_float=self._finite, parse_int=self._finite, parse_constant=self._finite)
        except RecursionError:
            raise SkeletonFileError(self.path, "", "is nested too deeply") from None
        return self.text

    def _finite(self, digits: str) -> float:
        value = float(digits)
        if not math.isfinite(value):
            raise FileError(self.path, f"its JSON has the number {cut(digits)}, which is not finite; export it again")
        return value

    @cached_property
    def document(self) -> Fields:
        """The values of the JSON by key."""
        nested = self.text.count("[") + self.text.count("{")
        pairs = self.text.count('":')
        if NESTED_SIZE * nested + PAIR_SIZE * pairs > MEMORY_PER_BYTE * len(self.text) + FREE_MEMORY:
            counts = f"{nested} lists and objects and {pairs} keys in {len(self.text)} characters"
            raise FileError(self.path, f"its JSON has {counts}: too large to read; expected a file of a character")
        document = parse_json(self.path, self.text).entries()
        version = document.inner("asset").read("version", Node.text, "")
        if version.partition(".")[0] != "2":
            raise SkeletonFileError(self.path, "asset.version", f"expected glTF 2.0, found {cut(version) or 'none'!r}")
        return document

    def entries(self, key: str) -> list[Node]:
        """The entries of a list of the document; empty if it has no such list."""
        if key not in self._lists:
            self._lists[key] = self.document.listed(key)
        return self._lists[key]

    def entry(self, key: str, reference: Node) -> Fields:
        """The values of the entry of a list at the index that a reference holds."""
        index = self.index(key, reference)
        if (key, index) not in self._entries:
            self._entries[key, index] = self.entries(key)[index].entries()
        return self._entries[key, index]

    def index(self, key: str, reference: Node) -> int:
        """The index that a reference to an entry of a list holds, checked."""
        return reference.index(len(self.entries(key)) - 1, key)

    def numbers(self, reference: Node, kind: str, components: tuple[int, ...] = tuple(COMPONENTS)) -> Array:
        """Return an accessor's numbers, (count, width), or (count,) for "SCALAR"; a SkeletonFileError if invalid."""
        fields = self.entry("accessors", reference)
        place, key = fields.node, (fields.node.place, kind)
        if fields.read("type", Node.text, "") != kind:
            place.fail(f"expected type {kind}")
        dtype = _dtype(fields, components)
        count = fields.need("count").whole()
        if count * WIDTHS[kind] > self.size:
            fields["count"].expected(f"no more numbers than the file has bytes, {self.size}")
        self._numbers_read += count * WIDTHS[kind]
        if self._numbers_read > max(PER_BYTE * self.size, FREE_NUMBERS):
            place.fail("is referred to too often for a file of this size")
        if key in self._accessors:
            return self._accessors[key]
        raw: NDArray[np.generic] = np.zeros((count, WIDTHS[kind]), dtype)
        if "bufferView" in fields:
            raw = self._view(fields, count, WIDTHS[kind], dtype)
        if "sparse" in fields:
            raw = self._with_sparse(fields["sparse"].entries(), raw.copy(), dtype)
        with np.errstate(invalid="ignore"):  # from numbers that are not finite
            numbers = raw.astype(np.float64)
        if dtype.kind != "f" and fields.read("normalized", Node.flag, False):
            numbers = np.maximum(numbers / np.iinfo(dtype.name).max, -1.0)
        if not np.isfinite(numbers).all():
            place.fail("has numbers that are not finite")
        self._accessors[key] = read_only(numbers[:, 0] if kind == "SCALAR" else numbers)
        return self._accessors[key]

    def _with_sparse(self, sparse: Fields, raw: NDArray[np.generic], dtype: Dtype) -> NDArray[np.generic]:
        """`raw` with the elements that a sparse accessor lists replaced, in place."""
        count = sparse.need("count").whole()
        indices, values = sparse.need("indices").entries(), sparse.need("values").entries()
        places = self._view(indices, count, 1, _dtype(indices, INDICES))[:, 0].astype(np.intp)
        if len(places) and places.max() >= len(raw):
            indices.node.fail(f"has the index {places.max()}; the accessor has {len(raw)} elements")
        raw[places] = self._view(values, count, raw.shape[1], dtype)
        return raw

    def _view(self, fields: Fields, count: int, width: int, dtype: Dtype) -> NDArray[np.generic]:
        """The numbers, (count, width), at an entry's byteOffset in its bufferView."""
        place, offset = fields.node, fields.read("byteOffset", Node.whole, 0)
        view = self.entry("bufferViews", fields.need("bufferView"))
        if "EXT_meshopt_compression" in view.inner("extensions"):
            place.fail("is compressed by meshopt, which is not read for joints and animations; export it uncompressed")
        buffer = self._buffer(self.entry("buffers", view.need("buffer")))
        start, length = view.read("byteOffset", Node.whole, 0), view.need("byteLength").whole()
        if start + length > len(buffer):
            view.node.fail(f"ends at byte {start + length}; its buffer has {len(buffer)}")
        row = width * dtype.itemsize
        stride = view.read("byteStride", Node.whole, row) or row
        if count and (stride < row or offset + (count - 1) * stride + row > length):
            place.fail(f"leads out of {view.node.place}, which has {length} bytes")
        steps = (stride, dtype.itemsize)
        return np.ndarray((count, width), dtype, buffer[start : start + length], offset if count else 0, steps)

    def _buffer(self, fields: Fields) -> memoryview:
        place, uri = fields.node, fields.read("uri", Node.text, None)
        if place.place in self._buffers:
            return self._buffers[place.place]
        length = fields.need("byteLength").whole()
        if uri is None:
            if self.binary is None or place.place != "buffers[0]":
                place.fail('has no "uri", and the file has no binary chunk for it')
            content = self.binary
        elif uri.startswith(DATA_URI):
            content = memoryview(_decoded(fields["uri"], uri))
        elif uri in self.beside:
            content = memoryview(self.beside[uri])
        else:
            fields["uri"].fail(f"there is no file {cut(uri)!r} beside it")
        if len(content) < length:
            place.fail(f"has {len(content)} of the {length} bytes that it should have: the file is cut or incomplete")
        self._buffers[place.place] = content[:length]
        return self._buffers[place.place]

    def image(self, reference: Node) -> bytes:
        """The content of an image; empty if it is in a file that cannot be read."""
        fields = self.entry("images", reference)
        if "uri" not in fields:
            length = self.entry("bufferViews", fields.need("bufferView")).need("byteLength").whole()
            return self._view(fields, length, 1, COMPONENTS[5121]).tobytes()
        uri = fields["uri"].text()
        if uri.startswith(DATA_URI):
            return _decoded(fields["uri"], uri)
        with suppress(DistretargetError):
            return b"" if not self.has_folder else read_bytes(inside(fields["uri"], Path(self.path).parent, uri))
        return b""

    @property
    def binary(self) -> memoryview | None:
        """The binary chunk of a GLB; None if there is none."""
        return next((content for kind, content in self.chunks[1:2] if kind == BINARY_CHUNK), None)

    @cached_property
    def size(self) -> int:
        """The size of the file and of its buffer files [bytes]."""
        beside = {id(content): content for content in self.beside.values()}.values()
        return sum(len(content) for _, content in self.chunks) + sum(map(len, beside))


def parse_gltf(
    content: bytes, path: str | Path, beside: Mapping[str, bytes] | None = None, has_folder: bool = True
) -> Gltf:
    """Return the glTF file with this content, or raise a FileError; `beside` and `has_folder` as in `Gltf`."""
    if content.startswith(GLB_MARK):
        return Gltf(path, _chunks(content, path), beside or {}, has_folder)
    if not content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"{", b"[")):
        raise FileError(path, "is no glTF: a GLB begins with 'glTF', a .gltf file with {" if content else "is empty")
    return Gltf(path, ((JSON_CHUNK, memoryview(content)),), beside or {}, has_folder)


def _chunks(content: bytes, path: str | Path) -> tuple[tuple[int, memoryview], ...]:
    if len(content) < HEADER.size:
        raise FileError(path, "is cut: a GLB file has at least 20 bytes")
    _, version, length = HEADER.unpack_from(content)
    if version != 2:
        raise FileError(path, f"is GLB version {version}; expected version 2 (glTF 2.0)")
    if length > len(content):
        raise FileError(path, f"is cut: it has {len(content)} of the {length} bytes that its header states")
    chunks, whole_file, start = [], memoryview(content)[:length], HEADER.size
    while start + CHUNK_HEADER.size <= length:
        size, kind = CHUNK_HEADER.unpack_from(whole_file, start)
        start += CHUNK_HEADER.size
        if start + size > length:
            raise FileError(path, f"is damaged: a chunk ends at byte {start + size}, the file at byte {length}")
        chunks.append((kind, whole_file[start : start + size]))
        start += size
    if not chunks or chunks[0][0] != JSON_CHUNK:
        raise FileError(path, "is damaged: its first chunk is not JSON")
    return tuple(chunks)


def read_beside(content: bytes, path: str | Path) -> dict[str, bytes]:
    """Return the contents of a .gltf file's buffer files by URI, or raise a FileError."""
    found: dict[str, bytes] = {}
    contents: dict[Path, bytes] = {}  # by path, since several URIs may lead to one file
    folder = Path(path).parent
    for place in parse_gltf(content, path).entries("buffers"):
        fields = place.entries()
        uri = fields.read("uri", Node.text, "")
        if uri and not uri.startswith(DATA_URI) and uri not in found:
            named = inside(fields["uri"], folder, uri)
            resolved = named.resolve()
            if resolved not in contents:
                contents[resolved] = read_bytes(named)
            found[uri] = contents[resolved]
    return found


def inside(place: Node, folder: Path, uri: str) -> Path:
    """Return the path of the file in a folder that a URI names; a SkeletonFileError if it is outside the folder."""
    path = Path(name := unquote(uri))
    if ":" in name or "\\" in name or "\0" in name or path.is_absolute() or ".." in path.parts:
        place.fail(f"leads to {cut(name)!r}; expected a file in the folder of the .gltf file")
    if not is_inside(folder / path, folder):
        place.fail(f"{cut(name)!r} leads out of the folder by a link")
    return folder / path


def _decoded(place: Node, uri: str) -> bytes:
    head, comma, data = uri.partition(",")
    if not comma or not head.endswith(";base64"):
        place.fail("expected a data URI in base64")
    try:
        return base64.b64decode(data, validate=True)
    except (binascii.Error, ValueError):
        place.fail("is not valid base64")


def _dtype(fields: Fields, known: tuple[int, ...]) -> Dtype:
    """The dtype for an entry's componentType, which must be one of `known`."""
    component = fields.need("componentType").whole()
    if component not in known:
        fields["componentType"].expected(f"one of {', '.join(map(str, known))}")
    return COMPONENTS[component]
