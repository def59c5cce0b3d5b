"""Which pairs are near, how firmly they are kept, and where they belong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from distretarget.distances import DistanceProblem
from distretarget.numerics.smoothing import widened
from distretarget.solve.poses import Springs

Array = NDArray[np.float64]

CLOSE = 0.11  # a pair is kept fully where its D is at most this ...
APART = 0.16  # ... and is not looked at where it is at least this; farther apart keeps more, and changes more
FAR_ALONG = 5  # joints on the path of a pair, at least: near along the tree is no contact
GRIP = 60.0  # how firmly a pair is kept at D = CLOSE, against the holds; the nearer, the more firmly ...
TOUCH = 0.005  # ... up to CLOSE / TOUCH times
ACROSS = 0.08  # [body units] pairs nearer than this are kept in all directions, farther ones along their own
LEAD = 0.3  # [s] a pair begins to take hold so long before it is near


@dataclass(frozen=True, eq=False)
class NearPairs:
    """The pairs that may come near, being far apart along the tree.

    Attributes:
        u, v: (pairs,), points.
        tau1, tau2: (pairs,), path lengths on the source and on the target [source file units, body units].
    """

    u: NDArray[np.intp]
    v: NDArray[np.intp]
    tau1: Array
    tau2: Array


def near_pairs(problem: DistanceProblem, unit: float) -> NearPairs:
    """All pairs of points with at least `FAR_ALONG` joints on their path."""
    u, v = np.triu_indices(len(problem), 1)
    far = (problem.sizes[u, v] >= FAR_ALONG) & (problem.tau1[u, v] > 0)
    u, v = u[far], v[far]
    return NearPairs(u, v, problem.tau1[u, v], problem.tau2[u, v] / unit)


def grips(D: Array, lead: float) -> Array:
    """f: (frames, pairs), from normalised distances: 1 up to `CLOSE`, 0 from `APART` on, smooth in between, and widened
    in time by `lead` frames. A single frame unlike both its neighbours, a spike, counts for nothing.
    """
    t = np.clip((APART - median_filter(D, (3, 1), mode="nearest")) / (APART - CLOSE), 0.0, 1.0)
    return widened(t**3 * (t * (6.0 * t - 15.0) + 10.0), lead)


def sight(lead: float) -> int:
    """How many frames `grips` looks at on both sides: it widens by twice the lead, after a median of three."""
    return 2 * round(lead) + 1


def pair_springs(
    pairs: NearPairs, problem: DistanceProblem, source: Array, copy: Array, block: slice, lead: float
) -> Springs:
    """The springs of the near pairs in a block of frames; arrays have the frames in front.

    `source`, (frames, points, 3), is the source's points [file units], `copy` the copy's [body units], of the whole
    clip; `lead` is in frames.
    """
    margin = sight(lead)
    first, last = max(block.start - margin, 0), min(block.stop + margin, len(source))
    seen = source[first:last]
    D = np.linalg.norm(seen[:, pairs.u] - seen[:, pairs.v], axis=-1) / pairs.tau1
    on = np.flatnonzero((D < APART).any(axis=0))
    u, v = pairs.u[on], pairs.v[on]
    inside = slice(block.start - first, block.stop - first)
    f = grips(D[:, on], lead)[inside]
    firm = GRIP * _shared(f, u, v, len(problem)) * CLOSE / (D[inside][:, on] + TOUCH)
    d_source = (source[block][:, u] - source[block][:, v]) * (pairs.tau2[on] / pairs.tau1[on])[:, None]
    d_copy = copy[block][:, u] - copy[block][:, v]
    delta = d_copy + f[..., None] * (d_source - d_copy)
    length = np.linalg.norm(d_source, axis=-1)
    e = d_source / np.maximum(length, 1e-12)[..., None]
    k = ACROSS**2 / (ACROSS**2 + length**2)
    return Springs(problem.targets[u], problem.targets[v], delta, e, firm, k)


def _shared(f: Array, u: NDArray[np.intp], v: NDArray[np.intp], points: int) -> Array:
    """The grips divided by the square root of one and all grips of either point.

    So each point of a cluster that comes near another is pulled about as firmly as one that comes alone.
    """
    sums = np.ones((points, len(f)))
    np.add.at(sums, u, f.T)
    np.add.at(sums, v, f.T)
    return np.asarray(f / np.sqrt(sums[u] * sums[v]).T)
