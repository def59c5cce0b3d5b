"""A diff or a run as a document of numbers, for JSON, or CSV with a row for each frame; and summary lines of a run.

`diff.schema.json` describes every key of a diff, and `measure.metrics.METRICS` has the keys of metrics.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, SupportsFloat, TypedDict

import numpy as np

from distretarget.body.conventions import convention_of
from distretarget.errors import counted
from distretarget.measure.diff import Diff
from distretarget.measure.metrics import BY_KEY, Tracks, Variant, clip_limits, clip_metrics, frame_metrics, metrics_at
from distretarget.pipeline.result import RetargetResult
from distretarget.report.page import VERSION
from distretarget.skeleton import Skeleton

FORMULAS = ("=", "+", "-", "@", "\t")  # a text that begins with one of these is a formula to spreadsheets
MetricValues = Mapping[str, float | None]
"""Metrics by key; None where nothing was measured."""
Values = Mapping[str, Any]
"""A part of a document, with keys as in its schema."""
DECIMALS = 12  # of the numbers in documents: fewer than doubles have, so that rounding errors vanish


def csv_text(rows: Sequence[Mapping[str, object]]) -> str:
    """Return rows with the same keys as CSV: a row of keys, then each row; None is an empty cell."""
    return "".join(csv_lines([*rows[0]], rows))


def csv_lines(columns: Sequence[str], rows: Iterable[Mapping[str, object]]) -> Iterator[str]:
    """Yield the lines of a table: the names of its columns, then each row; a missing value is an empty cell, and a text
    that a spreadsheet would run as a formula has an apostrophe before it.
    """
    line = io.StringIO()
    table = csv.writer(line, lineterminator="\n")
    for cells in chain([columns], (map(row.get, columns) for row in rows)):
        table.writerow([_plain(cell) if isinstance(cell, str) else cell for cell in cells])
        yield line.getvalue()
        line.seek(0)
        line.truncate()


def _plain(text: str) -> str:
    """The text of a cell; a carriage return, which ends the row for some readers, becomes a space."""
    text = text.replace("\r", " ")
    return f"'{text}" if text.startswith(FORMULAS) else text


class Table(TypedDict):
    """A table below the player; integer cells are frames, and become buttons that go there."""

    title: str
    columns: list[str]
    rows: list[list[str | int]]


@dataclass(frozen=True, eq=False, kw_only=True)
class About:
    """The contents of a document besides the numbers of its diff."""

    a: str  # the name of A's file
    b: str
    command: str = ""  # the command line that made the diff, if any
    rotation_copy: Tracks | None = None  # of the run, as verdict and warnings are, if B was made from A
    verdict: str = ""
    warnings: tuple[str, ...] = ()
    limits: tuple[tuple[str, float], ...] = ()  # keys of metrics, each with the largest value allowed


def document(diff: Diff, about: About) -> Values:
    """The diff as JSON values; None where nothing was measured."""
    sides: dict[Variant, Tracks] = {"source": diff.comparison.source_tracks, "result": diff.tracks}
    frames = _frames(diff, sides)
    a, b, drivers = diff.matching.source.skeleton, diff.matching.target.skeleton, diff.matching.drivers
    source, result = _of_clip(sides["source"]), _of_clip(sides["result"])
    copy = None if about.rotation_copy is None else _of_clip(about.rotation_copy)
    return {
        "format": "distretarget-diff",
        "version": 1,
        "a": _body(about.a, a),
        "b": _body(about.b, b),
        "program": {"version": VERSION, "command": about.command},
        "verdict": about.verdict,
        "warnings": list(about.warnings),
        "notes": list(diff.notes),
        "frame_time": diff.b.frame_time,
        "frame_count": len(diff),
        "unmatched_b": [b.keys[joint] for joint in b.joints if drivers[joint] < 0],
        "unmatched_a": [a.keys[joint] for joint in a.joints if joint not in drivers],
        "contact_frames": int(np.count_nonzero(diff.comparison.contacts.counts)),
        "metrics": {
            "source": source,
            "rotation_copy": copy,
            "result": result,
            "limits": clip_limits({"source": source, "rotation_copy": copy or {}, "result": result}),
        },
        "limits": [
            judged(key, limit, _known(BY_KEY[key].judgement(result[key], source.get(key))))
            for key, limit in about.limits
        ],
        "worst": {metric.key: _worst(frames[metric.key]) for metric in metrics_at("worst frames")},
        "frames": [dict(zip(frames, row, strict=True)) for row in zip(*frames.values(), strict=True)],
        "contacts": _contacts(diff),
    }


def json_text(document: Mapping[str, object]) -> str:
    """The document as JSON."""
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def rounded(value: SupportsFloat) -> float:
    """The number rounded to `DECIMALS`, 0 without a sign."""
    return round(float(value), DECIMALS) + 0.0


def _known(value: SupportsFloat | None) -> float | None:
    """The number rounded; None for nan, infinity and None."""
    return None if value is None or not math.isfinite(value) else rounded(value)


def _body(file: str, skeleton: Skeleton) -> Values:
    return {"file": file, "joints": len(skeleton.joints), "convention": convention_of(skeleton)}


def _of_clip(tracks: Tracks) -> MetricValues:
    return {key: _known(value) for key, value in clip_metrics(tracks).items()}


def judged(key: str, limit: float, value: float | None) -> Values:
    """A limit of a metric, and whether the value that it limits is over it."""
    return {"metric": key, "limit": limit, "value": value, "over": value is not None and value > limit}


def _frames(diff: Diff, sides: Mapping[Variant, Tracks]) -> dict[str, list[float | None]]:
    """The columns of the table of frames, by key."""
    count = np.arange(len(diff))
    return {
        "frame": count.tolist(),
        "time": [rounded(time) for time in count * diff.b.frame_time],
        "contacts": diff.comparison.contacts.counts.tolist(),
        "stance": diff.comparison.stance.sum(axis=1).tolist(),
        "supports": diff.comparison.others_rest.sum(axis=1).tolist(),
        **{key: [*map(_known, values)] for key, values in frame_metrics(sides, len(diff)).items()},
    }


def _worst(column: list[float | None]) -> int | None:
    """The frame of the largest value; None where there is none."""
    known = [(value, -frame) for frame, value in enumerate(column) if value is not None]
    return -max(known)[1] if known else None


def _contacts(diff: Diff) -> list[Values]:
    drivers = diff.matching.drivers
    a, b = diff.matching.source.skeleton.keys, diff.matching.target.skeleton.keys
    return [
        {
            "regions": touch.name,
            "joints_a": [a[drivers[touch.u]], a[drivers[touch.v]]],
            "joints_b": [b[touch.u], b[touch.v]],
            "frames": len(touch.frames),
            "distance_a": rounded(touch.distance_source),
            "distance_b": rounded(touch.distance_result),
            "error": rounded(touch.error),
            "worst_frame": touch.worst_frame,
        }
        for touch in diff.comparison.contacts.touches
    ]


def summary_line(result: RetargetResult, seconds: float) -> str:
    """The last line of a run: the number of frames, the time, and the verdict on the result."""
    return f"{counted(len(result.motion), 'frame')} in {seconds:.2f} s. {result.verdict}"


def metrics_line(result: RetargetResult) -> str:
    """One line with the metrics of rotation copy and result, and the frame with the most stress."""
    metrics, stress = result.metrics, BY_KEY["stress"]
    worst = int(np.argmax(result.written_stress))
    values = ", ".join(
        f"{metric.label}{f' [{metric.symbol}]' if metric.symbol else ''} "
        f"{metric.brief(metrics['rotation_copy'][metric.key])} / {metric.brief(metrics['result'][metric.key])}"
        for metric in metrics_at("line")
    )
    points = result.free_stress
    solved = "" if points is None else f"; stress of the solved points {stress.brief(float(points.mean()))}"
    return (
        f"rotation copy / result: {values}{solved}; "
        f"most stress in frame {worst} ({stress.brief(float(result.written_stress[worst]))})"
    )


def metrics_json(result: RetargetResult) -> str:
    """The metrics of a run as JSON: of the clip and of each frame, by key and suffix, and the solver's steps."""
    columns = frame_metrics(result.tracks, len(result.motion))
    frames = {key: [value if math.isfinite(value) else None for value in row.tolist()] for key, row in columns.items()}
    effort, stress = result.effort, result.free_stress
    document = {
        "format": "distretarget-metrics",
        "version": 1,
        "frame_time": result.motion.frame_time,
        "root_scale": result.root_scale,
        "verdict": result.verdict,
        "warnings": result.warnings,
        "metrics": result.metrics,
        "frames": {
            **frames,
            "iterations": effort.iterations.tolist(),
            "evaluations": effort.evaluations.tolist(),
            "reason": effort.reason_names,
            **({} if stress is None else {"stress_solved_points": stress.tolist()}),
        },
    }
    return json_text(document)
