"""Contacts of performers with each other and with props: joints that come near, and the springs that keep them near.

Between two performers, contacts are pairs of joints. A joint that touches a prop belongs where the prop's placement
takes the joint's driver.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from distretarget.baseline.rotation_copy import RootScale
from distretarget.ik.springs import Springs
from distretarget.numerics.joint_pairs import come_near, least_distances
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.time_series import Shots, by_shot, median_of_three
from distretarget.numerics.vectors import Array, Numbers, lengths
from distretarget.objectives.activation import FADE, ContactSettings, activation, activation_window
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact_pairs import pair_stiffness
from distretarget.objectives.contact_terms import share_across
from distretarget.scene.props import Placement

Both = tuple[Array, Array]

FIRMER = 0.3  # times the stiffness of a pair within a body at D = `settings.reach`; it grows for nearer pairs ...
NEAREST = 0.01  # ... until D is about this
LEAST_STIFFNESS = 0.05  # pairs with less are left out
NO_STIFFNESS = 1e-12  # added to a stiffness matrix so that it is never singular


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """The joints of a performer that may touch another performer or a prop."""

    joints: Numbers  # (points,), of the target
    regions: Numbers  # (points,), the region of the body of each
    source: Array  # (frames, points, 3), positions of their drivers [source file units]
    reach: Array  # (points,), path lengths from the pelvis to them in the source [source file units]
    target_reach: Array  # (points,), the same on the target [target file units]
    shots: Shots  # (frames,), the shots of the clip


@dataclass(frozen=True, eq=False, kw_only=True)
class PerformerContacts:
    """The pairs of joints of two performers that are near each other, with an entry for each pair in each frame."""

    frames: Numbers  # (entries,), the frame
    joints: Numbers  # (2, entries), the joint of each performer
    f: Array  # (entries,), the activation, 0 to 1
    w: Array  # (entries,), the stiffness
    vectors: Array  # (entries, 3), from the second to the first joint in the source, scaled [target file units]

    def gaps(self, one: Array, other: Array) -> Both:
        """(entries,) each, the distance between the joints of each pair, and what it should be.

        `one` and `other`, (frames, joints, 3), are the positions of both performers [target file units].
        """
        u, v = self.joints
        return lengths(one[self.frames, u] - other[self.frames, v]), lengths(self.vectors)

    def springs(self, alone: Both, now: Both, gives: Both, units: tuple[float, float]) -> list[Springs]:
        """The springs that draw the joints of each performer to where they touch, in its body units, frames first.

        `alone` and `now`, (frames, joints, 3), are the positions of both performers without each other and at present
        [target file units]; `gives`, (frames, joints), is how far each joint goes to meet the other [target file
        units], in proportion; `units` are the body units. A joint that touches several others has one spring with the
        sum of their energies.
        """

        def of_pairs(values: Both) -> list[Array]:
            return [each[self.frames, joints] for each, joints in zip(values, self.joints, strict=True)]

        (a, b), (c, d), (give, other) = of_pairs(alone), of_pairs(now), of_pairs(gives)
        change = a - b + self.f[:, None] * (self.vectors - (a - b)) - (c - d)
        length = lengths(self.vectors)
        e = self.vectors / np.maximum(length, 1e-12)[:, None]
        share = (give / (give + other))[:, None]
        drawn = zip(self.joints, units, (c + share * change, d - (1.0 - share) * change), strict=True)
        return [
            self._summed(joints, share_across((length / unit) ** 2), e, place / unit, len(now[0]))
            for joints, unit, place in drawn
        ]

    def _summed(self, joints: Numbers, k: Array, e: Array, places: Array, count: int) -> Springs:
        """One spring for each joint, over `count` frames, to where its pairs are in balance. Each entry draws its joint
        to its place in `places`, (entries, 3), with stiffness A = w (k I + (1 - k) e e^T).
        """
        touches = np.bincount(joints) > 0
        kept, column = np.flatnonzero(touches), np.cumsum(touches) - 1
        cell = self.frames * len(kept) + column[joints]

        def summed(values: Array) -> Array:
            return np.bincount(cell, values, count * len(kept)).astype(np.float64).reshape(count, len(kept))

        across, along = self.w * k, self.w * (1.0 - k)
        pull = along * (e * places).sum(axis=1)
        A = summed(across)[..., None, None] * np.eye(3)
        Ay = np.stack([summed(across * places[:, i] + pull * e[:, i]) for i in range(3)], axis=-1)
        for i, j in zip(*np.tril_indices(3), strict=True):
            A[..., i, j] += summed(along * e[:, i] * e[:, j])
            A[..., j, i] = A[..., i, j]
        balanced = np.linalg.solve(A + NO_STIFFNESS * np.eye(3), Ay[..., None])[..., 0]
        return Springs(kept, np.full(len(kept), -1), np.asarray(balanced, np.float64), A)


def find_performer_contacts(
    one: ContactPoints, other: ContactPoints, scale: RootScale, up: Array, frame_time: float, settings: ContactSettings
) -> PerformerContacts:
    """Return the pairs of joints of two performers that are near each other; `up` is the unit vector up.

    They are near where their distance over the mean length of both paths to the pelvis is below `settings.reach`: about
    where two hands of one body would be, between which the path is about as long.

    Their vectors have the `scale` of the world or that of Eq. (1), from the path lengths of both bodies, if it is less:
    hands that touch do not part because longer legs make the world larger.
    """
    found, lead = [], settings.blend / frame_time
    margin, shots = activation_window(lead), one.shots + other.shots  # a new shot at the cuts of either
    path = (one.reach[:, None] + other.reach) / 2.0
    near_u, near_v = np.nonzero(path > 0)
    for block in blocks_of(len(one.source)):
        first = max(block.start - margin, 0)
        inside = slice(block.start - first, block.stop - first)
        a, b = (points.source[first : block.stop + margin] for points in (one, other))
        on = come_near(a, b, near_u, near_v, (settings.reach + FADE) * path[near_u, near_v])
        u, v = near_u[on], near_v[on]
        around = shots[first : block.stop + margin]
        D, least = least_distances(a, b, u, v, path[u, v], around)
        f = activation(least, around, lead, settings.reach)[inside] if len(u) else D[inside]
        D = D[inside] / 2.0  # over both paths, for the stiffness
        w = pair_stiffness(f, D, (u, v + len(one.joints)), len(one.joints) + len(other.joints), settings)
        w *= firmness(D, settings)
        frames, pairs = np.nonzero(w > LEAST_STIFFNESS)
        u, v = u[pairs], v[pairs]
        d = a[inside][frames, u] - b[inside][frames, v]
        found.append((frames + block.start, u, v, f[frames, pairs], w[frames, pairs], d))
    frames, u, v, f, w, d = (np.concatenate(columns) for columns in zip(*found, strict=True))
    of_paths = (one.target_reach[u] + other.target_reach[v]) / (one.reach[u] + other.reach[v])
    vectors = np.minimum(of_paths / scale.level, 1.0)[:, None] * scale.places(d, up)
    joints = np.stack([one.joints[u], other.joints[v]])
    return PerformerContacts(frames=frames, joints=joints, f=f, w=w, vectors=vectors)


def firmness(D: Array, settings: ContactSettings) -> Array:
    """The stiffness of pairs across bodies over that of pairs within a body, by their normalised distances D.

    It is larger because whole bodies have to move, not only limbs. The nearest pairs count most: hands of different
    size that hold each other cannot keep all distances between their joints.
    """
    return FIRMER * (settings.reach + NEAREST) / (D + NEAREST)


@dataclass(frozen=True, eq=False, kw_only=True)
class PropContacts:
    """The joints of a performer that come near a prop."""

    joints: Numbers  # (joints,), of the target
    source: Array  # (frames, joints, 3), where their drivers are [source file units]
    distances: Array  # (frames, joints), of the drivers from the nearest point of the prop [source file units]
    f: Array  # (frames, joints), the activation, 0 to 1
    A: Array  # (frames, joints, 3, 3), the stiffness
    rises: Array  # (frames, joints, 3), how far a thick body's joints are from where the prop takes the source's

    def places(self, placement: Placement) -> Array:
        """(frames, joints, 3), where the joints belong on the prop [target file units]."""
        return placement(self.source) + self.rises

    def springs(self, placement: Placement, clip: Clip) -> Springs:
        """The springs that draw the joints to their places on the prop, frames first."""
        copied = clip.copy_on_path(self.joints)
        places = copied + self.f[..., None] * (self.places(placement) - copied)
        return Springs(self.joints, np.full(len(self.joints), -1), places / clip.unit, self.A)

    def gaps(self, now: Array, prop: Array, scale: float) -> tuple[Array, Array]:
        """(frames, joints) each, the joints' distances from the nearest point of the prop, and what they should be.

        `now` and `prop`, (frames, joints, 3), are the positions of the performer's joints and of the prop's points.
        """
        return _nearest_distances(now[:, self.joints], prop), scale * self.distances + lengths(self.rises)


def find_prop_contacts(
    points: ContactPoints, prop: Array, leg: float, free: Array, frame_time: float, settings: ContactSettings
) -> PropContacts:
    """Return the joints of a performer that come near the points of a prop, (frames, points, 3).

    No path leads from a joint to the prop: its normalised distance is that from the nearest point over the length of a
    `leg` [source file units]. Joints of one region share their stiffness. `free`, (frames, points), is 0 while a joint
    rests elsewhere.
    """
    distances = _nearest_distances(points.source, prop)
    D = distances / leg
    faultless = by_shot(median_of_three, points.shots, D)
    f = activation(faultless, points.shots, settings.blend / frame_time, settings.reach) * free
    on = np.flatnonzero(f.any(axis=0))
    ends = np.arange(len(on)), len(on) + points.regions[on]
    f, D, distances = f[:, on], D[:, on], distances[:, on]
    count = len(on) + int(points.regions.max(initial=0)) + 1
    w = firmness(D, settings) * pair_stiffness(f, D, ends, count, settings)
    w *= share_across((distances / (2.0 * leg)) ** 2)
    A = w[..., None, None] * np.eye(3)
    source = points.source[:, on]
    return PropContacts(joints=points.joints[on], source=source, distances=distances, f=f, A=A, rises=0.0 * source)


def _nearest_distances(joints: Array, prop: Array) -> Array:
    """(frames, joints), the distance of each joint from the nearest point of a prop, (frames, points, 3)."""
    distances = np.empty(joints.shape[:2])
    for block in blocks_of(len(joints)):
        distances[block] = lengths(joints[block][:, :, None] - prop[block][:, None]).min(axis=-1)
    return distances
