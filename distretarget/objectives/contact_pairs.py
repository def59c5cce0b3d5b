"""Pairs of joints that come near each other: when their springs set in, how stiff they are, and their rest vectors.

    1/2 w r^T (k I + (1 - k) e e^T) r,   r = x_u - x_v - delta,   delta = d_copy + f (tau2 / tau1 d_source - d_copy)

f is the activation, 0 to 1; w the stiffness; e the direction of d_source, and k the share of w that acts across it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import Regions
from distretarget.body.legs import Legs
from distretarget.distances import DistanceProblem
from distretarget.numerics.compiled import compiled, inlined
from distretarget.numerics.time_series import Shots, by_shot, widened
from distretarget.objectives.settings import ContactSettings

Array = NDArray[np.float64]
Joints = NDArray[np.intp]

FADE = 0.05  # [D] a pair is ignored from the reach of contacts plus this on
LEAST_PATH = 5  # |P| of a pair: joints near each other along the tree make no contact
STIFFNESS = 60.0  # of a pair at D = the reach of contacts, where their strength is 1
TOUCH = 0.005  # [D] added to the D that the stiffness is divided by, so that pairs that touch are not endlessly stiff
DIRECTION_RANGE = 0.08  # pairs nearer than about this keep their direction as well as their distance [body units]


@dataclass(frozen=True, eq=False)
class CandidatePairs:
    """The pairs of points that make a contact where they come near each other, being far apart along the tree.

    Attributes:
        u, v: (pairs,), points.
        a, b: (pairs,), the target's joints at these.
        tau1: (pairs,), path lengths on the source [source file units].
        ratio: (pairs,), tau2 / tau1 [body units / source file unit].
        feet: (pairs,), whether it is a pair of the two feet, which come near without a contact in a body that stands.
        points: how many points there are.
    """

    u: Joints
    v: Joints
    a: Joints
    b: Joints
    tau1: Array
    ratio: Array
    feet: NDArray[np.bool_]
    points: int


def candidate_pairs(distances: DistanceProblem, regions: Regions, legs: Legs | None, unit: float) -> CandidatePairs:
    """Return all pairs of points in two regions of the target that are not neighbours, with a path size |P| of at least
    `LEAST_PATH`; `legs` are the target's and `unit` is its body unit [file units].
    """
    of_point = regions.of_joint[distances.targets]
    u, v = np.triu_indices(len(distances), 1)
    far = (distances.sizes[u, v] >= LEAST_PATH) & (distances.tau1[u, v] > 0)
    far &= (np.minimum(of_point[u], of_point[v]) >= 0) & ~regions.neighbours[of_point[u], of_point[v]]
    u, v = u[far], v[far]
    feet = np.zeros(len(u), bool)
    if legs:
        regions_of_pair, of_feet = (
            np.sort([of_point[u], of_point[v]], axis=0),
            [regions.of_joint[leg.ankle] for leg in legs],
        )
        feet = (regions_of_pair == np.sort(of_feet)[:, None]).all(axis=0)
    tau1, targets = distances.tau1[u, v], distances.targets
    ratio = distances.tau2[u, v] / unit / tau1
    return CandidatePairs(u, v, targets[u], targets[v], tau1, ratio, np.asarray(feet), len(distances))


def activation(D: Array, shots: Shots, lead: float, reach: float) -> Array:
    """f: (frames, pairs), how far each pair has set in, from 0 to 1, given its normalised distances D.

    It is 1 up to `reach`, 0 from `reach + FADE` on, smooth in between, and widened by `lead` frames before and after. A
    single frame unlike both its neighbours is a fault of the clip, and ignored. `shots`, (frames,), say nothing of each
    other.
    """
    return by_shot(partial(_activation, lead=lead, reach=reach), shots, D)


def _activation(D: Array, lead: float, reach: float) -> Array:
    f = np.empty_like(D)
    _write_set_in(D, reach, reach + FADE, f)
    return widened(f, lead)


@compiled()
def _write_set_in(D, reach, apart, f):  # type: ignore[no-untyped-def]
    """Write how far pairs have set in by the median of three frames of their distances D, (frames, pairs)."""
    for frame in range(len(D)):
        before, after = max(frame - 1, 0), min(frame + 1, len(D) - 1)
        for pair in range(D.shape[1]):
            a, b, c = D[before, pair], D[frame, pair], D[after, pair]
            median = max(min(a, c), min(b, max(a, c)))
            t = min(max((apart - median) / (apart - reach), 0.0), 1.0)
            f[frame, pair] = t * t * t * (t * (6.0 * t - 15.0) + 10.0)


def activation_window(lead: float) -> int:
    """How many frames on both sides `activation` depends on: twice the lead, after a median of three frames."""
    return 2 * round(lead) + 1


class NearPairs(NamedTuple):
    """The near pairs of a block of frames, of which `write_pair_spring` makes the springs of a frame.

    Attributes:
        a, b: (pairs,), their joints of the target.
        u, v: (pairs,), their points.
        ratio: (pairs,), tau2 / tau1 [body units / file unit].
        source, copy: (frames, points, 3), the points of source and copy [file units, body units].
        f, w: (frames, pairs), how far they have set in, and their stiffness.
    """

    a: Joints
    b: Joints
    u: Joints
    v: Joints
    ratio: Array
    source: Array
    copy: Array
    f: Array
    w: Array


def near_pairs(
    pairs: CandidatePairs,
    source: Array,
    copy: Array,
    standing: Array,
    shots: Shots,
    *,
    block: slice,
    lead: float,
    settings: ContactSettings,
) -> NearPairs:
    """Return the pairs that are near in any frame of a block.

    `source`, (frames, points, 3), are the source's points [file units], `copy` the copy's [body units], and `shots`,
    (frames,), those of the whole clip; `standing`, (frames of the block,), is 1 while a foot rests; `lead` is in
    frames.
    """
    margin = activation_window(lead)
    first, last = max(block.start - margin, 0), min(block.stop + margin, len(source))
    window, inside = source[first:last], slice(block.start - first, block.stop - first)
    on = np.flatnonzero(come_near(window, window, pairs.u, pairs.v, (settings.reach + FADE) * pairs.tau1))
    u, v = pairs.u[on], pairs.v[on]
    D = normalised_distances(window, window, u, v, pairs.tau1[on])
    f = activation(D, shots[first:last], lead, settings.reach)[inside] * (1.0 - np.outer(standing, pairs.feet[on]))
    w = pair_stiffness(f, D[inside], (u, v), pairs.points, settings)
    return NearPairs(pairs.a[on], pairs.b[on], u, v, pairs.ratio[on], window[inside], copy[block], f, w)


def no_pairs(frames: int) -> NearPairs:
    """Return the near pairs of frames in which nothing is near."""
    none, points, values = np.zeros(0, np.intp), np.zeros((frames, 0, 3)), np.zeros((frames, 0))
    return NearPairs(none, none, none, none, np.zeros(0), points, points, values, values)


@inlined()
def share_across(square):  # type: ignore[no-untyped-def]
    """k: the stiffness across the direction of a pair, as a share of that along it, by its squared length [body units],
    a number or an array; at the length `DIRECTION_RANGE` it is a half.
    """
    return DIRECTION_RANGE**2 / (DIRECTION_RANGE**2 + square)


@inlined(fastmath=True)
def write_pair_spring(near: NearPairs, frame: int, pair: int, rest: Array, A: Array) -> None:
    """Write the spring of a pair in a frame: the difference that the pair is drawn to, d_copy + f (ratio d_source -
    d_copy), to `rest`, (3,), and its stiffness, w along the direction of d_source and k w across it (`share_across`),
    to `A`, (3, 3).
    """
    u, v, f, w, ratio = near.u[pair], near.v[pair], near.f[frame, pair], near.w[frame, pair], near.ratio[pair]
    dx = near.source[frame, u, 0] - near.source[frame, v, 0]
    dy = near.source[frame, u, 1] - near.source[frame, v, 1]
    dz = near.source[frame, u, 2] - near.source[frame, v, 2]
    square = dx * dx + dy * dy + dz * dz
    across = w * share_across(ratio * ratio * square)
    along = (w - across) / square if square > 0.0 else 0.0
    A[0, 0], A[0, 1], A[0, 2] = along * dx * dx + across, along * dx * dy, along * dx * dz
    A[1, 0], A[1, 1], A[1, 2] = along * dx * dy, along * dy * dy + across, along * dy * dz
    A[2, 0], A[2, 1], A[2, 2] = along * dx * dz, along * dy * dz, along * dz * dz + across
    rest[0], rest[1], rest[2] = dx, dy, dz
    for i in range(3):
        copied = near.copy[frame, u, i] - near.copy[frame, v, i]
        rest[i] = copied + f * (ratio * rest[i] - copied)


def come_near(a: Array, b: Array, u: Joints, v: Joints, reach: Array) -> NDArray[np.bool_]:
    """Whether each point u of `a` and point v of `b`, (frames, points, 3) both, are nearer than their reach in any
    frame, (pairs,).
    """
    near = np.zeros(len(u), np.bool_)
    _mark_near(a, b, u, v, reach, near)
    return near


@compiled(fastmath=True)
def _mark_near(a, b, u, v, reach, near):  # type: ignore[no-untyped-def]
    for pair in range(len(u)):
        i, j, square = u[pair], v[pair], reach[pair] ** 2
        for frame in range(len(a)):
            x = a[frame, i, 0] - b[frame, j, 0]
            y = a[frame, i, 1] - b[frame, j, 1]
            z = a[frame, i, 2] - b[frame, j, 2]
            if x * x + y * y + z * z < square:
                near[pair] = True
                break


def normalised_distances(a: Array, b: Array, u: Joints, v: Joints, tau: Array) -> Array:
    """D: (frames, pairs), the distances between points u of `a` and points v of `b`, (frames, points, 3) both, over
    path lengths tau, (pairs,).
    """
    D = np.empty((len(a), len(u)))
    _write_distances(a, b, u, v, tau, D)
    return D


@compiled()
def _write_distances(a, b, u, v, tau, D):  # type: ignore[no-untyped-def]
    for frame in range(len(a)):
        for pair in range(len(u)):
            i, j = u[pair], v[pair]
            x = a[frame, i, 0] - b[frame, j, 0]
            y = a[frame, i, 1] - b[frame, j, 1]
            z = a[frame, i, 2] - b[frame, j, 2]
            D[frame, pair] = np.sqrt(x * x + y * y + z * z) / tau[pair]


def pair_stiffness(f: Array, D: Array, ends: tuple[Joints, Joints], points: int, settings: ContactSettings) -> Array:
    """w: (frames, pairs), the stiffness of pairs with activations f and normalised distances D, (frames, pairs), whose
    ends, (pairs,) each, are numbers of `points` points.

    Activations count over sqrt((1 + F_u) (1 + F_v)), where F is the sum of the activations of a point. So a point that
    comes near a cluster of points is drawn about as strongly as one that comes near a single point.
    """
    w = np.empty_like(f)
    _write_stiffness(f, D, *ends, settings.strength * STIFFNESS, settings.reach, np.empty(points), w)
    return w


@compiled()
def _write_stiffness(f, D, u, v, stiffness, reach, sums, w):  # type: ignore[no-untyped-def]
    """Write w = stiffness f / sqrt((1 + F_u) (1 + F_v)) reach / (D + TOUCH); `sums`, (points,), is scratch."""
    for frame in range(len(f)):
        for point in range(len(sums)):
            sums[point] = 1.0
        for s in range(len(u)):
            sums[u[s]] += f[frame, s]
            sums[v[s]] += f[frame, s]
        for s in range(len(u)):
            w[frame, s] = 0.0
            if f[frame, s] > 0.0:
                shared = f[frame, s] / np.sqrt(sums[u[s]] * sums[v[s]])
                w[frame, s] = stiffness * shared * reach / (D[frame, s] + TOUCH)
