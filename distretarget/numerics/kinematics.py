"""Forward kinematics of a tree of joints, and path lengths in the tree.

A tree is given by its parents, (joints,), -1 for the root, with parents before children. Frames are the first axis of
arrays; quaternions are x y z w, as in scipy.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from distretarget.numerics.compiled import Out, compiled
from distretarget.numerics.parallel import over_blocks
from distretarget.numerics.quaternions import multiply
from distretarget.numerics.vectors import F2, F3, I1, Array, Numbers

ALL = slice(None)


def joint_positions(parents: Numbers, root_positions: Array, bones: Array, world: Array) -> Array:
    """The positions of joints in the world, (frames, joints, 3), from `root_positions`, (frames, 3), and `bones`,
    (frames or 1, joints, 3), from each joint's parent to it; `world`, (frames, joints, 4), are world rotations.
    """
    positions = np.empty((len(world), len(parents), 3))
    path, moving, turned = map(np.ascontiguousarray, (root_positions, bones, world))

    def place(part: slice) -> None:
        _positions(parents, path[part], moving[part if len(bones) > 1 else ALL], turned[part], positions[part])

    over_blocks(place, *positions.shape[:2])
    return positions


def world_rotations(parents: Numbers, local: Array) -> Array:
    """World rotations from local ones, both (frames, joints, 4): the parent's world rotation times the joint's own."""
    world = np.array(local, order="C")
    over_blocks(lambda part: _world_rotations(parents, world[part]), *world.shape[:2])
    return world


def line_rotations(line: Numbers, local: Array) -> Array:
    """(frames, 4), world rotations of the last joint of a chain from the root; `local` is (frames, all joints, 4)."""
    world = np.empty((len(local), 4))
    _write_line(line, np.ascontiguousarray(local), world)
    return world


@compiled()
def _write_line(line: I1, local: F3, world: Out[F2]) -> None:
    for frame in range(len(world)):
        now = world[frame]
        for i in range(4):
            now[i] = local[frame, line[0], i]
        for joint in line[1:]:
            x, y, z, w = now[0], now[1], now[2], now[3]
            multiply(x, y, z, w, local[frame, joint], now)


def make_local(parents: Numbers, rotations: Array) -> None:
    """Turn world rotations, (frames, joints, 4), into local ones in place; the inverse of `world_rotations`."""
    over_blocks(lambda part: _make_local(parents, rotations[part]), *rotations.shape[:2])


def turn_parts(vectors: Array, parts: Numbers, rotations: Array) -> None:
    """Rotate world rotations, (frames, joints, 4), in place by rotation vectors of parts, (frames, parts, 3) [rad];
    `parts`, (joints,), is the part of each joint, -1 for none.
    """

    def turn(part: slice) -> None:
        _turn(np.ascontiguousarray(vectors[part]), parts, np.empty((vectors.shape[1], 4)), rotations[part])

    over_blocks(turn, *rotations.shape[:2])


@compiled()
def _world_rotations(parents: I1, world: Out[F3]) -> None:
    """Turn local rotations into world rotations in place."""
    for frame in range(len(world)):
        for joint in range(1, len(parents)):
            p = world[frame, parents[joint]]
            multiply(p[0], p[1], p[2], p[3], world[frame, joint], world[frame, joint])


@compiled()
def _make_local(parents: I1, rotations: Out[F3]) -> None:
    """Multiply the inverse of the parent's world rotation with the joint's own, from the leaves to the root."""
    for frame in range(len(rotations)):
        for joint in range(len(parents) - 1, 0, -1):
            p = rotations[frame, parents[joint]]
            multiply(-p[0], -p[1], -p[2], p[3], rotations[frame, joint], rotations[frame, joint])


@compiled()
def _turn(vectors: F3, parts: I1, turns: Out[F2], rotations: Out[F3]) -> None:
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
                multiply(q[0], q[1], q[2], q[3], rotations[frame, joint], rotations[frame, joint])


@compiled()
def _positions(parents: I1, root_positions: F2, bones: F3, world: F3, positions: Out[F3]) -> None:
    """Write positions: the parent's, plus the joint's translation rotated by the parent."""
    for frame in range(len(world)):
        for i in range(3):
            positions[frame, 0, i] = root_positions[frame, i]
        for joint in range(1, len(parents)):
            parent = parents[joint]
            q, v = world[frame, parent], bones[frame if frame < len(bones) else 0, joint]
            x, y, z, w = q[0], q[1], q[2], q[3]
            a, b, c = v[0], v[1], v[2]
            # v + 2 w (q x v) + 2 q x (q x v), q the vector part
            i, j, k = y * c - z * b, z * a - x * c, x * b - y * a
            positions[frame, joint, 0] = positions[frame, parent, 0] + a + 2.0 * (w * i + y * k - z * j)
            positions[frame, joint, 1] = positions[frame, parent, 1] + b + 2.0 * (w * j + z * i - x * k)
            positions[frame, joint, 2] = positions[frame, parent, 2] + c + 2.0 * (w * k + x * j - y * i)


def children_of(parents: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """Return the children of each joint, in ascending order."""
    children: list[list[int]] = [[] for _ in parents]
    for joint, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(joint)
    return tuple(map(tuple, children))


def depth_first_order(children: Sequence[Sequence[int]]) -> tuple[int, ...]:
    """Return the joints depth first, children in their order."""
    order, waiting = [], [0]
    while waiting:
        order.append(joint := waiting.pop())
        waiting += reversed(children[joint])
    return tuple(order)


def paths_from(joint: int, parents: Sequence[int], lengths: Sequence[float]) -> Array:
    """Return the lengths of the paths from a joint to all joints, (joints,)."""
    paths = [-1.0] * len(parents)
    paths[joint] = 0.0
    while (parent := parents[joint]) >= 0:
        paths[parent] = paths[joint] + lengths[joint]
        joint = parent
    for below, above in enumerate(parents):
        if paths[below] < 0.0:
            paths[below] = paths[above] + lengths[below]
    return np.array(paths)


def paths_among(joints: Numbers, parents: Numbers, lengths: Array) -> Array:
    """Return the lengths of the paths between some joints, (some, some)."""
    paths = np.full((len(parents), len(joints)), -1.0)  # column n: from the n-th joint to joints above any of them
    n, at = np.arange(len(joints)), np.asarray(joints)
    paths[at, n] = 0.0
    is_above = np.zeros(len(parents), np.bool_)
    while len(at):
        is_above[at] = True
        n, at = n[at > 0], at[at > 0]
        paths[parents[at], n] = paths[at, n] + lengths[at]
        at = parents[at]
    for joint in np.flatnonzero(is_above)[1:]:
        paths[joint] = np.where(paths[joint] < 0.0, paths[parents[joint]] + lengths[joint], paths[joint])
    return np.ascontiguousarray(paths[joints].T)


def reaches(parents: Sequence[int], lengths: Sequence[float]) -> tuple[Array, Numbers]:
    """Return the farthest joint along the bones in the subtree of each joint, and the length of the path to it,
    (joints,) each, length first; of equally far joints the one with the fewest joints between, then the first.
    """
    reach, away, farthest = [0.0] * len(parents), [0] * len(parents), list(range(len(parents)))
    for joint in range(len(parents) - 1, 0, -1):
        parent = parents[joint]
        whole, steps = lengths[joint] + reach[joint], away[joint] + 1
        if whole > reach[parent] or (whole == reach[parent] and 0 < away[parent] >= steps):
            reach[parent], away[parent], farthest[parent] = whole, steps, farthest[joint]
    return np.array(reach), np.array(farthest, np.intp)
