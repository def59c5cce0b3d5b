"""Input files: their content, the files that they refer to, and their formats, one row each in `FORMATS`."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import IO, Literal

from distretarget.errors import SettingsError
from distretarget.io.arrays import NPY_MARK, ArraysFile
from distretarget.io.files import check_known, hash_of, read_bytes, text_of
from distretarget.io.gltf import GLB_MARK, Gltf, parse_gltf, read_beside

Source = str | Path | bytes | IO[bytes]  # a file to read: its path, its content, or a file object opened as binary
BYTES = "bytes"  # the name of a file without one in errors
Kind = Literal["BVH", "skeleton", "glTF", "FBX", "arrays"]
OutputKind = Literal["BVH", "character", "VRMA", "arrays"]

BEGINNING = 4096  # the first bytes of a file, in which `FBX_MARKS` are looked for
FBX_MARKS = (b"Kaydara FBX Binary", b"FBXHeaderExtension")  # in binary FBX files, and in those that are text
NPZ_MARK = b"PK\x03\x04"
JSON_START = re.compile(rb"[\xef\xbb\xbf\xff\xfe \t\r\n\0]*[{\[]")  # after a byte order mark
GLTF_ASSET = re.compile(rb'"asset"\s*:\s*\{')  # in every .gltf file, in no skeleton file


@dataclass(frozen=True)
class Format:
    """A file format."""

    kind: Kind
    name: str  # in messages, after "is"
    matches: Callable[[bytes, str], bool]  # whether the content of a file with this suffix has the format
    outputs: Mapping[str, OutputKind] = field(default_factory=dict)  # what is written, by suffix
    motions: tuple[str, ...] = ()  # suffixes of files that may hold a motion
    others: tuple[str, ...] = ()  # suffixes of files that hold bodies or arrays only
    has_characters: bool = False  # whether it can hold characters: skeletons with meshes
    unwritten: str = ""  # for messages: that it is not written, and what to write instead


BVH = Format("BVH", "BVH", lambda _, __: False, {".bvh": "BVH"}, (".bvh",))  # any other text is taken for BVH
GLTF = Format(
    "glTF",
    "glTF",
    lambda content, suffix: (
        content.startswith(GLB_MARK)
        or bool(JSON_START.match(content) and (suffix == ".gltf" or GLTF_ASSET.search(content)))
    ),
    {".glb": "character", ".gltf": "character", ".vrm": "character", ".vrma": "VRMA"},
    motions=(".glb", ".gltf", ".vrma"),
    others=(".vrm",),
    has_characters=True,
)
FBX = Format(
    "FBX",
    "FBX",
    lambda content, _: any(mark in content[:BEGINNING] for mark in FBX_MARKS),
    motions=(".fbx",),
    has_characters=True,
    unwritten="FBX is read, but not written; write .glb, which Blender, Unreal, Unity, Godot and Maya read",
)
ARRAYS = Format(
    "arrays",
    "a file of arrays",
    lambda content, _: content.startswith((NPY_MARK, NPZ_MARK)),
    {".npz": "arrays"},
    others=(".npz", ".npy"),
)
SKELETON = Format("skeleton", "a skeleton file", lambda content, _: JSON_START.match(content) is not None)

FORMATS = (BVH, GLTF, ARRAYS, FBX, SKELETON)  # the first that matches a content is its format
MOTION_SUFFIXES = tuple(suffix for each in FORMATS for suffix in each.motions)
OUTPUTS = {suffix: kind for each in FORMATS for suffix, kind in each.outputs.items()}
OUTPUT_FORMATS = ("own", *(suffix[1:] for suffix in OUTPUTS))  # of results; "own" is the target's format


def format_of_name(path: str | Path) -> Format | None:
    """Return the format with the suffix of a file's name, or None."""
    suffix = Path(path).suffix.lower()
    return next((each for each in FORMATS if suffix in each.motions + each.others), None)


def format_of(content: bytes, path: str | Path) -> Format:
    """Return the format of a file by its content, else its name, else BVH; a FileError as in `check_known`."""
    suffix = Path(path).suffix.lower()
    if matching := next((each for each in FORMATS if each.matches(content, suffix)), None):
        return matching
    check_known(path)
    named = format_of_name(path)
    return named if named and named is not ARRAYS else BVH


@dataclass(frozen=True, eq=False)
class InputFile:
    """The content of a file, and of the files that belong to it."""

    content: bytes
    path: str | Path  # of the file, or its name in errors
    beside: Mapping[str, bytes] = field(default_factory=dict)  # the contents of a .gltf file's buffer files by URI
    skeleton: InputFile | None = None  # of a file of arrays, the file with the skeleton they belong to
    has_folder: bool = True  # whether `path` is a real path, so that there may be files beside it

    @cached_property
    def format(self) -> Format:
        """The format of the file by its content, or else by its name."""
        return format_of(self.content, self.path)

    @property
    def kind(self) -> Kind:
        """The kind of format."""
        return self.format.kind

    def __reduce__(self) -> tuple[type[InputFile], tuple[object, ...]]:
        """Pickle the content, for a worker, without the cached properties."""
        return InputFile, (self.content, self.path, dict(self.beside), self.skeleton, self.has_folder)

    @cached_property
    def gltf(self) -> Gltf:
        """The file as glTF; errors as in `parse_gltf`."""
        return parse_gltf(self.content, self.path, self.beside, self.has_folder)

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


def load_file(source: Source) -> InputFile:
    """Read a file, and a .gltf file's buffer files; a FileError or SkeletonFileError if one cannot be read, or is
    outside the folder. Beside bytes and file objects no other file is read. A file object's name, if it has one, is
    used in errors, and its suffix may tell the format.
    """
    if isinstance(source, str | PathLike):
        return with_files_beside(InputFile(read_bytes(source), source))
    content = source.read() if hasattr(source, "read") else source
    if not isinstance(content, bytes):
        raise SettingsError(f"the file is {reprlib.repr(source)}; expected a path, bytes, or a file opened as binary")
    name = getattr(source, "name", None)
    return InputFile(content, name if isinstance(name, str) else BYTES, has_folder=False)


def with_files_beside(file: InputFile) -> InputFile:
    """Return a file with a .gltf file's buffer files; errors as in `load_file`."""
    if file.kind != "glTF" or file.content.startswith(GLB_MARK):
        return file
    return InputFile(file.content, file.path, read_beside(file.content, file.path))
