"""Heights, steps, speeds and rotation angles of joints over the frames of a motion, and joints that stand still.

Positions and paths are (frames, all joints, 3), in any unit; quaternions are x y z w, as in scipy.
"""

from __future__ import annotations

import numpy as np

from distretarget.numerics.compiled import Out, compiled, inlined
from distretarget.numerics.quaternions import multiply, rotated
from distretarget.numerics.vectors import B2, F1, F2, F3, I1, I2, Array, Numbers


def heights_of(positions: Array, joints: Numbers | list[int], up: Array) -> Array:
    """(frames, joints), heights of joints along the unit vector up."""
    heights = np.empty((len(positions), len(joints)))
    _write_heights(positions, np.array(joints, np.intp), up, heights)
    return heights


@compiled()
def _write_heights(positions: F3, joints: I1, up: F1, heights: Out[F2]) -> None:
    for frame in range(len(positions)):
        for n in range(len(joints)):
            x = positions[frame, joints[n]]
            heights[frame, n] = up[0] * x[0] + up[1] * x[1] + up[2] * x[2]


def lowest_heights(positions: Array, up: Array, joints: Numbers | None = None) -> Array:
    """(frames,), the height of the lowest joint, of all if none are given, along the unit vector up."""
    joints = np.arange(positions.shape[1]) if joints is None else joints
    return np.asarray(heights_of(positions, joints, up).min(axis=1, initial=np.inf))


def steps_along(paths: Array, joints: Numbers | None = None, lag: int = 1) -> Array:
    """(frames - lag, joints), the distance of joints, all if none are given, from their places `lag` frames earlier."""
    joints = np.arange(paths.shape[1]) if joints is None else joints
    steps = np.empty((max(len(paths) - lag, 0), len(joints)))
    _write_steps(np.ascontiguousarray(paths), joints, lag, steps)
    return steps


@compiled()
def _write_steps(paths: F3, joints: I1, lag: int, steps: Out[F2]) -> None:
    for frame in range(len(steps)):
        for n in range(len(joints)):
            start, end = paths[frame, joints[n]], paths[frame + lag, joints[n]]
            x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
            steps[frame, n] = np.sqrt(x * x + y * y + z * z)


def angles_to_bones(vectors: Array, positions: Array, upper: Numbers, lower: Numbers) -> Array:
    """(frames, bones), the angles of `vectors`, (frames, bones, 3), to bones from joints `upper` to `lower` [rad]."""
    angles = np.empty(vectors.shape[:2])
    _write_half_tangents(np.ascontiguousarray(vectors), np.ascontiguousarray(positions), upper, lower, angles)
    np.arctan(angles, out=angles)
    angles *= 2.0
    return angles


@compiled()
def _write_half_tangents(vectors: F3, positions: F3, upper: I1, lower: I1, tangents: Out[F2]) -> None:
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


def thirds_along(paths: Array, joints: Numbers) -> Array:
    """(frames - 3,), the mean over joints of the length of their third differences; 0 without joints."""
    means = np.empty(max(len(paths) - 3, 0))
    _write_thirds(np.ascontiguousarray(paths), joints, means)
    return means


@compiled()
def _write_thirds(paths: F3, joints: I1, means: Out[F1]) -> None:
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


def turns_along(parents: Numbers, rotations: Array, joints: Numbers) -> Array:
    """(frames - 1, joints), the angles by which joints rotate in the world to the next frame [rad]; `rotations`,
    (frames, all joints, 4), are local. Unit quaternions have the distance 2 sin(angle / 4); q and -q are the same.
    """
    apart = np.empty((max(len(rotations) - 1, 0), len(joints)))
    _write_apart(parents, np.ascontiguousarray(rotations), joints, np.empty((2, len(parents), 4)), apart)
    apart *= 0.5
    np.arcsin(np.minimum(apart, 1.0, out=apart), out=apart)
    apart *= 4.0
    return apart


@compiled()
def _write_apart(parents: I1, rotations: F3, joints: I1, world: Out[F3], apart: Out[F2]) -> None:
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


def speeds_along(paths: Array, frame_time: float, joints: Numbers | None = None) -> Array:
    """(frames, joints), speeds by central differences [paths / frame_time] of joints, all if none are given."""
    joints = np.arange(paths.shape[1]) if joints is None else joints
    speeds = np.zeros((len(paths), len(joints)))
    write_speeds(np.ascontiguousarray(paths), joints, np.array([0, len(paths)]), 1, frame_time, speeds)
    return speeds


@compiled()
def write_directions(
    positions: F3, upper: I1, lower: I1, world: F3, turning: I2, blend: F1, bones: F3, directions: Out[F3]
) -> None:
    """Write the vectors from the joints `upper` to `lower`, (bones,) each. A bone with `turning` joints, (bones, 2) or
    -1, has its vectors in `bones` instead, (bones, 2, 3), rotated by the joints' `world` rotations, blended by `blend`.
    """
    for frame in range(len(directions)):
        for n in range(len(lower)):
            vector, p, q = directions[frame, n], positions[frame, upper[n]], positions[frame, lower[n]]
            vector[0], vector[1], vector[2] = q[0] - p[0], q[1] - p[1], q[2] - p[2]
            for k in range(2):
                if turning[n, k] >= 0 and (k == 0 or blend[n] > 0.0):
                    r, v = world[frame, turning[n, k]], bones[n, k]
                    x, y, z = rotated(r[0], r[1], r[2], r[3], v[0], v[1], v[2])
                    share = blend[n] if k else 1.0
                    vector[0] = share * x + (1.0 - share) * vector[0]
                    vector[1] = share * y + (1.0 - share) * vector[1]
                    vector[2] = share * z + (1.0 - share) * vector[2]


@compiled()
def write_speeds(positions: F3, joints: I1, edges: I1, reach: int, frame_time: float, speeds: Out[F2]) -> None:
    """Write speeds: the length of the mean velocity over `reach` frames before and after each frame, within the shot,
    which goes from one of `edges` to the next.
    """
    for shot in range(len(edges) - 1):
        first, end = edges[shot], edges[shot + 1]
        for frame in range(first, end):
            before, after = max(frame - reach, first), min(frame + reach, end - 1)
            for k in range(len(joints)):
                square = 0.0
                for i in range(3):
                    square += (positions[after, joints[k], i] - positions[before, joints[k], i]) ** 2
                speeds[frame, k] = np.sqrt(square) / max(after - before, 1) / frame_time


@compiled()
def find_holding(
    slow: B2,
    positions: F3,
    joints: I1,
    bases: I1,
    times: float,
    farther: float,
    least: float,
    shots: I1,
    holding: Out[B2],
) -> None:
    """Set `holding`, (frames, joints), in runs of at least `least` slow frames of one shot in which the base of a limb
    moves more than `times` as far from its mean position as the joint, and `farther` more.
    """
    for k in range(len(joints)):
        first = 0
        for frame in range(1, len(slow) + 1):
            if frame == len(slow) or slow[frame, k] != slow[first, k] or shots[frame] != shots[first]:
                if slow[first, k] and frame - first >= least:
                    moves = _reach(positions, bases[k], first, frame)
                    if moves > times * _reach(positions, joints[k], first, frame) + farther:
                        for held in range(first, frame):
                            holding[held, k] = True
                first = frame


@inlined()
def _reach(positions: Array, joint: int, first: int, end: int) -> float:
    """The largest distance of a joint from its mean position in the frames from `first` to before `end`."""
    farthest, a, b, c = 0.0, 0.0, 0.0, 0.0
    for frame in range(first, end):
        a += positions[frame, joint, 0] / (end - first)
        b += positions[frame, joint, 1] / (end - first)
        c += positions[frame, joint, 2] / (end - first)
    for frame in range(first, end):
        x, y, z = positions[frame, joint, 0], positions[frame, joint, 1], positions[frame, joint, 2]
        square = (x - a) * (x - a) + (y - b) * (y - b) + (z - c) * (z - c)
        if square > farthest:
            farthest = square
    return float(np.sqrt(farthest))
