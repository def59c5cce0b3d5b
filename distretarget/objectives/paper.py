"""The paper's objective, Eq. (2): solved for free points, then over the rotations of rigid bones.

The points of every frame start from the rotation copy. A warm start from the previous frame takes fewer iterations, but
drifts over a clip to mirrored postures, which have the same stress. The rotation copy is never mirrored, and keeps
frames independent of each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.contact_entries import ContactList, Distance
from distretarget.distances import DistanceProblem, columns, filled, stress_and_gradient, target_distances
from distretarget.ik.articulation import Articulation, Scratch
from distretarget.ik.pose_solver import CopiedBones, Workspace, pose_solver
from distretarget.ik.poses import Poses, Progress, fit_rotations, ignore_progress
from distretarget.ik.spg import Effort, record, scratch_for, spectral_gradient, steepest
from distretarget.ik.springs import Springs
from distretarget.motion import Motion
from distretarget.numerics.compiled import compiled, copy_to, inlined
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.rotations import best_rotation
from distretarget.numerics.vectors import Array, Numbers
from distretarget.objectives.asking import Wishes
from distretarget.objectives.clip import Clip

POINT_TOLERANCE = 1e-9  # [body sizes] a posture is solved when the search direction is shorter than this
POINT_ITERATIONS = 2000  # at most, per frame
FLAT = 1e-6  # [body sizes] a posture thinner than this counts as planar ...
NUDGE = 1e-4  # [body sizes] ... and starts this far off its plane

PART_STIFFNESS = 1e-4  # keeps twist and heading, which the stress does not determine, near the rotation copy
ROOT_STIFFNESS = 1.0  # keeps the root on its path, which the stress does not determine either
POSE_TOLERANCE = 1e-5  # a frame is solved when the search direction is shorter, in the metric of the curvature


@dataclass(frozen=True, eq=False)
class Postures:
    """The solved points of every frame, with their stress and the solver's effort."""

    positions: Array  # (frames, points, 3), aligned to the rotation copy by rotation and centroid [target file units]
    stress: Array  # (frames,), sigma [body sizes squared]
    effort: Effort  # iterations, evaluations and reason to stop


def solve_paper(
    clip: Clip, progress: Progress = ignore_progress, asked: AskedDistances | None = None
) -> tuple[Poses, Postures]:
    """Minimise Eq. (2) in every frame of a clip: over free points, and then over the rotations of rigid bones.
    `progress` is called with numbers of solved frames; `asked` are distances in place of the source's.
    """
    postures = solve_postures(clip.distances, clip.source.positions, clip.copy.positions, asked)
    return solve_poses(clip, _fitted_poses(clip, postures), progress, asked), postures


def _fitted_poses(clip: Clip, postures: Postures) -> Array:
    """(frames, parts + 1, 3), the poses that turn the rotation copy's bones towards the solved points."""
    copy, points = clip.copy, np.array(clip.copy.positions)
    points[:, clip.distances.targets] = postures.positions
    fitted = fit_rotations(copy, points, clip.distances.targets, clip.roots)
    roots = np.unique(clip.parts, return_index=True)[1]
    before, after = (Rotation.from_quat(motion.world_rotations[:, roots]) for motion in (copy, fitted))
    return np.pad((after * before.inv()).as_rotvec(), ((0, 0), (0, 1), (0, 0)))


class AskedDistances(NamedTuple):
    """Pairs of points whose distances are asked for: they replace delta and pi, Eq. (2)."""

    u: Numbers  # (pairs,), the first point
    v: Numbers  # (pairs,), the second point
    delta: Array  # (pairs,), their distance [body sizes]
    pi: Array  # (pairs,), their priority
    own: Array  # (pairs,), their priority where nothing is asked
    weight: Array  # (frames, pairs), 1 where it is asked for, blended to 0

    def of_frames(self, frames: slice) -> AskedDistances:
        """Return those of some frames."""
        return self._replace(weight=self.weight[frames])


def no_distances(frames: int) -> AskedDistances:
    """Return no pairs."""
    none, nothing = np.zeros(0, np.intp), np.zeros(0)
    return AskedDistances(none, none, nothing, nothing, nothing, np.zeros((frames, 0)))


def find_distances(contacts: ContactList, wishes: Wishes) -> AskedDistances:
    """Return the distances of a contact list; a ContactsError for other entries, or joints that nothing drives."""
    problem, rows, weights = wishes.clip.distances, [], []
    for wish in wishes.wishes:
        entry = wish.entry
        if not isinstance(entry, Distance):
            what = "the paper's objective keeps nothing but distances; use --objective contact"
            raise contacts.fault(entry, "", what)
        u, v = (_point(contacts, entry, int(joints[0]), wishes.clip) for joints in wish.joints)
        size = wishes.length(entry.value) * wishes.clip.unit / problem.body_size
        rows.append((u, v, size, entry.priority, problem.priorities[u, v]))
        weights.append(wishes.firmness(wish))
    first, second, *values = zip(*rows, strict=True)
    delta, pi, own = (np.array(each, float) for each in values)
    weight = np.stack(weights, axis=1)
    return AskedDistances(np.array(first, np.intp), np.array(second, np.intp), delta, pi, own, weight)


def _point(contacts: ContactList, entry: Distance, joint: int, clip: Clip) -> int:
    """The point at a joint."""
    found = np.flatnonzero(clip.distances.targets == joint)
    if not len(found):
        key = clip.skeleton.keys[joint]
        what = f"no joint of the source drives {key!r}, or it is where its parent is; expected another joint"
        raise contacts.fault(entry, "distance", what)
    return int(found[0])


@inlined()
def _put_distances(asked: AskedDistances, frame: int, delta: Array, pi: Array) -> None:
    """Put what is asked in a frame in the place of target distances and priorities, (points, columns)."""
    for n in range(len(asked.u)):
        u, v, w = asked.u[n], asked.v[n], asked.weight[frame, n]
        value = delta[u, v] + w * (asked.delta[n] - delta[u, v])
        priority = asked.own[n] + w * (asked.pi[n] - asked.own[n])
        delta[u, v] = delta[v, u] = value
        pi[u, v] = pi[v, u] = priority


class _Stress(NamedTuple):
    """The stress of one frame: target distances and priorities, (points, columns)."""

    delta: Array
    pi: Array


@inlined()
def _objective(x, problem, gradient):  # type: ignore[no-untyped-def]
    return stress_and_gradient(x, problem.delta, problem.pi, gradient)


_minimise = spectral_gradient(_objective, steepest, adaptive=True)


@compiled()
def _solve_points(source, starts, ratio, problem, asked, solved, first, log, gradient, scratch):  # type: ignore[no-untyped-def]
    """Solve a block of frames, whose first is column `first` of `log`; distances are computed frame by frame."""
    for t in range(len(source)):
        copy_to(solved[t], starts[t])
        target_distances(source[t], ratio, problem.delta)
        _put_distances(asked, t, problem.delta, problem.pi)
        sigma = _objective(solved[t], problem, gradient)
        minimum = _minimise(solved[t], sigma, gradient, problem, POINT_TOLERANCE, POINT_ITERATIONS, scratch)
        record(minimum, log, first + t)


def solve_postures(
    problem: DistanceProblem, source: Array, copy: Array, asked: AskedDistances | None = None
) -> Postures:
    """Minimise Eq. (2) in every frame. `source`, (frames, source joints, 3), and `copy`, (frames, target joints, 3),
    are the positions of the source and of its rotation copy [file units]; `asked` replaces distances of the source.
    """
    asked = asked or no_distances(len(copy))
    points = copy[:, problem.targets]
    centroids = points.mean(axis=1, keepdims=True)
    C = columns((points - centroids) / problem.body_size)
    S = columns(source[:, problem.sources] - source[:, problem.sources].mean(axis=1, keepdims=True))
    X = np.empty_like(C)
    log = np.zeros((4, len(C)))
    ratio, priorities = filled(problem.ratio), filled(problem.priorities)
    shape = 3, ratio.shape[1]
    stress, gradient, scratch = _Stress(np.empty_like(ratio), priorities), np.zeros(shape), scratch_for(shape)
    for block in blocks_of(len(C)):
        x, solved = filled(off_plane(C[block])), np.empty((block.stop - block.start, *shape))
        _solve_points(
            filled(S[block]), x, ratio, stress, asked.of_frames(block), solved, block.start, log, gradient, scratch
        )
        X[block] = solved[:, :, : len(problem)]
    positions = aligned(X.transpose(0, 2, 1), C.transpose(0, 2, 1)) * problem.body_size + centroids
    return Postures(positions, log[0], Effort.from_log(log))


def off_plane(x: Array) -> Array:
    """Postures, (frames, 3, points), with those that lie in a plane or on a line moved off it.

    The gradient of a planar posture lies in its plane, so a solver would never leave it. The points move by at most
    `NUDGE` perpendicular to the plane, to either side; points on a line move in both perpendicular directions.
    """
    x = np.array(x)
    axes, extents, _ = np.linalg.svd(x - x.mean(axis=2, keepdims=True), full_matrices=True)
    flat = np.ones((len(x), 3), bool)
    flat[:, : extents.shape[1]] = extents < FLAT
    waves = NUDGE * np.cos(np.outer(np.arange(1, 4), np.arange(x.shape[2])))
    return np.asarray(x + np.einsum("fix,fx,xp->fip", axes, flat, waves))


def aligned(x: Array, onto: Array) -> Array:
    """Postures (frames, points, 3) with centroids at the origin, rotated onto `onto` by Kabsch's method."""
    x = x - x.mean(axis=1, keepdims=True)
    return np.asarray(Rotation.from_quat(best_rotation(x, onto)[:, None]).apply(x))


class Terms(NamedTuple):
    """The stress of one frame."""

    points: Numbers  # (points,), the joint at each point
    delta: Array  # (points, points), target distances [body sizes]
    pi: Array  # (points, points), priorities
    x: Array  # (3, points), scratch
    gradient: Array  # (3, points), scratch
    priorities: Array  # (springs,), pi of each pair whose pi is not 0
    springs: Springs  # one for each of these pairs, scratch for the curvature


class Given(NamedTuple):
    """A block of frames."""

    source: Array  # (frames, 3, points), the source's points [source file units]
    guess: Array  # (frames, parts + 1, 3), the start pose of each frame
    ratio: Array  # (points, points), tau2 / tau1 [body sizes / source file unit]
    terms: Terms  # those of one frame, scratch
    asked: AskedDistances  # distances in place of the source's
    springs: Numbers  # (asked,), the spring of each of them


class Posed(NamedTuple):
    """What `solve_poses` needs of a `Clip`."""

    source: Motion
    copy: Motion
    root: Array
    distances: DistanceProblem
    parts: Numbers


def solve_poses(
    clip: Clip | Posed, guess: Array, progress: Progress = ignore_progress, asked: AskedDistances | None = None
) -> Poses:
    """Minimise Eq. (2) over the rotations in every frame of a clip; `progress` and `asked` as in `solve_paper`.
    `guess`, (frames, parts + 1, 3), is the start pose of a frame unless the previous frames give a better one.
    """
    asked = asked or no_distances(len(clip.copy))
    distances, unit = clip.distances, clip.distances.body_size
    parts = int(clip.parts.max()) + 1
    stiffness = np.append(np.full(parts, PART_STIFFNESS), ROOT_STIFFNESS)
    body = Articulation.of(clip.copy.skeleton, clip.parts, stiffness)
    bones, root = np.ascontiguousarray(clip.copy.bones / unit), np.ascontiguousarray(clip.root / unit)
    S = np.ascontiguousarray(clip.source.positions[:, distances.sources].transpose(0, 2, 1))
    v, log = np.zeros((len(clip.copy), parts + 1, 3)), np.zeros((4, len(clip.copy)))
    terms, work = _terms(distances), Workspace.of(body)
    springs = _springs_of(asked, terms)
    for block in blocks_of(len(clip.copy)):
        copy = CopiedBones(bones[block], root[block])
        given = Given(S[block], guess[block], distances.ratio, terms, asked.of_frames(block), springs)
        _solve_poses(body, copy, given, POSE_TOLERANCE, v, block.start, log, work)
        progress(block.stop - block.start)
    v[:, -1] *= unit
    return Poses(v, log)


def _terms(distances: DistanceProblem) -> Terms:
    points = len(distances)
    u, v = np.triu_indices(points, 1)
    on = distances.priorities[u, v] > 0
    u, v = u[on], v[on]
    joints, pi = distances.targets, np.array(distances.priorities)
    springs = Springs(joints[u], joints[v], np.zeros((len(u), 3)), np.zeros((len(u), 3, 3)))
    columns = np.zeros((2, 3, points))
    return Terms(joints, np.zeros((points, points)), pi, columns[0], columns[1], pi[u, v], springs)


def _springs_of(asked: AskedDistances, terms: Terms) -> Numbers:
    """(asked,), the spring of each asked pair; -1 for none."""
    a, b = np.sort(terms.points[np.stack([asked.u, asked.v])], axis=0)
    on = (terms.springs.a == a[:, None]) & (terms.springs.b == b[:, None])
    return np.where(on.any(axis=1), on.argmax(axis=1), -1) if on.size else np.full(len(a), -1)


@inlined(fastmath=True)
def _stress(scratch: Scratch, terms: Terms) -> float:
    for point, joint in enumerate(terms.points):
        for i in range(3):
            terms.x[i, point] = scratch.x[joint, i]
    sigma = stress_and_gradient(terms.x, terms.delta, terms.pi, terms.gradient)
    for point, joint in enumerate(terms.points):
        for i in range(3):
            scratch.gradient[joint, i] += terms.gradient[i, point]
    return sigma


@inlined(fastmath=True)
def _pair_springs(scratch: Scratch, terms: Terms) -> tuple[Springs, int]:
    """A spring along each pair, with its priority as stiffness."""
    springs = terms.springs
    for s in range(len(springs.a)):
        a, b = scratch.x[springs.a[s]], scratch.x[springs.b[s]]
        square = 1e-30
        for i in range(3):
            square += (a[i] - b[i]) ** 2
        for i in range(3):
            for j in range(3):
                springs.A[s, i, j] = terms.priorities[s] * (a[i] - b[i]) * (a[j] - b[j]) / square
    return springs, len(springs.a)


@inlined()
def _terms_of(given: Given, frame: int, start: Array) -> Terms:
    copy_to(start, given.guess[frame])
    target_distances(given.source[frame], given.ratio, given.terms.delta)
    _put_distances(given.asked, frame, given.terms.delta, given.terms.pi)
    for n in range(len(given.springs)):
        if given.springs[n] >= 0:
            given.terms.priorities[given.springs[n]] = given.terms.pi[given.asked.u[n], given.asked.v[n]]
    return given.terms


_pose_solver = pose_solver(_terms_of, _stress, _pair_springs)


@compiled()
def _solve_poses(body, copy, given, tolerance, v, first, log, work):  # type: ignore[no-untyped-def]
    _pose_solver(body, copy, given, tolerance, v, first, log, work)
