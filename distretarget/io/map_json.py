"""Map files: JSON that says which source joint drives which target joint, and optionally a rest pose of the source."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from distretarget.body.body import Body
from distretarget.errors import FileError, MapError, MotionError, SkeletonFileError, entry_place, name_difference
from distretarget.io.files import read_text
from distretarget.io.input_file import InputFile, load_file
from distretarget.io.json_node import Node, on_lines, parse_json
from distretarget.io.reading import parse_motion
from distretarget.matching.matching import Matching
from distretarget.matching.pairing import pairs_of_map
from distretarget.motion import Motion
from distretarget.numerics.vectors import normalised
from distretarget.skeleton import JointMap, Skeleton
from distretarget.target import Target

HEADER: dict[str, object] = {"format": "distretarget-map", "version": 1}
DECIMALS = 9  # of the numbers of a quaternion
QUATERNION = 4  # numbers of a quaternion, x y z w


@dataclass(frozen=True)
class RestPose:
    """A standing pose of the source's body, to be aligned with the target's rest pose."""

    rotations: Mapping[str, Sequence[float]]  # local rotations by joint key, x y z w
    path: str | Path  # of its file, for errors

    def on(self, skeleton: Skeleton) -> Motion:
        """Return the pose on a skeleton, one frame; a FileError if it has other joints or the body does not stand."""
        keys = {skeleton.keys[joint] for joint in skeleton.joints}
        if keys != self.rotations.keys():
            raise FileError(
                self.path, f"the rest pose has other joints than SOURCE: {name_difference(self.rotations, keys)}"
            )
        rotations = np.tile(skeleton.rest_rotations, (1, 1, 1))
        for key, rotation in self.rotations.items():
            rotations[0, skeleton.index(key)] = normalised(np.array(rotation))
        motion = Motion(skeleton, np.zeros((1, 3)), rotations, "1")
        try:
            Body.of_motion(motion).standing_as(motion)
        except MotionError as error:
            raise FileError(self.path, error.reason) from None
        return motion


@dataclass(frozen=True)
class MapFile:
    """The pairs of a map file, {target key: source key or None}, its path for errors, and its rest pose."""

    pairs: JointMap
    path: str | Path
    rest: RestPose | None = None


def load_map(path: str | Path | None, rest: str | Path | None = None) -> MapFile:
    """Return the map in a file, or an empty map if `path` is None. The first frame of `rest`, a file of the source's
    rig, replaces the rest pose of the map.

    Raises:
        FileError: a file cannot be read, or `rest` has no frames, or the body does not stand in the first.
        SkeletonFileError, BvhError: the map is neither {"target joint": "source joint" or null} nor of the full form;
            `rest` is not valid.
    """
    map_file = parse_map(read_text(path), path) if path else MapFile({}, "")
    return replace(map_file, rest=rest_pose_in(load_file(rest))) if rest else map_file


def rest_pose_in(file: InputFile) -> RestPose:
    """Return the pose of a file's first frame; a FileError if it has no frames, or the body does not stand in it."""
    motion, _ = parse_motion(file)
    if not len(motion):
        raise FileError(file.path, "has no frames, expected one in which the body stands")
    skeleton = motion.skeleton
    rotations = {skeleton.keys[joint]: motion.rotations[0, joint].round(DECIMALS).tolist() for joint in skeleton.joints}
    rest = RestPose(rotations, file.path)
    rest.on(skeleton)
    return rest


def parse_map(text: str, path: str | Path) -> MapFile:
    """Return the map in the text of a file as `load_map` does; `path` is for errors."""
    root = parse_json(path, text)
    entries, rest = root.entries(entry_place), None
    if "format" in entries and entries["format"].value == HEADER["format"]:
        root.check_header(**HEADER)
        fields = root.fields((*HEADER, "map"), ("rest",))
        entries, rest = fields["map"].entries(entry_place), fields.read("rest", _rest, None)
    return MapFile({key: node.text_or_null() for key, node in entries.items()}, path, rest)


def _rest(node: Node) -> RestPose:
    rotations: dict[str, Sequence[float]] = {}
    for key, each in node.entries(entry_place).items():
        rotations[key] = [number.number() for number in each.items()]
        if len(rotations[key]) != QUATERNION or not any(rotations[key]):
            each.expected("a rotation of four numbers, x y z w")
    return RestPose(rotations, node.path)


def map_to_json(matching: Matching, rest: RestPose | None = None) -> str:
    """Return the text of a map file that reproduces a matching, without blended spines and matched End Sites."""
    source, target, drivers = matching.source.skeleton, matching.target.skeleton, matching.drivers
    blending = (drivers < 0) & (matching.rotation_sources[:, 0] >= 0)
    ends = target.end_sites & (np.array(matching.method) != "map")
    pairs = {
        target.keys[joint]: source.keys[drivers[joint]] if drivers[joint] >= 0 else None
        for joint in target.depth_first
        if not (blending[joint] or ends[joint])
    }
    if rest is None:
        return f"{on_lines(pairs, 1)}\n"
    return f"{on_lines(HEADER | {'map': pairs, 'rest': dict(rest.rotations)}, 2)}\n"


def joint_map(source: Skeleton, target: Target, path: str | Path, map_file: MapFile) -> JointMap:
    """Return the map in the target's file, at `path`, overridden by a map file's pairs, or a SkeletonFileError."""
    pairs = {**target.map, **map_file.pairs}
    try:
        pairs_of_map(source, target.skeleton, pairs)
    except MapError as error:
        file, place = (map_file.path, "") if error.key in map_file.pairs else (path, "map")
        raise SkeletonFileError(file, entry_place(place, error.key), error.fault) from error
    return pairs
