"""Arrays in npz files, which numpy loads without pickle; equal arrays make equal files."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any] | float]
Precision = Literal["float64", "float32"]

WITHOUT_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip file knows


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
