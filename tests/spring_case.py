"""A small body drawn by random springs, which the tests of springs, their curvature and the solver share."""

import numpy as np
from bodies import swaying, tree_of

from distretarget.ik.articulation import Articulation, Scratch, pose_body, pose_gradient, stiffness_energy
from distretarget.ik.pose_solver import CopiedBones, Workspace
from distretarget.ik.poses import part_of_joint
from distretarget.ik.springs import FrameSprings, Springs, no_floor, room_for_springs, spring_energy
from distretarget.objectives.contact import TOLERANCE
from distretarget.objectives.contact_terms import ContactFrames, NearPairs, solve_contact_frames


def no_pairs(frames):
    """Return the pairs of a clip without contacts."""
    none, points, values = np.zeros(0, np.intp), np.zeros((frames, 0, 3)), np.zeros((frames, 0))
    return NearPairs(none, none, none, none, points, points, values, values)


def stiffer_along(e, w, k):
    """The stiffness w (k I + (1 - k) e e^T): w along unit vectors e (..., 3), and k w across them."""
    outer = e[..., :, None] * e[..., None, :]
    return w[..., None, None] * (k[..., None, None] * np.eye(3) + (1 - k)[..., None, None] * outer)


def random_springs(draw, joints, frames=1, count=12, grounded=4):
    """Springs with the frames in front, the last few of them grounded."""
    a = draw.integers(0, joints, count)
    b = (a + draw.integers(1, joints, count)) % joints
    b[count - grounded :] = -1
    e = draw.normal(size=(frames, count, 3))
    e /= np.linalg.norm(e, axis=-1, keepdims=True)
    w, k = draw.uniform(0.5, 3, (frames, count)), draw.uniform(0, 1, (frames, count))
    return Springs(a, b, draw.normal(size=(frames, count, 3)), stiffer_along(e, w, k))


def at(springs, frame):
    return FrameSprings(springs.a, springs.b, *(values[frame] for values in springs[2:]))


def naive_energy(x, springs):
    energy = 0.0
    for a, b, rest, A in zip(*springs, strict=True):
        r = x[a] - rest - (x[b] if b >= 0 else 0)
        energy += 0.5 * r @ A @ r
    return energy


class Case:
    """A small body in one posture per frame, with random stiffness and springs."""

    def __init__(self, seed, frames=1, joints=8):
        draw = np.random.default_rng(seed)
        parents = [-1] + [int(draw.integers(max(0, joint - 3), joint)) for joint in range(1, joints)]
        skeleton = tree_of(0.4 * draw.normal(size=(joints, 3)), parents=parents)
        copy = swaying(skeleton, frames, seed=seed)
        self.parts = part_of_joint(skeleton, np.arange(joints))
        self.stiffness = draw.uniform(0.3, 1.0, self.parts.max() + 2)
        self.body = Articulation(skeleton.parents, self.parts, self.stiffness)
        self.bones = copy.positions - copy.positions[:, skeleton.parents]
        self.root = np.array(copy.positions[:, 0])
        self.springs = random_springs(draw, joints, frames)
        self.scratch = Scratch.of(self.body)

    @property
    def shape(self):
        return len(self.stiffness), 3

    def positions(self, v, frame=0):
        pose_body(v, self.body, self.bones[frame], self.root[frame], self.scratch)
        return self.scratch.x.copy()

    def energy(self, v, frame=0):
        held = 0.5 * np.sum(self.stiffness[:, None] * v**2)
        return naive_energy(self.positions(v, frame), at(self.springs, frame)) + held

    def energy_and_gradient(self, flat, frame=0):
        v, gradient = flat.reshape(self.shape), np.empty(self.shape)
        self.positions(v, frame)
        self.scratch.gradient[:] = 0.0
        springs = at(self.springs, frame)
        value = spring_energy(self.scratch, springs, len(springs.a)) + stiffness_energy(v, self.body)
        pose_gradient(v, self.body, self.scratch, gradient)
        return value, gradient.ravel()

    def without_residual(self, v=None):
        """The same body with springs at rest in the pose `v`, or else in the copy's posture."""
        for frame in range(len(self.root)):
            x, b = self.positions(np.zeros(self.shape) if v is None else v, frame), self.springs.b
            self.springs.rest[frame] = x[self.springs.a] - np.where(b[:, None] >= 0, x[b], 0.0)
        return self

    def solved(self, before=None):
        """The poses of all frames, the first of which may be given, and the log of the solver."""
        v, log = np.zeros((len(self.root), *self.shape)), np.zeros((4, len(self.root)))
        first = 0
        if before is not None:
            first = len(before)
            v[:first] = before
        rows = Springs(*self.springs[:2], *(values[first:] for values in self.springs[2:]))
        copy, frames = CopiedBones(self.bones[first:], self.root[first:]), len(self.root) - first
        given = ContactFrames(no_pairs(frames), rows, no_floor(frames), room_for_springs(len(rows.a)))
        solve_contact_frames(self.body, copy, given, TOLERANCE, v, first, log, Workspace.of(self.body))
        return v, log
