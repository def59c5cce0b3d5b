"""Springs between two joints, or between a joint and a place in the world: energy, gradient, and stiffness per subtree;
and the floor, a one-sided spring that keeps each joint above a height.

To first order, rotating a bone translates its whole subtree by one vector, and the torque on the bone comes from the
sum of the forces on the subtree. So the curvature needs the springs only as sums over subtrees, which take one pass
over the tree for any number of springs. All functions on arrays are compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distretarget.ik.articulation import Articulation, Scratch
from distretarget.numerics.compiled import inlined
from distretarget.numerics.vectors import B1, F1, F2, F3, F4, I1, Array, Numbers

NEGLIGIBLE = 1e-9  # springs of less stiffness are left out


class FrameSprings(NamedTuple):
    """Springs of one frame, which pull two joints to a given difference, or one joint to a place in the world.

    Spring s has the energy 1/2 r^T A[s] r, r = x[a[s]] - x[b[s]] - rest[s], or r = x[a[s]] - rest[s] where b[s] is -1.
    """

    a: I1  # (springs,), joints
    b: I1  # (springs,), joints; -1 where the spring is tied to the world
    rest: F2  # (springs, 3)
    A: F3  # (springs, 3, 3), symmetric, the stiffness in each direction


class Springs(NamedTuple):
    """The springs of some frames, between the same joints in all."""

    a: I1  # (springs,), joints
    b: I1  # (springs,), joints; -1 where the spring is tied to the world
    rest: F3  # (frames, springs, 3)
    A: F4  # (frames, springs, 3, 3)

    def of_frames(self, frames: slice) -> Springs:
        """The springs of some of the frames."""
        return self._replace(rest=self.rest[frames], A=self.A[frames])


def no_springs(frames: int) -> Springs:
    """No springs."""
    none = np.zeros(0, np.intp)
    return Springs(none, none, np.zeros((frames, 0, 3)), np.zeros((frames, 0, 3, 3)))


def room_for_springs(count: int) -> FrameSprings:
    """Scratch for `count` springs of one frame."""
    ends = np.zeros((2, count), np.intp)
    return FrameSprings(ends[0], ends[1], np.zeros((count, 3)), np.zeros((count, 3, 3)))


def joined(*springs: Springs) -> Springs:
    """All of these springs as one."""
    lists = [np.concatenate(arrays, axis=min(np.ndim(arrays[0]) - 1, 1)) for arrays in zip(*springs, strict=True)]
    return Springs(*lists)


@inlined(fastmath=True)
def is_negligible(A: Array, s: int) -> bool:
    """Whether spring s, of stiffnesses A, (springs, 3, 3), is too soft to count."""
    return bool(A[s, 0, 0] + A[s, 1, 1] + A[s, 2, 2] < NEGLIGIBLE)


@inlined(fastmath=True)
def spring_energy(scratch: Scratch, springs: FrameSprings, count: int) -> float:
    """Return the energy of the first `count` springs at `scratch.x`, and add its gradient to `scratch.gradient`."""
    energy = 0.0
    x, gradient, A, rest = scratch.x, scratch.gradient, springs.A, springs.rest
    for s in range(count):
        if is_negligible(A, s):
            continue
        a, b = springs.a[s], springs.b[s]
        rx, ry, rz = x[a, 0] - rest[s, 0], x[a, 1] - rest[s, 1], x[a, 2] - rest[s, 2]
        if b >= 0:
            rx, ry, rz = rx - x[b, 0], ry - x[b, 1], rz - x[b, 2]
        fx = A[s, 0, 0] * rx + A[s, 0, 1] * ry + A[s, 0, 2] * rz
        fy = A[s, 1, 0] * rx + A[s, 1, 1] * ry + A[s, 1, 2] * rz
        fz = A[s, 2, 0] * rx + A[s, 2, 1] * ry + A[s, 2, 2] * rz
        energy += 0.5 * (fx * rx + fy * ry + fz * rz)
        gradient[a, 0] += fx
        gradient[a, 1] += fy
        gradient[a, 2] += fz
        if b >= 0:
            gradient[b, 0] -= fx
            gradient[b, 1] -= fy
            gradient[b, 2] -= fz
    return energy


class Below(NamedTuple):
    """Work arrays for sums over subtrees, each long enough for all joints of a body."""

    moving_bones: I1  # (joints,), see `write_moving_bones`
    first: I1  # (joints + 1,), the index in `moving_bones` where each node begins, see `write_nodes`
    G: F4  # (joints, joints, 3, 3), the stiffness between nodes, see `write_stiffness_below`
    ends: I1  # (joints,), the number of springs with exactly one end at or below each joint
    is_end: B1  # (joints,), whether each joint is an end of a spring
    children: I1  # (joints,), the number of moving bones below each joint
    node: I1  # (joints,), the node of the bone to each joint; -1 if it does not move

    @classmethod
    def of(cls, body: Articulation) -> Below:
        """Arrays for a body."""
        joints = len(body.parents)
        bones, first, ends, children, node = (np.zeros(joints + n, np.intp) for n in (0, 1, 0, 0, 0))
        return cls(bones, first, np.zeros((joints, joints, 3, 3)), ends, np.zeros(joints, np.bool_), children, node)


@inlined(fastmath=True)
def write_moving_bones(springs: FrameSprings, count: int, body: Articulation, below: Below) -> int:
    """Write the moving bones to `below.moving_bones`, and return their number: the bones whose rotation changes one of
    the first `count` springs. A bone is given by its lower joint, in descending order; the root, 0, follows if a spring
    is tied to the world.

    A spring between two joints depends on the bones on the path between them.
    """
    ends, is_end = below.ends, below.is_end
    for joint in range(len(ends)):
        ends[joint], is_end[joint] = 0, False
    for s in range(count):
        if is_negligible(springs.A, s):
            continue
        a, b = springs.a[s], springs.b[s]
        ends[a] += 1
        is_end[a] = True
        if b >= 0:
            ends[b] += 1
            is_end[b] = True
            while a != b:  # up to where their lines to the root meet
                if a > b:
                    a = body.parents[a]
                else:
                    b = body.parents[b]
            ends[a] -= 2
    bones = 0
    for joint in range(len(ends) - 1, -1, -1):  # all below the joint has been added to `ends[joint]`
        if joint > 0:
            ends[body.parents[joint]] += ends[joint]
        if ends[joint] > 0:
            below.moving_bones[bones] = joint
            bones += 1
    return bones


@inlined(fastmath=True)
def write_nodes(bones: int, parents: Numbers, below: Below) -> int:
    """Write the index where each node begins among the first `bones` bones of `below.moving_bones`, and where the last
    one ends, to `below.first`; return the number of nodes. A node is a chain of bones without a branch and without the
    end of a spring inside.
    """
    moving, children, count = below.moving_bones, below.children, 0
    for joint in range(len(children)):
        children[joint] = 0
    for i in range(bones):
        if moving[i] > 0:
            children[parents[moving[i]]] += 1
    for i in range(bones):
        joint = moving[i]
        if i == 0 or parents[moving[i - 1]] != joint or children[joint] > 1 or below.is_end[joint]:
            below.first[count] = i
            count += 1
    below.first[count] = bones
    return count


@inlined(fastmath=True)
def write_stiffness_below(springs: FrameSprings, count: int, nodes: int, parents: Numbers, below: Below) -> None:
    """Write the stiffness between subtrees to the upper triangle of `below.G[:nodes, :nodes]`: the force on the subtree
    of one node per displacement of that of another. Bones that do not move change no spring, and add nothing.
    """
    moving, first, node, G = below.moving_bones, below.first, below.node, below.G
    for joint in range(len(node)):
        node[joint] = -1
    for n in range(nodes):
        for i in range(first[n], first[n + 1]):
            node[moving[i]] = n
        for m in range(n, nodes):
            for i in range(3):
                for j in range(3):
                    G[n, m, i, j] = 0.0
    _add_ends(springs, count, node, G)
    for n in range(nodes):
        top = moving[first[n + 1] - 1]
        above = node[parents[top]] if top > 0 else -1
        if above >= 0:
            _add_to_above(G, n, above, nodes)


@inlined(fastmath=True)
def _add_ends(springs: FrameSprings, count: int, node: Numbers, G: Array) -> None:
    """Add the stiffness of each spring to G at the nodes of its ends."""
    A = springs.A
    for s in range(count):
        if is_negligible(A, s):
            continue
        a, b = node[springs.a[s]], node[springs.b[s]] if springs.b[s] >= 0 else -1
        if a >= 0:
            _add(A[s], 1.0, G[a, a])
        if b >= 0:
            _add(A[s], 1.0, G[b, b])
        if a >= 0 and b >= 0:
            _add(A[s], -1.0, G[a, b] if a < b else G[b, a])


@inlined(fastmath=True)
def _add_to_above(G: Array, n: int, above: int, nodes: int) -> None:
    """Add row and column of node n to those of the node above it, whose subtree contains that of n."""
    for other in range(n):
        _add(G[other, n], 1.0, G[other, above])
    for other in range(n + 1, above + 1):
        _add_transposed(G[n, other], G[other, above])
    _add(G[n, above], 1.0, G[above, above])
    _add(G[n, n], 1.0, G[above, above])
    _add(G[n, n], 1.0, G[n, above])
    for other in range(above + 1, nodes):
        _add(G[n, other], 1.0, G[above, other])


@inlined(fastmath=True)
def couples(block: Array) -> bool:
    """Whether a block of G is more than rounding: a sum of stiffness matrices, or minus such a sum."""
    return bool(abs(block[0, 0] + block[1, 1] + block[2, 2]) >= NEGLIGIBLE)


@inlined(fastmath=True)
def _add(block: Array, sign: float, to: Array) -> None:
    for i in range(3):
        for j in range(3):
            to[i, j] += sign * block[i, j]


@inlined(fastmath=True)
def _add_transposed(block: Array, to: Array) -> None:
    for i in range(3):
        for j in range(3):
            to[i, j] += block[j, i]


# ---- the floor: 1/2 sum over joints below their height h   k (h - x . up)^2


class FloorSprings(NamedTuple):
    """The heights that joints keep above in some frames; in a single frame the axis of the frames is left out."""

    joints: I1  # (joints,), joints of the target
    heights: F2  # (frames, joints), h [body units]
    stiffness: F2  # (frames, joints), k
    up: F1  # (3,), the unit vector up

    def of_frames(self, frames: slice) -> FloorSprings:
        """Return the floor of some of the frames."""
        return self._replace(heights=self.heights[frames], stiffness=self.stiffness[frames])


def no_floor(frames: int) -> FloorSprings:
    """Return a floor that supports no joint."""
    return FloorSprings(np.zeros(0, np.intp), np.zeros((frames, 0)), np.zeros((frames, 0)), np.zeros(3))


@inlined(fastmath=True)
def depth_below(scratch: Scratch, floor: FloorSprings, n: int) -> float:
    """How far the n-th joint is below its height at the positions `scratch.x`; negative above it."""
    x = scratch.x[floor.joints[n]]
    return float(floor.heights[n] - (x[0] * floor.up[0] + x[1] * floor.up[1] + x[2] * floor.up[2]))


@inlined(fastmath=True)
def floor_energy(scratch: Scratch, floor: FloorSprings) -> float:
    """Return the floor's energy at the positions `scratch.x`, and add its gradient to `scratch.gradient`."""
    energy = 0.0
    for n in range(len(floor.joints)):
        if floor.stiffness[n] < NEGLIGIBLE:
            continue
        depth = depth_below(scratch, floor, n)
        if depth > 0.0:
            energy += 0.5 * floor.stiffness[n] * depth * depth
            for i in range(3):
                scratch.gradient[floor.joints[n], i] -= floor.stiffness[n] * depth * floor.up[i]
    return energy


@inlined(fastmath=True)
def add_floor(scratch: Scratch, floor: FloorSprings, springs: FrameSprings, count: int) -> int:
    """Append a spring with the floor's curvature per joint below its height to `count` springs; return the count."""
    for n in range(len(floor.joints)):
        if floor.stiffness[n] >= NEGLIGIBLE and depth_below(scratch, floor, n) > 0.0:
            springs.a[count], springs.b[count] = floor.joints[n], -1
            for i in range(3):
                for j in range(3):
                    springs.A[count, i, j] = floor.stiffness[n] * floor.up[i] * floor.up[j]
            count += 1
    return count
