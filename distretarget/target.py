"""Targets: a whole skeleton, or the source's skeleton with other bone lengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import NoneType

from distretarget.checks import check_callable, check_kind, check_number
from distretarget.errors import SkeletonError, SkeletonFileError, closest, entry_place
from distretarget.motion import Motion
from distretarget.skeleton import LARGEST, SMALLEST, JointMap, Skeleton
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import MeshReader, no_mesh


@dataclass(frozen=True, eq=False)
class Target:
    """The skeleton to retarget to.

    Attributes:
        skeleton: the skeleton, with rigid bones.
        map: the joint map in the file; empty if it has none.
        name: the skeleton's name in the file; empty if it has none.
        motion: the motion of a BVH file, if it has a valid one; it may show axes that the rest pose does not.
        mesh: returns the mesh of a character, or None; called when the mesh is needed.
        radii: mean thickness of the parts that single joints carry, by joint, if the file states it [file units].
        capsules: the body's surface, if already known; else it comes from mesh or radii, or from an average body.
    """

    skeleton: Skeleton
    map: JointMap
    name: str
    motion: Motion | None = None
    mesh: MeshReader = field(default_factory=lambda: no_mesh)
    radii: Mapping[int, float] = field(default_factory=dict)
    capsules: Capsules | None = None

    def __post_init__(self) -> None:
        check_kind("skeleton", self.skeleton, Skeleton)
        check_kind("map", self.map, Mapping)
        check_kind("motion", self.motion, Motion, NoneType)
        check_callable("mesh", self.mesh)
        check_kind("radii", self.radii, Mapping)
        check_kind("capsules", self.capsules, Capsules, NoneType)

    @property
    def is_measured(self) -> bool:
        """Whether the file shows the thickness of the body, by a mesh or radii."""
        return bool(self.radii) or self.mesh() is not None

    def for_source(self, source: Skeleton) -> Target:  # noqa: ARG002
        """Return the target itself: it is the same for every source."""
        return self

    def facing_forward(self) -> Target:
        """Return the target facing +Z by convention: turned if it faced -Z (`Skeleton.faces_negative_z`)."""
        if not self.skeleton.faces_negative_z:
            return self
        return replace(
            self,
            skeleton=self.skeleton.turned_round(),
            motion=self.motion and self.motion.facing_forward(),
            mesh=cache(lambda: (mesh := self.mesh()) and mesh.turned_round()),
            capsules=self.capsules and self.capsules.turned_round(),
        )

    def scaled(self, factor: float) -> Target:
        """Return the target with its body scaled by a factor."""
        return replace(
            self,
            skeleton=self.skeleton.with_offsets(factor * self.skeleton.offsets),
            motion=self.motion and self.motion.scaled(factor),
            mesh=cache(lambda: (mesh := self.mesh()) and mesh.scaled(factor)),
            radii={joint: factor * radius for joint, radius in self.radii.items()},
            capsules=self.capsules and self.capsules.scaled(factor),
        )


@dataclass(frozen=True)
class SkeletonEdit:
    """Changes of the bone lengths of a source's skeleton; each bone is named by the key of its lower joint.

    Attributes:
        scale: factor of all bone lengths and of the root's offset.
        lengths: final length of single bones, regardless of the scale [file units].
        factors: additional factor of single bones.
        path: path of the file, for error messages.

    Raises:
        SettingsError: a number is not above 0.
    """

    scale: float
    lengths: Mapping[str, float]
    factors: Mapping[str, float]
    path: str | Path

    def __post_init__(self) -> None:
        check_number("scale", self.scale, SMALLEST, LARGEST)
        for name, numbers in (("lengths", self.lengths), ("factors", self.factors)):
            check_kind(name, numbers, Mapping)
            for key, number in numbers.items():
                check_number(entry_place(name, str(key)), number, SMALLEST, LARGEST)

    def for_source(self, source: Skeleton) -> Target:
        """Return the edited skeleton as a target; errors as in `apply`."""
        return Target(self.apply(source), {}, "")

    def facing_forward(self) -> SkeletonEdit:
        """Return the same edit: lengths have no direction."""
        return self

    def scaled(self, factor: float) -> SkeletonEdit:
        """Return the edit with its result scaled by a factor."""
        lengths = {key: factor * length for key, length in self.lengths.items()}
        return replace(self, scale=factor * self.scale, lengths=lengths)

    def apply(self, source: Skeleton) -> Skeleton:
        """Return the source's skeleton with these bone lengths and unchanged bone directions; a SkeletonFileError if a
        key is no joint, has a bone of length 0, or is in both `lengths` and `factors`, or if bones get length 0 or too
        long.
        """
        check_kind("source", source, Skeleton)
        lengths = self.scale * source.lengths
        for key, factor in self.factors.items():
            lengths[self._bone("factors", key, source)] *= factor
        for key, length in self.lengths.items():
            lengths[self._bone("lengths", key, source)] = length
        if both := [entry_place("lengths", key) for key in self.lengths if key in self.factors]:
            raise SkeletonFileError(self.path, both[0], "is in factors too; give only one of them")
        try:
            offsets = source.with_lengths(lengths).offsets.copy()
            offsets[0] *= self.scale
            return with_bones(source.with_offsets(offsets), self.path)
        except SkeletonError as error:
            raise SkeletonFileError(self.path, "", str(error)) from error

    def _bone(self, field: str, key: str, source: Skeleton) -> int:
        """The joint with this key; an error if it has no bone whose length can be changed."""
        place = entry_place(field, key)
        if key not in source.keys:
            raise SkeletonFileError(self.path, place, f"no such joint; {closest(key, source.keys)}")
        joint = source.index(key)
        if not joint:
            raise SkeletonFileError(self.path, place, "the root has no bone; expected a joint with a parent")
        if source.lengths[joint] == 0:
            raise SkeletonFileError(self.path, place, "the bone has length 0 in the source, so it has no direction")
        return joint


LoadedTarget = Target | SkeletonEdit
"""What `load_target` returns: a whole skeleton, or an edit of the source's."""

AnyTarget = Motion | Skeleton | LoadedTarget
"""What `retarget` takes for the body to retarget to."""


def with_bones(skeleton: Skeleton, path: str | Path, place: str = "") -> Skeleton:
    """Return the skeleton, or raise a SkeletonFileError if no bone has a length."""
    if not skeleton.lengths.max() >= SMALLEST:
        fault = f"all bones have length 0, or are shorter than {SMALLEST:g}"
        raise SkeletonFileError(path, place, f"{fault}; expected at least one longer bone")
    return skeleton
