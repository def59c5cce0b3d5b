"""Self-contacts of regions of a body, such as hand and hip, and how well a result keeps them.

Two regions of the target's body touch in a frame if they are not neighbours and their nearest joints are close to each
other in the source, but far apart along the tree, and clearly closer than while the source stands with hanging arms:
a hand that hangs beside the hip does not touch it. Two feet, and two shins, do not count while the body stands or
walks, since they pass each other in every stride.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from distretarget.body.anatomy import Regions
from distretarget.body.limbs import Legs
from distretarget.contact_entries import DroppedContact
from distretarget.distances import MOST_POINTS
from distretarget.matching.matching import Matching
from distretarget.measure.metrics import Track
from distretarget.measure.skin_touches import hanging_gaps
from distretarget.motion import Motion
from distretarget.numerics.joint_pairs import write_nearest
from distretarget.numerics.moving import largest
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths
from distretarget.rig import rig_cached

CONTACT_DISTANCE = 0.15  # joints in contact have D below this in the source ...
NEARER = 0.8  # ... and below this share of their D while arms hang ...
LEAST_DISTANCE = 0.01  # ... or, if that is less, below this ...
FAR_ALONG = 5  # ... and at least this many joints on the path between them
STRIDE = 0.2  # a body stands or walks in frames within this time of one in which a foot rests [s]


@dataclass(frozen=True, eq=False)
class Candidates:
    """The pairs of target joints that may touch, ordered by their pairs of regions."""

    names: tuple[str, ...]  # (pairs of regions,), as "left hand - hips", the most interesting first
    passing: Flags  # (pairs of regions,), whether the two regions pass each other in a stride
    first: Numbers  # (pairs of regions,), where the pairs of joints of each begin
    u: Numbers  # (pairs of joints,)
    v: Numbers  # (pairs of joints,)
    tau_source: Array  # (pairs of joints,), path lengths on the source, between their drivers [source file units]
    tau: Array  # (pairs of joints,), path lengths on the target [target file units]
    limits: Array  # (pairs of joints,), the D in the source below which they touch


class RegionContact(NamedTuple):
    """The contacts between two regions over a clip, and how well the result keeps them."""

    name: str  # of the two regions, such as "left hand - right hand"
    frames: Numbers  # (frames of contact,), in which they touch in the source
    distance_source: float  # mean D of their nearest joints over these frames
    distance_result: float  # the same in the result
    error: float  # mean |D_source - D_result| over these frames
    worst_frame: int  # of the largest |D_source - D_result|
    u: int  # with v, the target joints that are nearest in the source in that frame
    v: int


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contacts of a source and their distances in a result: a row for each contact in each frame."""

    candidates: Candidates
    strides: Flags  # (frames,), whether a foot of the source rests within `STRIDE`
    frame: Numbers  # (rows,), ascending
    regions: Numbers  # (rows,), the pair of regions that touches, an index into `candidates.names`
    nearest: Numbers  # (rows,), the pair of joints that is nearest in the source, an index into `candidates.u`
    distance_source: Array  # (rows,), D of these joints
    distance_result: Array

    @property
    def u(self) -> Numbers:
        """(rows,), the first target joint of the nearest pair."""
        return self.candidates.u[self.nearest]

    @property
    def v(self) -> Numbers:
        """(rows,), the second target joint of the nearest pair."""
        return self.candidates.v[self.nearest]

    def without(self, drops: Sequence[DroppedContact]) -> Contacts:
        """Return the contacts without those that a user drops."""
        is_left = ~np.any([drop.matches(self.u, self.v) & drop.frames[self.frame] for drop in drops], axis=0)
        rows = (self.frame, self.regions, self.nearest, self.distance_source, self.distance_result)
        return Contacts(self.candidates, self.strides, *(each[is_left] for each in rows))

    def in_result(self, result: Motion) -> Contacts:
        """The same contacts with the distances of a result."""
        tau = self.candidates.tau[self.nearest]
        return replace(self, distance_result=_distances(result, self.frame, self.u, self.v) / tau)

    @property
    def error(self) -> Array:
        """(rows,), |D_source - D_result|."""
        return np.abs(self.distance_source - self.distance_result)

    @property
    def counts(self) -> Numbers:
        """(frames,), the number of contacts in each frame."""
        return np.bincount(self.frame, minlength=len(self.strides))

    @property
    def track(self) -> Track:
        """(frames,), the mean error of the contacts of a frame, where it has some."""
        sums, counts = np.bincount(self.frame, self.error, minlength=len(self.strides)), self.counts
        return Track(np.asarray(sums / np.maximum(counts, 1)), counts > 0)

    @property
    def touches(self) -> tuple[RegionContact, ...]:
        """The contacts of each pair of regions that touches in the source, the most interesting first."""
        found = []
        for k in np.unique(self.regions).tolist():
            rows = np.flatnonzero(self.regions == k)
            worst, distances = rows[self.error[rows].argmax()], (self.distance_source, self.distance_result, self.error)
            source, result, error = (float(each[rows].mean()) for each in distances)
            nearest = int(self.frame[worst]), int(self.u[worst]), int(self.v[worst])
            found.append(RegionContact(self.candidates.names[k], self.frame[rows], source, result, error, *nearest))
        return tuple(found)


def find_region_contacts(source: Motion, matching: Matching, feet_rest: Flags) -> Contacts:
    """Find the contacts of a source, with its own distances as a result's; `feet_rest` is (frames, foot joints)."""
    candidates, reach = find_candidates(matching), round(STRIDE / source.frame_time)
    strides = largest(np.asarray(feet_rest.any(axis=1), np.float64)[:, None], reach)[:, 0] > 0.0
    u, v = (matching.drivers[joints] for joints in (candidates.u, candidates.v))
    limits, ends = (candidates.limits * candidates.tau_source) ** 2, np.append(candidates.first, len(u))
    nearest = np.empty((len(source), len(candidates.first)), np.int32)
    write_nearest(np.ascontiguousarray(source.positions), u, v, limits, ends, nearest)
    frame, regions = np.nonzero((nearest >= 0) & ~(candidates.passing & strides[:, None]))
    pair = nearest[frame, regions].astype(np.intp)
    D = _distances(source, frame, u[pair], v[pair]) / candidates.tau_source[pair]
    return Contacts(candidates, strides, frame, regions, pair, D, D)


@rig_cached
def find_candidates(matching: Matching) -> Candidates:
    """Find the pairs of driven target joints that may touch: in regions that are not neighbours, and far apart on the
    tree. Of coinciding joints the first counts; of more than `MOST_POINTS` those on the longest branches.
    """
    source, target = matching.source.skeleton, matching.target.skeleton
    drivers, regions = matching.drivers, matching.regions
    driven = np.flatnonzero(drivers >= 0)
    places = np.stack([target.coincident[driven], source.coincident[drivers[driven]]])
    points = target.on_longest_branches(np.sort(driven[np.unique(places, axis=1, return_index=True)[1]]), MOST_POINTS)
    upper = np.triu_indices(len(points), 1)
    u, v = (points[end] for end in upper)
    tau, tau_source = target.paths_among(points)[upper], source.paths_among(drivers[points])[upper]
    of_u, of_v = regions.of_joint[u], regions.of_joint[v]
    possible = (of_u >= 0) & (of_v >= 0) & (target.path_sizes(points)[upper] >= FAR_ALONG)
    possible &= ~regions.neighbours[of_u, of_v] & (tau > 0) & (tau_source > 0)
    ends = np.sort(np.stack([of_u, of_v], axis=1)[possible], axis=1)
    order = np.lexsort(ends.T[::-1])
    u, v = u[possible][order], v[possible][order]
    tau, tau_source = tau[possible][order], tau_source[possible][order]
    hanging = hanging_gaps(matching.source, drivers[u], drivers[v]) / tau_source
    pairs, first = np.unique(ends[order], axis=0, return_index=True)
    names = tuple(f"{regions.names[a]} - {regions.names[b]}" for a, b in pairs)
    passing = _pass_in_stride(regions, pairs.reshape(-1, 2), matching.legs[1] if matching.legs else None)
    limits = np.clip(NEARER * hanging, LEAST_DISTANCE, CONTACT_DISTANCE)
    return Candidates(names, passing, first, u, v, tau_source, tau, limits)


def _pass_in_stride(regions: Regions, pairs: Numbers, legs: Legs | None) -> Flags:
    """(pairs,), whether two regions, (pairs, 2), pass each other in a stride: both shins, or both feet."""
    if not legs:
        return np.zeros(len(pairs), bool)
    feet = {int(regions.of_joint[leg.ankle]) for leg in legs}
    shins = {number for number, name in enumerate(regions.names) if name.endswith(" shin")}
    both = [len(some) == len(legs) for some in (feet, shins)]
    return np.array([(both[0] and {*pair} == feet) or (both[1] and {*pair} == shins) for pair in pairs.tolist()], bool)


def _distances(motion: Motion, frame: Numbers, u: Numbers, v: Numbers) -> Array:
    """(rows,), the distance of joints u and v in one frame each [file units]."""
    return np.asarray(lengths(motion.positions[frame, u] - motion.positions[frame, v]))
