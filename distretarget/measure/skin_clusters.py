"""Points of skin in patches, and capsules in clusters, each within a ball: what is apart need not be looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from distretarget.measure.skin_points import LIMBS, SkinPoints
from distretarget.numerics.vectors import lengths
from distretarget.skin.capsules import Capsules

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

CLUSTER = 8  # most capsules of a cluster
PATCH = 8  # most points of a patch
BLENDED = 1.2  # room for points that other joints move as well [radii of a patch]
STEEP = 1e9  # slope of a capsule of which one end is within the other


@dataclass(frozen=True, eq=False)
class Clusters:
    """Capsules in groups of one joint and one segment, and these in clusters of a few neighbours, each within a ball.

    Attributes:
        groups: (groups + 1, 3), the joint and the segment of each, and its first cluster; the last is their end.
        first: (clusters + 1,), the first capsule of each; the last is their end.
        balls: (groups + clusters, 4), centre relative to the joint, and radius [file units].
        capsules: (capsules, 10), where the axis begins relative to the joint, its direction and its length, the radius
            where it begins, the change of the radius along it, and how far along it, over a point's distance to the
            axis, the nearest ball is off the point's foot.
    """

    groups: Numbers
    first: Numbers
    balls: Array
    capsules: Array


def clusters_of(capsules: Capsules) -> Clusters:
    """Return the capsules of a body in clusters."""
    middles, groups, balls = capsules.ends.mean(axis=1), [], []
    clusters: list[Numbers] = []
    for joint, segment in np.unique(np.stack([capsules.joints, capsules.segments], axis=1), axis=0).tolist():
        on = np.flatnonzero((capsules.joints == joint) & (capsules.segments == segment))
        groups.append((joint, segment, len(clusters)))
        balls.append(_ball_around(capsules, on))
        clusters += _halves(middles, on, CLUSTER)
    balls += [_ball_around(capsules, on) for on in clusters]
    order = np.concatenate([np.zeros(0, np.intp), *clusters])
    ends, radii = capsules.ends[order], capsules.radii[order]
    axes = ends[:, 1] - ends[:, 0]
    along = lengths(axes)
    known = np.where(along > 0.0, along, 1.0)
    taper = np.where(along > 0.0, radii[:, 1] - radii[:, 0], 0.0) / known
    cosine = np.sqrt(np.maximum(1.0 - taper**2, 0.0))
    slope = np.divide(taper, cosine, out=STEEP * np.sign(taper), where=cosine > 1.0 / STEEP)
    return Clusters(
        groups=np.array([*groups, (-1, -1, len(clusters))], np.intp),
        first=np.cumsum([0, *map(len, clusters)]),
        balls=np.array(balls).reshape(-1, 4),
        capsules=np.column_stack([ends[:, 0], axes / known[:, None], along, radii[:, 0], taper, slope]),
    )


@dataclass(frozen=True, eq=False)
class Patches:
    """Points of one limb that one joint moves most, in patches of a few neighbours.

    Attributes:
        limbs: (limbs + 1,), the first patch of each; the last is their end.
        patches: (patches + 1, 2), joint and first point of each; the last is their end.
        balls: (patches, 4), centre relative to the joint, and radius [file units].
        points: the points in this order.
    """

    limbs: Numbers
    patches: Numbers
    balls: Array
    points: SkinPoints


def patches_of(points: SkinPoints) -> Patches:
    """Return points in patches."""
    rows, strongest = np.arange(len(points)), points.weights.argmax(axis=1)
    joints, offsets = points.joints[rows, strongest], points.offsets[rows, strongest]
    limbs, patches, balls = [0], [], []
    order: list[int] = []
    for limb in range(len(LIMBS)):
        for joint in np.unique(joints[points.limbs == limb]).tolist():
            for patch in _halves(offsets, np.flatnonzero((points.limbs == limb) & (joints == joint)), PATCH):
                middle = offsets[patch].mean(axis=0)
                patches.append((joint, len(order)))
                balls.append((*middle, BLENDED * lengths(offsets[patch] - middle).max()))
                order.extend(patch.tolist())
        limbs.append(len(patches))
    return Patches(
        limbs=np.array(limbs, np.intp),
        patches=np.array([*patches, (-1, len(order))], np.intp),
        balls=np.array(balls).reshape(-1, 4),
        points=points[np.array(order, np.intp)],
    )


def _ball_around(capsules: Capsules, on: Numbers) -> Array:
    """A ball around some of the capsules of a joint: centre and radius."""
    ends = capsules.ends[on]
    centre = ends.mean(axis=(0, 1))
    return np.append(centre, (lengths(ends - centre) + capsules.radii[on]).max())


def _halves(places: Array, on: Numbers, most: int) -> list[Numbers]:
    """Some of the places in halves of halves along their longest extent, down to parts of `most` at most."""
    if len(on) <= most:
        return [on]
    in_line = on[np.argsort(places[on, np.ptp(places[on], axis=0).argmax()], kind="stable")]
    half = len(on) // 2
    return _halves(places, in_line[:half], most) + _halves(places, in_line[half:], most)
