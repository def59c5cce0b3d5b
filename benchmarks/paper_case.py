"""The paper's experiment: a motion on the skeleton of its Table I, and the same skeleton with other bone lengths."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from clips import SAMPLES
from edits import ARMS, LEGS, edited
from skeleton_edits import only

from distretarget import Motion, Options, RetargetResult, Skeleton, read_bvh, retarget
from distretarget.baseline.rotation_copy import RootScale, find_root_scale, rotation_copy
from distretarget.body.body import Body
from distretarget.distances import DistanceProblem, distance_problem, posture_stress
from distretarget.matching.matching import match
from distretarget.numerics.vectors import Array, angles_between

METRES = 0.01  # per unit of the sample clips, which are in centimetres
POSTURE = 61  # the frame of the walk used as the paper's walking posture: both feet down, legs far apart

GROUPS = {"arms": ARMS, "legs": LEGS, "spine": ("trunk",), "arms, legs, spine": (*ARMS, *LEGS, "trunk")}
"""The parts of the body, by the names in `edits`, that the edits change together."""
PERCENT = (-30, 60)


def _scaled(percents: dict[str, int]) -> dict[str, float]:
    """Factors by part of the body, from percentages by group."""
    return {part: 1 + percent / 100 for group, percent in percents.items() for part in GROUPS[group]}


EDITS: dict[str, dict[str, float]] = {
    **{f"{group} {percent:+d} %": _scaled({group: percent}) for group in GROUPS for percent in PERCENT},
    "arms +60 %, legs -30 %": _scaled({"arms": 60, "legs": -30}),
    "legs +60 %, spine -30 %": _scaled({"legs": 60, "spine": -30}),
    "arms -30 %, spine +60 %": _scaled({"arms": -30, "spine": 60}),
}
"""Factors on bone lengths by part of the body; hips and shoulders keep their widths."""


@cache
def on_table_one(clip: str) -> Motion:
    """A sample clip on the 22 joints of Table I, without its End Sites [m]."""
    motion = read_bvh(SAMPLES / f"{clip}.bvh")
    joints = list(motion.skeleton.joints)
    body = only(motion.skeleton, joints)
    body = replace(body, offsets=METRES * body.offsets, units="m")
    translations = METRES * motion.translations[:, joints]
    return Motion.of_translations(body, translations, motion.rotations[:, joints], motion.frame_time_text)


@dataclass(frozen=True, eq=False)
class Case:
    """A motion, and a target with the same joints and other bone lengths."""

    source: Motion
    target: Skeleton

    @cached_property
    def problem(self) -> DistanceProblem:
        """The paper's distance problem; its points are the joints."""
        return distance_problem(self.source.skeleton, self.target, np.arange(len(self.target)))

    @cached_property
    def paper(self) -> RetargetResult:
        """The paper's objective, over free points and over rotations."""
        return retarget(self.source, self.target, Options(objective="paper"))

    @cached_property
    def contact(self) -> RetargetResult:
        """The contact objective."""
        return retarget(self.source, self.target, Options(objective="contact"))

    @cached_property
    def copy(self) -> Array:
        """(frames, joints, 3), positions of the rotation copy, from which the paper's solver starts [m]."""
        matching = match(Body.of_motion(self.source), Body.of(self.target))
        return rotation_copy(matching, RootScale.even(find_root_scale(matching))).positions

    def postures(self) -> dict[str, Array]:
        """The results of all methods, (frames, joints, 3) each [m]."""
        return {
            "rotation copy": self.copy,
            "paper, points": self.paper.postures.positions,
            "paper, exact bones": self.paper.motion.positions,
            "contact": self.contact.motion.positions,
        }

    def metrics(self, key: str) -> tuple[float, ...]:
        """A metric (`measure.metrics.METRICS`) of rotation copy, paper's exact bones and contact."""
        sides = self.paper.metrics["rotation_copy"], self.paper.metrics["result"], self.contact.metrics["result"]
        return tuple(side[key] or 0.0 for side in sides)

    def sigma(self, points: Array) -> Array:
        """(frames,), Eq. (2) [m^2], of postures (frames, joints, 3) [m]."""
        return posture_stress(self.problem, self.source.positions, points) * self.problem.body_size**2


@cache
def case(edit: str, clip: str = "walk") -> Case:
    """A sample clip, and its own skeleton after one of `EDITS`."""
    source = on_table_one(clip)
    return Case(source, edited(source.skeleton, EDITS[edit]))


# ---- errors of postures


def bones_of(points: Array, case: Case) -> Array:
    """(..., bones, 3), the bones of postures (..., joints, 3), from parent to joint."""
    return np.asarray(points[..., 1:, :] - points[..., case.target.parents[1:], :])


def bone_errors(points: Array, case: Case) -> Array:
    """(..., bones), relative errors of the bone lengths of postures (..., joints, 3)."""
    return np.asarray(np.abs(np.linalg.norm(bones_of(points, case), axis=-1) / case.target.lengths[1:] - 1))


def distance_error(points: Array, source: Array, case: Case) -> Array:
    """(...), the mean of |D_source - D_result| over all pairs, Eq. (1), of postures (..., joints, 3)."""
    u, v = np.triu_indices(len(case.target), 1)
    D_source, D_result = (
        np.linalg.norm(x[..., u, :] - x[..., v, :], axis=-1) / tau[u, v]
        for x, tau in ((source, case.problem.tau1), (points, case.problem.tau2))
    )
    return np.asarray(np.abs(D_source - D_result).mean(axis=-1))


def direction_errors(points: Array, source: Array, case: Case) -> Array:
    """(..., bones), angles between the bones of postures (..., joints, 3) and the source's [degrees]."""
    return np.degrees(angles_between(bones_of(points, case), bones_of(source, case)))


def mirrored(points: Array, case: Case) -> float:
    """The share of frames whose points, (frames, joints, 3), are nearer to the mirror image of the rotation copy."""
    x, copy = (each - each.mean(axis=1, keepdims=True) for each in (points, case.copy))
    return float((np.linalg.det(x.transpose(0, 2, 1) @ copy) < 0).mean())
