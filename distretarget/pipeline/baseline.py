"""The baseline of a clip: its source, the rotation copy on the target, and how far the copy is from the source.

It does not depend on what a user asks for, so all results of one clip on one target are measured against the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from distretarget.baseline.world import World
from distretarget.body.beside import Tree
from distretarget.body.body import Body
from distretarget.body.pelvis import way_to_thighs
from distretarget.distances import DistanceProblem, posture_stress
from distretarget.matching.matching import Matching
from distretarget.measure.comparison import Comparison, Reference
from distretarget.measure.skin import Skin, find_skin
from distretarget.measure.surface import find_surface
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array
from distretarget.objectives.body_skin import Skins
from distretarget.rig import found_once
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh


@dataclass(frozen=True, eq=False, kw_only=True)
class Baseline:
    """A source and its rotation copy, with the fields of these names of a `RetargetResult`."""

    source: Motion
    rotation_copy: Motion
    matching: Matching
    world: World
    distances: DistanceProblem
    skins: Skins | None
    mesh: SkinnedMesh | None
    source_mesh: SkinnedMesh | None

    @cached_property
    def reference(self) -> Reference:
        """The source as motions are measured against it."""
        source, target = self.matching.source, self.matching.target
        skins, surface = None, None
        if self.skins:
            of_target = _skin_of(target, self.skins.target.capsules, self.mesh)
            skins = _skin_of(source, self.skins.source.capsules, self.source_mesh), of_target
            surface = find_surface(target.skeleton, self.skins.target.capsules, self.mesh)
        return Reference(self.source, self.matching, self.world.up_vector, skins, surface)

    @cached_property
    def comparison(self) -> Comparison:
        """The rotation copy measured against the source, frame by frame."""
        comparison = self.reference.compare(self.on_body(self.rotation_copy))
        self.stress  # noqa: B018 - by these positions
        self.rotation_copy.forget()
        return comparison

    @cached_property
    def stress(self) -> Array:
        """(frames,), `stress_of` the rotation copy."""
        return self.stress_of(self.rotation_copy)

    def stress_of(self, motion: Motion) -> Array:
        """(frames,), the stress of a motion, Eq. (2), over the squared height of the target's rest pose."""
        return self.relative * posture_stress(self.distances, self.source.positions, motion.positions)

    @property
    def relative(self) -> float:
        """The factor from stress in body sizes squared to stress in target heights squared."""
        return (self.distances.body_size / self.matching.target.height) ** 2

    def on_body(self, motion: Motion) -> Motion:
        """Return a motion of the target's file by the joints of its body, where feet and hands may hang otherwise."""
        own = self.matching.target.skeleton
        hung = (motion.skeleton.parents != own.parents).any()
        motion = Tree(own, np.arange(len(own))).motion(motion) if hung else motion
        way = way_to_thighs(Body.of(motion.skeleton)) if (motion.skeleton.offsets != own.offsets).any() else None
        return way.motion(motion) if way else motion


@found_once
def _skin_of(body: Body, capsules: Capsules, mesh: SkinnedMesh | None) -> Skin:
    """The skin by which a body is measured."""
    return find_skin(body, capsules, mesh)
