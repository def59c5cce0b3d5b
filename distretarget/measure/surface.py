"""The lowest heights of the surface of a body, of its mesh or, if it has none, of its capsules."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from distretarget.body.soles import Sole
from distretarget.motion import Motion
from distretarget.numerics.parallel import in_blocks
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh, outermost

ALONE = 0.99  # a joint with at least this skin weight moves a vertex alone


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface as balls on the joints of a skeleton; those of a mesh are its vertices and have no radius."""

    centres: SkinnedMesh  # the centres of the balls as vertices, without triangles
    radii: Array  # (balls,) [file units]
    rest: Array  # (joints, 3), the positions of the joints in the rest pose [file units]
    of_mesh: bool
    rigid: Flags  # (balls,), whether each is on a rigid piece of a mesh that has others which bend

    @property
    def without_gear(self) -> Surface:
        """The surface without the rigid pieces on joints that carry other skin as well: wings, a pack, a scabbard."""
        of_skin = self.centres.carriers[~self.rigid]
        on = np.flatnonzero(~(self.rigid & np.isin(self.centres.carriers, of_skin)))
        some = _without_triangles(self.centres, on)
        return replace(self, centres=some, radii=self.radii[on], rigid=self.rigid[on])

    def on(self, joints: Iterable[int]) -> Numbers:
        """The numbers of the balls that some joints carry."""
        return np.flatnonzero(np.isin(self.centres.carriers, [*joints]))

    def lowest(self, motion: Motion, joints: Iterable[int], up: Array) -> Array:
        """(frames,), the height of the lowest point that some joints carry, along the unit vector `up`, (3,) [file
        units]; infinite if they carry none.
        """
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
    """Return the surface of a mesh: of the vertices that one joint carries, and of its rigid pieces, those that can be
    the outermost.
    """
    rigid = _on_rigid_pieces(mesh)
    kinds = 2 * mesh.carriers + rigid
    groups = [np.flatnonzero(kinds == kind) for kind in np.unique(kinds)]
    on = np.concatenate([group[outermost(mesh.vertices[group])] for group in groups])
    rest, some = skeleton.rest_positions, _without_triangles(mesh, on)
    return Surface(some, np.zeros(len(on)), rest, of_mesh=True, rigid=rigid[on])


def _on_rigid_pieces(mesh: SkinnedMesh) -> Flags:
    """(vertices,), whether each is on a connected piece that one joint moves alone, if there are pieces that bend."""
    bends = np.zeros(mesh.pieces.max(initial=-1) + 1, bool)
    joint_of = np.zeros(len(bends), np.intp)
    joint_of[mesh.pieces] = mesh.carriers
    bends[mesh.pieces[(mesh.carriers != joint_of[mesh.pieces]) | (mesh.weights.max(axis=1) < ALONE)]] = True
    return np.asarray(~bends[mesh.pieces] & bends.any())


def surface_of_capsules(capsules: Capsules, skeleton: Skeleton) -> Surface:
    """Return the surface of capsules: the lowest point of each is that of one of its ends."""
    joints, rest = np.repeat(capsules.joints, 2)[:, None], skeleton.rest_positions
    centres = (capsules.ends + rest[capsules.joints, None]).reshape(-1, 3)
    balls = SkinnedMesh(centres, joints, np.ones(joints.shape), np.zeros((0, 3), np.intp))
    return Surface(balls, capsules.radii.ravel(), rest, of_mesh=False, rigid=np.zeros(len(centres), bool))
