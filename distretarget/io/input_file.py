"""Input files: their content, their format, and the files beside them that they refer to."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import IO

from distretarget.errors import SettingsError
from distretarget.io.arrays import ArraysFile
from distretarget.io.files import hash_of, read_bytes, text_of
from distretarget.io.formats import GLB_MARK, Format, Kind, format_of
from distretarget.io.gltf import Gltf, parse_gltf, read_beside

Source = str | Path | bytes | IO[bytes]  # a file to read: its path, its content, or a file object opened as binary
BYTES = "bytes"  # the name of a file without one in errors


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
