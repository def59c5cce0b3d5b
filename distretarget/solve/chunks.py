"""A clip in pieces of about equal length, solved one after the other or side by side, and put together again.

Where a clip is cut depends on its length alone: whoever solves the pieces, the result is the same, digit for digit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from distretarget.solve.poses import Clip, Poses
from distretarget.solve.spg import Effort

PIECE = 1024  # frames of a piece, about
LEAD_IN = 32  # frames solved before a piece, so that it begins where the piece before it ends

Mapper = Callable[..., Iterable[Any]]  # like `map` and an executor's: calls a function on items, results in order
Progress = Callable[[int], Any]


@dataclass(frozen=True)
class Piece:
    """Frames of a clip that are solved together.

    Attributes:
        seen: the frames of the clip that solving looks at.
        solved: those of them that are solved, counted from the first one seen.
        kept: those of the solved ones that count, counted from the first one solved.
    """

    seen: slice
    solved: slice
    kept: slice


def pieces_of(frames: int, margin: int, lead_in: int = LEAD_IN) -> list[Piece]:
    """The pieces of a clip, where solving a frame looks at `margin` frames on both sides."""
    edges = np.linspace(0, frames, max(1, round(frames / PIECE)) + 1).astype(int).tolist()
    pieces = []
    for first, end in pairwise(edges):
        start = max(first - lead_in, 0)
        seen = slice(max(start - margin, 0), min(end + margin, frames))
        pieces.append(Piece(seen, slice(start - seen.start, end - seen.start), slice(first - start, end - start)))
    return pieces


def solve_pieces(
    solve: Callable[[Clip, Any, slice], Poses], clip: Clip, more: Any, margin: int, mapper: Mapper, progress: Progress
) -> Poses:
    """The poses of a clip from `solve(clip, more, frames)`, which solves some frames of what it is given.

    `more` can be sliced by frames, as the clip can. `mapper` has to return results in order; `progress` is called with
    numbers of frames as they are there.
    """
    pieces = pieces_of(len(clip), margin)
    arguments = [clip[piece.seen] for piece in pieces], [more[piece.seen] for piece in pieces]
    poses = []
    for piece, solved in zip(pieces, mapper(solve, *arguments, [piece.solved for piece in pieces]), strict=True):
        poses.append(solved[piece.kept])
        progress(piece.kept.stop - piece.kept.start)
    return _joined(poses)


def _joined(poses: list[Poses]) -> Poses:
    efforts = [each.effort for each in poses]
    effort = Effort(*(np.concatenate([getattr(e, name) for e in efforts]) for name in Effort.__dataclass_fields__))
    return Poses(np.concatenate([each.v for each in poses]), effort)
