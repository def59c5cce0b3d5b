"""The sample clips, and clips of any length made from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from distretarget import Motion

SAMPLES = Path(__file__).resolve().parents[1] / "sample_bvh"
LONG = 10_000  # frames of a long clip


def back_and_forth(motion: Motion, frames: int) -> Motion:
    """The motion played forwards and backwards until it has this many frames; needs at least two frames."""
    last = len(motion) - 1
    order = last - np.abs(np.arange(frames) % (2 * last) - last)
    return motion[order]
