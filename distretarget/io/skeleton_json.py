"""Skeleton files in JSON: a whole skeleton (full form), or bone lengths to change on the source's own (short form)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from distretarget.errors import SkeletonError, closest, quoted
from distretarget.io.json_node import Node, described, field_place, parse_json
from distretarget.skeleton import AXES, POSITION_CHANNELS, ROTATION_CHANNELS, UNITS, JointMap, Skeleton
from distretarget.target import SkeletonEdit, Target, with_bones


def joints_meant(reference: str, names: Sequence[str], parents: Sequence[int]) -> list[int]:
    """The joints among the first `len(parents)` that a reference `name`, `parent/name` and so on may mean.

    If it names the whole path from the root to a joint, it means that joint. So each of `Skeleton.keys` means its own
    joint, as long as no name contains "/".
    """
    tops = {joint: _top(reference, joint, names, parents) for joint in range(len(parents))}
    whole = [joint for joint, top in tops.items() if top == 0]
    return whole if len(whole) == 1 else [joint for joint, top in tops.items() if top >= 0]


def _top(reference: str, joint: int, names: Sequence[str], parents: Sequence[int]) -> int:
    """The joint or ancestor at which a reference begins that ends at the joint; -1 if the reference does not fit."""
    end = len(reference)
    while joint >= 0 and reference.endswith(names[joint], 0, end):
        end -= len(names[joint]) + 1
        if end < 0:
            return joint
        joint = parents[joint] if reference[end] == "/" else -1
    return -1


FORMAT = "distretarget-skeleton"
VERSION = 1
ALL_CHANNELS = POSITION_CHANNELS + ROTATION_CHANNELS
JOINT_CHANNELS = ("Zrotation", "Xrotation", "Yrotation")  # of a joint for which the file states none
ROOT_CHANNELS = POSITION_CHANNELS + JOINT_CHANNELS  # of a root for which the file states none

HEADER_KEYS = ("format", "version", "name")
FULL_KEYS = ("joints", "units", "up", "map")
SHORT_KEYS = ("scale", "lengths", "factors")


def parse_skeleton_json(text: str, path: str | Path) -> Target | SkeletonEdit:
    """Return the target in the text of a skeleton file; `path` is for errors.

    Raises:
        SkeletonFileError: the text is not JSON, or breaks the format.
    """
    document = Node(path, "", parse_json(path, text))
    _check_header(document)
    fields = document.fields(HEADER_KEYS[:2], (*HEADER_KEYS[2:], *FULL_KEYS, *SHORT_KEYS))
    full = [key for key in FULL_KEYS if key in fields]
    short = [key for key in SHORT_KEYS if key in fields]
    if full and short:
        both_forms = f"{quoted(FULL_KEYS)} or {quoted(SHORT_KEYS)}"
        fields[short[0]].fail(f'cannot be combined with "{full[0]}"; expected {both_forms}')
    return _full(document, fields) if full else _edit(document, fields)


def _check_header(document: Node) -> None:
    """Check that the file states this format and version, and that the name is a string."""
    fields = document.entries(field_place)
    for key, known in (("format", FORMAT), ("version", VERSION)):
        if key not in fields:
            document.fail(f'has no "{key}"; expected "{key}": {json.dumps(known)}')
        if isinstance(fields[key].value, bool) or fields[key].value != known:
            fields[key].expected(json.dumps(known))
    if "name" in fields:
        fields["name"].text()


def _edit(document: Node, fields: Mapping[str, Node]) -> SkeletonEdit:
    """The target of a file in the short form."""
    scale = fields["scale"].positive() if "scale" in fields else 1.0
    return SkeletonEdit(scale, _positives(fields, "lengths"), _positives(fields, "factors"), document.path)


def _positives(fields: Mapping[str, Node], key: str) -> dict[str, float]:
    """The numbers above 0 in an optional object."""
    return {name: node.positive() for name, node in fields[key].entries().items()} if key in fields else {}


def _full(document: Node, fields: Mapping[str, Node]) -> Target:
    """The target of a file in the full form."""
    if "joints" not in fields:
        document.fail('has no "joints"')
    joints = [node.fields(("name", "parent", "offset"), ("channels", "end")) for node in fields["joints"].items()]
    if not joints:
        fields["joints"].expected("at least a root and one more joint")
    units = fields["units"].one_of(UNITS) if "units" in fields else None
    up = fields["up"].one_of(AXES) if "up" in fields else None
    try:
        skeleton = _skeleton(joints, units, up)
    except SkeletonError as error:
        fields["joints"].fail(str(error))
    name = fields["name"].text() if "name" in fields else ""
    return Target(with_bones(skeleton, document.path, "joints"), _map(fields, skeleton), name)


def _skeleton(joints: Sequence[Mapping[str, Node]], units: str | None, up: str | None) -> Skeleton:
    names = tuple(joint["name"].name() for joint in joints)
    ends = ["end" in joint and joint["end"].flag() for joint in joints]
    if ends[0]:
        joints[0]["end"].fail("the root cannot be an End Site")
    parents = _parents([joint["parent"] for joint in joints], names, ends)
    offsets = [_offset(joint["offset"]) for joint in joints]
    channels = tuple(map(_channels, joints, ends))
    return Skeleton(
        names=names,
        parents=np.array(parents),
        offsets=np.array(offsets),
        channels=channels,
        end_sites=np.array(ends),
        units=units,
        up=up,
    )


def _offset(node: Node) -> list[float]:
    numbers = node.items()
    if len(numbers) != 3:
        node.expected("a list of three numbers")
    return [number.number() for number in numbers]


def _channels(joint: Mapping[str, Node], end: bool) -> tuple[str, ...]:
    """The channels of a joint: those that the file states, else the usual ones."""
    if "channels" not in joint:
        usual = JOINT_CHANNELS if joint["parent"].value is not None else ROOT_CHANNELS
        return () if end else usual
    channels: list[str] = []
    for node in joint["channels"].items():
        if end:
            joint["channels"].fail("an End Site has no channels")
        if node.text() not in ALL_CHANNELS:
            node.fail(f"unknown channel {described(node.value)}; {closest(node.text(), ALL_CHANNELS)}")
        if node.text() in channels:
            node.fail(f"expected each channel once, found {described(node.value)} again")
        channels.append(node.text())
    return tuple(channels)


def _parents(nodes: Sequence[Node], names: Sequence[str], ends: Sequence[bool]) -> list[int]:
    """(joints,), the number of each joint's parent, -1 for the root."""
    roots = [node for node in nodes if node.value is None]
    if not roots:
        nodes[0].expected("null, since the first joint is the root")
    if nodes[0].value is not None:
        roots[0].fail("the root must be the first joint")
    if len(roots) > 1:
        roots[1].expected(f"the name of a joint, since {names[0]!r} is the root")
    parents = [-1]
    for node in nodes[1:]:
        parents.append(_parent(node, names, parents))
        if ends[parents[-1]]:
            node.fail(f"{node.text()!r} is an End Site, which has no children")
    return parents


def _parent(node: Node, names: Sequence[str], parents: Sequence[int]) -> int:
    """The number of the joint that a node names; it must be one of the first `len(parents)` joints."""
    meant = joints_meant(node.text(), names, parents)
    if not meant and node.text() in names:
        node.fail(f"expected the name of an earlier joint, found {node.text()!r}, which is not one")
    if not meant:
        node.fail(f"no joint {node.text()!r}; {closest(node.text(), names)}")
    if len(meant) > 1:
        paths = quoted(f"{names[parents[joint]]}/{names[joint]}" for joint in meant)
        node.fail(f"{node.text()!r} may be {paths}; write the parents too, as in these")
    return meant[0]


def _map(fields: Mapping[str, Node], skeleton: Skeleton) -> JointMap:
    """The map in the file, whose keys must be joints of the skeleton."""
    sources = fields["map"].entries() if "map" in fields else {}
    for key, node in sources.items():
        if key not in skeleton.keys:
            node.fail(f"the target has no such joint; {closest(key, skeleton.keys)}")
    return {key: node.text_or_null() for key, node in sources.items()}


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
