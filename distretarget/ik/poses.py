"""A clip as the pose solver takes it, solved in overlapping chunks of frames, and the poses that come out.

Where a clip is cut depends on its number of frames alone, so that the result is the same, digit for digit, whoever
solves the chunks.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import Regions
from distretarget.body.legs import Legs
from distretarget.distances import DistanceProblem
from distretarget.ik.spg import Effort
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseProblem:
    """A clip whose poses are to be solved; a slice of it has some of its frames.

    Attributes:
        skeleton: of the target.
        legs: of the target; None where it has none.
        unit: the target's body unit [target file units].
        roots: (joints,), the topmost joint of the rigid part that each joint belongs to.
        parts: (joints,), the rigid part that carries the bones below each joint.
        distances: the points that source and target share, with their path lengths.
        regions: of the target, which touch each other.
        source: (frames, source joints, 3), positions [source file units].
        copy: (frames, joints, 3), positions of the rotation copy [target file units].
        root: (frames, 3), the path the root keeps to [target file units].
        frame_time: [s].
    """

    skeleton: Skeleton
    legs: Legs | None
    unit: float
    roots: NDArray[np.intp]
    parts: NDArray[np.intp]
    distances: DistanceProblem
    regions: Regions
    source: Array
    copy: Array
    root: Array
    frame_time: float

    def __len__(self) -> int:
        return len(self.copy)

    def __getitem__(self, frames: slice) -> PoseProblem:
        return replace(self, source=self.source[frames], copy=self.copy[frames], root=self.root[frames])

    def raised(self, by: Array) -> PoseProblem:
        """The same clip with the path of the root displaced by vectors (frames, 3) [target file units]."""
        return replace(self, root=self.root + by)

    def copy_on_path(self, joints: NDArray[np.intp]) -> Array:
        """(frames, joints, 3), positions of joints in the rotation copy whose root keeps to its path [target file
        units].
        """
        places = np.take(self.copy, joints, axis=1)
        places += (self.root - self.copy[:, 0])[:, None]
        return places

    @property
    def loose_parts(self) -> NDArray[np.intp]:
        """The numbers of the parts that neither begin at a point of the distance problem nor carry one, such as fingers
        that nothing drives: only the floor moves them.
        """
        return np.setdiff1d(self.parts, self.parts[[*self.skeleton.lines(self.distances.targets)]])

    @property
    def bones(self) -> Array:
        """(frames, joints, 3), the copy's bones, from each joint's parent to it [target file units]."""
        bones = np.take(self.copy, self.skeleton.parents, axis=1)
        return np.subtract(self.copy, bones, out=bones)


@dataclass(frozen=True, eq=False)
class Poses:
    """The solved poses of a clip.

    Attributes:
        v: (frames, parts + 1, 3), the deviation of each part from the rotation copy [rad]; last, the displacement of
            the root from its path [target file units].
        effort: what the solver took.
    """

    v: Array
    effort: Effort

    def __getitem__(self, frames: slice) -> Poses:
        return Poses(self.v[frames], self.effort[frames])

    @classmethod
    def joined(cls, chunks: Iterator[Poses], frames: int) -> Poses:
        """Return the poses of a clip with so many frames from those of its chunks, each of which is copied as it comes,
        so that its memory is free for those that follow.
        """
        first = next(chunks)
        v, efforts, done = np.empty((frames, *first.v.shape[1:])), [], 0
        for poses in itertools.chain([first], chunks):
            v[done : done + len(poses.v)] = poses.v
            efforts.append(poses.effort)
            done += len(poses.v)
        return cls(v, Effort.joined(efforts))


CHUNK_FRAMES = 1024  # frames of a chunk, about
LEAD_IN = 32  # frames solved before a chunk, so that it begins where the chunk before it ends

Mapper = Callable[..., Iterable[Any]]  # like `map` and an executor's: calls a function on items, results in order
Progress = Callable[[int], Any]


def ignore_progress(_frames: int) -> None:
    """Show no progress."""


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
