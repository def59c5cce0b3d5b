"""Bodies whose skin is made of capsules, so that these are known answers."""

import numpy as np

from distretarget.skin.mesh import SkinnedMesh


def capsule_surface(ends, radii, rings=24, around=24):
    """Points, (points, 3), and triangles of a tapered capsule."""
    ends, radii = np.asarray(ends, float), np.asarray(radii, float)
    axis = ends[1] - ends[0]
    along = axis / np.linalg.norm(axis)
    side = np.linalg.svd(along[None])[2][1:]
    angles = np.linspace(-np.pi / 2, np.pi / 2, rings)
    turns = np.linspace(0, 2 * np.pi, around, endpoint=False)
    circle = np.cos(turns)[:, None] * side[0] + np.sin(turns)[:, None] * side[1]
    points = []
    for half, centre, radius in zip(np.array_split(angles, 2), ends, radii, strict=True):
        points += [centre + radius * (np.sin(angle) * along + np.cos(angle) * circle) for angle in half]
    grid = np.arange(rings * around).reshape(rings, around)
    a, b, c, d = grid[:-1], np.roll(grid, -1, 1)[:-1], grid[1:], np.roll(grid, -1, 1)[1:]
    return np.concatenate(points), np.concatenate(
        [np.stack(corners, -1).reshape(-1, 3) for corners in ((a, b, c), (b, d, c))]
    )


def mesh_of(surfaces):
    """The mesh of surfaces, each moved by one joint: pairs of the joint and the surface."""
    vertices, joints, triangles, start = [], [], [], 0
    for joint, (points, corners) in surfaces:
        vertices.append(points)
        joints.append(np.full((len(points), 1), joint))
        triangles.append(corners + start)
        start += len(points)
    joints = np.concatenate(joints)
    return SkinnedMesh(np.concatenate(vertices), joints, np.ones(joints.shape), np.concatenate(triangles))
