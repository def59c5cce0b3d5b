"""A run in words and numbers: its verdict and metrics as lines, and its metrics as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal, TypedDict

import numpy as np

from distretarget.errors import counted
from distretarget.measure.metrics import BY_KEY, Variant, frame_metrics, metrics_at
from distretarget.pipeline.result import RetargetResult
from distretarget.report.diff_document import json_text


class RunMetricsDocument(TypedDict):
    """The metrics of a run, with the keys and units of `measure.metrics.METRICS`.

    Attributes:
        format, version: of the document.
        frame_time: the time between frames [s].
        root_scale: target units per source unit of the root's path.
        verdict: what was kept and what changed, in a sentence.
        warnings: a line each.
        metrics: of the whole clip, for source, rotation copy and result; None where nothing was to be measured.
        frames: columns with an entry for each frame: the metrics, with `_source` or `_copy` after their keys for source
            and rotation copy; the solver's `iterations` and `evaluations`, and the `reason` why it stopped; with the
            paper's objective `stress_solved_points`.
    """

    format: Literal["distretarget-metrics"]
    version: Literal[1]
    frame_time: float
    root_scale: float
    verdict: str
    warnings: Sequence[str]
    metrics: Mapping[Variant, Mapping[str, float | None]]
    frames: Mapping[str, Sequence[float | str | None]]


def summary_line(result: RetargetResult, seconds: float) -> str:
    """The last line of a run: its frames, its time, and the verdict on the result."""
    return f"{counted(len(result.motion), 'frame')} in {seconds:.2f} s. {result.verdict}"


def metrics_line(result: RetargetResult) -> str:
    """One line with the metrics of rotation copy and result, and the frame of most stress."""
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
    """The metrics of a run as JSON: those of the whole clip, and those of each frame."""
    columns = frame_metrics(result.tracks, len(result.motion))
    frames: dict[str, Sequence[float | str | None]] = {
        **{key: [value if math.isfinite(value) else None for value in row.tolist()] for key, row in columns.items()},
        "iterations": result.effort.iterations.tolist(),
        "evaluations": result.effort.evaluations.tolist(),
        "reason": result.effort.reason_names,
    }
    if result.free_stress is not None:
        frames["stress_solved_points"] = result.free_stress.tolist()
    document: RunMetricsDocument = {
        "format": "distretarget-metrics",
        "version": 1,
        "frame_time": result.motion.frame_time,
        "root_scale": result.root_scale,
        "verdict": result.verdict,
        "warnings": result.warnings,
        "metrics": result.metrics,
        "frames": frames,
    }
    return json_text(document)
