"""Synchronise clips: the same start, frame time and number of frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.errors import MotionError
from distretarget.motion import Motion

SAME_TIME = 1e-6  # largest difference between two frame times that are the same [of the frame time]


def aligned(motions: Sequence[Motion], *, cut: bool, resample: bool) -> list[Motion]:
    """Return the motions, as far as asked for with the first one's frame time (`resample`) and with as many frames as
    the shortest has (`cut`).
    """
    if resample:
        motions = [resampled(motion, motions[0].frame_time_text) for motion in motions]
    if cut:
        frames = min(map(len, motions))
        motions = [motion[:frames] for motion in motions]
    return list(motions)


def started(motion: Motion, start: float) -> Motion:
    """Return the motion without the time before its start [s].

    Raises:
        MotionError: the motion ends before its start.
    """
    first = round(start / motion.frame_time)
    if first >= len(motion):
        raise MotionError(f"lasts {len(motion) * motion.frame_time:g} s; start before that")
    return motion[first:] if first else motion


def resampled(motion: Motion, frame_time_text: str) -> Motion:
    """Return the motion with another frame time: translations between frames linear, rotations about one axis."""
    step = float(frame_time_text)
    if same_time(motion.frame_time, step):
        return motion
    times = np.arange(int((len(motion) - 1) * motion.frame_time / step + SAME_TIME) + 1) * step / motion.frame_time
    before = np.minimum(times.astype(int), len(motion) - 1)
    after, share = np.minimum(before + 1, len(motion) - 1), times - before
    start, end = (Rotation.from_quat(motion.rotations[frames]) for frames in (before, after))
    turns = (start.inv() * end).as_rotvec() * share[:, None, None]
    every = motion.translations
    first, second = every[before], every[after]
    translations = first + share[:, None, None] * (second - first)
    rotations = (start * Rotation.from_rotvec(turns)).as_quat()
    return Motion.of_translations(motion.skeleton, translations, rotations, frame_time_text)


def same_time(one: float, other: float) -> bool:
    """Return whether two frame times [s] are the same but for their last digits."""
    return abs(one - other) <= SAME_TIME * one
