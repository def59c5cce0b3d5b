"""Gaps between the skins of two performers: how far those of the result are off those of the source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import counted
from distretarget.measure.skin import TOUCHING, Skin
from distretarget.measure.skin_depths import find_depths
from distretarget.measure.skin_points import LIMBS
from distretarget.motion import Motion
from distretarget.numerics.parallel import blocks_of
from distretarget.skin.capsules import PLACE, SEGMENTS

Array = NDArray[np.float64]


class Touch(NamedTuple):
    """A hand or forearm of one performer that touches the other in the source.

    Attributes:
        frame: of the clip.
        error: the difference of the gap in the result to the source's, 0 or more there, in proportion to heights [% of
            height].
        parts: the parts of the first and the second performer that touch.
    """

    frame: int
    error: float
    parts: tuple[str, str]


@dataclass(frozen=True)
class SkinGap:
    """How well two performers keep touching, by their touches, one or more."""

    touches: tuple[Touch, ...]

    @property
    def frames(self) -> int:
        """The number of frames in which they touch."""
        return len({touch.frame for touch in self.touches})

    @property
    def error(self) -> float:
        """The mean error [% of height]."""
        return float(np.mean([touch.error for touch in self.touches]))

    @property
    def worst(self) -> Touch:
        """The touch with the largest error."""
        return max(self.touches, key=lambda touch: touch.error)

    @property
    def sentence(self) -> str:
        """What is told of it."""
        return (
            f"contacts in {counted(self.frames, 'frame')}: gaps between the skins off by {self.error:.1f} % of "
            f"height on average, worst in frame {self.worst.frame} ({' - '.join(self.worst.parts)})"
        )


@dataclass(frozen=True, eq=False)
class _Both:
    """Two bodies as one, with the joints of the first before those of the second; moves as `find_depths` needs it."""

    motions: Sequence[Motion]

    @property
    def positions(self) -> Array:
        return np.concatenate([each.positions for each in self.motions], axis=1)

    def world_rotations_in(self, frames: slice) -> Array:
        return np.concatenate([each.world_rotations_in(frames) for each in self.motions], axis=1)


def measure_skin_gap(
    sources: Sequence[Motion], results: Sequence[Motion], source_skins: Sequence[Skin], skins: Sequence[Skin]
) -> SkinGap | None:
    """Measure the gaps of two performers' skins in source and result, with the same frames; None where none touch."""
    touches: list[Touch] = []
    for one, other in ((0, 1), (1, 0)):
        for block in blocks_of(len(sources[0])):
            gaps = _gaps(sources, source_skins, one, other, block, TOUCHING)
            touching = gaps < TOUCHING
            if not touching.any():
                continue
            after = _gaps(results, skins, one, other, block, np.inf)
            for frame, limb in zip(*np.nonzero(touching.any(axis=2)), strict=True):
                part = int(gaps[frame, limb].argmin())
                gap = gaps[frame, limb, part]
                now = after[frame, limb][PLACE[:-1] == PLACE[part]].min()
                error = float(max(now - max(gap, 0.0), gap - now, 0.0))
                own, others = str(LIMBS[limb]), str(SEGMENTS[part])
                touches.append(Touch(block.start + int(frame), error, (own, others) if one == 0 else (others, own)))
    return SkinGap(tuple(touches)) if touches else None


def _gaps(
    motions: Sequence[Motion], skins: Sequence[Skin], one: int, other: int, frames: slice, farthest: float
) -> Array:
    """(frames, limbs, segments), the gaps between the hands and forearms of one performer and all of the other, up to
    the `farthest` [% of the mean height]; infinite where there is none.
    """
    clusters, height = skins[other].clusters, (skins[0].height + skins[1].height) / 2.0
    groups = clusters.groups.copy()
    groups[:, 0] += len(motions[one].skeleton)
    there = np.isin(np.arange(len(SEGMENTS)), groups[:-1, 1])
    reach = np.where(there, farthest / 100.0 * height, -np.inf) * np.ones((1, len(LIMBS), 1))
    both = cast(Motion, _Both([motions[one], motions[other]]))
    found = find_depths(skins[one].patches, replace(clusters, groups=groups), both, frames, reach)
    return np.where(there, -100.0 / height * found.depths, np.inf)
