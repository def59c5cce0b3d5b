"""The diff of two scenes as one document, for JSON, CSV with a row for each frame, and tables of gaps and metrics.

`scene_diff.schema.json` describes every key; the types here have the same keys.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, TypedDict

from distretarget.measure.diff import SceneDiff
from distretarget.measure.gaps import Gap
from distretarget.measure.metrics import METRICS
from distretarget.report.diff_document import About, DiffDocument, DiffLimit, Program, csv_text, rounded

GAP_ERROR = "gap_error"  # the metric of a whole scene


class DiffGaps(TypedDict):
    """The gaps between two parts of a scene that touch in A [% of leg length]."""

    between: list[str]
    regions: list[str]
    joints: list[str]
    worst_frame: int
    frames: int
    gap_a: float
    gap_b: float
    gap_worst: float
    gap_error: float


class SceneDiffDocument(TypedDict):
    """The numbers of a diff of two scenes; performers have the limits of metrics other than `GAP_ERROR`."""

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


class Table(TypedDict):
    """A table below the player; an integer cell is the number of a frame, and becomes a button that goes there."""

    title: str
    columns: list[str]
    rows: list[list[str | int]]


def scene_document(
    diff: SceneDiff, performers: Mapping[str, DiffDocument], props: Sequence[str], about: About
) -> SceneDiffDocument:
    """The diff of two scenes as JSON values, from the documents of the performers and the names of the props.

    `about` has the limits of `GAP_ERROR`.
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
            {"metric": key, "limit": limit, "value": error, "over": error is not None and error > limit}
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


def gap_table(document: SceneDiffDocument) -> Table:
    """The gaps between regions that touch in A, the longest contact first."""
    rows: list[list[str | int]] = [
        [
            _touching(gaps),
            str(gaps["frames"]),
            *(f"{gaps[key]:.1f}" for key in ("gap_a", "gap_b", "gap_worst", "gap_error")),
            gaps["worst_frame"],
        ]
        for gaps in document["gaps"]
    ]
    title = "Mean gap where they touch in A, in % of a leg of A\u2019s world"
    return {
        "title": title,
        "columns": ["between", "frames", "A", "B", "worst 1 % in B", "error", "worst frame"],
        "rows": rows,
    }


def metric_table(document: SceneDiffDocument) -> Table:
    """The metrics of all performers: of A, where it has one, and of B."""
    sides = [one["metrics"][side] for one in document["performers"].values() for side in ("source", "result")]
    rows: list[list[str | int]] = []
    for metric in METRICS:
        name = f"{metric.label}, {metric.symbol}" if metric.symbol else metric.label
        rows.append([name, *(metric.brief(side.get(metric.key)) for side in sides)])
    columns = ["metric", *(f"{name} {side}" for name in document["performers"] for side in "AB")]
    return {"title": "Metrics of each performer", "columns": columns, "rows": rows}


def _touching(gaps: DiffGaps) -> str:
    """What touches, in words: "lead's left hand - chair"."""
    parts = zip(gaps["between"], gaps["regions"], strict=True)
    return " - ".join(f"{name}'s {region}" if region else name for name, region in parts)


def _gaps(gaps: Gap, names: Sequence[str]) -> DiffGaps:
    return {
        "between": [names[number] for number in gaps.between],
        "regions": list(gaps.regions),
        "joints": list(gaps.joints),
        "worst_frame": gaps.worst_frame,
        "frames": gaps.frames,
        "gap_a": _percent(gaps.a),
        "gap_b": _percent(gaps.b),
        "gap_worst": _percent(gaps.worst),
        "gap_error": _percent(gaps.error),
    }


def _percent(gap: float) -> float:
    return rounded(100.0 * gap)
