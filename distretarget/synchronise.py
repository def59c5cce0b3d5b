"""Synchronise clips: the same start, frame time and number of frames."""

from __future__ import annotations

from collections.abc import Sequence

from distretarget.errors import MotionError
from distretarget.motion import Motion


def aligned(motions: Sequence[Motion], starts: Sequence[float], *, cut: bool, resample: bool) -> list[Motion]:
    """Return the motions without the time before their `starts` [s], as far as asked for with the first one's frame
    time (`resample`) and with as many frames as the shortest has (`cut`).

    Raises:
        MotionError: a motion ends before its start.
    """
    begun = [_from(motion, start) for motion, start in zip(motions, starts, strict=True)]
    if resample:
        begun = [motion.resampled(begun[0].frame_time_text) for motion in begun]
    if cut:
        frames = min(map(len, begun))
        begun = [motion[:frames] for motion in begun]
    return begun


def _from(motion: Motion, start: float) -> Motion:
    first = round(start / motion.frame_time)
    if first >= len(motion):
        raise MotionError(f"begins at {start:g} s of a clip of {len(motion) * motion.frame_time:g} s; begin earlier")
    return motion[first:] if first else motion
