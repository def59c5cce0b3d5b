"""The paper's experiment: a motion on the skeleton of its Table I, and the same skeleton with other bone lengths; its
solver from any start, another solver of the same problem, and checks of exactly known values.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from fractions import Fraction
from functools import cache, cached_property

import numpy as np
from clips import ARMS, LEGS, SAMPLES, edited
from scipy.optimize import minimize
from skeleton_edits import only

from distretarget import Motion, Options, RetargetResult, Skeleton, read_bvh, retarget
from distretarget.baseline.rotation_copy import RootScale, find_root_scale, rotation_copy
from distretarget.body.body import Body
from distretarget.distances import DistanceProblem, distance_problem, posture_stress
from distretarget.ik.spg import Effort
from distretarget.matching.matching import match
from distretarget.numerics.vectors import Array, angles_between
from distretarget.objectives.paper import Postures, aligned, solve_postures

METRES = 0.01  # per unit of the sample clips, which are in centimetres
POSTURE = 61  # the frame of the walk used as the paper's walking posture: both feet down, legs far apart

GROUPS = {"arms": ARMS, "legs": LEGS, "spine": ("trunk",), "arms, legs, spine": (*ARMS, *LEGS, "trunk")}
"""The parts of the body, by the names in `clips`, that the edits change together."""
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


# ---- solvers

OFF = 0.05  # standard deviation of each coordinate of the start "copy, disturbed" [body sizes]
CLOUD = 0.2  # the same of the start "random points" [body sizes]
HIGHER = 1.01  # a minimum is another one if its sigma is more than this times the least known


def least_sigma(problem: DistanceProblem, source: Array, start: Array) -> float:
    """The sigma [body sizes squared] that scipy's L-BFGS-B finds for a posture from a start, (joints, 3) both."""
    u, v = np.triu_indices(len(problem), 1)
    pi = problem.priorities[u, v]
    delta = problem.ratio[u, v] * np.linalg.norm(source[u] - source[v], axis=1)

    def objective(flat: Array) -> tuple[float, Array]:
        """Eq. (2), and its gradient."""
        x = flat.reshape(start.shape)
        along = x[u] - x[v]
        distances = np.linalg.norm(along, axis=1)
        pull = (pi * (distances - delta) / distances)[:, None] * along
        gradient = np.zeros_like(x)
        np.add.at(gradient, u, pull)
        np.add.at(gradient, v, -pull)
        return 0.5 * float(pi @ (distances - delta) ** 2), gradient.ravel()

    options = {"ftol": 0, "gtol": 1e-10}
    first = start.ravel() / problem.body_size
    return float(minimize(objective, first, jac=True, method="L-BFGS-B", options=options).fun)


# ---- whole clips


def solved(one: Case, starts: Array, frames: Sequence[int] | slice = slice(None)) -> Postures:
    """Frames of a case, by default all, each solved from its own start, (frames, joints, 3) [m]."""
    return solve_postures(one.problem, one.source.positions[frames], starts)


def from_before(one: Case) -> Postures:
    """Every frame of a case, solved from the points of the frame before, the first from the rotation copy."""
    before, frames = one.copy[:1], []
    for posture in one.source.positions:
        frames.append(solve_postures(one.problem, posture[None], before))
        before = frames[-1].positions
    positions, stress = (np.concatenate([getattr(frame, key) for frame in frames]) for key in ("positions", "stress"))
    counts = [np.concatenate(each) for each in zip(*(astuple(frame.effort) for frame in frames), strict=True)]
    return Postures(positions, stress, Effort(*counts))


def _noise(one: Case, deviation: float) -> Array:
    """(frames, joints, 3), random numbers with a standard deviation in body sizes [m]."""
    return deviation * one.problem.body_size * np.random.default_rng(0).normal(size=one.copy.shape)


STARTS: dict[str, Callable[[Case], Postures]] = {
    "rotation copy": lambda one: solved(one, one.copy),
    "source's posture": lambda one: solved(one, one.source.positions),
    "frame before": from_before,
    f"copy, disturbed by {OFF:.0%}": lambda one: solved(one, one.copy + _noise(one, OFF)),
    "random points": lambda one: solved(one, _noise(one, CLOUD)),
}
"""The solution of a case from each start."""


@cache
def solved_from(start: str, edit: str, clip: str = "walk") -> Postures:
    """A clip after an edit, solved from one of `STARTS`."""
    return STARTS[start](case(edit, clip))


def elsewhere(solved: Postures, edit: str, clip: str = "walk") -> float:
    """The share of frames that end in a higher minimum than the best that any start reaches."""
    least = np.min([solved_from(start, edit, clip).stress for start in STARTS], axis=0)
    return float((solved.stress > HIGHER * least).mean())


# ---- known answers

Check = tuple[str, str, str]
"""A description, the known answer, and the value found."""

MIRROR = np.array([-1.0, 1.0, 1.0])
SCALE = 1.6
ROUNDING = 1e-12  # a difference up to this comes from rounding
NEAR = 1e-7  # how far a solved point may be from its known place [m]
AGREEMENT = 1e-6  # how far two solvers may differ in the sigma they find [relative]


def checks() -> Iterator[Check]:
    """Every check."""
    yield from problem_checks()
    source, spine = on_table_one("walk"), case("spine +60 %")
    posture = source.positions[POSTURE]

    # Where no bone changes, the source's posture is the answer.
    same = solved(Case(source, source.skeleton), posture[None], [POSTURE])
    yield "no bone changed: sigma, iterations", "0, 0", f"{zero(same.stress[0])}, {same.effort.iterations[0]}"

    # Where every bone is scaled by s, s times the posture is the answer; the start is the source's posture.
    larger = source.skeleton.with_offsets(SCALE * source.skeleton.offsets)
    scaled = solved(Case(source, larger), posture[None], [POSTURE])
    expected = SCALE * (posture - posture.mean(axis=0))[None]
    off = np.abs(aligned(scaled.positions, expected) - expected).max()
    what = f"every bone times {SCALE}: sigma, points off {SCALE} times the posture [m]"
    yield what, f"0, < {NEAR:g}", f"{zero(scaled.stress[0])}, {less(off, NEAR)}"

    # A mirrored start gives the mirrored result, with the same sigma.
    one, other = (solved(spine, sign * spine.copy[[POSTURE]], [POSTURE]) for sign in (1.0, MIRROR))
    off = np.abs(other.positions - MIRROR * one.positions).max()
    found = f"{zero(off)}, {zero(other.stress[0] - one.stress[0])}"
    yield "mirrored start: off the mirrored result [m], difference of sigma", "0, 0", found

    # Another solver, L-BFGS-B of scipy, finds the same minimum from the same start.
    differences = []
    for edit in map(case, EDITS):
        start = edit.copy[POSTURE]
        found = solved(edit, start[None], [POSTURE]).stress[0]
        differences.append(abs(found / least_sigma(edit.problem, posture, start) - 1))
    what = "sigma after each edit against L-BFGS-B's, largest relative difference"
    yield what, f"< {AGREEMENT:g}", less(max(differences), AGREEMENT)


def problem_checks() -> Iterator[Check]:
    """Pairs, path sizes and priorities."""
    problem, skeleton = case("spine +60 %").problem, on_table_one("walk").skeleton
    u, v = np.triu_indices(len(problem), 1)
    count = Counter(problem.sizes[u, v].astype(int).tolist())
    bones = np.arange(1, len(skeleton)), skeleton.parents[1:]
    wrists, longest = ((skeleton.index("RightWrist"), skeleton.index(other)) for other in ("LeftWrist", "RightToe"))
    yield "pairs of joints", "231", str(count.total())
    sizes = ", ".join(str(count[size]) for size in sorted(count))
    yield "pairs by path size, 2 to 12", "21, 24, 27, 28, 31, 28, 24, 22, 14, 8, 4", sizes
    yield "path size from RightWrist to RightToe, the largest", "12", f"{problem.sizes[longest]:.0f}"
    yield "priority of that pair, the smallest", "1/6", fraction(problem.priorities[u, v].min())
    yield "smallest priority of a bone", "1", fraction(problem.priorities[bones].min())
    yield "path size from RightWrist to LeftWrist", "9", f"{problem.sizes[wrists]:.0f}"
    yield "priority of that pair", "5/12", fraction(problem.priorities[wrists])


def fraction(value: float) -> str:
    """A number as a fraction with a small denominator if it is one, else with its digits."""
    nearest = Fraction(float(value)).limit_denominator(24)
    return str(nearest) if abs(value - nearest) < ROUNDING else f"{value:.12g}"


def zero(value: float) -> str:
    """The number, or 0 if it differs from 0 by rounding only."""
    return "0" if abs(value) < ROUNDING else f"{value:.2g}"


def less(value: float, bound: float) -> str:
    """`< bound` for a number below the bound, else the number."""
    return f"< {bound:g}" if value < bound else f"{value:.2g}"
