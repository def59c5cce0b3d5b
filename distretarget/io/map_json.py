"""Map files: JSON that says which source joint drives which target joint."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from distretarget.errors import MapError, SkeletonFileError, entry_place
from distretarget.io.files import read_text
from distretarget.io.json_node import parse_json
from distretarget.io.target_file import pairs_to_json
from distretarget.matching.matching import Matching
from distretarget.matching.pairing import pairs_of_map
from distretarget.skeleton import JointMap, Skeleton
from distretarget.target import Target


@dataclass(frozen=True)
class MapFile:
    """The pairs of a map file, {target key: source key or None}, and the path of the file, for errors."""

    pairs: JointMap
    path: str | Path


def load_map(path: str | Path | None) -> MapFile:
    """Return the map in a file, or an empty map if `path` is None.

    Raises:
        FileError: the file cannot be read.
        SkeletonFileError: the file is not an object {"target joint": "source joint" or null}.
    """
    return parse_map(read_text(path), path) if path else MapFile({}, "")


def parse_map(text: str, path: str | Path) -> MapFile:
    """Return the map in the text of a file as `load_map` does; `path` is for errors."""
    return MapFile({key: node.text_or_null() for key, node in parse_json(path, text).entries().items()}, path)


def map_to_json(matching: Matching) -> str:
    """Return the text of a map file that gives this matching again.

    It has a pair for each joint of the target, depth first, except for joints without a driver that blend the rotations
    of a spine or neck, and for End Sites that were matched automatically.
    """
    source, target, drivers = matching.source.skeleton, matching.target.skeleton, matching.drivers
    bending = (drivers < 0) & (matching.rotation_sources[:, 0] >= 0)
    ends = target.end_sites & (np.array(matching.method) != "map")
    pairs = {
        target.keys[joint]: source.keys[drivers[joint]] if drivers[joint] >= 0 else None
        for joint in target.depth_first
        if not (bending[joint] or ends[joint])
    }
    return f"{pairs_to_json(pairs)}\n"


def joint_map(source: Skeleton, target: Target, path: str | Path, map_file: MapFile) -> JointMap:
    """Return the map in the target's file, `path`, with the pairs of a map file in place of its own.

    Raises:
        SkeletonFileError: one of the two files names joints that do not exist.
    """
    pairs = {**target.map, **map_file.pairs}
    try:
        pairs_of_map(source, target.skeleton, pairs)
    except MapError as error:
        file, place = (map_file.path, "") if error.key in map_file.pairs else (path, "map")
        raise SkeletonFileError(file, entry_place(place, error.key), error.fault) from error
    return pairs
