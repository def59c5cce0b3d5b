"""Whole motions, which the paper leaves to future work: every sample clip on the skeleton of Table I."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from clips import SAMPLES
from paper_case import case
from paper_starts import STUDIED, from_before_moved, mirrored, solve_all

CLIPS = tuple(sorted(path.stem for path in SAMPLES.glob("*.bvh")))


@dataclass(frozen=True, kw_only=True)
class MotionRow:
    """Figures of a clip on one body, or their means over bodies; each field has several, in this order.

    Attributes:
        sigma: mean over the frames, of rotation copy, points and exact bones [m^2].
        contact_error, direction_error: of rotation copy, exact bones and contact [D], [degrees].
        slide: of resting feet, of the source, rotation copy, exact bones and contact [leg lengths/s].
        jerk: of exact bones and contact, over the rotation copy's.
        iterations: per frame, of points, exact bones and contact.
        unsolved: the share of frames that did not converge, of points, exact bones and contact.
        mirrored: the share of frames whose points are mirrored: started from the rotation copy; from the frame before,
            moved as the copy.
    """

    sigma: tuple[float, ...]
    contact_error: tuple[float, ...]
    direction_error: tuple[float, ...]
    slide: tuple[float, ...]
    jerk: tuple[float, ...]
    iterations: tuple[float, ...]
    unsolved: tuple[float, ...]
    mirrored: tuple[float, ...]


def motion_rows() -> Iterator[tuple[str, MotionRow]]:
    """Each sample clip, and its means over the bodies of `STUDIED`."""
    for clip in CLIPS:
        rows = [motion_row(clip, edit) for edit in STUDIED]
        names = [field.name for field in fields(MotionRow)]
        yield clip, MotionRow(**{name: tuple(np.mean([getattr(row, name) for row in rows], axis=0)) for name in names})


def motion_row(clip: str, edit: str) -> MotionRow:
    """The figures of a clip after one edit."""
    one = case(edit, clip)
    points = one.paper.postures
    efforts = points.effort, one.paper.effort, one.contact.effort
    copy_jerk, *jerks = one.figures("jerk")
    from_copy = mirrored(points.positions, one)
    from_before = mirrored(solve_all(one, from_before_moved).points, one)
    return MotionRow(
        sigma=tuple(one.sigma(positions).mean() for positions in list(one.postures().values())[:3]),
        contact_error=one.figures("contact_error"),
        direction_error=one.figures("direction_error"),
        slide=(one.paper.figures["source"]["slide"], *one.figures("slide")),
        jerk=tuple(jerk / copy_jerk for jerk in jerks),
        iterations=tuple(effort.iterations.mean() for effort in efforts),
        unsolved=tuple(len(effort.unsolved) / len(one.source) for effort in efforts),
        mirrored=(from_copy, from_before),
    )
