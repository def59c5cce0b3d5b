"""The numbers of a diff as one document, to be written as JSON or, frame by frame, as CSV."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import SupportsFloat

import numpy as np
from numpy.typing import NDArray

from distretarget.body.conventions import convention_of
from distretarget.measure.diff import Diff
from distretarget.measure.figures import BY_KEY, Tracks, Variant, clip_figures, clip_limits, figures_at, frame_figures
from distretarget.report.document_types import DiffBody, DiffContact, DiffDocument, DiffLimit, FigureValues
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

DECIMALS = 12  # that a number is rounded to, so that rounding errors vanish


@dataclass(frozen=True, eq=False, kw_only=True)
class About:
    """What a document says besides the numbers of its diff.

    Attributes:
        a, b: the names of the files.
        command: the command line that made the diff, "" if none.
        version: of this package.
        rotation_copy: what the figures of the rotation copy are taken from, where B was made from A.
        verdict: what was kept and what changed in a plain sentence, where B was made from A.
        warnings: what needs a look, a line each, where B was made from A.
        limits: keys of figures, each with the limit that it is to stay at or below.
    """

    a: str
    b: str
    command: str
    version: str
    rotation_copy: Tracks | None = None
    verdict: str = ""
    warnings: tuple[str, ...] = ()
    limits: tuple[tuple[str, float], ...] = ()


def document(diff: Diff, about: About) -> DiffDocument:
    """The diff as JSON values that follow `diff.schema.json`; None where nothing was to be measured."""
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
        "program": {"version": about.version, "command": about.command},
        "verdict": about.verdict,
        "warnings": list(about.warnings),
        "notes": list(diff.notes),
        "frame_time": diff.b.frame_time,
        "frame_count": len(diff),
        "unmatched_b": [b.keys[joint] for joint in b.joints if drivers[joint] < 0],
        "unmatched_a": [a.keys[joint] for joint in a.joints if joint not in drivers],
        "contact_frames": int(np.count_nonzero(diff.comparison.contacts.counts)),
        "figures": {
            "source": source,
            "rotation_copy": copy,
            "result": result,
            "needs_look_above": clip_limits({"source": source, "rotation_copy": copy or {}, "result": result}),
        },
        "limits": [_limit(key, limit, result[key], source.get(key)) for key, limit in about.limits],
        "worst": {figure.key: _worst(frames[figure.key]) for figure in figures_at("worst frames")},
        "frames": [dict(zip(frames, row, strict=True)) for row in zip(*frames.values(), strict=True)],
        "contacts": _contacts(diff),
    }


def json_text(document: Mapping[str, object]) -> str:
    """The document as JSON."""
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def csv_text(document: DiffDocument) -> str:
    """The frames of the document as CSV: a row of keys, then a row per frame, with an empty cell for None."""
    text = io.StringIO()
    table = csv.DictWriter(text, list(document["frames"][0]), lineterminator="\n")
    table.writeheader()
    table.writerows(document["frames"])
    return text.getvalue()


def _body(file: str, skeleton: Skeleton) -> DiffBody:
    return {"file": file, "joints": len(skeleton.joints), "convention": convention_of(skeleton)}


def _of_clip(tracks: Tracks) -> FigureValues:
    """The figures of the whole clip, by key."""
    return {key: None if value is None else _rounded(value) for key, value in clip_figures(tracks).items()}


def _limit(key: str, limit: float, value: float | None, source: float | None) -> DiffLimit:
    """A limit of a figure, the number that it is for, and whether that is over it."""
    judged = BY_KEY[key].judgement(value, source)
    number = None if judged is None else _rounded(judged)
    return {"figure": key, "limit": limit, "value": number, "over": number is not None and number > limit}


def _frames(diff: Diff, sides: Mapping[Variant, Tracks]) -> dict[str, list[float | None]]:
    """The columns of the frames, each with a value or None for every frame."""
    count = np.arange(len(diff))
    return {
        "frame": count.tolist(),
        "time": _column(np.multiply(count, diff.b.frame_time)),
        "contacts": diff.comparison.contacts.counts.tolist(),
        "stance": diff.comparison.feet.stance.sum(axis=1).tolist(),
        "supports": diff.comparison.supports.rest.sum(axis=1).tolist(),
        **{key: _column(values) for key, values in frame_figures(sides, len(diff)).items()},
    }


def _column(values: Array) -> list[float | None]:
    return [_rounded(value) for value in values]


def _worst(column: list[float | None]) -> int | None:
    """The frame of the largest value; None where there is none."""
    known = [(value, -frame) for frame, value in enumerate(column) if value is not None]
    return -max(known)[1] if known else None


def _contacts(diff: Diff) -> list[DiffContact]:
    drivers = diff.matching.drivers
    a, b = diff.matching.source.skeleton.keys, diff.matching.target.skeleton.keys
    return [
        {
            "regions": touch.name,
            "joints_a": [a[drivers[touch.u]], a[drivers[touch.v]]],
            "joints_b": [b[touch.u], b[touch.v]],
            "frames": len(touch.frames),
            "distance_a": _round(touch.distance_source),
            "distance_b": _round(touch.distance_result),
            "error": _round(touch.error),
            "worst_frame": touch.worst_frame,
        }
        for touch in diff.comparison.contacts.touches
    ]


def _rounded(value: SupportsFloat) -> float | None:
    """The number rounded; None for nan and infinity."""
    return _round(value) if math.isfinite(value) else None


def _round(value: SupportsFloat) -> float:
    """The number rounded to `DECIMALS`, 0 without a sign."""
    return round(float(value), DECIMALS) + 0.0
