"""What a run reports: the line at its end, the warnings, and the figures of the clip and of each frame as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import quoted
from distretarget.measure.figures import BY_KEY, Figure, Side, Track, Tracks, clip_figures, figures_at, frame_figures
from distretarget.measure.metrics import compare
from distretarget.retargeting import RetargetResult
from distretarget.solve.spg import Reason

REACH = 0.005  # [twice the leg length]; a resting foot farther than this from its place is worth a warning


class Figures:
    """The figures of a run: of its source, of the rotation copy, which is the baseline, and of its result."""

    def __init__(self, run: RetargetResult) -> None:
        self.run = run
        self.baseline, self.result = (
            compare(run.source, motion, run.matching, run.world.up_vector) for motion in (run.copy, run.motion)
        )

    @property
    def sides(self) -> dict[Side, Tracks]:
        """What the figures of each motion are taken from."""
        return {
            "source": self.result.source_tracks,
            "rotation_copy": {**self.baseline.tracks, "stress": Track(self.run.copy_stress)},
            "result": {**self.result.tracks, "stress": Track(self.run.written_stress)},
        }

    def line(self, seconds: float) -> str:
        """One line for the end of a run: figures of rotation copy and result, and the frame of most stress."""
        run, of_clip, stress = self.run, self.of_clip(), BY_KEY["stress"]
        worst = int(np.argmax(run.written_stress))
        values = ", ".join(
            f"{_named(figure)} {figure.brief(of_clip['rotation_copy'][figure.key])}"
            f" / {figure.brief(of_clip['result'][figure.key])}"
            for figure in figures_at("line")
        )
        points = run.free_stress
        solved = "" if points is None else f"; stress of the solved points {stress.brief(float(points.mean()))}"
        return (
            f"{len(run.motion)} frames in {seconds:.2f} s; rotation copy / result: {values}{solved}; "
            f"most stress in frame {worst} ({stress.brief(float(run.written_stress[worst]))})"
        )

    def unmatched(self) -> Iterator[str]:
        """The joints that follow their parents, if there are any."""
        if joints := self.run.matching.followers:
            many = f"{len(joints)} joints of the target have no counterpart and follow their parents"
            one = "1 joint of the target has no counterpart and follows its parent"
            yield f"{one if len(joints) == 1 else many}: {quoted(joints)}"

    def warnings(self) -> Iterator[str]:
        """Frames that did not converge, and feet that did not reach their place."""
        frames = len(self.run.motion)
        unsolved = self.run.effort.unsolved
        if len(unsolved):
            reasons = sorted({_name(reason) for reason in self.run.effort.reasons[unsolved]})
            first = f"(first: frame {unsolved[0]}; {', '.join(reasons)})"
            yield f"{len(unsolved)} of {frames} frames did not converge {first}"
        short = np.flatnonzero(self._unreached())
        if len(short):
            missed = f"in {len(short)} of {frames} frames (first: frame {short[0]})"
            yield f"a resting foot does not reach its place {missed}"

    def _unreached(self) -> NDArray[np.bool_]:
        """(frames,), whether a resting foot is away from its place."""
        stance = self.run.stance
        away = np.linalg.norm(self.run.motion.positions[:, stance.joints] - stance.places, axis=-1)
        limit = REACH * self.run.matching.target.unit
        return np.asarray(((away > limit) & (stance.weights > 0.99)).any(axis=1))

    def of_clip(self) -> dict[Side, dict[str, float | None]]:
        """The figures of the whole clip, of each motion; None where nothing was to be measured."""
        return {side: clip_figures(tracks) for side, tracks in self.sides.items()}

    def json(self) -> str:
        """The figures as JSON: those of the clip, then one list per figure with an entry per frame."""
        run, effort = self.run, self.run.effort
        frames: dict[str, list[object]] = {
            **_columns(frame_figures(self.sides, len(run.motion))),
            "iterations": effort.iterations.tolist(),
            "evaluations": effort.evaluations.tolist(),
            "reason": [_name(reason) for reason in effort.reasons],
        }
        if run.free_stress is not None:
            frames["stress_solved_points"] = run.free_stress.tolist()
        document = {
            "format": "distretarget-figures",
            "version": 1,
            "frame_time": run.motion.frame_time,
            "root_scale": run.root_scale,
            "figures": self.of_clip(),
            "frames": frames,
        }
        return json.dumps(document, indent=1, allow_nan=False) + "\n"


def _name(reason: int) -> str:
    return Reason(int(reason)).name.lower().replace("_", " ")


def _named(figure: Figure) -> str:
    return f"{figure.label} [{figure.symbol}]" if figure.symbol else figure.label


def _columns(values: Mapping[str, NDArray[np.float64]]) -> dict[str, list[object]]:
    """Lists of JSON values, null for nan."""
    return {key: [value if math.isfinite(value) else None for value in row.tolist()] for key, row in values.items()}
