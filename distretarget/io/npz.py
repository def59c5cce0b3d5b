"""Motions as npz files, the arrays that numpy loads without pickle."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, cast

import numpy as np

from distretarget.checks import check_kind
from distretarget.io.files import write_whole
from distretarget.motion import Motion
from distretarget.numerics.rotations import RotationKind


def write_npz(
    path: str | Path, motion: Motion, rotations: RotationKind = "quaternion", overwrite: bool = False
) -> None:
    """Write the arrays of `Motion.to_dict` to an npz file, whole or not at all.

    `numpy.load(path)` gives them back under their names, without pickle.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written.
    """
    check_kind("motion", motion, Motion)
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **cast(dict[str, Any], motion.to_dict(rotations)))
    write_whole(path, content.getvalue(), overwrite)
