"""Files that are read: their content, their kind, the files beside them that they name, and arrays in them."""

from __future__ import annotations

import io
import re
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import FileError, closest
from distretarget.io.files import hash_of, read_bytes, text_of
from distretarget.io.gltf import MAGIC, Gltf, parse_gltf, read_beside
from distretarget.numerics.vectors import Array
from distretarget.skeleton import LARGEST

Kind = Literal["BVH", "skeleton", "glTF", "FBX", "arrays"]

FBX_MARKS = (b"Kaydara FBX Binary", b"FBXHeaderExtension")  # one of them is at the beginning of an FBX file
NPY_MARK, NPZ_MARK = b"\x93NUMPY", b"PK\x03\x04"
HEAD = 4096  # how far the beginning of a file reaches [bytes]
GLTF_ASSET = re.compile(rb'"asset"\s*:\s*\{')  # in every .gltf file, in no skeleton file
# By suffix, where the content does not tell.
KINDS: dict[str, Kind] = {".glb": "glTF", ".gltf": "glTF", ".vrm": "glTF", ".vrma": "glTF", ".fbx": "FBX"}
ARRAY_SUFFIXES = (".npz", ".npy")  # of files of arrays
MOTION_SUFFIXES = (".bvh", *(suffix for suffix in KINDS if suffix != ".vrm"))  # of files that may be motions
ONLY = ""  # the name of the array in an npy file
DAMAGED = (ValueError, EOFError, OSError, KeyError, NotImplementedError, zipfile.BadZipFile, zlib.error)  # by numpy
FAULTS = (*DAMAGED, SyntaxError, tokenize.TokenError)  # the last two of the header of an array


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


@dataclass(frozen=True, eq=False)
class ArraysFile:
    """The arrays in an npz file by name, or the only one of an npy file; each is read when it is asked for."""

    path: str | Path
    arrays: Mapping[str, NDArray[Any]]

    @classmethod
    def of(cls, content: bytes, path: str | Path) -> ArraysFile:
        """Return the arrays in the content of a file, or raise a FileError if it is not whole."""
        read = _read(path, lambda: np.load(io.BytesIO(content), allow_pickle=False))
        return cls(path, {ONLY: read} if isinstance(read, np.ndarray) else read)

    def __contains__(self, name: str) -> bool:
        return name in self.arrays

    def array(self, name: str) -> NDArray[Any]:
        """Return an array as it is, or raise a FileError."""
        if name not in self.arrays:
            raise FileError(self.path, f"has no {name!r}; {closest(name, [*self.arrays])}")
        return np.asarray(_read(self.path, lambda: self.arrays[name]))

    def number(self, name: str) -> float:
        """Return the only number of an array, or raise a FileError."""
        found = self.array(name)
        if found.size != 1 or found.dtype.kind not in "iuf":
            raise FileError(self.path, f"{name} is {found.dtype} of shape {found.shape}; expected one number")
        return float(found.ravel()[0])

    def numbers(self, name: str, *shape: int | str) -> Array:
        """Return an array of finite numbers up to `LARGEST` of this shape, names being any number, or raise a
        FileError. At least one is a frame.
        """
        found = self.array(name)
        label = name or "the array"
        fits = found.ndim == len(shape) and all(
            n == m for n, m in zip(found.shape, shape, strict=True) if isinstance(m, int)
        )
        if not fits or found.dtype.kind not in "iuf":
            wanted = f"numbers of shape ({', '.join(map(str, shape))})"
            raise FileError(self.path, f"{label} is {found.dtype} of shape {found.shape}; expected {wanted}")
        if "frames" in shape and not len(found):
            raise FileError(self.path, f"{label} has no frames; expected one or more")
        largest = np.abs(found).max(initial=0.0)
        if not largest <= LARGEST:  # nan is not, either
            raise FileError(self.path, f"{label} contains {largest:.3g}; expected finite numbers up to {LARGEST:g}")
        return found.astype(np.float64)


def _read(path: str | Path, read: Callable[[], Any]) -> Any:
    """What `read` returns; a FileError where the content is not whole, or needs pickle, which may run any code."""
    try:
        return read()
    except FAULTS as error:
        raise FileError(path, f"is not a whole file of arrays: {error}") from error
    except MemoryError:
        raise FileError(path, "is damaged: an array would be larger than the memory") from None
