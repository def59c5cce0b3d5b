"""The soles that a mesh shows: the flat underside of each foot or shoe, on which it stands."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from distretarget.body.body import Body
from distretarget.body.limbs import Legs
from distretarget.body.soles import Sole
from distretarget.numerics.vectors import Array, cross, lengths, normalised
from distretarget.rig import rig_cached
from distretarget.skin.mesh import SkinnedMesh

SAME_FACE = np.cos(np.radians(10))  # faces of a hull within this angle form one side of the foot [cosine]
# A flat sole is at least this share of the hull's surface: soles of real characters are 0.15 to 0.26 of it, the largest
# face of a round foot is 0.05, that of a pointed toe less.
FLAT = 0.1
NEAR = np.cos(np.radians(45))  # a sole is within this angle of the one that rest pose or joints show [cosine]


@rig_cached
def flat_normals(body: Body, legs: Legs, soles: tuple[Sole, Sole], mesh: SkinnedMesh) -> tuple[Array, Array] | None:
    """Return the normals of the soles of both feet as the body's mesh shows them, (3,) each, in the axes of the ankles;
    None where one of the feet has no flat sole. `soles` are the soles that rest pose and joints show.

    A foot rests on a face of its convex hull. Candidates are the faces near to those soles; the one whose direction is
    shared by most of the hull's surface is the sole. Up in a standing rest pose, or else the given normal, is preferred
    if half as much surface shares it.
    """
    normals = [_flat_normal(body, leg.ankle, sole, mesh) for leg, sole in zip(legs, soles, strict=True)]
    left, right = normals
    return None if left is None or right is None else (left, right)


def _flat_normal(body: Body, ankle: int, sole: Sole, mesh: SkinnedMesh) -> Array | None:
    """The normal of the flat sole of one foot, (3,); None without one."""
    ups, shares = _faces(mesh, body.skeleton.subtree(ankle))
    known = [sole.normal, *([body.rest.axes[:, 1]] if body.stands_at_rest else [])]
    near = np.flatnonzero((ups @ np.stack(known, axis=1) > NEAR).any(axis=1))
    if not len(near):
        return None
    alike = ups @ np.vstack([ups[near], known]).T > SAME_FACE
    flat = shares @ alike
    best, at_known = flat[: len(near)].max(), flat[len(near) :]
    if best < FLAT:
        return None
    if 2.0 * at_known[-1] > best:
        return np.asarray(known[-1])
    return normalised((shares * alike[:, flat[: len(near)].argmax()]) @ ups)


def _faces(mesh: SkinnedMesh, joints: list[int]) -> tuple[Array, Array]:
    """The triangles of the convex hull of the vertices that some joints move most: the inward normal of each,
    (triangles, 3), and its share of the hull's surface, (triangles,).
    """
    points = mesh.vertices[np.isin(mesh.carriers, joints)]
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return np.zeros((0, 3)), np.zeros(0)
    a, b, c = points[hull.simplices].swapaxes(0, 1)
    areas = lengths(cross(b - a, c - a))
    return -hull.equations[:, :3], areas / areas.sum()
