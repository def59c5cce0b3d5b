"""Files of arrays, .npz and .npy: each array read when it is asked for, within bounds, and written without a time."""

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
from distretarget.io.formats import NPY_MARK
from distretarget.numerics.vectors import Array
from distretarget.skeleton import LARGEST

Arrays = Mapping[str, NDArray[Any] | float]
Precision = Literal["float64", "float32"]

WITHOUT_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip file knows
ONLY = ""  # the name of the array in an npy file
FREE_NUMBERS = 1_000_000  # so many numbers may an array have, however small the file is ...
NUMBERS_PER_BYTE = 4  # ... and so many for each of its bytes: arrays of poses that rest become that small
# What numpy raises where a file is damaged.
DAMAGED = (zipfile.BadZipFile, zlib.error, tokenize.TokenError)
FAULTS = (*DAMAGED, ValueError, EOFError, OSError, KeyError, NotImplementedError, SyntaxError)


@dataclass(frozen=True, eq=False)
class ArraysFile:
    """The arrays in an npz file by name, or the one in an npy file, each read when it is asked for, within bounds."""

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
        shape, dtype = self.kind(name)
        if math.prod(shape) != 1 or dtype.kind not in "iuf":
            raise FileError(self.path, f"{name} is {dtype} of shape {shape}; expected one number")
        return float(self.array(name).ravel()[0])

    def numbers(self, name: str, *shape: int | str) -> Array:
        """Return finite numbers of this shape, names being any number, "frames" one at least; or raise a FileError."""
        (own, dtype), label = self.kind(name), name or "the array"
        fits = len(own) == len(shape) and all(n == m for n, m in zip(own, shape, strict=True) if isinstance(m, int))
        if not fits or dtype.kind not in "iuf":
            wanted = f"numbers of shape ({', '.join(map(str, shape))})"
            raise FileError(self.path, f"{label} is {dtype} of shape {own}; expected {wanted}")
        if "frames" in shape and 0 in own[:1]:
            raise FileError(self.path, f"{label} has no frames; expected one or more")
        found = self.array(name).astype(np.float64)
        largest = np.abs(found).max(initial=0.0)
        if not largest <= LARGEST:  # nan is not, either
            raise FileError(self.path, f"{label} contains {largest:.3g}; expected finite numbers up to {LARGEST:g}")
        return found


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


def npz(arrays: Arrays, precision: Precision = "float64") -> bytes:
    """Return the content of an npz file with some arrays by name, whose numbers have this precision; single numbers,
    such as the frame time, stay float64. Equal arrays make equal files.
    """
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:
        for name, values in arrays.items():
            array = np.asarray(values)
            if array.ndim and array.dtype == np.float64:
                array = array.astype(precision)
            with archive.open(zipfile.ZipInfo(f"{name}.npy", WITHOUT_TIME), "w", force_zip64=True) as file:
                np.lib.format.write_array(file, array, allow_pickle=False)
    return content.getvalue()
