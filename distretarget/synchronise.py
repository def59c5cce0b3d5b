"""Synchronise clips: the same start, frame time and number of frames."""

from __future__ import annotations

from collections.abc import Sequence

from distretarget.errors import MotionError
from distretarget.motion import Motion


def aligned(motions: Sequence[Motion], *, cut: bool, resample: bool) -> list[Motion]:
    """Return the motions, as far as asked for with the first one's frame time (`resample`) and with as many frames as
    the shortest has (`cut`).
    """
    if resample:
        motions = [motion.resampled(motions[0].frame_time_text) for motion in motions]
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
