"""Sanity checks of a result: finite positions, with hips and feet near those of the rotation copy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import MotionError
from distretarget.motion import Motion
from distretarget.numerics.vectors import extent, lengths
from distretarget.objectives.clip import Clip
from distretarget.skeleton import LARGEST

Array = NDArray[np.float64]

HIPS_RANGE = 2.0  # most distance of the hips from the root's path [body units]
FEET_RANGE = 3.0  # most distance of an ankle from the rotation copy's on that path [body units]
DIGITS = 1e-9  # rounding error far from the origin [of the distance from it]
REPORT = "please report this with the clip and the target"


def check_places(posed: Motion, clip: Clip) -> None:
    """Check that a result has the frames of its source, with hips and ankles near those of the rotation copy.

    Raises:
        MotionError: it does not; the message names joint and frame.
    """
    if len(posed) != len(clip):
        raise MotionError(f"the result has {len(posed)} frames, the source {len(clip)}; {REPORT}")
    joints = np.array([clip.pelvis, *(pair.target.ankle for pair in clip.legs)])
    copied = clip.copy_on_path(joints)
    away = lengths(posed.positions_of(joints) - copied) / (clip.unit + DIGITS * extent(copied[:, 0]))
    for some, most in ((slice(1), HIPS_RANGE), (slice(1, None), FEET_RANGE)):
        far = f"is more than {most:g} heights away from where copied rotations put it"
        _refuse_first(~(away[:, some] <= most), posed, joints[some], far)


def check_finite(motion: Motion) -> None:
    """Check that all positions are finite, and within the bound for positions.

    Raises:
        MotionError: one is not; the message names joint and frame.
    """
    if extent(motion.positions) <= LARGEST:
        return
    joints, farthest = np.arange(len(motion.skeleton)), np.abs(motion.positions).max(axis=2)
    _refuse_first(~np.isfinite(farthest), motion, joints, "is nowhere, at no finite position")
    _refuse_first(
        farthest > LARGEST, motion, joints, f"is beyond {LARGEST:g}", "use other units, or a smaller root scale"
    )


def _refuse_first(
    wrong: NDArray[np.bool_], motion: Motion, joints: NDArray[np.intp], fault: str, advice: str = REPORT
) -> None:
    """Raise an error for the first frame in which a joint is wrong, (frames, joints), if there is one."""
    if wrong.any():
        frame, column = np.argwhere(wrong)[0]
        key = motion.skeleton.keys[joints[column]]
        raise MotionError(f"frame {frame} of the result is wrong: {key!r} {fault}; {advice}")
