"""glTF 2.0 files (.glb, .gltf, .vrm, .vrma): their JSON, with the place of each value, and their numbers.

Khronos Group, "glTF 2.0 Specification", 2021. Files may come from anywhere: each index and length is checked, and no
array is larger than the file allows.
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TypeVar
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import DistretargetError, FileError, SkeletonFileError, cut
from distretarget.io.files import is_inside, read_bytes
from distretarget.io.json_node import Fields, Node, field_place, parse_json
from distretarget.numerics.compiled import read_only

Array = NDArray[np.float64]
Dtype = np.dtype[np.integer] | np.dtype[np.floating]
Value = TypeVar("Value")

MAGIC = b"glTF"
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942  # the types of chunks in a GLB
HEADER, CHUNK_HEADER = struct.Struct("<4sII"), struct.Struct("<II")
COMPONENTS: dict[int, Dtype] = {  # of accessors, by the number that stands for them
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
LARGEST_OF = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535, 5125: 2**32 - 1}  # that stands for 1 if normalized
INDICES = (5121, 5123, 5125)  # components of the indices of sparse accessors
FREE_NUMBERS = 4_000_000  # so many numbers may a file refer to, however small it is
PER_BYTE = 2  # so many numbers may it refer to for each of its bytes: channels share accessors
DATA_URI = "data:"
LISTS = ("nodes", "skins", "accessors", "bufferViews", "buffers", "meshes", "materials", "textures", "images")
NESTED_SIZE, PAIR_SIZE = 64, 120  # memory that an empty list and a key with its value take in others [bytes]
MOST_MEMORY, FREE_MEMORY = 7, 2**26  # memory that these may take [sizes of the JSON, and beside that bytes]


@dataclass(eq=False)
class _Read:
    """What of a file has been read already.

    Attributes:
        entries: of lists, by list and number.
        accessors: the numbers of accessors, by number and kind.
        buffers: the content of buffers, by number.
        numbers: how many numbers all references to accessors had that were followed.
    """

    entries: dict[tuple[str, int], Fields] = field(default_factory=dict)
    accessors: dict[tuple[int, str], Array] = field(default_factory=dict)
    buffers: dict[int, memoryview] = field(default_factory=dict)
    numbers: int = 0


@dataclass(frozen=True, eq=False)
class Gltf:
    """A glTF file.

    Attributes:
        path: of the file, for errors.
        chunks: of a GLB, (type, content) each; of a .gltf file its JSON alone.
        is_binary: whether the file is a GLB.
        beside: the content of the files that a .gltf file names, by the URI in the file.
    """

    path: str | Path
    chunks: tuple[tuple[int, memoryview], ...]
    is_binary: bool
    beside: Mapping[str, bytes] = field(default_factory=dict)

    @cached_property
    def text(self) -> str:
        """The JSON."""
        try:
            return bytes(self.chunks[0][1]).decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise FileError(self.path, f"its JSON is not valid UTF-8: {error.reason}") from None

    @cached_property
    def document(self) -> Fields:
        """The values of the JSON, by key."""
        nested = self.text.count("[") + self.text.count("{")
        pairs = self.text.count('":')
        if NESTED_SIZE * nested + PAIR_SIZE * pairs > MOST_MEMORY * len(self.text) + FREE_MEMORY:
            counts = f"{nested} lists and objects and {pairs} keys in {len(self.text)} characters"
            raise FileError(self.path, f"its JSON has {counts}: too large to read; expected a file of a character")
        document = parse_json(self.path, self.text).entries(dotted)
        asset = document["asset"].entries(dotted) if "asset" in document else Fields()
        version = asset.read("version", Node.text, "")
        if version.partition(".")[0] != "2":
            raise SkeletonFileError(self.path, "asset.version", f"expected glTF 2.0, found {cut(version) or 'none'!r}")
        return document

    def entries(self, key: str) -> list[Node]:
        """The entries of a list of the document; empty without it."""
        return self.document.listed(key)

    @cached_property
    def _lists(self) -> dict[str, list[Node]]:
        return {key: self.entries(key) for key in LISTS}

    def entry(self, key: str, reference: Node) -> Fields:
        """The values of the entry of a list that a reference, an index, leads to."""
        number = self.index(key, reference)
        read = self._read.entries
        if (key, number) not in read:
            read[key, number] = self._lists[key][number].entries(dotted)
        return read[key, number]

    @cached_property
    def _read(self) -> _Read:
        return _Read()

    def index(self, key: str, reference: Node) -> int:
        """The index in a reference to an entry of a list."""
        return whole(reference, len(self._lists[key]) - 1, key)

    def numbers(self, reference: Node, kind: str, components: tuple[int, ...] = tuple(COMPONENTS)) -> Array:
        """Return the numbers of an accessor, (count, width), or (count,) for "SCALAR"; integers that are normalized
        become fractions.

        Raises:
            SkeletonFileError: the accessor has another kind or other components, leads out of its buffer, or has
                numbers that are not finite.
        """
        fields = self.entry("accessors", reference)
        accessor = self.index("accessors", reference)
        place = self._lists["accessors"][accessor]
        if fields.read("type", Node.text, "") != kind:
            place.fail(f"expected type {kind}")
        component = _component(place, fields, components)
        count = required(place, fields, "count", whole)
        width = WIDTHS[kind]
        if count * width > self.size:
            fields["count"].expected(f"no more numbers than the file has bytes, {self.size}")
        read = self._read
        read.numbers += count * width
        if read.numbers > max(PER_BYTE * self.size, FREE_NUMBERS):
            place.fail("is referred to too often for a file of this size")
        if (accessor, kind) not in read.accessors:
            read.accessors[accessor, kind] = read_only(self._numbers(place, fields, kind, count, component))
        return read.accessors[accessor, kind]

    def _numbers(self, place: Node, fields: Fields, kind: str, count: int, component: int) -> Array:
        width, dtype = WIDTHS[kind], COMPONENTS[component]
        raw: NDArray[np.generic] = np.zeros((count, width), dtype)
        if "bufferView" in fields:
            raw = self._view(fields["bufferView"], _offset(fields), count, width, dtype, place)
        if "sparse" in fields:
            raw = self._sparse(fields["sparse"], raw.copy(), dtype)
        with np.errstate(invalid="ignore"):  # of numbers that are not finite
            numbers = raw.astype(np.float64)
        if dtype.kind != "f" and fields.read("normalized", Node.flag, False):
            numbers = np.maximum(numbers / LARGEST_OF[component], -1.0)
        if not np.isfinite(numbers).all():
            place.fail("has numbers that are not finite")
        return numbers[:, 0] if kind == "SCALAR" else numbers

    def _sparse(self, sparse: Node, raw: NDArray[np.generic], dtype: Dtype) -> NDArray[np.generic]:
        """Numbers with those replaced that a sparse accessor lists."""
        fields = sparse.entries(dotted)
        count = required(sparse, fields, "count", whole)
        indices, values = (required(sparse, fields, key, lambda node: node) for key in ("indices", "values"))
        parts = indices.entries(dotted)
        index_type = COMPONENTS[_component(indices, parts, INDICES)]
        view = required(indices, parts, "bufferView", lambda node: node)
        places = self._view(view, _offset(parts), count, 1, index_type, indices)[:, 0].astype(np.intp)
        if len(places) and places.max() >= len(raw):
            indices.fail(f"has the index {places.max()}; the accessor has {len(raw)} elements")
        parts = values.entries(dotted)
        view = required(values, parts, "bufferView", lambda node: node)
        raw[places] = self._view(view, _offset(parts), count, raw.shape[1], dtype, values)
        return raw

    def _view(
        self, reference: Node, offset: int, count: int, width: int, dtype: Dtype, place: Node
    ) -> NDArray[np.generic]:
        """`count` times `width` numbers of a bufferView, from an offset [bytes]."""
        view = self.entry("bufferViews", reference)
        if "extensions" in view and "EXT_meshopt_compression" in view["extensions"].entries(dotted):
            place.fail("is compressed by meshopt, which is not read for joints and animations; export it uncompressed")
        at = self._lists["bufferViews"][self.index("bufferViews", reference)]
        buffer = self._buffer(required(at, view, "buffer", lambda node: node))
        start, length = _offset(view), required(at, view, "byteLength", whole)
        if start + length > len(buffer):
            at.fail(f"ends at byte {start + length}; its buffer has {len(buffer)}")
        row = width * dtype.itemsize
        stride = view.read("byteStride", whole, row) or row
        if count and (stride < row or offset + (count - 1) * stride + row > length):
            place.fail(f"leads out of bufferViews[{self.index('bufferViews', reference)}], which has {length} bytes")
        steps = (stride, dtype.itemsize)
        return np.ndarray((count, width), dtype, buffer[start : start + length], offset if count else 0, steps)

    def _buffer(self, reference: Node) -> memoryview:
        """The content of a buffer."""
        number, read = self.index("buffers", reference), self._read
        if number not in read.buffers:
            read.buffers[number] = self._buffer_at(number)
        return read.buffers[number]

    def _buffer_at(self, number: int) -> memoryview:
        place = self._lists["buffers"][number]
        fields = place.entries(dotted)
        length = required(place, fields, "byteLength", whole)
        content = self._content(number, place, fields)
        if len(content) < length:
            place.fail(f"has {len(content)} of the {length} bytes that it should have: the file is cut or incomplete")
        return content[:length]

    def _content(self, number: int, place: Node, fields: Fields) -> memoryview:
        if "uri" not in fields:
            binary = self.binary
            if number or binary is None:
                place.fail('has no "uri", and the file has no binary chunk for it')
            return binary
        uri = fields["uri"].text()
        if uri.startswith(DATA_URI):
            return memoryview(_decoded(fields["uri"], uri))
        if uri not in self.beside:
            fields["uri"].fail(f"there is no file {cut(uri)!r} beside it")
        return memoryview(self.beside[uri])

    def image(self, reference: Node) -> bytes:
        """The content of an image; empty where it is in a file that cannot be read."""
        fields, place = self.entry("images", reference), self._lists["images"][self.index("images", reference)]
        if "uri" in fields:
            uri = fields["uri"].text()
            if uri.startswith(DATA_URI):
                return _decoded(fields["uri"], uri)
            with suppress(DistretargetError):
                return read_bytes(inside(fields["uri"], Path(self.path).parent, uri))
            return b""
        view = required(place, fields, "bufferView", lambda node: node)
        length = required(place, self.entry("bufferViews", view), "byteLength", whole)
        return self._view(view, 0, length, 1, COMPONENTS[5121], place).tobytes()

    @property
    def binary(self) -> memoryview | None:
        """The binary chunk of a GLB; None where there is none."""
        if len(self.chunks) > 1 and self.chunks[1][0] == BINARY_CHUNK:
            return self.chunks[1][1]
        return None

    @cached_property
    def size(self) -> int:
        """The size of the file and those that it names [bytes]."""
        return sum(len(content) for _, content in self.chunks) + sum(
            map(len, {id(content): content for content in self.beside.values()}.values())
        )


def parse_gltf(content: bytes, path: str | Path, beside: Mapping[str, bytes] | None = None) -> Gltf:
    """Return the glTF file with a content; `beside` has the files that it names, by URI.

    Raises:
        FileError: it is no glTF 2.0, or is cut.
    """
    if content.startswith(MAGIC):
        return Gltf(path, _chunks(content, path), is_binary=True, beside=beside or {})
    if not content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"{", b"[")):
        raise FileError(path, "is no glTF: a GLB begins with 'glTF', a .gltf file with {" if content else "is empty")
    return Gltf(path, ((JSON_CHUNK, memoryview(content)),), is_binary=False, beside=beside or {})


def _chunks(content: bytes, path: str | Path) -> tuple[tuple[int, memoryview], ...]:
    """The chunks of a GLB."""
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
    """Return the content of the files that the buffers of a .gltf file name, by URI.

    Raises:
        SkeletonFileError: a URI leads out of the file's folder or to a network.
        FileError: a file is missing or cannot be read.
    """
    found: dict[str, bytes] = {}
    contents: dict[Path, bytes] = {}  # by path, as several names may lead to one file
    folder = Path(path).parent
    for place in parse_gltf(content, path).entries("buffers"):
        fields = place.entries(dotted)
        uri = fields.read("uri", Node.text, "")
        if uri and not uri.startswith(DATA_URI) and uri not in found:
            place_of = inside(fields["uri"], folder, uri)
            if place_of.resolve() not in contents:
                contents[place_of.resolve()] = read_bytes(place_of)
            found[uri] = contents[place_of.resolve()]
    return found


def inside(place: Node, folder: Path, uri: str) -> Path:
    """Return the path of a file in a folder, which a URI names; a SkeletonFileError if it leads out of the folder."""
    name = unquote(uri)
    path = Path(name)
    if ":" in name or "\\" in name or "\0" in name or path.is_absolute() or ".." in path.parts:
        place.fail(f"leads to {cut(name)!r}; expected a file in the folder of the .gltf file")
    if not is_inside(folder / path, folder):
        place.fail(f"{cut(name)!r} leads out of the folder by a link")
    return folder / path


def _decoded(place: Node, uri: str) -> bytes:
    """The content of a data URI."""
    head, comma, data = uri.partition(",")
    if not comma or not head.endswith(";base64"):
        place.fail("expected a data URI in base64")
    try:
        return base64.b64decode(data, validate=True)
    except (binascii.Error, ValueError):
        place.fail("is not valid base64")


def dotted(place: str, key: str) -> str:
    """Return the place of a key of an object."""
    return field_place(place, key)


def whole(node: Node, most: int = 2**53, key: str = "") -> int:
    """Return a whole number from 0, or raise a SkeletonFileError; `key` is the list that it is an index of."""
    value = node.value
    if not isinstance(value, float) or not 0 <= value <= most or value != int(value):
        node.expected(f"an index of {key}, from 0 to {most}" if key and most >= 0 else "a whole number, from 0")
    return int(value)


def _offset(fields: Fields) -> int:
    return fields.read("byteOffset", whole, 0)


def _component(place: Node, fields: Fields, known: tuple[int, ...]) -> int:
    component = required(place, fields, "componentType", whole)
    if component not in known:
        fields["componentType"].expected(f"one of {', '.join(map(str, known))}")
    return component


def required(place: Node, fields: Fields, key: str, read: Callable[[Node], Value]) -> Value:
    """Return what `read` makes of the value at a key of an entry, or raise a SkeletonFileError if it lacks the key."""
    if key not in fields:
        place.fail(f'has no "{key}"')
    return read(fields[key])
