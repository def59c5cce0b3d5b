"""The paper's objective, Eq. (2): solved for free points, then over the rotations of rigid bones.

The points of every frame start from the rotation copy. A warm start from the previous frame would take fewer
iterations, but drift over a clip to mirrored postures, which have the same stress. The rotation copy is never mirrored,
and makes frames independent of each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.contact_entries import ContactList, Distance
from distretarget.distances import DistanceProblem, columns, padded
from distretarget.ik.articulation import Articulation
from distretarget.ik.pose_solver import CopiedBones, Workspace
from distretarget.ik.poses import Poses, Progress, fit_rotations, ignore_progress
from distretarget.ik.spg import Effort, scratch_for
from distretarget.ik.springs import FrameSprings
from distretarget.motion import Motion
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.rotations import best_rotation
from distretarget.numerics.vectors import Array, Numbers
from distretarget.objectives.clip import Clip
from distretarget.objectives.constraints import Constraints
from distretarget.objectives.paper_terms import (
    PaperFrames,
    PaperTerms,
    Stress,
    UserDistances,
    no_distances,
    solve_paper_frames,
    solve_points,
)

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
    clip: Clip, progress: Progress = ignore_progress, set_by_user: UserDistances | None = None
) -> tuple[Poses, Postures]:
    """Minimise Eq. (2) in every frame of a clip: over free points, and then over the rotations of rigid bones.
    `progress` is called with numbers of solved frames; `set_by_user` are distances in place of the source's.
    """
    postures = solve_postures(clip.distances, clip.source.positions, clip.copy.positions, set_by_user)
    return solve_poses(clip, _fitted_poses(clip, postures), progress, set_by_user), postures


def _fitted_poses(clip: Clip, postures: Postures) -> Array:
    """(frames, parts + 1, 3), the poses that turn the rotation copy's bones towards the solved points."""
    copy, points = clip.copy, np.array(clip.copy.positions)
    points[:, clip.distances.targets] = postures.positions
    fitted = fit_rotations(copy, points, clip.distances.targets, clip.roots)
    roots = np.unique(clip.parts, return_index=True)[1]
    before, after = (Rotation.from_quat(motion.world_rotations[:, roots]) for motion in (copy, fitted))
    return np.pad((after * before.inv()).as_rotvec(), ((0, 0), (0, 1), (0, 0)))


def find_distances(contacts: ContactList, constraints: Constraints) -> UserDistances:
    """Return the distances of a contact list; a ContactsError for other kinds of entries and for undriven joints."""
    problem, rows, weights = constraints.clip.distances, [], []
    for constraint in constraints:
        entry = constraint.entry
        if not isinstance(entry, Distance):
            what = "the paper's objective keeps nothing but distances; use --objective contact"
            raise contacts.fault(entry, "", what)
        u, v = (_point(contacts, entry, int(joints[0]), constraints.clip) for joints in constraint.joints)
        size = constraints.length(entry.value) * constraints.clip.unit / problem.body_size
        rows.append((u, v, size, entry.priority, problem.priorities[u, v]))
        weights.append(constraints.firmness(constraint))
    first, second, *values = zip(*rows, strict=True)
    delta, pi, paper_pi = (np.array(each, float) for each in values)
    weight = np.stack(weights, axis=1)
    return UserDistances(np.array(first, np.intp), np.array(second, np.intp), delta, pi, paper_pi, weight)


def _point(contacts: ContactList, entry: Distance, joint: int, clip: Clip) -> int:
    """The point at a joint."""
    found = np.flatnonzero(clip.distances.targets == joint)
    if not len(found):
        key = clip.skeleton.keys[joint]
        what = f"no joint of the source drives {key!r}, or it is where its parent is; expected another joint"
        raise contacts.fault(entry, "distance", what)
    return int(found[0])


def solve_postures(
    problem: DistanceProblem, source: Array, copy: Array, set_by_user: UserDistances | None = None
) -> Postures:
    """Minimise Eq. (2) in every frame. `source`, (frames, source joints, 3), and `copy`, (frames, target joints, 3),
    are the positions of the source and of its rotation copy [file units]; `set_by_user` replaces distances of it.
    """
    set_by_user = set_by_user or no_distances(len(copy))
    points = copy[:, problem.targets]
    centroids = points.mean(axis=1, keepdims=True)
    C = columns((points - centroids) / problem.body_size)
    S = columns(source[:, problem.sources] - source[:, problem.sources].mean(axis=1, keepdims=True))
    X = np.empty_like(C)
    log = np.zeros((4, len(C)))
    ratio, priorities = padded(problem.ratio), padded(problem.priorities)
    shape = 3, ratio.shape[1]
    stress, gradient, scratch = Stress(np.empty_like(ratio), priorities), np.zeros(shape), scratch_for(shape)
    for block in blocks_of(len(C)):
        x, solved = padded(off_plane(C[block])), np.empty((block.stop - block.start, *shape))
        given = set_by_user.of_frames(block)
        solve_points(padded(S[block]), x, ratio, stress, given, solved, block.start, log, gradient, scratch)
        X[block] = solved[:, :, : len(problem)]
    positions = aligned(X.transpose(0, 2, 1), C.transpose(0, 2, 1)) * problem.body_size + centroids
    return Postures(positions, log[0], Effort.from_log(log))


def off_plane(x: Array) -> Array:
    """Postures, (frames, 3, points); those that lie in a plane or on a line are moved off it.

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


class BareClip(NamedTuple):
    """The fields of a `Clip` that `solve_poses` needs."""

    source: Motion
    copy: Motion
    root: Array
    distances: DistanceProblem
    parts: Numbers


def solve_poses(
    clip: Clip | BareClip, guess: Array, progress: Progress = ignore_progress, set_by_user: UserDistances | None = None
) -> Poses:
    """Minimise Eq. (2) over the rotations in every frame of a clip; `progress` and `set_by_user` as in `solve_paper`.
    `guess`, (frames, parts + 1, 3), is the start pose of a frame unless the previous frames give a better one.
    """
    set_by_user = set_by_user or no_distances(len(clip.copy))
    distances, unit = clip.distances, clip.distances.body_size
    parts = int(clip.parts.max()) + 1
    stiffness = np.append(np.full(parts, PART_STIFFNESS), ROOT_STIFFNESS)
    body = Articulation(clip.copy.skeleton.parents, clip.parts, stiffness)
    bones, root = np.ascontiguousarray(clip.copy.bones / unit), np.ascontiguousarray(clip.root / unit)
    S = np.ascontiguousarray(clip.source.positions[:, distances.sources].transpose(0, 2, 1))
    v, log = np.zeros((len(clip.copy), parts + 1, 3)), np.zeros((4, len(clip.copy)))
    terms, work = _terms(distances), Workspace.of(body)
    springs = _springs_of(set_by_user, terms)
    for block in blocks_of(len(clip.copy)):
        copy = CopiedBones(bones[block], root[block])
        given = PaperFrames(S[block], guess[block], distances.ratio, terms, set_by_user.of_frames(block), springs)
        solve_paper_frames(body, copy, given, POSE_TOLERANCE, v, block.start, log, work)
        progress(block.stop - block.start)
    v[:, -1] *= unit
    return Poses(v, log)


def _terms(distances: DistanceProblem) -> PaperTerms:
    points = len(distances)
    u, v = np.triu_indices(points, 1)
    on = distances.priorities[u, v] > 0
    u, v = u[on], v[on]
    joints, pi = distances.targets, np.array(distances.priorities)
    springs = FrameSprings(joints[u], joints[v], np.zeros((len(u), 3)), np.zeros((len(u), 3, 3)))
    columns = np.zeros((2, 3, points))
    return PaperTerms(joints, np.zeros((points, points)), pi, columns[0], columns[1], pi[u, v], springs)


def _springs_of(set_by_user: UserDistances, terms: PaperTerms) -> Numbers:
    """(pairs,), the spring of each pair whose distance a user sets; -1 for none."""
    a, b = np.sort(terms.points[np.stack([set_by_user.u, set_by_user.v])], axis=0)
    on = (terms.springs.a == a[:, None]) & (terms.springs.b == b[:, None])
    return np.where(on.any(axis=1), on.argmax(axis=1), -1) if on.size else np.full(len(a), -1)
