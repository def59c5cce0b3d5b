"""Forward kinematics of a tree of joints, the rotations it needs, and the speeds of joints. Compiled where it pays.

A tree is its parents, (joints,), -1 for the root, parents before children. Arrays have the frames in front; quaternions
are x y z w, as in scipy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import SettingsError
from distretarget.numerics.compiled import compiled, inlined, read_only
from distretarget.numerics.vectors import lengths

Array = NDArray[np.float64]
Parents = NDArray[np.intp]
Parts = NDArray[np.intp]


def forward_kinematics(parents: Parents, translations: Array, world: Array) -> Array:
    """The position of every joint in the world, (frames, joints, 3), in the units of `translations`.

    `translations`, (frames, joints, 3), are from each joint's parent to it, for the root its place in the world;
    `world`, (frames, joints, 4), are the joints' rotations in the world.

    Raises:
        SettingsError: the arrays do not fit each other.
    """
    frames, joints = np.shape(translations)[:1], np.shape(parents)
    if np.shape(translations) != (*frames, *joints, 3) or np.shape(world) != (*frames, *joints, 4):
        shapes = f"{np.shape(parents)}, {np.shape(translations)} and {np.shape(world)}"
        raise SettingsError(f"the shapes are {shapes}; expected (joints,), (frames, joints, 3) and (frames, joints, 4)")
    return joint_positions(parents, translations[:, 0], translations, world)


def joint_positions(parents: Parents, root_positions: Array, bones: Array, world: Array) -> Array:
    """The same for a root at `root_positions`, (frames, 3), and the translations `bones`, (frames, joints, 3) or the
    same in all frames, (1, joints, 3), of which the root's is not used.
    """
    positions = np.empty((len(world), len(parents), 3))
    _positions(read_only(parents), read_only(root_positions), read_only(bones), read_only(world), positions)
    return positions


def world_rotations(parents: Parents, local: Array) -> Array:
    """World rotations from local ones, both (frames, joints, 4): each joint's is its parent's times its own."""
    world = np.array(local)
    _world_rotations(read_only(parents), world)
    return world


def local_rotations(parents: Parents, world: Array) -> Array:
    """Local rotations from world ones, both (frames, joints, 4); the inverse of `world_rotations`."""
    local = np.array(world)
    _local_rotations(read_only(parents), world, local)
    return local


def rotation_products(first: Array, second: Array) -> Array:
    """The product of each rotation of `first`, (frames, joints, 4), with that of `second`, the same or one frame."""
    product = np.empty_like(first)
    _products(first, second, product)
    return product


def turned_rotations(vectors: Array, parts: Parts, rotations: Array) -> Array:
    """World rotations, (frames, joints, 4), each turned in the world by the rotation vector of its part.

    `vectors`, (frames, parts, 3), are in [rad]; `parts`, (joints,), is the part of each joint, -1 for joints that keep
    their rotations.
    """
    turned = np.array(rotations)
    _turn(vectors, parts, np.empty((vectors.shape[1], 4)), turned)
    return turned


@compiled()
def _world_rotations(parents: Parents, world: Array) -> None:
    """Turn local rotations into world rotations in place."""
    for frame in range(len(world)):
        for joint in range(1, len(parents)):
            p = world[frame, parents[joint]]
            _multiply(p[0], p[1], p[2], p[3], world[frame, joint], world[frame, joint])


@compiled()
def _local_rotations(parents: Parents, world: Array, local: Array) -> None:
    """Write local rotations: the inverse of the parent's world rotation times the joint's own."""
    for frame in range(len(world)):
        for joint in range(1, len(parents)):
            p = world[frame, parents[joint]]
            _multiply(-p[0], -p[1], -p[2], p[3], world[frame, joint], local[frame, joint])


@compiled()
def _products(first: Array, second: Array, product: Array) -> None:
    for frame in range(len(first)):
        for joint in range(first.shape[1]):
            p = first[frame, joint]
            _multiply(p[0], p[1], p[2], p[3], second[min(frame, len(second) - 1), joint], product[frame, joint])


@compiled()
def _turn(vectors: Array, parts: Parts, turns: Array, rotations: Array) -> None:
    """Turn world rotations in place by the rotation vectors of their parts; `turns`, (parts, 4), is scratch."""
    for frame in range(len(rotations)):
        for part in range(len(turns)):
            x, y, z = vectors[frame, part, 0], vectors[frame, part, 1], vectors[frame, part, 2]
            angle = np.sqrt(x * x + y * y + z * z)
            half = np.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
            turns[part, 0], turns[part, 1], turns[part, 2] = half * x, half * y, half * z
            turns[part, 3] = np.cos(0.5 * angle)
        for joint in range(len(parts)):
            if parts[joint] >= 0:
                q = turns[parts[joint]]
                _multiply(q[0], q[1], q[2], q[3], rotations[frame, joint], rotations[frame, joint])


@inlined()
def _multiply(x, y, z, w, q, product):  # type: ignore[no-untyped-def]
    """Write the product of the quaternion x y z w and q; `product` may be q itself."""
    i, j, k, r = q[0], q[1], q[2], q[3]
    product[0] = w * i + x * r + y * k - z * j
    product[1] = w * j - x * k + y * r + z * i
    product[2] = w * k + x * j - y * i + z * r
    product[3] = w * r - x * i - y * j - z * k


@compiled()
def _positions(parents: Parents, root_positions: Array, bones: Array, world: Array, positions: Array) -> None:
    """Write positions: each joint stands from its parent by its translation, turned by the parent."""
    for frame in range(len(world)):
        for i in range(3):
            positions[frame, 0, i] = root_positions[frame, i]
        for joint in range(1, len(parents)):
            parent = parents[joint]
            q, v = world[frame, parent], bones[min(frame, len(bones) - 1), joint]
            x, y, z, w = q[0], q[1], q[2], q[3]
            a, b, c = v[0], v[1], v[2]
            # v + 2 w (q x v) + 2 q x (q x v), q the vector part
            i, j, k = y * c - z * b, z * a - x * c, x * b - y * a
            positions[frame, joint, 0] = positions[frame, parent, 0] + a + 2.0 * (w * i + y * k - z * j)
            positions[frame, joint, 1] = positions[frame, parent, 1] + b + 2.0 * (w * j + z * i - x * k)
            positions[frame, joint, 2] = positions[frame, parent, 2] + c + 2.0 * (w * k + x * j - y * i)


def speeds_along(paths: Array, frame_time: float) -> Array:
    """The speeds along paths, (frames, joints, 3), by central differences, (frames, joints); 0 in a single frame.

    They are in the units of `paths` per unit of `frame_time`.
    """
    if len(paths) < 2:
        return np.zeros(paths.shape[:2])
    steps = np.empty_like(paths)
    np.subtract(paths[2:], paths[:-2], out=steps[1:-1])
    steps[0], steps[-1] = 2.0 * (paths[1] - paths[0]), 2.0 * (paths[-1] - paths[-2])
    return lengths(steps) / (2.0 * frame_time)
