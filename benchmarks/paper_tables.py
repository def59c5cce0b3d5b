"""The tables of docs/paper.md, by name; sigma in 10^-3 m^2."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from clips import SAMPLES
from numpy.typing import NDArray
from paper_case import (
    EDITS,
    POSTURE,
    STARTS,
    Case,
    bone_errors,
    case,
    checks,
    direction_errors,
    distance_error,
    elsewhere,
    from_before,
    mirrored,
    solved_from,
)
from tables import several, table

from distretarget import Skeleton
from distretarget.numerics.vectors import Array, angles_between

STUDIED = ("arms +60 %", "legs -30 %", "spine +60 %", "arms, legs, spine +60 %", "arms +60 %, legs -30 %")
"""The edits whose postures are solved in every frame of a clip."""
TURNED = ("walk", "turn")  # straight ahead, and on the spot through 360 degrees
LONG_SPINE = "spine +60 %"  # the edit that the paper remarks on
SPINE = ("Hips", "Chest", "Chest2", "Chest3", "Neck", "Head")
SIDES = ("Left", "Right")
UP = np.array([0.0, 1.0, 0.0])


def tables() -> dict[str, str]:
    """Every table."""
    motions = {path.stem: motion_cells(path.stem) for path in sorted(SAMPLES.glob("*.bvh"))}
    return {
        "checks": table(" | known | found", checks()),
        "edits": table(EDITS_HEAD, map(edit_cells, EDITS)),
        "spine": spine_table(),
        "pairs": pairs_table(),
        "starts": table(STARTS_HEAD, map(start_cells, STARTS)),
        "motions": table(MOTIONS_HEAD, ([clip, *quality] for clip, (quality, _) in motions.items())),
        "solving": table(SOLVING_HEAD, ([clip, *solving] for clip, (_, solving) in motions.items())),
    }


# ---- the walking posture after each edit, by every method

EDITS_HEAD = (
    "edit | sigma: copy / points / exact bones / contact | direction error, degrees: points / exact bones / contact | "
    "bone error of the points, mean / largest, % | distance error: copy / points | iterations"
)


def edit_cells(edit: str) -> list[str]:
    """The row of an edit; the paper's solver starts from the rotation copy."""
    one = case(edit)
    posture, results = one.source.positions[POSTURE], list(one.postures().values())
    start, points = (each[POSTURE] for each in results[:2])
    bones = 100 * bone_errors(points, one)
    return [
        edit,
        several([1e3 * one.sigma(each)[POSTURE] for each in results], ".1f"),
        several([direction_errors(each[POSTURE], posture, one).mean() for each in results[1:]], ".1f"),
        several([bones.mean(), bones.max()], ".1f"),
        several([float(distance_error(each, posture, one)) for each in (start, points)], ".4f"),
        str(one.paper.postures.effort.iterations[POSTURE]),
    ]


# ---- the walking posture on the long spine: angles and places, and which pairs sigma comes from


def spine_table() -> str:
    """Measures of the posture, for the source and every method."""
    one = case(LONG_SPINE)
    postures = [one.source.positions[POSTURE], *(points[POSTURE] for points in one.postures().values())]
    measured = [spine_measures(dict(zip(one.target.names, posture, strict=True))) for posture in postures]
    rows = ([name, *(f"{each[name]:.{2 if '[m]' in name else 0}f}" for each in measured)] for name in measured[0])
    return table(("", "source", "copy", "points", "exact bones", "contact"), rows)


def spine_measures(at: dict[str, Array]) -> dict[str, float]:
    """Measures of a posture from its joint positions [m], means over both sides; a straight limb has no bend."""
    bones = np.diff([at[name] for name in SPINE], axis=0)
    shoulders = [at[f"{side}Shoulder"] - at["Chest3"] for side in SIDES]
    return {
        "length of the spine [m]": np.linalg.norm(bones, axis=1).sum(),
        "bend of the spine, sum over its joints [degrees]": _degrees(bones[1:], bones[:-1]).sum(),
        "lean of the trunk [degrees]": _degrees(at["Neck"] - at["Hips"], UP).mean(),
        "slope of the shoulders [degrees]": np.mean([_degrees(shoulder, UP) - 90 for shoulder in shoulders]),
        "bend of the elbows [degrees]": _bend(at, "Shoulder", "Elbow", "Wrist"),
        "bend of the knees [degrees]": _bend(at, "Hip", "Knee", "Ankle"),
        "wrists over the hips [m]": np.mean([(at[f"{side}Wrist"] - at["Hips"]) @ UP for side in SIDES]),
    }


def _degrees(a: Array, b: Array) -> Array:
    """The angles between vectors [degrees]."""
    return np.degrees(angles_between(np.atleast_2d(a), np.atleast_2d(b)))


def _bend(at: dict[str, Array], upper: str, middle: str, lower: str) -> float:
    ends = [(at[side + upper], at[side + middle], at[side + lower]) for side in SIDES]
    return float(np.mean([_degrees(b - a, c - b) for a, b, c in ends]))


def pairs_table() -> str:
    """How sigma is shared among kinds of pairs of joints."""
    rows = ([name, *(f"{1e3 * sigma:.1f}" for sigma in sigmas)] for name, sigmas in pair_rows())
    return table(("sigma of the pairs of", "copy", "points", "exact bones", "contact"), rows)


def pair_rows() -> Iterator[tuple[str, list[float]]]:
    """For every method, sigma from pairs of an arm and a leg, an arm and the spine, and all others [m^2]."""
    one = case(LONG_SPINE)
    arm, leg = joints_below(one.target, "Collar"), joints_below(one.target, "Hip")
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
    """(joints,), whether a joint is in the subtree of the joint of this name on either side."""
    below = np.zeros(len(skeleton), bool)
    for side in SIDES:
        below[skeleton.subtree(skeleton.index(side + name))] = True
    return below


def stress_terms(one: Case, points: Array) -> Array:
    """(joints, joints), the terms of Eq. (2) for the pairs u < v of a posture (joints, 3), 0 for the others [m^2]."""
    wanted, distances = (np.linalg.norm(x[:, None] - x, axis=-1) for x in (one.source.positions[POSTURE], points))
    delta = one.problem.body_size * one.problem.ratio * wanted
    return np.triu(one.problem.priorities * (distances - delta) ** 2, 1) / 2


# ---- the effect of the start on the iterations of the solver, and on the minimum that it finds; means

STARTS_HEAD = "start | iterations: walk / turn | sigma, end | in a higher minimum, % | mirrored, %"


def start_cells(start: str) -> list[str]:
    """The row of a start: means over the edits, for each clip of `TURNED`."""
    runs = [[(edit, clip, solved_from(start, edit, clip)) for edit in STUDIED] for clip in TURNED]

    def means(measure: Callable[..., float], form: str) -> str:
        return several([np.mean([measure(*run) for run in of_clip]) for of_clip in runs], form)

    return [
        start,
        means(lambda _edit, _clip, run: run.effort.iterations.mean(), ".0f"),
        means(lambda edit, clip, run: 1e3 * case(edit, clip).sigma(run.positions).mean(), ".2f"),
        means(lambda edit, clip, run: 100 * elsewhere(run, edit, clip), ".1f"),
        means(lambda edit, clip, run: 100 * mirrored(run.positions, case(edit, clip)), ".1f"),
    ]


# ---- whole motions, which the paper leaves to future work

MOTIONS_HEAD = (
    "clip | sigma: copy / points / exact bones | contact error: copy / exact bones / contact | "
    "direction error, degrees: copy / exact bones / contact | jerk over copy's: exact bones / contact | "
    "foot skate: source / copy / exact bones / contact"
)
SOLVING_HEAD = (
    "clip | iterations a frame: points / exact bones / contact | "
    "points mirrored, %: from the copy / from the frame before"
)
MOTION_FORMS = (".1f", ".3f", ".1f", ".1f", ".2f", ".0f", ".0f")


def motion_cells(clip: str) -> tuple[list[str], list[str]]:
    """The quality of a clip's results and the effort of solving it; means over the bodies of `STUDIED`."""
    values = zip(*(motion_values(case(edit, clip)) for edit in STUDIED), strict=True)
    cells = [several(np.mean(each, axis=0), form) for each, form in zip(values, MOTION_FORMS, strict=True)]
    return cells[:5], cells[5:]


def motion_values(one: Case) -> Iterator[list[float]]:
    """The values in each cell of a clip on one body, in the order of `MOTIONS_HEAD` and `SOLVING_HEAD`."""
    points = one.paper.postures
    efforts = points.effort, one.paper.effort, one.contact.effort
    copy_jerk, *jerks = one.metrics("jerk")
    yield [1e3 * one.sigma(positions).mean() for positions in list(one.postures().values())[:3]]
    yield list(one.metrics("contact_error"))
    yield list(one.metrics("direction_error"))
    yield [jerk / copy_jerk for jerk in jerks]
    yield [one.paper.metrics["source"]["foot_skate"], *one.metrics("foot_skate")]
    yield [effort.iterations.mean() for effort in efforts]
    yield [100 * mirrored(each, one) for each in (points.positions, from_before(one).positions)]
