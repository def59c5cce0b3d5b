"""Key frames: some of a clip's frames, evenly apart, between which values are interpolated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.time_series import Shots

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class KeyFrames:
    """The key frames of a clip. Slicing selects frames, whose first is then a key frame as well.

    Attributes:
        shots: (frames,), the number of each frame's shot.
        are_keys: (frames,), whether each frame is one; the first of each shot is.
        frame_time: the time between frames [s].
        time: that between key frames [s].
    """

    shots: Shots
    are_keys: NDArray[np.bool_]
    frame_time: float
    time: float

    @classmethod
    def of(cls, shots: Shots, frame_time: float, rate: float) -> KeyFrames:
        """Return key frames at about this rate [1/s]; all frames of a clip with fewer."""
        step = max(round(1.0 / (rate * frame_time)), 1)
        since = np.arange(len(shots)) - np.searchsorted(shots, shots)  # the first frame of the shot
        return cls(shots, since % step == 0, frame_time, step * frame_time)

    def __getitem__(self, frames: slice) -> KeyFrames:
        shots, are_keys = self.shots[frames], self.are_keys[frames].copy()
        are_keys[np.searchsorted(shots, shots)] = True
        return KeyFrames(shots, are_keys, self.frame_time, self.time)

    @property
    def numbers(self) -> Numbers:
        """(keys,), the frames that they are."""
        return np.flatnonzero(self.are_keys)

    @property
    def around(self) -> tuple[Numbers, Numbers]:
        """(frames,) twice, which key frame each frame is at or after, and the next one, if its shot has one."""
        before = np.cumsum(self.are_keys) - 1
        after = np.minimum(before + 1, before[-1])
        shots = self.shots[self.numbers]
        return before, np.where(shots[after] == shots[before], after, before)

    def between(self, values: Array) -> Array:
        """(frames, ...), values at the key frames, (keys, ...), interpolated; the last of a shot stays."""
        (before, after), numbers = self.around, self.numbers
        way = numbers[after] - numbers[before]
        share = (np.arange(len(before)) - numbers[before]) / np.maximum(way, 1)
        share = np.where(way > 0, share, 0.0).reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray((1.0 - share) * values[before] + share * values[after])
