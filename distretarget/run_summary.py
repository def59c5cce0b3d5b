"""What a run reports: the line at its end, joints without a counterpart, and its figures as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import quoted
from distretarget.matching.matching import Matching
from distretarget.measure.figures import BY_KEY, Figure, figures_at, frame_figures
from distretarget.result import RetargetResult


def summary_line(result: RetargetResult, seconds: float) -> str:
    """One line for the end of a run: figures of rotation copy and result, and the frame of most stress."""
    figures, stress = result.figures, BY_KEY["stress"]
    worst = int(np.argmax(result.written_stress))
    values = ", ".join(
        f"{_named(figure)} {figure.brief(figures['rotation_copy'][figure.key])}"
        f" / {figure.brief(figures['result'][figure.key])}"
        for figure in figures_at("line")
    )
    points = result.free_stress
    solved = "" if points is None else f"; stress of the solved points {stress.brief(float(points.mean()))}"
    return (
        f"{len(result.motion)} frames in {seconds:.2f} s; rotation copy / result: {values}{solved}; "
        f"most stress in frame {worst} ({stress.brief(float(result.written_stress[worst]))})"
    )


def unmatched(matching: Matching) -> Iterator[str]:
    """A line with the joints that follow their parents, if there are any."""
    if joints := matching.followers:
        many = f"{len(joints)} joints of the target have no counterpart and follow their parents"
        one = "1 joint of the target has no counterpart and follows its parent"
        yield f"{one if len(joints) == 1 else many}: {quoted(joints)}"


def figures_json(result: RetargetResult) -> str:
    """The figures as JSON: those of the clip, then one list per figure with an entry per frame."""
    effort = result.effort
    frames: dict[str, list[object]] = {
        **_columns(frame_figures(result.tracks, len(result.motion))),
        "iterations": effort.iterations.tolist(),
        "evaluations": effort.evaluations.tolist(),
        "reason": list[object](effort.reason_names),
    }
    if result.free_stress is not None:
        frames["stress_solved_points"] = result.free_stress.tolist()
    document = {
        "format": "distretarget-figures",
        "version": 1,
        "frame_time": result.motion.frame_time,
        "root_scale": result.root_scale,
        "figures": result.figures,
        "frames": frames,
    }
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def _named(figure: Figure) -> str:
    return f"{figure.label} [{figure.symbol}]" if figure.symbol else figure.label


def _columns(values: Mapping[str, NDArray[np.float64]]) -> dict[str, list[object]]:
    """Lists of JSON values, null for nan."""
    return {key: [value if math.isfinite(value) else None for value in row.tolist()] for key, row in values.items()}
