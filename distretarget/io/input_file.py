"""Files that are read: their content, their kind, and the files beside them that they name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal

from distretarget.io.files import hash_of, read_bytes, text_of
from distretarget.io.gltf import MAGIC, Gltf, parse_gltf, read_beside
from distretarget.io.npz import NPY_MARK, NPZ_MARK, ArraysFile

Kind = Literal["BVH", "skeleton", "glTF", "FBX", "arrays"]

FBX_MARKS = (b"Kaydara FBX Binary", b"FBXHeaderExtension")  # one of them is at the beginning of an FBX file
HEAD = 4096  # how far the beginning of a file reaches [bytes]
GLTF_ASSET = re.compile(rb'"asset"\s*:\s*\{')  # in every .gltf file, in no skeleton file
# By suffix, where the content does not tell.
KINDS: dict[str, Kind] = {".glb": "glTF", ".gltf": "glTF", ".vrm": "glTF", ".vrma": "glTF", ".fbx": "FBX"}
ARRAY_SUFFIXES = (".npz", ".npy")  # of files of arrays
MOTION_SUFFIXES = (".bvh", *(suffix for suffix in KINDS if suffix != ".vrm"))  # of files that may be motions


@dataclass(frozen=True, eq=False)
class InputFile:
    """The content of a file, and of the files that belong to it."""

    content: bytes
    path: str | Path  # of the file, or what stands for it in errors
    beside: Mapping[str, bytes] = field(default_factory=dict)  # the files that a .gltf file names, by the URI in it
    joints: InputFile | None = None  # the skeleton that arrays are for

    @cached_property
    def kind(self) -> Kind:
        """What the file is, by its content, and by its name where that does not tell."""
        head = self.content[:HEAD]
        if head.startswith(MAGIC):
            return "glTF"
        if head.startswith((NPY_MARK, NPZ_MARK)):
            return "arrays"
        if any(mark in head for mark in FBX_MARKS):
            return "FBX"
        suffix = Path(self.path).suffix.lower()
        if self.content.lstrip(b"\xef\xbb\xbf\xff\xfe \t\r\n\0")[:1] in (b"{", b"["):
            return "glTF" if suffix == ".gltf" or GLTF_ASSET.search(self.content) else "skeleton"
        return KINDS.get(suffix, "BVH")

    def __reduce__(self) -> tuple[type[InputFile], tuple[object, ...]]:
        """What goes to a worker: what was read, not what was made of it."""
        return InputFile, (self.content, self.path, dict(self.beside), self.joints)

    @cached_property
    def gltf(self) -> Gltf:
        """The file as glTF; errors as in `parse_gltf`."""
        return parse_gltf(self.content, self.path, self.beside)

    @cached_property
    def arrays(self) -> ArraysFile:
        """The arrays in an npz or npy file, or a FileError."""
        return ArraysFile.of(self.content, self.path)

    @property
    def text(self) -> str:
        """The text of a BVH or skeleton file, not cached: it may be long; errors as in `read_text`."""
        return text_of(self.content, self.path)

    @cached_property
    def hash(self) -> str:
        """The hash of the content."""
        return hash_of(self.content)


def load_file(path: str | Path) -> InputFile:
    """Read a file, and those that it names if it is a .gltf file; a FileError or SkeletonFileError if one cannot be
    read, or if it names one outside its folder.
    """
    return with_files_beside(InputFile(read_bytes(path), path))


def with_files_beside(file: InputFile) -> InputFile:
    """Return the file with those that it names; errors as in `load_file`."""
    if file.kind != "glTF" or file.content.startswith(MAGIC):
        return file
    return InputFile(file.content, file.path, read_beside(file.content, file.path))
