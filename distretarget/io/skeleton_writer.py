"""Writing skeleton files, and the maps in them."""

from __future__ import annotations

import json

from distretarget.errors import SkeletonError
from distretarget.io.joint_reference import joints_meant
from distretarget.io.skeleton_json import FORMAT, VERSION
from distretarget.matching.pairing import JointMap
from distretarget.skeleton import Skeleton


def skeleton_to_json(skeleton: Skeleton, name: str, joint_map: JointMap | None = None) -> str:
    """Return the text of a skeleton file (full form) with the skeleton and, if it has entries, the map.

    Each joint and each pair of the map has a line of its own.

    Raises:
        SkeletonError: because of a "/" in joint names it is not clear which joint is a parent.
    """
    head = {"format": FORMAT, "version": VERSION, "name": name, "units": skeleton.units, "up": skeleton.up}
    lines = [f"  {_dump(key)}: {_dump(value)},\n" for key, value in head.items() if value is not None]
    joints = ",\n".join(f"    {_dump(_joint(skeleton, joint))}" for joint in range(len(skeleton)))
    pairs = f',\n  "map": {pairs_to_json(joint_map, "  ")}' if joint_map else ""
    return "{\n" + "".join(lines) + f'  "joints": [\n{joints}\n  ]{pairs}\n}}\n'


def pairs_to_json(joint_map: JointMap, indent: str = "") -> str:
    """Return the JSON object of a map, one pair per line; the lines after the first begin with `indent`."""
    pairs = ",\n".join(f"{indent}  {_dump(key)}: {_dump(driver)}" for key, driver in joint_map.items())
    return f"{{\n{pairs}\n{indent}}}"


def _joint(skeleton: Skeleton, joint: int) -> dict[str, object]:
    """The entry of a joint in the full form."""
    parent = int(skeleton.parents[joint])
    entry: dict[str, object] = {"name": skeleton.names[joint], "parent": None}
    if joint:
        entry["parent"] = key = skeleton.keys[parent]
        if joints_meant(key, skeleton.names, skeleton.parents[:joint].tolist()) != [parent]:
            raise SkeletonError(f"{key!r} may mean several joints because of the '/' in names; rename one")
    entry["offset"] = skeleton.offsets[joint].tolist()
    last = {"end": True} if skeleton.end_sites[joint] else {"channels": skeleton.channels[joint]}
    return entry | last


def _dump(value: object) -> str:
    """The JSON of a value on one line; only characters that UTF-8 cannot encode are escaped."""
    return json.dumps(value, ensure_ascii=False).encode("utf-8", "backslashreplace").decode()
