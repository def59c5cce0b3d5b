"""What a run says of itself: the line at the end, the warnings, and the figures of each frame as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import quoted
from distretarget.measure.metrics import Comparison, compare
from distretarget.retargeting import RetargetResult
from distretarget.solve.spg import Reason

REACH = 0.005  # a resting foot so far [of twice the leg length] off its place is told


class Figures:
    """The figures of a run and of the rotation copy, both against the source."""

    def __init__(self, result: RetargetResult) -> None:
        self.result = result
        self.copied, self.reached = (
            compare(result.source, motion, result.matching, result.world.up_vector)
            for motion in (result.copy, result.motion)
        )

    def line(self, seconds: float) -> str:
        """One line for the end of a run: rotation copy / result of each figure, and the frame of most stress."""
        result, copied, reached = self.result, self.copied.means(), self.reached.means()
        worst = int(np.argmax(result.written_stress))
        smoothness = reached["jerk"] / copied["jerk"] if copied["jerk"] > 0 else 1.0
        return (
            f"{len(result.motion)} frames in {seconds:.2f} s; rotation copy / result: "
            f"contact error {copied['contact_error']:.4f} / {reached['contact_error']:.4f}, "
            f"slide {copied['slide']:.3f} / {reached['slide']:.3f}, "
            f"direction error {copied['direction_error']:.1f} / {reached['direction_error']:.1f}, "
            f"jerk 1 / {smoothness:.2f}, stress x 1000 {self._stress()}; "
            f"worst frame {worst} ({1e3 * result.written_stress[worst]:.3g})"
        )

    def _stress(self) -> str:
        result = self.result
        copy, written = 1e3 * result.copy_stress.mean(), 1e3 * result.written_stress.mean()
        free = "" if result.free_stress is None else f" (solved points {1e3 * result.free_stress.mean():.3g})"
        return f"{copy:.3g} / {written:.3g}{free}"

    def unmatched(self) -> Iterator[str]:
        """The joints that follow their parents, if there are any."""
        if joints := self.result.matching.followers:
            many = f"{len(joints)} joints of the target have no counterpart and follow their parents"
            one = "1 joint of the target has no counterpart and follows its parent"
            yield f"{one if len(joints) == 1 else many}: {quoted(joints)}"

    def warnings(self) -> Iterator[str]:
        """Frames that did not converge, and feet that did not reach their place."""
        frames = len(self.result.motion)
        unsolved = self.result.effort.unsolved
        if len(unsolved):
            reasons = sorted({_name(reason) for reason in self.result.effort.reasons[unsolved]})
            first = f"(first: frame {unsolved[0]}; {', '.join(reasons)})"
            yield f"{len(unsolved)} of {frames} frames did not converge {first}"
        short = np.flatnonzero(self._unreached())
        if len(short):
            missed = f"in {len(short)} of {frames} frames (first: frame {short[0]})"
            yield f"a resting foot does not reach its place {missed}"

    def _unreached(self) -> NDArray[np.bool_]:
        """(frames,), whether a resting foot is off its place."""
        stance = self.result.stance
        off = np.linalg.norm(self.result.motion.positions[:, stance.joints] - stance.places, axis=-1)
        limit = REACH * self.result.matching.target.unit
        return np.asarray(((off > limit) & (stance.weights > 0.99)).any(axis=1))

    def means(self) -> dict[str, dict[str, float]]:
        """The figures of the whole clip, of the rotation copy and of the result, with the mean stress of each."""
        stress = self.result.copy_stress, self.result.written_stress
        return {
            name: {"stress": float(values.mean()), **figures.means()}
            for name, values, figures in zip(
                ("rotation_copy", "result"), stress, (self.copied, self.reached), strict=True
            )
        }

    def json(self) -> str:
        """The figures as JSON: what holds for the clip, then one list per figure with an entry per frame."""
        result = self.result
        effort = result.effort
        frames: dict[str, list[object]] = {
            "stress_rotation_copy": result.copy_stress.tolist(),
            "stress_written": result.written_stress.tolist(),
            "iterations": effort.iterations.tolist(),
            "evaluations": effort.evaluations.tolist(),
            "reason": [_name(reason) for reason in effort.reasons],
            **{f"{name}_rotation_copy": values for name, values in _per_frame(self.copied).items()},
            **_per_frame(self.reached),
        }
        if result.free_stress is not None:
            frames["stress_solved_points"] = result.free_stress.tolist()
        document = {
            "format": "distretarget-figures",
            "version": 1,
            "frame_time": result.motion.frame_time,
            "root_scale": result.root_scale,
            **self.means(),
            "frames": frames,
        }
        return json.dumps(document, indent=1, allow_nan=False) + "\n"


def _name(reason: int) -> str:
    return Reason(int(reason)).name.lower().replace("_", " ")


def _per_frame(figures: Comparison) -> dict[str, list[object]]:
    """A figure per frame; null where a frame has no contact pair."""
    pairs = np.maximum(figures.contacts, 1)
    contact = figures.contact_error / pairs
    return {
        "distance_error": figures.distance_error.tolist(),
        "contact_error": [
            value if count else None for value, count in zip(contact.tolist(), figures.contacts, strict=True)
        ],
        "direction_error": figures.direction_error.mean(axis=1).tolist() if figures.direction_error.size else [],
        "bone_error": figures.bone_error.tolist(),
    }
