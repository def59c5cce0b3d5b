"""What a diff says, as numbers to store and to send on: one document, written as JSON or, frame by frame, as CSV."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import NDArray

from distretarget.body.conventions import convention_of
from distretarget.measure.diff import Diff
from distretarget.measure.metrics import Comparison
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]
Document = dict[str, Any]

DECIMALS = 12  # what is left of a figure; rounding errors are beyond
PAIRS = 100  # in a document, at most
STILL = 1e-3  # feet that slide slower [leg lengths / s] stand still: what is left are digits of the file


@dataclass(frozen=True, eq=False)
class About:
    """What the numbers do not tell.

    Attributes:
        a, b: the names of the files.
        command: the command line that made the diff, "" if none.
        version: of this package.
        copy: the figures of the rotation copy against A, where B was made from A.
        copy_stress: (frames,), its stress, as that of the diff.
        limits: figures by their names on the command line, with what they are to stay at or below.
    """

    a: str
    b: str
    command: str
    version: str
    copy: Comparison | None = None
    copy_stress: Array | None = None
    limits: tuple[tuple[str, float], ...] = ()


def document(diff: Diff, about: About) -> Document:
    """The diff as JSON values, as `diff.schema.json` has it; None where nothing was to be measured."""
    frames = _frames(diff)
    a, b, drivers = diff.matching.source.skeleton, diff.matching.target.skeleton, diff.matching.drivers
    summary = _summary(diff.stress, diff.figures, diff.jerk_a)
    return {
        "format": "distretarget-diff",
        "version": 1,
        "a": _body(about.a, a),
        "b": _body(about.b, b),
        "program": {"version": about.version, "command": about.command},
        "notes": list(diff.notes),
        "frame_time": diff.b.frame_time,
        "frame_count": len(diff),
        "unmatched_b": [b.keys[joint] for joint in b.joints if drivers[joint] < 0],
        "unmatched_a": [a.keys[joint] for joint in a.joints if joint not in drivers],
        "summary": summary,
        "limits": [_limit(summary, name, limit) for name, limit in about.limits],
        "rotation_copy": _rotation_copy(diff, about),
        "worst": {
            name: _worst(frames[name])
            for name in ("stress", "contact_error", "direction_error", "slide_b", "bone_error")
        },
        "frames": [dict(zip(frames, row, strict=True)) for row in zip(*frames.values(), strict=True)],
        "pairs": _pairs(diff),
    }


def json_text(document: Mapping[str, Any]) -> str:
    """The document as JSON."""
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def csv_text(document: Mapping[str, Any]) -> str:
    """The frames of the document as CSV: a head, and a row for each; empty where nothing was to be measured."""
    text = io.StringIO()
    table = csv.DictWriter(text, list(document["frames"][0]), lineterminator="\n")
    table.writeheader()
    table.writerows(document["frames"])
    return text.getvalue()


def _body(file: str, skeleton: Skeleton) -> Document:
    return {"file": file, "joints": len(skeleton.joints), "convention": convention_of(skeleton)}


def _rotation_copy(diff: Diff, about: About) -> Document | None:
    if about.copy is None or about.copy_stress is None:
        return None
    return _summary(about.copy_stress, about.copy, diff.jerk_a)


def _summary(stress: Array, figures: Comparison, jerk_a: Array) -> Document:
    """The figures of the whole clip; `jerk_a` is A's, (frames - 3,)."""
    means = figures.means()
    contacts, bones, stance = figures.contacts.any(), figures.direction_error.size, figures.stance.any()
    summary = {
        "stress": _rounded(stress.mean()),
        "distance_error": _rounded(means["distance_error"]),
        "contact_error": _rounded(means["contact_error"]) if contacts else None,
        "contact_frames": int(np.count_nonzero(figures.contacts)),
        "direction_error": _rounded(means["direction_error"]) if bones else None,
        "direction_error_p99": _rounded(means["direction_error_p99"]) if bones else None,
        "bone_error": _rounded(means["bone_error"]),
        "slide_a": _rounded(means["source_slide"]) if stance else None,
        "slide_b": _rounded(means["slide"]) if stance else None,
        "foot_height_a": _rounded(means["source_foot_height"]) if stance else None,
        "foot_height_b": _rounded(means["foot_height"]) if stance else None,
        "jerk_a": _rounded(jerk_a.mean()) if jerk_a.size else None,
        "jerk_b": _rounded(means["jerk"]) if jerk_a.size else None,
        "turn": _rounded(means["turn"]) if figures.turn.size else None,
    }
    return summary | {
        "slide": _ratio(summary["slide_a"], summary["slide_b"], STILL),
        "jerk": _ratio(summary["jerk_a"], summary["jerk_b"], 0.0),
    }


def _limit(summary: Document, name: str, limit: float) -> Document:
    """A limit, the value that it is for, and whether that is over it."""
    value = _limited(summary, name)
    return {"figure": name, "limit": limit, "value": value, "over": value is not None and value > limit}


def _limited(summary: Document, name: str) -> float | None:
    """The value that a limit of this name is for; None where nothing was to be measured."""
    if name == "foot":
        a, b = summary["foot_height_a"], summary["foot_height_b"]
        return None if a is None else _rounded(abs(b - a))
    if name == "slide":
        a, b = summary["slide_a"], summary["slide_b"]
        return None if a is None else _rounded(b / max(a, STILL))
    value: float | None = summary[f"{name}_error" if name in ("contact", "direction", "bone", "distance") else name]
    return value


def _ratio(a: float | None, b: float | None, nothing: float) -> float | None:
    """B over A; None where A has none, or no more than counts as nothing."""
    return None if a is None or b is None or a <= nothing else _rounded(b / a)


def _frames(diff: Diff) -> dict[str, list[Any]]:
    """The columns of the frames, with a value or None for each."""
    figures, stance, count = diff.figures, diff.figures.stance, np.arange(len(diff))
    return {
        "frame": count.tolist(),
        "time": _column(np.multiply(count, diff.b.frame_time)),
        "stress": _column(diff.stress),
        "distance_error": _column(figures.distance_error),
        "contact_error": _column(_per(figures.contact_error, figures.contacts)),
        "contacts": figures.contacts.tolist(),
        "direction_error": _column(_row_means(figures.direction_error, np.ones(figures.direction_error.shape, bool))),
        "bone_error": _column(figures.bone_error),
        "slide_a": _column(_row_means(figures.source_slide, stance)),
        "slide_b": _column(_row_means(figures.slide, stance)),
        "stance": stance.sum(axis=1).tolist(),
        "jerk_a": _column(_padded(diff.jerk_a, len(diff))),
        "jerk_b": _column(_padded(figures.jerk, len(diff))),
    }


def _row_means(values: Array, where: NDArray[np.bool_]) -> Array:
    """(frames,), the mean of (frames, columns) over the columns where `where`, nan where there is none."""
    return _per(np.where(where, values, 0.0).sum(axis=1), where.sum(axis=1))


def _per(sums: Array, counts: NDArray[np.intp]) -> Array:
    """(frames,), sums over counts, nan where the count is 0."""
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def _padded(values: Array, frames: int) -> Array:
    return np.pad(values, (0, frames - len(values)), constant_values=np.nan)


def _column(values: Array) -> list[float | None]:
    return [_rounded(value) for value in values]


def _worst(column: list[float | None]) -> int | None:
    """The frame of the largest value; None where there is none."""
    known = [(value, -frame) for frame, value in enumerate(column) if value is not None]
    return -max(known)[1] if known else None


def _pairs(diff: Diff) -> list[Document]:
    pairs, drivers = diff.pairs, diff.matching.drivers
    a, b = diff.matching.source.skeleton.keys, diff.matching.target.skeleton.keys
    return [
        {
            "joints_a": [a[drivers[pairs.u[k]]], a[drivers[pairs.v[k]]]],
            "joints_b": [b[pairs.u[k]], b[pairs.v[k]]],
            "contact_frames": int(pairs.contact_frames[k]),
            "distance_a": _rounded(pairs.distance_a[k]),
            "distance_b": _rounded(pairs.distance_b[k]),
            "error": _rounded(pairs.error[k]),
            "worst_frame": int(pairs.worst_frame[k]),
        }
        for k in pairs.worst(PAIRS)
    ]


def _rounded(value: SupportsFloat) -> float | None:
    """The number at so many decimals, 0 without a sign; None for nan and for what no number holds."""
    number = float(value)
    return round(number, DECIMALS) + 0.0 if math.isfinite(number) else None
