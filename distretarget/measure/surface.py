"""The lowest heights of the surface of a body, of its mesh or, if it has none, of its capsules."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from distretarget.body.soles import Sole
from distretarget.motion import Motion
from distretarget.numerics.parallel import in_blocks
from distretarget.numerics.vectors import Array, Numbers
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh, outermost


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface as balls on the joints of a skeleton; those of a mesh are its vertices and have no radius."""

    centres: SkinnedMesh  # the centres of the balls as vertices, without triangles
    radii: Array  # (balls,) [file units]
    rest: Array  # (joints, 3), the positions of the joints in the rest pose [file units]
    of_mesh: bool

    def on(self, joints: Iterable[int]) -> Numbers:
        """The numbers of the balls that some joints carry."""
        return np.flatnonzero(np.isin(self.centres.carriers, [*joints]))

    def lowest(self, motion: Motion, joints: Iterable[int], up: Array) -> Array:
        """(frames,), the height of the lowest point on some joints along `up` [file units]; infinite without."""
        on = self.on(joints)
        some, radii = _without_triangles(self.centres, on), self.radii[on]
        return in_blocks(
            lambda block: (some.heights(motion[block], up) - radii).min(axis=1, initial=np.inf), len(motion)
        )

    def below_sole(self, sole: Sole) -> float:
        """The thickness of a flat foot below its lowest joint [file units]; 0 for a foot without skin."""
        on = self.on(sole.joints.tolist())
        if not len(on):
            return 0.0
        joints = self.rest[sole.joints] @ sole.normal
        return float(joints.min() - (self.centres.vertices[on] @ sole.normal - self.radii[on]).min())


def _without_triangles(mesh: SkinnedMesh, on: Numbers) -> SkinnedMesh:
    """Some vertices of a mesh."""
    return SkinnedMesh(mesh.vertices[on], mesh.joints[on], mesh.weights[on], mesh.triangles[:0])


def find_surface(skeleton: Skeleton, capsules: Capsules, mesh: SkinnedMesh | None) -> Surface:
    """Return the surface of a body: of its mesh, else of its capsules."""
    return surface_of_capsules(capsules, skeleton) if mesh is None else surface_of_mesh(mesh, skeleton)


@lru_cache(maxsize=4)
def surface_of_mesh(mesh: SkinnedMesh, skeleton: Skeleton) -> Surface:
    """Return the surface of a mesh: of the vertices that one joint carries, those that can be the outermost."""
    groups = [np.flatnonzero(mesh.carriers == joint) for joint in np.unique(mesh.carriers)]
    on = np.concatenate([group[outermost(mesh.vertices[group])] for group in groups])
    return Surface(_without_triangles(mesh, on), np.zeros(len(on)), skeleton.rest_positions, of_mesh=True)


def surface_of_capsules(capsules: Capsules, skeleton: Skeleton) -> Surface:
    """Return the surface of capsules: the lowest point of each is that of one of its ends."""
    joints, rest = np.repeat(capsules.joints, 2)[:, None], skeleton.rest_positions
    centres = (capsules.ends + rest[capsules.joints, None]).reshape(-1, 3)
    balls = SkinnedMesh(centres, joints, np.ones(joints.shape), np.zeros((0, 3), np.intp))
    return Surface(balls, capsules.radii.ravel(), rest, of_mesh=False)
