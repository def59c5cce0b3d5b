"""Clips in blocks of frames, so that what is computed on the way takes memory for a block alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Value = TypeVar("Value", bound=np.generic)

BLOCK_FRAMES = 384  # most frames of a block


def blocks_of(frames: int) -> Iterator[slice]:
    """The frames of a clip in blocks of at most `BLOCK_FRAMES`, all about as long; none for a clip without frames."""
    blocks = -(-frames // BLOCK_FRAMES)
    for block in range(blocks):
        yield slice(frames * block // blocks, frames * (block + 1) // blocks)


def in_blocks(compute: Callable[[slice], NDArray[Value]], frames: int) -> NDArray[Value]:
    """What `compute` returns for the frames of each block of a clip, joined."""
    first, *others = list(blocks_of(frames)) or [slice(0, 0)]
    values = compute(first)
    joined = np.empty((frames, *values.shape[1:]), values.dtype)
    joined[first] = values
    for block in others:
        joined[block] = compute(block)
    return joined
