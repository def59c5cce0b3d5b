"""Distances that are asked for in the paper's objective: they replace delta and pi of their pairs, Eq. (2)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from distretarget.contact_entries import ContactList, Distance, Entry
from distretarget.distances import DistanceProblem
from distretarget.numerics.compiled import inlined
from distretarget.objectives.asking import Wishes

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


class AskedDistances(NamedTuple):
    """Pairs of points whose distances are asked for."""

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
    """Return the distances of a contact list.

    Raises:
        ContactsError: an entry asks for something else, or for the distance of a joint that nothing drives.
    """
    clip, problem = wishes.clip, wishes.clip.distances
    ends, values = [], []
    for wish in wishes.wishes:
        entry = wish.entry
        if not isinstance(entry, Distance):
            raise contacts.fault(
                entry, "", "the paper's objective keeps nothing but distances; use --objective contact"
            )
        points = [_point(contacts, problem, entry, int(joints[0]), clip.skeleton.keys) for joints in wish.joints]
        ends.append(points)
        size = wishes.length(entry.value) * clip.unit / problem.body_size
        values.append((size, entry.priority, problem.priorities[points[0], points[1]], wishes.firmness(wish)))
    u, v = np.array(ends, np.intp).reshape(-1, 2).T
    delta, pi, own = (np.array([each[n] for each in values], float) for n in range(3))
    weight = np.stack([each[3] for each in values], axis=1)
    return AskedDistances(np.ascontiguousarray(u), np.ascontiguousarray(v), delta, pi, own, weight)


def _point(contacts: ContactList, problem: DistanceProblem, entry: Entry, joint: int, keys: tuple[str, ...]) -> int:
    """The point at a joint."""
    found = np.flatnonzero(problem.targets == joint)
    if not len(found):
        what = f"no joint of the source drives {keys[joint]!r}, or it is where its parent is; expected another joint"
        raise contacts.fault(entry, "distance", what)
    return int(found[0])


@inlined()
def put_distances(asked: AskedDistances, frame: int, delta: Array, pi: Array) -> None:
    """Put what is asked in a frame in the place of target distances and priorities, (points, columns)."""
    for n in range(len(asked.u)):
        u, v, w = asked.u[n], asked.v[n], asked.weight[frame, n]
        value = delta[u, v] + w * (asked.delta[n] - delta[u, v])
        priority = asked.own[n] + w * (asked.pi[n] - asked.own[n])
        delta[u, v] = delta[v, u] = value
        pi[u, v] = pi[v, u] = priority
