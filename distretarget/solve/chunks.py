"""Long clips in chunks: overlapping runs of frames, solved one after the other or side by side, and joined.

Where a clip is cut depends on its number of frames alone, so that the result is the same, digit for digit, whoever
solves the chunks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from distretarget.solve.poses import PoseProblem, Poses

CHUNK_FRAMES = 1024  # frames of a chunk, about
LEAD_IN = 32  # frames solved before a chunk, so that it begins where the chunk before it ends

Mapper = Callable[..., Iterable[Any]]  # like `map` and an executor's: calls a function on items, results in order
Progress = Callable[[int], Any]


@dataclass(frozen=True)
class Chunk:
    """Frames of a clip that are solved together.

    Attributes:
        context: the frames of the clip that the solved ones depend on.
        solve: the frames to solve, counted from the first one of `context`.
        keep: the frames whose poses are kept, counted from the first one of `solve`.
    """

    context: slice
    solve: slice
    keep: slice


def chunks_of(frames: int, margin: int, lead_in: int = LEAD_IN) -> list[Chunk]:
    """The chunks of a clip whose frames depend on `margin` frames on both sides."""
    edges = np.linspace(0, frames, max(1, round(frames / CHUNK_FRAMES)) + 1).astype(int).tolist()
    chunks = []
    for first, end in pairwise(edges):
        start = max(first - lead_in, 0)
        context = slice(max(start - margin, 0), min(end + margin, frames))
        solve = slice(start - context.start, end - context.start)
        chunks.append(Chunk(context, solve, keep=slice(first - start, end - start)))
    return chunks


def solve_in_chunks(
    solve: Callable[[PoseProblem, Any, slice], Poses],
    problem: PoseProblem,
    more: Any,
    *,
    margin: int,
    mapper: Mapper,
    progress: Progress,
) -> Poses:
    """The poses of a clip, from `solve(problem, more, frames)`, which solves some frames of what it is given.

    `more` can be sliced by frames, as the problem can. `mapper` calls `solve` on every chunk and returns the results in
    order; `progress` is called with the number of frames of each result.
    """
    chunks = chunks_of(len(problem), margin)
    arguments = [problem[chunk.context] for chunk in chunks], [more[chunk.context] for chunk in chunks]

    def solved() -> Iterator[Poses]:
        for chunk, poses in zip(chunks, mapper(solve, *arguments, [chunk.solve for chunk in chunks]), strict=True):
            yield poses[chunk.keep]
            progress(chunk.keep.stop - chunk.keep.start)

    return Poses.joined(solved(), len(problem))
