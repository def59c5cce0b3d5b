"""Map files: which source joint drives which target joint, as JSON to read, write and edit."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from distretarget.errors import MapError, SkeletonFileError
from distretarget.files import read_text
from distretarget.json_node import Node, entry_place, parse_json
from distretarget.matching import Matching
from distretarget.pairs import JointMap, given
from distretarget.skeleton import Skeleton
from distretarget.skeleton_json import Target, pairs_to_json


def load_map(path: str | Path) -> JointMap:
    """The map in a file, {"target joint": "source joint" or null}.

    Raises:
        FileError: the file cannot be read.
        SkeletonFileError: it is no such object.
    """
    entries = Node(path, "", parse_json(path, read_text(path))).entries()
    return {key: node.text_or_null() for key, node in entries.items()}


def map_to_json(matching: Matching) -> str:
    """The text of a map file that gives this matching again: a pair for each joint of the target, in the order of its
    tree. Left out are joints without a driver that bend with a spine or neck, and End Sites that no map drives.
    """
    target, drivers = matching.target, matching.drivers
    bending = (drivers < 0) & (matching.turns[:, 0] >= 0)
    ends = target.end_sites & (np.array(matching.found) != "map")
    pairs = {
        target.keys[joint]: matching.source.keys[drivers[joint]] if drivers[joint] >= 0 else None
        for joint in target.depth_first
        if not (bending[joint] or ends[joint])
    }
    return f"{pairs_to_json(pairs)}\n"


def joint_map(source: Skeleton, goal: Target, path: str | Path, map_path: str | Path | None) -> JointMap:
    """The map in the target's file, `path`, with the pairs of a map file before its own.

    Raises:
        FileError, SkeletonFileError: as in `load_map`; or one of the two files names joints that are not there.
    """
    own = load_map(map_path) if map_path else {}
    pairs = {**goal.map, **own}
    try:
        given(source, goal.skeleton, pairs)
    except MapError as error:
        file, place = (map_path, "") if map_path and error.key in own else (path, "map")
        raise SkeletonFileError(file, entry_place(place, error.key), error.reason) from error
    return pairs
