"""Contact pairs of joints: which pairs are in contact in a frame, and their stiffness."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from distretarget.body.anatomy import Regions
from distretarget.body.limbs import Legs, hanging_distances, passing_regions
from distretarget.contact_entries import DroppedContact
from distretarget.distances import DistanceProblem
from distretarget.numerics.joint_pairs import come_near, least_distances
from distretarget.numerics.time_series import Shots
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.objectives.activation import ContactSettings, SelfContact
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact_terms import TOUCH, NearPairs, write_stiffness
from distretarget.objectives.supports import Supports

LEAST_PATH = 5  # |P| of a pair: joints that are close along the tree make no contact
STIFFNESS = 400.0  # of a pair, over reach / D, with `strength` 1


@dataclass(frozen=True, eq=False)
class CandidatePairs:
    """Pairs of points that make a self-contact when they come close, since they are far apart along the tree."""

    u: Numbers  # (pairs,), the first point
    v: Numbers  # (pairs,), the second point
    a: Numbers  # (pairs,), the target's joint at u
    b: Numbers  # (pairs,), the target's joint at v
    tau1: Array  # (pairs,), path lengths on the source [source file units]
    ratio: Array  # (pairs,), tau2 / tau1 [body units / source file unit]
    hanging: Array  # (pairs,), D in the source as it stands with hanging arms
    regions: Numbers  # (pairs, 2), the body regions of a and b
    passing: Flags  # (pairs,), whether the pair joins feet or shins, which pass each other in a stride

    def without(self, some: Flags) -> CandidatePairs:
        """Return the candidates without those of some pairs of joints, a mask, (joints, joints)."""
        others = ~some[self.a, self.b]
        return CandidatePairs(*(getattr(self, field.name)[others] for field in fields(self)))


def candidate_pairs(
    distances: DistanceProblem,
    regions: Regions,
    legs: Legs | None,
    unit: float,
    hanging: Array,
    points: Flags,
) -> CandidatePairs:
    """Return all pairs of points that lie in two non-adjacent regions of the target and have a path size |P| of at
    least `LEAST_PATH`. `legs` are the target's, `unit` is its body unit [file units], and `hanging` is `Body.hanging`
    of the source; only `points`, (points,), count.
    """
    of_point = regions.of_joint[distances.targets]
    u, v = np.triu_indices(len(distances), 1)
    far = (distances.sizes[u, v] >= LEAST_PATH) & (distances.tau1[u, v] > 0)
    far &= (np.minimum(of_point[u], of_point[v]) >= 0) & ~regions.neighbours[of_point[u], of_point[v]]
    far &= points[u] & points[v]
    u, v = u[far], v[far]
    of_pair = np.stack([of_point[u], of_point[v]], axis=1)
    passing = passing_regions(regions, legs)[*of_pair.T]
    tau1, targets = distances.tau1[u, v], distances.targets
    ratio = distances.tau2[u, v] / unit / tau1
    D = np.maximum(hanging_distances(hanging, distances.sources[u], distances.sources[v], tau1), TOUCH)
    return CandidatePairs(u, v, targets[u], targets[v], tau1, ratio, D, of_pair, passing)


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactSearch:
    """Finds the contact pairs of a clip, block by block."""

    pairs: CandidatePairs
    source: Array  # (frames, points, 3), the points of the source [file units]
    copy: Array  # (frames, points, 3), those of the rotation copy [body units]
    shots: Shots  # (frames,)
    raised: Array  # (frames, points), `Clip.raised_arms`
    frame_time: float  # [s]
    settings: ContactSettings
    regions: int  # the number of body regions
    drops: tuple[DroppedContact, ...] = ()  # contacts that the user drops

    @classmethod
    def of(cls, clip: Clip, settings: ContactSettings, points: Flags | None = None) -> ContactSearch:
        """Return the search for all contact pairs of a clip, or for those among some `points`, a mask, (points,)."""
        distances = clip.distances
        points = np.ones(len(distances), bool) if points is None else points
        # One layout of arrays, for which the solver is compiled once.
        source = np.take(clip.source.positions, distances.sources, axis=1)
        copy = np.take(clip.copy.positions, distances.targets, axis=1)
        copy /= clip.unit
        pairs = candidate_pairs(distances, clip.regions, clip.target_legs, clip.unit, clip.hanging, points)
        return cls(
            pairs=pairs if clip.by_skin is None else pairs.without(clip.by_skin),
            source=source,
            copy=copy,
            shots=clip.shots,
            raised=clip.raised_arms[:, distances.sources],
            frame_time=clip.frame_time,
            settings=settings,
            regions=len(clip.regions.names),
            drops=clip.drops,
        )

    def near(self, block: slice, held: Supports) -> NearPairs:
        """Return the contact pairs of a block of frames with the supports `held`. Pairs between two body regions that
        both rest on the world are no contacts, since their supports place them.
        """
        pairs, contact = self.pairs, SelfContact.of(self.settings, self.frame_time)
        first = max(block.start - contact.window, 0)
        around, inside = slice(first, block.stop + contact.window), slice(block.start - first, block.stop - first)
        source, raised = self.source[around], self.raised[around]
        ever_raised = np.asarray(raised.any(axis=0))
        apart = contact.apart(pairs.hanging, ever_raised[pairs.u] | ever_raised[pairs.v])
        on = np.flatnonzero(come_near(source, source, pairs.u, pairs.v, apart * pairs.tau1))
        u, v, a, b = pairs.u[on], pairs.v[on], pairs.a[on], pairs.b[on]
        D, least = least_distances(source, source, u, v, pairs.tau1[on], self.shots[around])
        enabled = np.ones_like(D)
        for drop in self.drops:
            enabled[np.ix_(drop.frames[around], drop.matches(a, b))] = 0.0
        arms = np.maximum(raised[:, u], raised[:, v])
        f = contact.activation(least, pairs.hanging[on], arms, self.shots[around], enabled)[inside]
        f[:, pairs.passing[on]] *= (1.0 - held.standing)[:, None]
        one, other = held.of_regions(self.regions)[:, pairs.regions[on]].transpose(2, 0, 1)
        f *= 1.0 - one * other
        D = D[inside]
        w = pair_stiffness(f, D, (u, v), source.shape[1], self.settings)
        w /= 1.0 + np.square(np.square(D / self.settings.reach))  # faster than **4
        d_source, d_copy = (
            np.take(points, u, axis=1) - np.take(points, v, axis=1) for points in (source[inside], self.copy[block])
        )
        return NearPairs(a, b, u, v, pairs.ratio[on, None] * d_source, d_copy, f, w)


def pair_stiffness(f: Array, D: Array, ends: tuple[Numbers, Numbers], points: int, settings: ContactSettings) -> Array:
    """w: (frames, pairs), the stiffness of pairs with activations f and normalised distances D, (frames, pairs); `ends`
    are the indices of their two points, (pairs,) each, among `points` points.

    An activation is divided by sqrt((1 + F_u) (1 + F_v)), where F is the sum of the activations of a point: a point
    close to a cluster of points is pulled about as strongly as one close to a single point.
    """
    f, D = np.ascontiguousarray(f), np.ascontiguousarray(D)
    w = np.empty_like(f)
    write_stiffness(f, D, *ends, settings.strength * STIFFNESS, settings.reach, np.empty(points), w)
    return w
