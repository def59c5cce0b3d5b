"""The surface of a body, of its mesh or, where it has none, of capsules: how low it reaches."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from distretarget.body.soles import Sole
from distretarget.motion import Motion
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.quaternions import turned_by
from distretarget.numerics.vectors import Array, Numbers
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh, outermost

BACKWARDS = np.array([-1.0, -1.0, -1.0, 1.0])  # a quaternion times this turns back


@dataclass(frozen=True, eq=False)
class Surface:
    """Balls on the joints of a skeleton; those of a mesh are its vertices and have no radius."""

    carriers: Numbers  # (balls,), the joint that moves each most
    centres: Array  # (balls, 3), while no joint is turned [file units]
    joints: Numbers  # (balls, influences), the joints that move each
    weights: Array  # (balls, influences), their shares, which sum to 1
    radii: Array  # (balls,) [file units]
    rest: Array  # (joints, 3), the places of the joints while none is turned [file units]
    of_mesh: bool

    def on(self, joints: Iterable[int]) -> Numbers:
        """The balls that some joints carry."""
        return np.flatnonzero(np.isin(self.carriers, [*joints]))

    def lowest(self, motion: Motion, joints: Iterable[int], up: Array) -> Array:
        """(frames,), the height of the lowest point that some joints carry, along the unit vector up, (3,); infinite
        where they carry none [file units].

        With joints at x, turned by R: w (x + R (centre - rest)) . up, summed, is linear in x . up and R^T up.
        """
        on, heights = self.on(joints), np.full(len(motion), np.inf)
        if not len(on):
            return heights
        moving = np.unique(self.joints[on][self.weights[on] > 0.0])
        shares = np.stack([np.where(self.joints[on] == joint, self.weights[on], 0.0).sum(axis=1) for joint in moving])
        arms = shares[..., None] * (self.centres[on] - self.rest[moving, None])
        linear = np.concatenate([arms, shares[..., None]], axis=2).transpose(0, 2, 1).reshape(-1, len(on))
        poses = np.empty((len(motion), len(moving), 4))
        for column, joint in enumerate(moving.tolist()):
            poses[:, column, :3] = turned_by(motion.world_rotations_of(joint) * BACKWARDS, up)
            poses[:, column, 3] = motion.positions[:, joint] @ up
        for block in blocks_of(len(motion)):
            heights[block] = (poses[block].reshape(-1, len(linear)) @ linear - self.radii[on]).min(axis=1)
        return heights

    def below_sole(self, sole: Sole) -> float:
        """How far the skin of a flat foot is below its lowest joint [file units]; 0 for a foot without skin."""
        on = self.on(sole.joints.tolist())
        if not len(on):
            return 0.0
        joints = self.rest[sole.joints] @ sole.normal
        return float(joints.min() - (self.centres[on] @ sole.normal - self.radii[on]).min())


def find_surface(skeleton: Skeleton, capsules: Capsules, mesh: SkinnedMesh | None) -> Surface:
    """Return the surface of a body: of its mesh, else of its capsules."""
    return surface_of_capsules(capsules, skeleton) if mesh is None else surface_of_mesh(mesh, skeleton)


@lru_cache(maxsize=4)
def surface_of_mesh(mesh: SkinnedMesh, skeleton: Skeleton) -> Surface:
    """Return the surface of a mesh: the vertices that can be the outermost of all that one joint carries."""
    groups = [np.flatnonzero(mesh.carriers == joint) for joint in np.unique(mesh.carriers)]
    on = np.concatenate([group[outermost(mesh.vertices[group])] for group in groups])
    joints, weights = mesh.joints[on], mesh.weights[on]
    return Surface(
        mesh.carriers[on], mesh.vertices[on], joints, weights, np.zeros(len(on)), skeleton.rest_positions, of_mesh=True
    )


def surface_of_capsules(capsules: Capsules, skeleton: Skeleton) -> Surface:
    """Return the surface of capsules: the lowest point of each is that of one of its ends."""
    joints, rest = np.repeat(capsules.joints, 2), skeleton.rest_positions
    centres = (capsules.ends + rest[capsules.joints, None]).reshape(-1, 3)
    weights = np.ones((len(joints), 1))
    return Surface(joints, centres, joints[:, None], weights, capsules.radii.ravel(), rest, of_mesh=False)
