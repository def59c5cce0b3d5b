"""Pairs of joints that come near each other: when their springs set in, how stiff they are, and what they draw to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.body.anatomy import Regions
from distretarget.body.legs import Legs
from distretarget.distances import DistanceProblem
from distretarget.numerics.compiled import compiled, inlined
from distretarget.numerics.time_series import widened
from distretarget.objectives.settings import ContactSettings

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CandidatePairs:
    """The pairs of points that make a contact where they come near each other, being far apart along the tree.

    Attributes:
        u, v: (pairs,), points.
        tau1, tau2: (pairs,), path lengths on the source and on the target [source file units, body units].
        feet: (pairs,), whether it is a pair of the two feet, which come near without a contact in a body that stands.
    """

    u: NDArray[np.intp]
    v: NDArray[np.intp]
    tau1: Array
    tau2: Array
    feet: NDArray[np.bool_]


def candidate_pairs(
    distances: DistanceProblem, regions: Regions, legs: Legs | None, unit: float, least_path: int
) -> CandidatePairs:
    """All pairs of points in two regions of the target that are not neighbours, with a path size |P| of at least
    `least_path`; `legs` are the target's and `unit` is its body unit [file units].
    """
    of_point = regions.of_joint[distances.targets]
    u, v = np.triu_indices(len(distances), 1)
    far = (distances.sizes[u, v] >= least_path) & (distances.tau1[u, v] > 0)
    far &= (np.minimum(of_point[u], of_point[v]) >= 0) & ~regions.neighbours[of_point[u], of_point[v]]
    u, v = u[far], v[far]
    feet = np.zeros(len(u), bool)
    if legs:
        one, other = (regions.of_joint[leg.ankle] for leg in legs)
        feet = (np.minimum(of_point[u], of_point[v]) == min(one, other)) & (
            np.maximum(of_point[u], of_point[v]) == max(one, other)
        )
    return CandidatePairs(u, v, distances.tau1[u, v], distances.tau2[u, v] / unit, feet)


def activation(D: Array, lead: float, settings: ContactSettings) -> Array:
    """f: (frames, pairs), how far each pair has set in, from 0 to 1, given its normalised distances D.

    It is 1 up to `settings.close`, 0 from `settings.apart` on, smooth in between, and widened by `lead` frames before
    and after. A single frame unlike both its neighbours is a fault of the clip, and ignored.
    """
    f = np.empty_like(D)
    _write_set_in(D, settings.close, settings.apart, f)
    return widened(f, lead)


@compiled()
def _write_set_in(D, close, apart, f):  # type: ignore[no-untyped-def]
    """Write how far pairs have set in by the median of three frames of their distances D, (frames, pairs)."""
    for frame in range(len(D)):
        before, after = max(frame - 1, 0), min(frame + 1, len(D) - 1)
        for pair in range(D.shape[1]):
            a, b, c = D[before, pair], D[frame, pair], D[after, pair]
            median = max(min(a, c), min(b, max(a, c)))
            t = min(max((apart - median) / (apart - close), 0.0), 1.0)
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
        direction_range: the length at which half of the stiffness acts across their direction too [body units].
    """

    a: NDArray[np.intp]
    b: NDArray[np.intp]
    u: NDArray[np.intp]
    v: NDArray[np.intp]
    ratio: Array
    source: Array
    copy: Array
    f: Array
    w: Array
    direction_range: float


def near_pairs(
    pairs: CandidatePairs,
    distances: DistanceProblem,
    source: Array,
    copy: Array,
    standing: Array,
    *,
    block: slice,
    lead: float,
    settings: ContactSettings,
) -> NearPairs:
    """The pairs that are near in any frame of a block.

    `source`, (frames, points, 3), are the source's points [file units] and `copy` the copy's [body units], of the whole
    clip; `standing`, (frames of the block,), is 1 while a foot rests; `lead` is in frames.
    """
    margin = activation_window(lead)
    first, last = max(block.start - margin, 0), min(block.stop + margin, len(source))
    window = source[first:last]
    on = np.flatnonzero(come_near(window, window, pairs.u, pairs.v, settings.apart * pairs.tau1))
    u, v = pairs.u[on], pairs.v[on]
    D = normalised_distances(window, window, u, v, pairs.tau1[on])
    inside = slice(block.start - first, block.stop - first)
    f = activation(D, lead, settings)[inside] * (1.0 - np.outer(standing, pairs.feet[on]))
    return NearPairs(
        a=distances.targets[u],
        b=distances.targets[v],
        u=u,
        v=v,
        ratio=pairs.tau2[on] / pairs.tau1[on],
        source=window[inside],
        copy=copy[block],
        f=f,
        w=pair_stiffness(f, D[inside], (u, v), len(distances), settings),
        direction_range=settings.direction_range,
    )


def no_pairs(frames: int) -> NearPairs:
    """Nothing is near."""
    none, points, values = np.zeros(0, np.intp), np.zeros((frames, 0, 3)), np.zeros((frames, 0))
    return NearPairs(none, none, none, none, np.zeros(0), points, points, values, values, 1.0)


@inlined()
def share_across(square, direction_range):  # type: ignore[no-untyped-def]
    """k: the stiffness across the direction of a pair, as a share of that along it, by its squared length, a number or
    an array; at the length `direction_range` it is a half.
    """
    return direction_range**2 / (direction_range**2 + square)


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
    across = w * share_across(ratio * ratio * square, near.direction_range)
    along = (w - across) / square if square > 0.0 else 0.0
    A[0, 0], A[0, 1], A[0, 2] = along * dx * dx + across, along * dx * dy, along * dx * dz
    A[1, 0], A[1, 1], A[1, 2] = along * dx * dy, along * dy * dy + across, along * dy * dz
    A[2, 0], A[2, 1], A[2, 2] = along * dx * dz, along * dy * dz, along * dz * dz + across
    rest[0], rest[1], rest[2] = dx, dy, dz
    for i in range(3):
        copied = near.copy[frame, u, i] - near.copy[frame, v, i]
        rest[i] = copied + f * (ratio * rest[i] - copied)


def come_near(a: Array, b: Array, u: NDArray[np.intp], v: NDArray[np.intp], reach: Array) -> NDArray[np.bool_]:
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


def normalised_distances(a: Array, b: Array, u: NDArray[np.intp], v: NDArray[np.intp], tau: Array) -> Array:
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


def pair_stiffness(
    f: Array, D: Array, ends: tuple[NDArray[np.intp], NDArray[np.intp]], points: int, settings: ContactSettings
) -> Array:
    """w: (frames, pairs), the stiffness of pairs with activations f and normalised distances D, (frames, pairs), whose
    ends, (pairs,) each, are numbers of `points` points.

    Activations count over sqrt((1 + F_u) (1 + F_v)), where F is the sum of the activations of a point. So a point that
    comes near a cluster of points is drawn about as strongly as one that comes near a single point.
    """
    w = np.empty_like(f)
    _write_stiffness(f, D, *ends, settings.pair_stiffness, settings.close, settings.touch, np.empty(points), w)
    return w


@compiled()
def _write_stiffness(f, D, u, v, stiffness, close, touch, sums, w):  # type: ignore[no-untyped-def]
    """Write w = stiffness f / sqrt((1 + F_u) (1 + F_v)) close / (D + touch); `sums`, (points,), is scratch."""
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
                w[frame, s] = stiffness * shared * close / (D[frame, s] + touch)
