"""Build glTF files with json, struct and numpy, without the package's own glTF code."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

import numpy as np

GENERATOR = "distretarget's tools"
COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {(): "SCALAR", (2,): "VEC2", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}


def glb(document: bytes, binary: bytes) -> bytes:
    """A GLB file of a document's JSON and its buffer, which has no chunk if it is empty."""
    text = document + b" " * (-len(document) % 4)
    parts = struct.pack("<II", len(text), 0x4E4F534A) + text
    if binary:
        parts += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


@dataclass
class Gltf:
    """A glTF file to be built: its JSON, which may be edited, and its only buffer."""

    document: dict = field(default_factory=lambda: {"asset": {"version": "2.0", "generator": GENERATOR}})
    binary: bytearray = field(default_factory=bytearray)

    def add(self, kind: str, **entry: object) -> int:
        """Append an entry to a list of the document, without what is None, and return its number."""
        entries = self.document.setdefault(kind, [])
        entries.append({key: value for key, value in entry.items() if value is not None})
        return len(entries) - 1

    def view(self, data: bytes, stride: int | None = None, target: int | None = None) -> int:
        """Append bytes to the buffer, on a multiple of four, as a bufferView."""
        self.binary += bytes(-len(self.binary) % 4)
        start = len(self.binary)
        self.binary += data
        return self.add(
            "bufferViews", buffer=0, byteOffset=start, byteLength=len(data), byteStride=stride, target=target
        )

    def accessor(
        self,
        values: np.ndarray,
        dtype: str = "f4",
        *,
        bounds: bool = False,
        stride: int | None = None,
        sparse: bool = False,
        target: int | None = None,
    ) -> int:
        """Append an accessor of values (count, ...); integers that hold fractions are normalized.

        Args:
            values: the elements; matrices row by row.
            dtype: the type of the numbers, one of `COMPONENTS`.
            bounds: write min and max.
            stride: bytes from one element to the next; by default the size of an element.
            sparse: store the first element for all, and the elements that differ in a sparse accessor.
            target: of the buffer view.
        """
        values = np.asarray(values)
        normalized = dtype != "f4" and values.dtype.kind == "f"
        if normalized:
            values = np.round(values * np.iinfo(dtype).max)
        stored = np.ascontiguousarray(values, f"<{dtype}")
        shape, count = stored.shape[1:], len(stored)
        entry = {"componentType": COMPONENTS[dtype], "type": TYPES[shape], "count": count}
        entry |= {"normalized": normalized or None}
        if bounds:
            flat = stored.reshape(count, -1)
            entry |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        if shape == (4, 4):
            stored = np.ascontiguousarray(stored.transpose(0, 2, 1))
        if sparse:
            changed = np.flatnonzero((stored != stored[0]).reshape(count, -1).any(axis=1)).astype("<u2")
            entry["sparse"] = {
                "count": len(changed),
                "indices": {"bufferView": self.view(changed.tobytes()), "componentType": COMPONENTS["u2"]},
                "values": {"bufferView": self.view(stored[changed].tobytes())},
            }
            stored = np.repeat(stored[:1], count, axis=0)
        if stride:
            rows = stored.reshape(count, -1).view(np.uint8).reshape(count, -1)
            stored = np.pad(rows, ((0, 0), (0, stride - rows.shape[1])), constant_values=0xAB)
        view, start = self.view(stored.tobytes(), stride, target), 0 if stride else None
        return self.add("accessors", bufferView=view, byteOffset=start, **entry)

    def uses(self, *extensions: str) -> None:
        used = self.document.setdefault("extensionsUsed", [])
        used += [name for name in extensions if name not in used]

    def glb(self) -> bytes:
        """The file as GLB."""
        binary = bytes(self.binary) + bytes(-len(self.binary) % 4)
        if binary:
            self.document["buffers"] = [{"byteLength": len(self.binary)}]
        return glb(json.dumps(self.document).encode(), binary)

    def write(self, path: Path) -> Path:
        """Write the file: `.gltf` with its buffer in a file beside it, every other name as GLB."""
        if path.suffix != ".gltf":
            path.write_bytes(self.glb())
            return path
        buffer = path.with_suffix(".bin")
        buffer.write_bytes(self.binary)
        self.document["buffers"] = [{"uri": quote(buffer.name), "byteLength": len(self.binary)}]
        path.write_text(json.dumps(self.document), "utf-8")
        return path
