"""Animations sampled at frames that are equally far apart: at their own keys, or at a frame rate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.character.animations import frame_count, frame_times, is_on_grid, own_rate
from distretarget.character.nodes import Animation
from distretarget.errors import FileError, cut
from distretarget.motion import LONGEST_FRAME
from distretarget.numerics.vectors import Array, lengths, normalised
from distretarget.skeleton import SMALLEST

BLOCK = 65536  # frames that are sampled at once
FREE_SAMPLES = 1_000_000  # so many samples may a file have, however small it is [frames x curves]


@dataclass(frozen=True, eq=False)
class Curve:
    """The keys of one property of a node; those of a "CUBICSPLINE" are tangent in, value, tangent out."""

    times: Array  # (keys,), in ascending order [s]
    keys: Array  # (keys, 1 or 3, numbers)
    interpolation: str  # between keys: "LINEAR", "STEP" or "CUBICSPLINE"

    def at(self, times: Array, rotates: bool) -> Array:
        """(times, numbers), the values at times [s]; the first and last key hold before and after. Rotations,
        quaternions x y z w, become unit quaternions.
        """
        values = self.keys[:, self.keys.shape[1] // 2]
        after = np.clip(np.searchsorted(self.times, times, side="right"), 1, max(len(self.times) - 1, 1))
        before, after = after - 1, np.minimum(after, len(self.times) - 1)
        span = self.times[after] - self.times[before]
        passed = np.clip(times - self.times[before], 0.0, span)
        share = np.divide(passed, span, out=np.zeros(len(times)), where=span > 0)
        if self.interpolation == "STEP":
            result = np.where((share >= 1.0)[:, None], values[after], values[before])
        elif self.interpolation == "CUBICSPLINE":
            result = self._cubic(before, after, share, span)
        elif rotates:
            result = _slerp(values[before], values[after], share)
        else:
            result = values[before] + share[:, None] * (values[after] - values[before])
        if not rotates:
            return result
        usual = values[before]  # where a spline passes through 0
        return normalised(np.where((lengths(result) > SMALLEST * lengths(usual))[:, None], result, usual))

    def _cubic(self, before: NDArray[np.intp], after: NDArray[np.intp], share: Array, span: Array) -> Array:
        """Hermite's spline, glTF 2.0 specification, appendix C.5."""
        t, d = share[:, None], span[:, None]
        start, out = self.keys[before, 1], self.keys[before, 2]
        into, end = self.keys[after, 0], self.keys[after, 1]
        t2, t3 = t * t, t * t * t
        return np.asarray(
            (2 * t3 - 3 * t2 + 1) * start
            + d * (t3 - 2 * t2 + t) * out
            + (-2 * t3 + 3 * t2) * end
            + d * (t3 - t2) * into
        )


def _slerp(start: Array, end: Array, share: Array) -> Array:
    """(n, 4), between two rotations on the shorter way."""
    first = Rotation.from_quat(start)
    turn = (first.inv() * Rotation.from_quat(end)).as_rotvec()
    return np.asarray((first * Rotation.from_rotvec(share[:, None] * turn)).as_quat())


def sampled(
    path: str | Path, name: str, curves: Mapping[str, Mapping[int, Curve]], fps: float | None, most: int
) -> Animation:
    """Return an animation's curves, by property and node, sampled at `fps` frames/s, else at the rate of its keys
    (`own_rate`); one that is too long for this and whose keys are equally far apart has these as its frames. The size
    of the file bounds the samples, `most` [bytes]. A FileError if nothing is animated, or if it is too long.
    """
    every = [curve for of_nodes in curves.values() for curve in of_nodes.values()]
    if not every:
        raise FileError(path, f"nothing moves in its animation {cut(name)!r}")
    times = np.unique(np.concatenate([*{id(curve.times): curve.times for curve in every}.values()]))
    rate, most = fps or own_rate(times), max(most, FREE_SAMPLES) // len(every)
    if fps is None and frame_count(times, rate) > most:
        step = float(np.diff(times).mean())
        rate = 1.0 / step if step <= LONGEST_FRAME and is_on_grid(times, 1.0 / step) else rate
    if frame_count(times, rate) > most:
        duration = f"{times[-1] - times[0]:.6g} s"
        raise FileError(path, f"its animation {cut(name)!r} is {duration} long; at {rate:g} frames/s that is too much")
    at = frame_times(times, rate)
    blocks = [at[first : first + BLOCK] for first in range(0, len(at), BLOCK)]
    values = {
        kind: {
            node: np.concatenate([curve.at(block, kind == "rotation") for block in blocks])
            for node, curve in of_nodes.items()
        }
        for kind, of_nodes in curves.items()
    }
    return Animation(name, len(at), f"{1 / rate:.9g}", values["translation"], values["rotation"], values["scale"])
