"""Pairs of joints that come near each other: when their springs set in, how stiff they are, and what they draw to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from distretarget.body.legs import Legs
from distretarget.body.regions import Regions
from distretarget.distances import DistanceProblem
from distretarget.numerics.compiled import compiled
from distretarget.numerics.smoothing import widened
from distretarget.numerics.vectors import lengths
from distretarget.solve.settings import ContactSettings
from distretarget.solve.springs import Springs, stiffer_along

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
    t = np.clip(
        (settings.apart - median_filter(D, (3, 1), mode="nearest")) / (settings.apart - settings.close), 0.0, 1.0
    )
    return widened(t**3 * (t * (6.0 * t - 15.0) + 10.0), lead)


def activation_window(lead: float) -> int:
    """How many frames on both sides `activation` depends on: twice the lead, after a median of three frames."""
    return 2 * round(lead) + 1


def pair_springs(
    pairs: CandidatePairs,
    distances: DistanceProblem,
    source: Array,
    copy: Array,
    standing: Array,
    *,
    block: slice,
    lead: float,
    settings: ContactSettings,
) -> Springs:
    """The springs of the near pairs in a block of frames; their arrays have the frames in front.

    `source`, (frames, points, 3), are the source's points [file units] and `copy` the copy's [body units], of the whole
    clip; `standing`, (frames of the block,), is 1 while a foot rests; `lead` is in frames.
    """
    margin = activation_window(lead)
    first, last = max(block.start - margin, 0), min(block.stop + margin, len(source))
    window = source[first:last]
    on = np.flatnonzero(come_near(window, window, pairs.u, pairs.v, settings.apart * pairs.tau1))
    u, v = pairs.u[on], pairs.v[on]
    d_source = window[:, u] - window[:, v]
    D = lengths(d_source) / pairs.tau1[on]
    inside = slice(block.start - first, block.stop - first)
    f = activation(D, lead, settings)[inside] * (1.0 - np.outer(standing, pairs.feet[on]))
    w = pair_stiffness(f, D[inside], (u, v), len(distances), settings)
    d_source = d_source[inside] * (pairs.tau2[on] / pairs.tau1[on])[:, None]
    d_copy = copy[block][:, u] - copy[block][:, v]
    delta = d_copy + f[..., None] * (d_source - d_copy)
    length = lengths(d_source)
    e = d_source / np.maximum(length, 1e-12)[..., None]
    return Springs(
        distances.targets[u], distances.targets[v], delta, stiffer_along(e, w, share_across(length, settings))
    )


@compiled(fastmath=True)
def come_near(a, b, u, v, reach):  # type: ignore[no-untyped-def]
    """Whether each point u of `a` and point v of `b`, (frames, points, 3) both, are nearer than their reach in any
    frame, (pairs,).
    """
    near = np.zeros(len(u), np.bool_)
    for pair in range(len(u)):
        i, j, square = u[pair], v[pair], reach[pair] ** 2
        for frame in range(len(a)):
            x = a[frame, i, 0] - b[frame, j, 0]
            y = a[frame, i, 1] - b[frame, j, 1]
            z = a[frame, i, 2] - b[frame, j, 2]
            if x * x + y * y + z * z < square:
                near[pair] = True
                break
    return near


def pair_stiffness(
    f: Array, D: Array, ends: tuple[NDArray[np.intp], NDArray[np.intp]], points: int, settings: ContactSettings
) -> Array:
    """w: (frames, pairs), the stiffness of pairs with activations f and normalised distances D, (frames, pairs), whose
    ends, (pairs,) each, are numbers of `points` points.

    Activations count over sqrt((1 + F_u) (1 + F_v)), where F is the sum of the activations of a point. So a point that
    comes near a cluster of points is drawn about as strongly as one that comes near a single point.
    """
    u, v = ends
    sums = np.ones((points, len(f)))
    np.add.at(sums, u, f.T)
    np.add.at(sums, v, f.T)
    shared = f / np.sqrt(sums[u] * sums[v]).T
    return np.asarray(settings.pair_stiffness * shared * settings.close / (D + settings.touch))


def share_across(lengths: Array, settings: ContactSettings) -> Array:
    """k: the stiffness across the direction of a pair, as a share of that along it, by its length [body units]."""
    return settings.direction_range**2 / (settings.direction_range**2 + lengths**2)
