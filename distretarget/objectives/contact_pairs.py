"""Contact pairs: when two joints count as a self-contact, and the spring that keeps the contact.

    1/2 w r^T (k I + (1 - k) e e^T) r,   r = x_u - x_v - delta,   delta = d_copy + f (tau2 / tau1 d_source - d_copy)

f is the activation, 0 to 1; w the stiffness; e the direction of d_source; k w the stiffness perpendicular to e.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from distretarget.body.anatomy import Regions
from distretarget.body.limbs import Legs, hanging_distances, passing_regions
from distretarget.distances import DistanceProblem
from distretarget.numerics.compiled import compiled, inlined
from distretarget.numerics.time_series import Shots
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.objectives.activation import ContactSettings, SelfContact
from distretarget.objectives.clip import Clip, Drop

LEAST_PATH = 5  # |P| of a pair: joints that are close along the tree make no contact
STIFFNESS = 400.0  # of a pair, over reach / D, with `strength` 1
WITHIN = 0.05  # a pair that asks the rotation copy to change by more than this pulls with a bounded force [body units]
TOUCH = 0.005  # [D] added to D before the stiffness is divided by it, which keeps touching pairs finite
DIRECTION_RANGE = 0.08  # pairs closer than about this keep their direction as well as their distance [body units]


@dataclass(frozen=True, eq=False)
class CandidatePairs:
    """The pairs of points that count as a self-contact when they come close, being far apart along the tree."""

    u: Numbers  # (pairs,), the first point
    v: Numbers  # (pairs,), the second point
    a: Numbers  # (pairs,), the target's joint at u
    b: Numbers  # (pairs,), the target's joint at v
    tau1: Array  # (pairs,), path lengths on the source [source file units]
    ratio: Array  # (pairs,), tau2 / tau1 [body units / source file unit]
    hanging: Array  # (pairs,), D in the source with hanging arms; infinite where that is not known
    passing: Flags  # (pairs,), whether the pair joins feet or shins, which pass each other in a stride


def candidate_pairs(
    distances: DistanceProblem,
    regions: Regions,
    legs: Legs | None,
    unit: float,
    hanging: Array | None,
    points: Flags,
) -> CandidatePairs:
    """Return all pairs of points that lie in two non-adjacent regions of the target and have a path size |P| of at
    least `LEAST_PATH`. `legs` are the target's, `unit` is its body unit [file units], and `hanging`, if known, is
    `Body.hanging` of the source; only `points`, (points,), count.
    """
    of_point = regions.of_joint[distances.targets]
    u, v = np.triu_indices(len(distances), 1)
    far = (distances.sizes[u, v] >= LEAST_PATH) & (distances.tau1[u, v] > 0)
    far &= (np.minimum(of_point[u], of_point[v]) >= 0) & ~regions.neighbours[of_point[u], of_point[v]]
    far &= points[u] & points[v]
    u, v = u[far], v[far]
    passing = passing_regions(regions, legs)[of_point[u], of_point[v]]
    tau1, targets = distances.tau1[u, v], distances.targets
    ratio = distances.tau2[u, v] / unit / tau1
    D = np.maximum(hanging_distances(hanging, distances.sources[u], distances.sources[v], tau1), TOUCH)
    return CandidatePairs(u, v, targets[u], targets[v], tau1, ratio, D, passing)


class NearPairs(NamedTuple):
    """The contact pairs of a block of frames; `write_pair_spring` makes their springs."""

    a: Numbers  # (pairs,), the target's joint at u
    b: Numbers  # (pairs,), the target's joint at v
    u: Numbers  # (pairs,), the first point
    v: Numbers  # (pairs,), the second point
    ratio: Array  # (pairs,), tau2 / tau1 [body units / file unit]
    source: Array  # (frames, points, 3), the points of the source [file units]
    copy: Array  # (frames, points, 3), the points of the rotation copy [body units]
    f: Array  # (frames, pairs), activation
    w: Array  # (frames, pairs), stiffness


@dataclass(frozen=True, eq=False, kw_only=True)
class Contacts:
    """What the contact pairs of a clip are found from."""

    pairs: CandidatePairs
    source: Array  # (frames, points, 3), the points of the source [file units]
    copy: Array  # (frames, points, 3), those of the rotation copy [body units]
    shots: Shots  # (frames,)
    raised: Array  # (frames, points), 1 while the arm of each is raised or bent
    frame_time: float  # [s]
    settings: ContactSettings
    drops: tuple[Drop, ...] = ()  # contacts that do not count

    @classmethod
    def of(cls, clip: Clip, settings: ContactSettings, points: Flags | None = None) -> Contacts:
        """Return it for all contact pairs of a clip, or for those of two of the `points`, (points,)."""
        distances = clip.distances
        points = np.ones(len(distances), bool) if points is None else points
        # One layout of arrays, for which the solver is compiled once.
        source = np.take(clip.source.positions, distances.sources, axis=1)
        copy = np.take(clip.copy.positions, distances.targets, axis=1)
        copy /= clip.unit
        return cls(
            pairs=candidate_pairs(distances, clip.regions, clip.target_legs, clip.unit, clip.hanging, points),
            source=source,
            copy=copy,
            shots=clip.shots,
            raised=clip.raised_arms[:, distances.sources],
            frame_time=clip.frame_time,
            settings=settings,
            drops=clip.drops,
        )

    def near(self, block: slice, standing: Array) -> NearPairs:
        """Return the pairs in contact in a block; `standing`, (frames of it,), is 1 while a foot rests."""
        pairs, contact = self.pairs, SelfContact.of(self.settings, self.frame_time)
        first = max(block.start - contact.window, 0)
        around, inside = slice(first, block.stop + contact.window), slice(block.start - first, block.stop - first)
        source, raised = self.source[around], self.raised[around]
        apart = contact.apart(pairs.hanging, raised[:, pairs.u] + raised[:, pairs.v])
        on = np.flatnonzero(come_near(source, source, pairs.u, pairs.v, apart * pairs.tau1))
        u, v, a, b = pairs.u[on], pairs.v[on], pairs.a[on], pairs.b[on]
        D = normalised_distances(source, source, u, v, pairs.tau1[on])
        kept = np.ones_like(D)
        for drop in self.drops:
            kept[np.ix_(drop.frames[around], drop.of(a, b))] = 0.0
        arms = np.maximum(raised[:, u], raised[:, v])
        f = contact.activation(D, pairs.hanging[on], arms, self.shots[around], kept)[inside]
        f *= 1.0 - np.outer(standing, pairs.passing[on])
        D = D[inside]
        w = pair_stiffness(f, D, (u, v), source.shape[1], self.settings) / (1.0 + (D / self.settings.reach) ** 4)
        return NearPairs(a, b, u, v, pairs.ratio[on], source[inside], self.copy[block], f, w)


@inlined()
def share_across(square):  # type: ignore[no-untyped-def]
    """k: a pair's stiffness perpendicular to its direction over that along it, from its squared length [body units], a
    number or an array; 1/2 at the length `DIRECTION_RANGE`.
    """
    return DIRECTION_RANGE**2 / (DIRECTION_RANGE**2 + square)


@inlined(fastmath=True)
def write_pair_spring(near: NearPairs, frame: int, pair: int, rest: Array, A: Array) -> None:
    """Write the spring of a pair in a frame: its rest vector d_copy + f (ratio d_source - d_copy) to `rest`, (3,), and
    its stiffness, w along d_source and k w perpendicular to it (`share_across`), to `A`, (3, 3).

    The stiffness is bounded by the length c of the change that the pair asks for, f |ratio d_source - d_copy|: it is
    divided by (1 + (c / WITHIN)^4)^(1/4). So contacts in reach are firm, and others hardly bend the body.
    """
    u, v, f, w, ratio = near.u[pair], near.v[pair], near.f[frame, pair], near.w[frame, pair], near.ratio[pair]
    dx = near.source[frame, u, 0] - near.source[frame, v, 0]
    dy = near.source[frame, u, 1] - near.source[frame, v, 1]
    dz = near.source[frame, u, 2] - near.source[frame, v, 2]
    rest[0], rest[1], rest[2] = dx, dy, dz
    change = 0.0
    for i in range(3):
        copied = near.copy[frame, u, i] - near.copy[frame, v, i]
        asked = f * (ratio * rest[i] - copied)
        rest[i] = copied + asked
        change += asked * asked
    change /= WITHIN * WITHIN
    w /= np.sqrt(np.sqrt(1.0 + change * change))
    square = dx * dx + dy * dy + dz * dz
    across = w * share_across(ratio * ratio * square)
    along = (w - across) / square if square > 0.0 else 0.0
    A[0, 0], A[0, 1], A[0, 2] = along * dx * dx + across, along * dx * dy, along * dx * dz
    A[1, 0], A[1, 1], A[1, 2] = along * dx * dy, along * dy * dy + across, along * dy * dz
    A[2, 0], A[2, 1], A[2, 2] = along * dx * dz, along * dy * dz, along * dz * dz + across


def come_near(a: Array, b: Array, u: Numbers, v: Numbers, reach: Array) -> Flags:
    """(pairs,), whether points u of `a` and v of `b`, (frames, points, 3), ever come closer than `reach`, (pairs,)."""
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


def normalised_distances(a: Array, b: Array, u: Numbers, v: Numbers, tau: Array) -> Array:
    """D: (frames, pairs), distances between points u of `a` and v of `b`, (frames, points, 3), over path lengths."""
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


def pair_stiffness(f: Array, D: Array, ends: tuple[Numbers, Numbers], points: int, settings: ContactSettings) -> Array:
    """w: (frames, pairs), the stiffness of pairs with activations f and normalised distances D, (frames, pairs), whose
    `ends`, (pairs,) each, are numbers of `points` points.

    An activation is divided by sqrt((1 + F_u) (1 + F_v)), where F is the sum of the activations of a point: a point
    close to a cluster of points is pulled about as strongly as one close to a single point.
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
