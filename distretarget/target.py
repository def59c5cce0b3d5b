"""Targets: a whole skeleton, or other bone lengths for the source's skeleton."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import NoneType

from distretarget.checks import check_kind, check_number
from distretarget.errors import SkeletonError, SkeletonFileError, closest, entry_place
from distretarget.motion import Motion
from distretarget.skeleton import LARGEST, SMALLEST, JointMap, Skeleton


@dataclass(frozen=True, eq=False)
class Target:
    """The skeleton to retarget to.

    Attributes:
        skeleton: the skeleton, with rigid bones.
        map: the map in the file, source key by target key; empty where the file has none.
        name: the name of the skeleton in the file; empty where it has none.
        motion: the motion of a BVH file, if it has a valid one; it can show what the rest pose does not.
    """

    skeleton: Skeleton
    map: JointMap
    name: str
    motion: Motion | None = None

    def __post_init__(self) -> None:
        check_kind("skeleton", self.skeleton, Skeleton)
        check_kind("map", self.map, Mapping)
        check_kind("motion", self.motion, Motion, NoneType)

    def for_source(self, source: Skeleton) -> Target:  # noqa: ARG002
        """Return the target itself, since it is the same for every source."""
        return self


@dataclass(frozen=True)
class SkeletonEdit:
    """Other bone lengths for the skeleton of a source.

    Attributes:
        scale: the factor for all bone lengths and the root's offset.
        lengths: by the key of a bone's lower joint, the bone's final length, whatever the scale [file units].
        factors: by the key of a bone's lower joint, an additional factor for the bone's length.
        path: the path of the file, for errors.

    Raises:
        SettingsError: a number is not above 0.
    """

    scale: float
    lengths: Mapping[str, float]
    factors: Mapping[str, float]
    path: str | Path

    def __post_init__(self) -> None:
        check_number("scale", self.scale, SMALLEST, LARGEST)
        for field, numbers in (("lengths", self.lengths), ("factors", self.factors)):
            check_kind(field, numbers, Mapping)
            for key, number in numbers.items():
                check_number(entry_place(field, str(key)), number, SMALLEST, LARGEST)

    def for_source(self, source: Skeleton) -> Target:
        """Return the source's skeleton with these lengths as a target; errors as in `apply`."""
        return Target(self.apply(source), {}, "")

    def apply(self, source: Skeleton) -> Skeleton:
        """Return the source's skeleton with these bone lengths and its own rest directions.

        Raises:
            SkeletonFileError: a key is not a joint of the source, has a bone of length 0, or is in both `lengths` and
                `factors`; or all bones have length 0, or one becomes too long.
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
        """The joint with this key, which must have a bone to change."""
        place = entry_place(field, key)
        if key not in source.keys:
            raise SkeletonFileError(self.path, place, f"no such joint; {closest(key, source.keys)}")
        joint = source.index(key)
        if not joint:
            raise SkeletonFileError(self.path, place, "the root has no bone; expected a joint with a parent")
        if source.lengths[joint] == 0:
            raise SkeletonFileError(self.path, place, "the bone has length 0 in the source, so it has no direction")
        return joint


def with_bones(skeleton: Skeleton, path: str | Path, place: str = "") -> Skeleton:
    """Return the skeleton; raise a SkeletonFileError if no bone has a length."""
    if not skeleton.lengths.max() >= SMALLEST:
        fault = f"all bones have length 0, or are shorter than {SMALLEST:g}"
        raise SkeletonFileError(path, place, f"{fault}; expected at least one longer bone")
    return skeleton
