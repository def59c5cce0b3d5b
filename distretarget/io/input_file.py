"""Files that are read: their content, their kind, the files beside them that they name, and arrays in them."""

from __future__ import annotations

import io
import math
import re
import reprlib
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from os import PathLike
from pathlib import Path
from typing import IO, Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import FileError, SettingsError, closest
from distretarget.io.files import check_known, hash_of, read_bytes, text_of
from distretarget.io.gltf import MAGIC, Gltf, parse_gltf, read_beside
from distretarget.numerics.vectors import Array
from distretarget.skeleton import LARGEST

Source = str | Path | bytes | IO[bytes]  # a file to read: its path, its content, or a file object opened as binary
Kind = Literal["BVH", "skeleton", "glTF", "FBX", "arrays"]

FBX_MARKS = (b"Kaydara FBX Binary", b"FBXHeaderExtension")  # one of them is at the beginning of an FBX file
NPY_MARK, NPZ_MARK = b"\x93NUMPY", b"PK\x03\x04"
HEAD = 4096  # how far the beginning of a file reaches [bytes]
GLTF_ASSET = re.compile(rb'"asset"\s*:\s*\{')  # in every .gltf file, in no skeleton file
# By suffix, where the content does not tell.
KINDS: dict[str, Kind] = {".glb": "glTF", ".gltf": "glTF", ".vrm": "glTF", ".vrma": "glTF", ".fbx": "FBX"}
ARRAY_SUFFIXES = (".npz", ".npy")  # of files of arrays
MOTION_SUFFIXES = (".bvh", *(suffix for suffix in KINDS if suffix != ".vrm"))  # of files that may be motions
BYTES = "bytes"  # stands for a file without a name in errors
ONLY = ""  # the name of the array in an npy file
FREE_NUMBERS = 1_000_000  # so many numbers may an array have, however small the file is ...
NUMBERS_PER_BYTE = 4  # ... and so many for each of its bytes: arrays of poses that rest become that small
DAMAGED = (ValueError, EOFError, OSError, KeyError, NotImplementedError, zipfile.BadZipFile, zlib.error)  # by numpy
FAULTS = (*DAMAGED, SyntaxError, tokenize.TokenError)  # the last two of the header of an array


@dataclass(frozen=True, eq=False)
class InputFile:
    """The content of a file, and of the files that belong to it."""

    content: bytes
    path: str | Path  # of the file, or what stands for it in errors
    beside: Mapping[str, bytes] = field(default_factory=dict)  # the files that a .gltf file names, by the URI in it
    joints: InputFile | None = None  # the skeleton that arrays are for
    has_folder: bool = True  # whether the path is one, so that there may be files beside it

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
        check_known(self.path)
        if self.content.lstrip(b"\xef\xbb\xbf\xff\xfe \t\r\n\0")[:1] in (b"{", b"["):
            return "glTF" if suffix == ".gltf" or GLTF_ASSET.search(self.content) else "skeleton"
        return KINDS.get(suffix, "BVH")

    def __reduce__(self) -> tuple[type[InputFile], tuple[object, ...]]:
        """What goes to a worker: what was read, not what was made of it."""
        return InputFile, (self.content, self.path, dict(self.beside), self.joints, self.has_folder)

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
    """Read a file, and those that it names if it is a .gltf file; a FileError or SkeletonFileError if one cannot be
    read, or if it names one outside its folder.

    Bytes, and what a file object holds, have no folder, so that no file beside them is read; the name of a file object,
    if it has one, stands for them in errors, and its ending says what they are where they do not.
    """
    if isinstance(source, str | PathLike):
        return with_files_beside(InputFile(read_bytes(source), source))
    content = source if isinstance(source, bytes) else _content_of(source)
    name = getattr(source, "name", None)
    return InputFile(content, name if isinstance(name, str) else BYTES, has_folder=False)


def _content_of(source: IO[bytes]) -> bytes:
    """The rest of a file object."""
    content = source.read() if hasattr(source, "read") else None
    if not isinstance(content, bytes):
        raise SettingsError(f"the file is {reprlib.repr(source)}; expected a path, bytes, or a file opened as binary")
    return content


def with_files_beside(file: InputFile) -> InputFile:
    """Return the file with those that it names; errors as in `load_file`."""
    if file.kind != "glTF" or file.content.startswith(MAGIC):
        return file
    return InputFile(file.content, file.path, read_beside(file.content, file.path))


@dataclass(frozen=True, eq=False)
class ArraysFile:
    """The arrays in an npz file by name, or the only one of an npy file; each is read when it is asked for, if it has
    no more numbers than a file of this size may have.
    """

    path: str | Path
    size: int  # of the file [bytes]
    parts: Mapping[str, Callable[[], IO[bytes]]]  # opens the npy file of each array

    @classmethod
    def of(cls, content: bytes, path: str | Path) -> ArraysFile:
        """Return the arrays in the content of a file, or raise a FileError if it is not whole."""
        if content.startswith(NPY_MARK):
            return cls(path, len(content), {ONLY: lambda: io.BytesIO(content)})
        archive = _read(path, lambda: zipfile.ZipFile(io.BytesIO(content)))
        parts = {name.removesuffix(".npy"): partial(archive.open, name) for name in archive.namelist()}
        return cls(path, len(content), parts)

    def __contains__(self, name: str) -> bool:
        return name in self.parts

    def kind(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        """Return the shape and the type of an array, of which only the beginning is read, or raise a FileError."""
        if name not in self.parts:
            raise FileError(self.path, f"has no {name!r}; {closest(name, [*self.parts])}")
        return cast(tuple[tuple[int, ...], np.dtype[Any]], _read(self.path, lambda: _header(self.parts[name]())))

    def array(self, name: str) -> NDArray[Any]:
        """Return an array as it is, or raise a FileError."""
        shape, dtype = self.kind(name)
        most = max(FREE_NUMBERS, NUMBERS_PER_BYTE * self.size)
        if math.prod(shape) * max(dtype.itemsize // 8, 1) > most:  # texts count as the numbers in their place
            found = f"{name or 'the array'} has the shape {shape}"
            raise FileError(self.path, f"{found}: more numbers than a file of {self.size} bytes should have")
        return np.asarray(_read(self.path, lambda: np.lib.format.read_array(self.parts[name](), allow_pickle=False)))

    def number(self, name: str) -> float:
        """Return the only number of an array, or raise a FileError."""
        return float(self._numbers(name, lambda shape: math.prod(shape) == 1, "one number").ravel()[0])

    def numbers(self, name: str, *shape: int | str) -> Array:
        """Return an array of finite numbers up to `LARGEST` of this shape, names being any number, or raise a
        FileError. At least one is a frame.
        """

        def fits(found: tuple[int, ...]) -> bool:
            pairs = zip(found, shape, strict=False)
            return len(found) == len(shape) and all(n == m for n, m in pairs if isinstance(m, int))

        label = name or "the array"
        found = self._numbers(name, fits, f"numbers of shape ({', '.join(map(str, shape))})")
        if "frames" in shape and not len(found):
            raise FileError(self.path, f"{label} has no frames; expected one or more")
        largest = np.abs(found).max(initial=0.0)
        if not largest <= LARGEST:  # nan is not, either
            raise FileError(self.path, f"{label} contains {largest:.3g}; expected finite numbers up to {LARGEST:g}")
        return found

    def _numbers(self, name: str, fits: Callable[[tuple[int, ...]], bool], wanted: str) -> Array:
        """An array of numbers whose shape fits, which is found before they are read."""
        shape, dtype = self.kind(name)
        if not fits(shape) or dtype.kind not in "iuf":
            raise FileError(self.path, f"{name or 'the array'} is {dtype} of shape {shape}; expected {wanted}")
        return self.array(name).astype(np.float64)


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """The shape and the type of the array in an npy file."""
    version = np.lib.format.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise ValueError(f"its arrays are of version {version[0]}.{version[1]} of the format, not of 1.0 or 2.0")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file)
    return shape, dtype


def _read(path: str | Path, read: Callable[[], Any]) -> Any:
    """What `read` returns; a FileError where the content is not whole, or needs pickle, which may run any code."""
    try:
        return read()
    except FAULTS as error:
        raise FileError(path, f"is not a whole file of arrays: {error}") from error
    except MemoryError:
        raise FileError(path, "is damaged: an array would be larger than the memory") from None
