"""Map files: which source joint drives which target joint, as JSON to read, write and edit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from distretarget.errors import MapError, SkeletonFileError
from distretarget.io.files import read_text
from distretarget.io.json_node import Node, entry_place, parse_json
from distretarget.io.skeleton_json import Target, pairs_to_json
from distretarget.matching.matching import Matching
from distretarget.matching.pairing import JointMap, pairs_of_map
from distretarget.skeleton import Skeleton


@dataclass(frozen=True)
class MapFile:
    """The pairs of a map file, {target key: source key or None}, and its path, for errors."""

    pairs: JointMap
    path: str | Path


def load_map(path: str | Path | None) -> MapFile:
    """The map in a file; no pairs without a file.

    Raises:
        FileError: the file cannot be read.
        SkeletonFileError: it is no object {"target joint": "source joint" or null}.
    """
    return parse_map(read_text(path), path) if path else MapFile({}, "")


def parse_map(text: str, path: str | Path) -> MapFile:
    """The map in the text of a file, whose path is for errors; as `load_map`."""
    entries = Node(path, "", parse_json(path, text)).entries()
    return MapFile({key: node.text_or_null() for key, node in entries.items()}, path)


def map_to_json(matching: Matching) -> str:
    """The text of a map file that gives this matching again: a pair for each joint of the target, in the order of its
    tree. Left out are joints without a driver that bend with a spine or neck, and End Sites that no map drives.
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


def joint_map(source: Skeleton, goal: Target, path: str | Path, own: MapFile) -> JointMap:
    """The map in the target's file, `path`, with the pairs of a map file before its own.

    Raises:
        SkeletonFileError: one of the two files names joints that are not there.
    """
    pairs = {**goal.map, **own.pairs}
    try:
        pairs_of_map(source, goal.skeleton, pairs)
    except MapError as error:
        file, place = (own.path, "") if error.key in own.pairs else (path, "map")
        raise SkeletonFileError(file, entry_place(place, error.key), error.fault) from error
    return pairs
