"""A clip as the pose solver takes it, and the poses that it returns."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from distretarget.body.legs import Legs
from distretarget.body.regions import Regions
from distretarget.distances import DistanceProblem
from distretarget.skeleton import Skeleton
from distretarget.solve.spg import Effort

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
