"""The diff of two scenes as one document, to be written as JSON or, frame by frame, as CSV.

`scene_diff.schema.json` describes the document key by key; the types here have the same keys.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, TypedDict

from distretarget.measure.scene_gaps import Gap, SceneDiff
from distretarget.report.diff_document import About, DiffDocument, DiffLimit, Program, csv_text, rounded

GAP_ERROR = "gap_error"  # the figure of a whole scene


class DiffGaps(TypedDict):
    """The gaps between two parts of a scene that touch in A [% of leg length]."""

    between: list[str]
    regions: list[str]
    joints: list[str]
    worst_frame: int
    frames: int
    gap_a: float
    gap_b: float
    gap_error: float


class SceneDiffDocument(TypedDict):
    """The numbers of a diff of two scenes. Limits of figures other than `GAP_ERROR` stand with the performers."""

    format: Literal["distretarget-scene-diff"]
    version: Literal[1]
    a: str
    b: str
    program: Program
    world_scale: float
    gap_a: float | None
    gap_b: float | None
    gap_error: float | None
    limits: list[DiffLimit]
    performers: dict[str, DiffDocument]
    props: list[str]
    gaps: list[DiffGaps]


def scene_document(
    diff: SceneDiff, performers: Mapping[str, DiffDocument], props: Sequence[str], about: About
) -> SceneDiffDocument:
    """The diff of two scenes as JSON values. `performers` are the documents of the performers by name, `props` the
    names of the props; `about` has the limits of `GAP_ERROR`.
    """
    gap_a, gap_b, error = (None if gap is None else _percent(gap) for gap in diff.mean_gaps or (None, None, None))
    names = [*performers, *props]
    return {
        "format": "distretarget-scene-diff",
        "version": 1,
        "a": about.a,
        "b": about.b,
        "program": {"version": about.version, "command": about.command},
        "world_scale": diff.world_scale,
        "gap_a": gap_a,
        "gap_b": gap_b,
        "gap_error": error,
        "limits": [
            {"figure": key, "limit": limit, "value": error, "over": error is not None and error > limit}
            for key, limit in about.limits
        ],
        "performers": dict(performers),
        "props": list(props),
        "gaps": [_gaps(gaps, names) for gaps in diff.gaps],
    }


def scene_csv(document: SceneDiffDocument) -> str:
    """The frames of all performers as CSV: a row of keys, then a row for each performer and frame."""
    performers = document["performers"].items()
    return csv_text([{"performer": name, **frame} for name, one in performers for frame in one["frames"]])


def part(between: Sequence[str], regions: Sequence[str]) -> str:
    """What touches, in words: "lead's left hand - chair"."""
    return " - ".join(f"{name}'s {region}" if region else name for name, region in zip(between, regions, strict=True))


def _gaps(gaps: Gap, names: Sequence[str]) -> DiffGaps:
    return {
        "between": [names[number] for number in gaps.between],
        "regions": list(gaps.regions),
        "joints": list(gaps.joints),
        "worst_frame": gaps.worst_frame,
        "frames": gaps.frames,
        "gap_a": _percent(gaps.a),
        "gap_b": _percent(gaps.b),
        "gap_error": _percent(gaps.error),
    }


def _percent(gap: float) -> float:
    return rounded(100.0 * gap)
