"""Poses of a clip, solved in overlapping chunks of frames, serially or in parallel.

Only the number of frames decides where a clip is split, so the result is bit-identical for any number of workers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from distretarget.ik.spg import Effort

Array = NDArray[np.float64]
Mapper = Callable[..., Iterable[Any]]  # like `map` and an executor's: calls a function on items, results in order
Progress = Callable[[int], Any]

CHUNK_FRAMES = 1024  # about the length of a chunk [frames]
LEAD_IN = 32  # frames solved and discarded before a chunk, which let it continue the chunk before


def ignore_progress(_frames: int) -> None:
    """Show no progress."""


@dataclass(frozen=True, eq=False)
class Poses:
    """The solved poses of a clip."""

    # (frames, parts + 1, 3), the deviation of each part from the rotation copy [rad]; last, the displacement of the
    # root from its path [target file units]
    v: Array
    log: Array  # (4, frames), objective value, iterations, evaluations and reason to stop, see `spg.record`

    @property
    def effort(self) -> Effort:
        """The solver's effort on each frame."""
        return Effort.from_log(self.log)


@dataclass(frozen=True)
class Chunk:
    """Frames of a clip that are solved together."""

    frames: slice  # the frames whose poses are kept
    context: slice  # the frames that the solved ones depend on
    solve: slice  # the frames to solve, relative to `context`
    keep: slice  # the frames whose poses are kept, relative to `solve`


def chunks_of(frames: int, margin: int, lead_in: int = LEAD_IN) -> list[Chunk]:
    """The chunks of a clip in which each frame depends on `margin` frames before and after it."""
    edges = np.linspace(0, frames, max(1, round(frames / CHUNK_FRAMES)) + 1).astype(int).tolist()
    chunks = []
    for first, end in pairwise(edges):
        start = max(first - lead_in, 0)
        context = slice(max(start - margin, 0), min(end + margin, frames))
        solve = slice(start - context.start, end - context.start)
        chunks.append(Chunk(slice(first, end), context, solve, slice(first - start, end - start)))
    return chunks


def solve_in_chunks(
    solve: Callable[[Any, Any, slice], Poses], clip: Any, supports: Any, margin: int, mapper: Mapper, progress: Progress
) -> Poses:
    """Concatenate the chunks' results of `solve(clip, supports, frames)` into one preallocated array.

    `clip` and `supports` can be sliced by frames. `mapper` calls `solve` on every chunk and returns results in order;
    `progress` is called with the number of frames of each.
    """
    chunks = chunks_of(len(clip), margin)
    slices = [[whole[chunk.context] for chunk in chunks] for whole in (clip, supports)]
    solved = zip(chunks, mapper(solve, *slices, [chunk.solve for chunk in chunks]), strict=True)
    v, log = np.empty(0), np.empty((4, len(clip)))
    for chunk, poses in solved:
        if not v.size:
            v = np.empty((len(clip), *poses.v.shape[1:]))
        v[chunk.frames], log[:, chunk.frames] = poses.v[chunk.keep], poses.log[:, chunk.keep]
        progress(chunk.frames.stop - chunk.frames.start)
    return Poses(v, log)
