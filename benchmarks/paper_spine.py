"""What becomes of the walking posture on a spine +60 %, the edit that the paper remarks on: angles and places."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from paper_case import POSTURE, Case, case
from paper_errors import angles
from paper_solver import Stress

from distretarget import Skeleton

Array = NDArray[np.float64]

EDIT = "spine +60 %"
SPINE = ("Hips", "Chest", "Chest2", "Chest3", "Neck", "Head")
SIDES = ("Left", "Right")
UP = np.array([0.0, 1.0, 0.0])


def spine_rows() -> Iterator[tuple[str, list[float]]]:
    """Each measure of the posture, of the source and of what every method makes of it."""
    one = case(EDIT)
    postures = [one.source.positions[POSTURE], *(points[POSTURE] for points in one.postures().values())]
    places = [dict(zip(one.target.names, posture, strict=True)) for posture in postures]
    for name, measure in MEASURES.items():
        yield name, [measure(place) for place in places]


def pair_rows() -> Iterator[tuple[str, list[float]]]:
    """The part of sigma that pairs of an arm and a leg have, an arm and the spine, and all others, of every method
    [m^2].
    """
    one = case(EDIT)
    below = {name: joints_below(one.target, name) for name in ("Collar", "Hip")}
    arm, leg = below["Collar"], below["Hip"]
    spine = ~(arm | leg)
    both = {
        "an arm and a leg": np.outer(arm, leg) | np.outer(leg, arm),
        "an arm and the spine": np.outer(arm, spine) | np.outer(spine, arm),
    }
    both["all others"] = ~np.any(list(both.values()), axis=0)
    terms = [stress_terms(one, points[POSTURE]) for points in one.postures().values()]
    for name, pairs in both.items():
        yield name, [float(values[pairs].sum()) for values in terms]


def joints_below(skeleton: Skeleton, name: str) -> NDArray[np.bool_]:
    """(joints,), whether a joint is the joint of this name on either side, or below it."""
    below = np.zeros(len(skeleton), bool)
    for side in SIDES:
        below[skeleton.subtree(skeleton.index(side + name))] = True
    return below


def stress_terms(one: Case, points: Array) -> Array:
    """(joints, joints), the terms of Eq. (2) for the pairs u < v of a posture (joints, 3), 0 for the others [m^2]."""
    stress = Stress.of(one.problem, one.source.positions[POSTURE])
    distances = np.linalg.norm(points[:, None] - points, axis=-1)
    return np.triu(stress.pi * (distances - one.problem.body_size * stress.delta) ** 2, 1) / 2


def spine_bend(at: dict[str, Array]) -> float:
    """The sum of the angles between one bone of the spine and the next [degrees]."""
    bones = np.diff([at[name] for name in SPINE], axis=0)
    return float(angles(bones[1:], bones[:-1]).sum())


def spine_length(at: dict[str, Array]) -> float:
    """The sum of the lengths of the spine's bones [m]."""
    return float(np.linalg.norm(np.diff([at[name] for name in SPINE], axis=0), axis=1).sum())


def lean(at: dict[str, Array]) -> float:
    """The angle between the line from hips to neck and the vertical [degrees]."""
    return float(angles(at["Neck"] - at["Hips"], UP))


def shoulder_slope(at: dict[str, Array]) -> float:
    """How far the line from the top of the chest to a shoulder points below the horizontal, mean [degrees]."""
    return float(np.mean([angles(at[f"{side}Shoulder"] - at["Chest3"], UP) - 90 for side in SIDES]))


def elbow_bend(at: dict[str, Array]) -> float:
    """The angle between upper arm and forearm, 0 for a straight arm, mean [degrees]."""
    return _bend(at, "Shoulder", "Elbow", "Wrist")


def knee_bend(at: dict[str, Array]) -> float:
    """The angle between thigh and shin, 0 for a straight leg, mean [degrees]."""
    return _bend(at, "Hip", "Knee", "Ankle")


def wrist_height(at: dict[str, Array]) -> float:
    """The height of the wrists over the hips, mean [m]."""
    return float(np.mean([(at[f"{side}Wrist"] - at["Hips"]) @ UP for side in SIDES]))


def _bend(at: dict[str, Array], upper: str, middle: str, lower: str) -> float:
    ends = [(at[side + upper], at[side + middle], at[side + lower]) for side in SIDES]
    return float(np.mean([angles(b - a, c - b) for a, b, c in ends]))


MEASURES = {
    "length of the spine [m]": spine_length,
    "bend of the spine, sum over its joints [degrees]": spine_bend,
    "lean of the trunk [degrees]": lean,
    "slope of the shoulders [degrees]": shoulder_slope,
    "bend of the elbows [degrees]": elbow_bend,
    "bend of the knees [degrees]": knee_bend,
    "wrists over the hips [m]": wrist_height,
}
