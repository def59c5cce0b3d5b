"""Forward kinematics of a tree of joints, its rotations, and the heights and speeds of joints.

A tree is given by its parents, (joints,), -1 for the root, with parents before children. Frames are the first axis of
arrays; quaternions are x y z w, as in scipy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from distretarget.errors import SettingsError
from distretarget.numerics.compiled import compiled, inlined, read_only
from distretarget.numerics.parallel import over_blocks

Array = NDArray[np.float64]
Parents = NDArray[np.intp]
Parts = NDArray[np.intp]

ALL = slice(None)


def forward_kinematics(parents: Parents, translations: Array, world: Array) -> Array:
    """Return the positions of joints in the world, (frames, joints, 3), in the units of `translations`.

    `translations`, (frames, joints, 3), lead from each joint's parent to it, and to the root from the origin; `world`,
    (frames, joints, 4), are the joints' world rotations.

    Raises:
        SettingsError: the arrays do not fit each other.
    """
    frames, joints = np.shape(translations)[:1], np.shape(parents)
    if np.shape(translations) != (*frames, *joints, 3) or np.shape(world) != (*frames, *joints, 4):
        shapes = f"{np.shape(parents)}, {np.shape(translations)} and {np.shape(world)}"
        raise SettingsError(f"the shapes are {shapes}; expected (joints,), (frames, joints, 3) and (frames, joints, 4)")
    bones = np.asarray(translations, np.float64)
    return joint_positions(np.asarray(parents, np.intp), bones[:, 0], bones, np.asarray(world, np.float64))


def joint_positions(parents: Parents, root_positions: Array, bones: Array, world: Array) -> Array:
    """The same with `root_positions`, (frames, 3), and `bones`, (frames or 1, joints, 3), in place of translations."""
    positions = np.empty((len(world), len(parents), 3))
    tree, path = read_only(parents), read_only(np.ascontiguousarray(root_positions))
    moving, turned = read_only(bones), read_only(world)

    def place(part: slice) -> None:
        _positions(tree, path[part], moving[part if len(bones) > 1 else ALL], turned[part], positions[part])

    over_blocks(place, *positions.shape[:2])
    return positions


def world_rotations(parents: Parents, local: Array) -> Array:
    """World rotations from local ones, both (frames, joints, 4): the parent's world rotation times the joint's own."""
    world, parents = np.array(local), read_only(parents)
    over_blocks(lambda part: _world_rotations(parents, world[part]), *world.shape[:2])
    return world


def line_rotations(line: NDArray[np.intp], local: Array) -> Array:
    """(frames, 4), the world rotations of the last joint of a line that begins at the root, (joints,), from local ones,
    (frames, all joints, 4).
    """
    world = np.empty((len(local), 4))
    _write_line(line, _whole(local), world)
    return world


@compiled()
def _write_line(line: Parts, local: Array, world: Array) -> None:
    for frame in range(len(world)):
        now = world[frame]
        for i in range(4):
            now[i] = local[frame, line[0], i]
        for joint in line[1:]:
            x, y, z, w = now[0], now[1], now[2], now[3]
            multiply(x, y, z, w, local[frame, joint], now)


def turned_by(rotations: Array, vector: Array) -> Array:
    """(frames, 3), a vector, (3,), turned by rotations, (frames, 4)."""
    vectors = np.empty((len(rotations), 3))
    _write_turned(_whole(rotations), _whole(vector), vectors)
    return vectors


@compiled()
def _write_turned(rotations: Array, vector: Array, vectors: Array) -> None:
    for frame in range(len(rotations)):
        q, v = rotations[frame], vectors[frame]
        v[0], v[1], v[2] = turned(q[0], q[1], q[2], q[3], vector[0], vector[1], vector[2])


def make_local(parents: Parents, rotations: Array) -> None:
    """Turn world rotations, (frames, joints, 4), into local ones in place; the inverse of `world_rotations`."""
    parents = read_only(parents)
    over_blocks(lambda part: _make_local(parents, rotations[part]), *rotations.shape[:2])


def rotation_products(first: Array, of_first: NDArray[np.intp], second: Array) -> Array:
    """(frames, joints, 4), for each joint the product of rotation number `of_first`, (joints,), of `first`, (frames, n,
    4), and its rotation in `second`, (joints, 4); the identity where `of_first` is negative.
    """
    product = np.empty((len(first), len(second), 4))
    _products(first, of_first, second, product)
    return product


def turn_parts(vectors: Array, parts: Parts, rotations: Array) -> None:
    """Rotate world rotations, (frames, joints, 4), in place by the rotation vectors of their parts.

    `vectors`, (frames, parts, 3), are in [rad]; `parts`, (joints,), is the part of each joint, or -1 for none.
    """

    def turn(part: slice) -> None:
        _turn(vectors[part], parts, np.empty((vectors.shape[1], 4)), rotations[part])

    over_blocks(turn, *rotations.shape[:2])


@compiled()
def _world_rotations(parents: Parents, world: Array) -> None:
    """Turn local rotations into world rotations in place."""
    for frame in range(len(world)):
        for joint in range(1, len(parents)):
            p = world[frame, parents[joint]]
            multiply(p[0], p[1], p[2], p[3], world[frame, joint], world[frame, joint])


@compiled()
def _make_local(parents: Parents, rotations: Array) -> None:
    """Multiply the inverse of the parent's world rotation with the joint's own, from the leaves to the root."""
    for frame in range(len(rotations)):
        for joint in range(len(parents) - 1, 0, -1):
            p = rotations[frame, parents[joint]]
            multiply(-p[0], -p[1], -p[2], p[3], rotations[frame, joint], rotations[frame, joint])


@compiled()
def _products(first: Array, of_first: NDArray[np.intp], second: Array, product: Array) -> None:
    for frame in range(len(first)):
        for joint in range(len(of_first)):
            if of_first[joint] >= 0:
                p = first[frame, of_first[joint]]
                multiply(p[0], p[1], p[2], p[3], second[joint], product[frame, joint])
            else:
                for i in range(4):
                    product[frame, joint, i] = 1.0 if i == 3 else 0.0


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
                multiply(q[0], q[1], q[2], q[3], rotations[frame, joint], rotations[frame, joint])


@inlined()
def multiply(x, y, z, w, q, product):  # type: ignore[no-untyped-def]
    """Write the product of the quaternion x y z w and q; `product` may be q itself."""
    i, j, k, r = q[0], q[1], q[2], q[3]
    product[0] = w * i + x * r + y * k - z * j
    product[1] = w * j - x * k + y * r + z * i
    product[2] = w * k + x * j - y * i + z * r
    product[3] = w * r - x * i - y * j - z * k


@inlined()
def turned(x, y, z, w, a, b, c):  # type: ignore[no-untyped-def]
    """Return the vector a b c turned by the quaternion x y z w."""
    i, j, k = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2.0 * (w * i + y * k - z * j),
        b + 2.0 * (w * j + z * i - x * k),
        c + 2.0 * (w * k + x * j - y * i),
    )


@compiled()
def _positions(parents: Parents, root_positions: Array, bones: Array, world: Array, positions: Array) -> None:
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


def heights_of(positions: Array, joints: NDArray[np.intp] | list[int], up: Array) -> Array:
    """(frames, joints), heights of joints along the unit vector up; `positions` are (frames, all joints, 3)."""
    heights = np.empty((len(positions), len(joints)))
    _write_heights(read_only(positions), np.array(joints, np.intp), read_only(up), heights)
    return heights


@compiled()
def _write_heights(positions: Array, joints: NDArray[np.intp], up: Array, heights: Array) -> None:
    for frame in range(len(positions)):
        for n in range(len(joints)):
            x = positions[frame, joints[n]]
            heights[frame, n] = up[0] * x[0] + up[1] * x[1] + up[2] * x[2]


def lowest_heights(positions: Array, up: Array, joints: NDArray[np.intp] | None = None) -> Array:
    """(frames,), the height of the lowest joint along the unit vector up, of all joints if none are given; `positions`
    are (frames, all joints, 3).
    """
    joints = np.arange(positions.shape[1]) if joints is None else joints
    lowest = np.empty(len(positions))
    _write_lowest(read_only(positions), joints, read_only(up), lowest)
    return lowest


@compiled()
def _write_lowest(positions: Array, joints: NDArray[np.intp], up: Array, lowest: Array) -> None:
    for frame in range(len(positions)):
        lowest[frame] = np.inf
        for joint in joints:
            x = positions[frame, joint]
            height = up[0] * x[0] + up[1] * x[1] + up[2] * x[2]
            if height < lowest[frame]:
                lowest[frame] = height


def steps_along(paths: Array, joints: NDArray[np.intp] | None = None, lag: int = 1) -> Array:
    """(frames - lag, joints), distance of each joint from its place `lag` frames earlier, in the units of `paths`,
    (frames, all joints, 3); of all joints if none are given.
    """
    joints = np.arange(paths.shape[1]) if joints is None else joints
    steps = np.empty((max(len(paths) - lag, 0), len(joints)))
    _write_steps(_whole(paths), joints, lag, steps)
    return steps


@compiled()
def _write_steps(paths: Array, joints: NDArray[np.intp], lag: int, steps: Array) -> None:
    for frame in range(len(steps)):
        for n in range(len(joints)):
            start, end = paths[frame, joints[n]], paths[frame + lag, joints[n]]
            x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
            steps[frame, n] = np.sqrt(x * x + y * y + z * z)


def _whole(array: Array) -> Array:
    """The array as compiled functions that measure take it, read-only and contiguous."""
    return read_only(np.ascontiguousarray(array))


def stretch_of(positions: Array, upper: NDArray[np.intp], lower: NDArray[np.intp], lengths: Array) -> Array:
    """(frames,), the largest relative difference of bones from their `lengths`, (bones,), and 0 without bones; a bone
    is from the joint `upper` to the joint `lower`, (bones,) each, of `positions`, (frames, joints, 3).
    """
    largest = np.empty(len(positions))
    _write_stretch(_whole(positions), upper, lower, lengths, largest)
    return largest


@compiled()
def _write_stretch(positions, upper, lower, lengths, largest):  # type: ignore[no-untyped-def]
    for frame in range(len(positions)):
        largest[frame] = 0.0
        for n in range(len(lower)):
            a, b = positions[frame, upper[n]], positions[frame, lower[n]]
            bone = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
            largest[frame] = max(largest[frame], abs(bone / lengths[n] - 1.0))


def angles_to_bones(vectors: Array, positions: Array, upper: NDArray[np.intp], lower: NDArray[np.intp]) -> Array:
    """(frames, bones), the angles between `vectors`, (frames, bones, 3), and bones as in `stretch_of` [rad]; as
    `vectors.angles_between`.
    """
    angles = np.empty(vectors.shape[:2])
    _write_half_tangents(_whole(vectors), _whole(positions), upper, lower, angles)
    np.arctan(angles, out=angles)
    angles *= 2.0
    return angles


@compiled()
def _write_half_tangents(vectors, positions, upper, lower, tangents):  # type: ignore[no-untyped-def]
    """Write the tangents of half the angles; 0 for a zero vector."""
    for frame in range(len(vectors)):
        for n in range(len(lower)):
            a, p, q = vectors[frame, n], positions[frame, upper[n]], positions[frame, lower[n]]
            x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
            size, bone = np.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2), np.sqrt(x * x + y * y + z * z)
            u, v, w = bone * a[0], bone * a[1], bone * a[2]
            x, y, z = size * x, size * y, size * z
            across = np.sqrt((u - x) ** 2 + (v - y) ** 2 + (w - z) ** 2)
            along = np.sqrt((u + x) ** 2 + (v + y) ** 2 + (w + z) ** 2)
            tangents[frame, n] = across / along if across > 0.0 else 0.0


def thirds_along(paths: Array, joints: NDArray[np.intp]) -> Array:
    """(frames - 3,), the mean over joints of the length of the third difference of their positions, in the units of
    `paths`, (frames, all joints, 3); 0 without joints.
    """
    means = np.empty(max(len(paths) - 3, 0))
    _write_thirds(_whole(paths), joints, means)
    return means


@compiled()
def _write_thirds(paths: Array, joints: NDArray[np.intp], means: Array) -> None:
    for frame in range(len(means)):
        total = 0.0
        for joint in joints:
            square = 0.0
            for i in range(3):
                a, b, c, d = (
                    paths[frame, joint, i],
                    paths[frame + 1, joint, i],
                    paths[frame + 2, joint, i],
                    paths[frame + 3, joint, i],
                )
                third = (d - a) - 3.0 * (c - b)
                square += third * third
            total += np.sqrt(square)
        means[frame] = total / max(len(joints), 1)


def turns_along(parents: Parents, rotations: Array, joints: NDArray[np.intp]) -> Array:
    """(frames - 1, joints), the angle by which joints turn in the world to the next frame [rad]; `rotations`, (frames,
    all joints, 4), are relative to the parents.

    The distance of two unit quaternions is 2 sin(angle / 4); q and -q are the same rotation.
    """
    apart = np.empty((max(len(rotations) - 1, 0), len(joints)))
    _write_apart(read_only(parents), _whole(rotations), joints, np.empty((2, len(parents), 4)), apart)
    apart *= 0.5
    np.arcsin(np.minimum(apart, 1.0, out=apart), out=apart)
    apart *= 4.0
    return apart


@compiled()
def _write_apart(parents, rotations, joints, world, apart):  # type: ignore[no-untyped-def]
    """Write the distances of quaternions to those of the next frame; `world`, (2, all joints, 4), is scratch."""
    for frame in range(len(rotations)):
        now, before = world[frame % 2], world[1 - frame % 2]
        for i in range(4):
            now[0, i] = rotations[frame, 0, i]
        for joint in range(1, len(parents)):
            p = now[parents[joint]]
            multiply(p[0], p[1], p[2], p[3], rotations[frame, joint], now[joint])
        if frame:
            for n in range(len(joints)):
                p, q, less, more = before[joints[n]], now[joints[n]], 0.0, 0.0
                for i in range(4):
                    less += (q[i] - p[i]) ** 2
                    more += (q[i] + p[i]) ** 2
                apart[frame - 1, n] = np.sqrt(min(less, more))


def speeds_along(paths: Array, frame_time: float, joints: NDArray[np.intp] | None = None) -> Array:
    """(frames, joints), speeds of joints by central differences, in units of `paths`, (frames, all joints, 3), per unit
    of `frame_time`; of all joints if none are given. A single frame has speed 0.
    """
    if len(paths) < 2:
        return np.zeros((len(paths), paths.shape[1] if joints is None else len(joints)))
    first, last = (2.0 * steps_along(paths[ends], joints) for ends in (slice(2), slice(-2, None)))
    return np.concatenate([first, steps_along(paths, joints, lag=2), last]) / (2.0 * frame_time)
