"""Arrays in npz and npy files, without pickle; equal arrays make equal npz files."""

from __future__ import annotations

import io
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import FileError, closest
from distretarget.skeleton import LARGEST

Arrays = Mapping[str, NDArray[Any] | float]
Precision = Literal["float64", "float32"]

WITHOUT_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip file knows
NPY_MARK, NPZ_MARK = b"\x93NUMPY", b"PK\x03\x04"  # at the beginning of files
ONLY = ""  # the name of the array in an npy file
DAMAGED = (ValueError, EOFError, OSError, KeyError, NotImplementedError, zipfile.BadZipFile, zlib.error)  # by numpy
FAULTS = (*DAMAGED, SyntaxError, tokenize.TokenError)  # the last two of the header of an array


def npz(arrays: Arrays, precision: Precision = "float64") -> bytes:
    """Return the content of an npz file with some arrays by name, whose numbers have this precision.

    Single numbers, such as the frame time, stay float64. The file says nothing of when it was made.
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

    def numbers(self, name: str, *shape: int | str) -> NDArray[np.float64]:
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
