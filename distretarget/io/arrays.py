"""Read .npz and .npy files, each array on demand and within size limits; write .npz files without time stamps."""

from __future__ import annotations

import io
import math
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import FileError, closest
from distretarget.numerics.vectors import Array
from distretarget.skeleton import LARGEST

Arrays = Mapping[str, NDArray[Any] | float]
Precision = Literal["float64", "float32"]

NPY_MARK = b"\x93NUMPY"
FIXED_TIME = (1980, 1, 1, 0, 0, 0)  # time stamp of all entries, the earliest that a zip file can hold
NPY_NAME = ""  # the name given to the array in an npy file
FREE_NUMBERS = 1_000_000  # allowed size of an array in a file of any size ...
NUMBERS_PER_BYTE = 4  # ... and per byte of the file; constant poses compress this well
# What numpy raises for a damaged file.
DAMAGED = (zipfile.BadZipFile, zlib.error, tokenize.TokenError)
FAULTS = (*DAMAGED, ValueError, EOFError, OSError, KeyError, NotImplementedError, SyntaxError)


@dataclass(frozen=True, eq=False)
class ArraysFile:
    """The arrays in an npz file by name, or the one in an npy file, read on demand and within size limits."""

    path: str | Path
    size: int  # of the file [bytes]
    parts: Mapping[str, Callable[[], IO[bytes]]]  # opens the npy file of each array

    @classmethod
    def of(cls, content: bytes, path: str | Path) -> ArraysFile:
        """Return the arrays in the content of a file, or raise a FileError if it is damaged."""
        if content.startswith(NPY_MARK):
            return cls(path, len(content), {NPY_NAME: lambda: io.BytesIO(content)})
        archive = _checked(path, lambda: zipfile.ZipFile(io.BytesIO(content)))
        parts = {name.removesuffix(".npy"): partial(archive.open, name) for name in archive.namelist()}
        return cls(path, len(content), parts)

    def __contains__(self, name: str) -> bool:
        return name in self.parts

    def shape_and_dtype(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        """Return the shape and dtype of an array from its header alone, or raise a FileError."""
        if name not in self.parts:
            raise FileError(self.path, f"has no {name!r}; {closest(name, [*self.parts])}")
        return cast(tuple[tuple[int, ...], np.dtype[Any]], _checked(self.path, lambda: _header(self.parts[name]())))

    def array(self, name: str) -> NDArray[Any]:
        """Return an array of any shape and dtype, or raise a FileError if it is damaged or too large."""
        shape, dtype = self.shape_and_dtype(name)
        limit = max(FREE_NUMBERS, NUMBERS_PER_BYTE * self.size)
        if math.prod(shape) * max(dtype.itemsize // 8, 1) > limit:  # a string counts as the numbers of equal size
            found = f"{name or 'the array'} has the shape {shape}"
            raise FileError(self.path, f"{found}: more numbers than a file of {self.size} bytes should have")
        return np.asarray(_checked(self.path, lambda: np.lib.format.read_array(self.parts[name](), allow_pickle=False)))

    def number(self, name: str) -> float:
        """Return the number in an array of size 1, or raise a FileError."""
        shape, dtype = self.shape_and_dtype(name)
        if math.prod(shape) != 1 or dtype.kind not in "iuf":
            raise FileError(self.path, f"{name} is {dtype} of shape {shape}; expected one number")
        return float(self.array(name).ravel()[0])

    def numbers(self, name: str, *shape: int | str) -> Array:
        """Return an array of finite numbers, or a FileError; a string in `shape` is any length, "frames" 1 or more."""
        (found, dtype), label = self.shape_and_dtype(name), name or "the array"
        fits = len(found) == len(shape) and all(n == m for n, m in zip(found, shape, strict=True) if isinstance(m, int))
        if not fits or dtype.kind not in "iuf":
            wanted = f"numbers of shape ({', '.join(map(str, shape))})"
            raise FileError(self.path, f"{label} is {dtype} of shape {found}; expected {wanted}")
        if "frames" in shape and 0 in found[:1]:
            raise FileError(self.path, f"{label} has no frames; expected one or more")
        numbers = self.array(name).astype(np.float64)
        largest = np.abs(numbers).max(initial=0.0)
        if not largest <= LARGEST:  # false for nan
            raise FileError(self.path, f"{label} contains {largest:.3g}; expected finite numbers up to {LARGEST:g}")
        return numbers


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """The shape and dtype of the array in an npy file."""
    version = np.lib.format.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise ValueError(f"its arrays are of version {version[0]}.{version[1]} of the format, not of 1.0 or 2.0")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file)
    return shape, dtype


def _checked(path: str | Path, read: Callable[[], Any]) -> Any:
    """`read()`; a FileError if the content is damaged, or needs pickle, which could run any code."""
    try:
        return read()
    except FAULTS as error:
        raise FileError(path, f"is not a whole file of arrays: {error}") from error
    except MemoryError:
        raise FileError(path, "is damaged: an array would be larger than the memory") from None


def npz(arrays: Arrays, precision: Precision = "float64") -> bytes:
    """Return an npz file's content, with arrays of float64 in a `precision`. Equal arrays make equal files."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:
        for name, values in arrays.items():
            array = np.asarray(values)
            if array.ndim and array.dtype == np.float64:
                array = array.astype(precision)
            with archive.open(zipfile.ZipInfo(f"{name}.npy", FIXED_TIME), "w", force_zip64=True) as file:
                np.lib.format.write_array(file, array, allow_pickle=False)
    return content.getvalue()
