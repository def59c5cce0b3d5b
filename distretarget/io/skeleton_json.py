"""Skeleton files: JSON with a skeleton (full form), or with bone lengths to change the source's (short form)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from distretarget.errors import SkeletonError, closest, entry_place, quoted
from distretarget.io.json_node import Fields, Node, on_lines
from distretarget.skeleton import AXES, DEFAULT_ROOT, DEFAULT_ROTATIONS, UNITS, JointMap, Skeleton
from distretarget.target import LoadedTarget, SkeletonEdit, Target, with_bones

HEADER: dict[str, object] = {"format": "distretarget-skeleton", "version": 1}
FULL_KEYS = ("joints", "units", "up", "map")
SHORT_KEYS = ("scale", "lengths", "factors")


def skeleton_target(document: Node) -> LoadedTarget:
    """Return the target in the JSON of a skeleton file, or raise a SkeletonFileError."""
    document.check_header(**HEADER)
    fields = document.fields(tuple(HEADER), ("name", *FULL_KEYS, *SHORT_KEYS))
    name = fields.read("name", Node.text, "")
    full, short = ([key for key in keys if key in fields] for keys in (FULL_KEYS, SHORT_KEYS))
    if full and short:
        both_forms = f"{quoted(FULL_KEYS)} or {quoted(SHORT_KEYS)}"
        fields[short[0]].fail(f'cannot be combined with "{full[0]}"; expected {both_forms}')
    if full:
        return _full_form(document, fields, name)
    return SkeletonEdit(
        scale=fields.read("scale", Node.positive, 1.0),
        lengths=fields.read("lengths", _positives, {}),
        factors=fields.read("factors", _positives, {}),
        path=document.path,
    )


def _positives(node: Node) -> Mapping[str, float]:
    return {name: number.positive() for name, number in node.entries(entry_place).items()}


def _full_form(document: Node, fields: Fields, name: str) -> Target:
    if "joints" not in fields:
        document.fail('has no "joints"')
    joints = [
        node.fields(("name", "parent", "offset"), ("channels", "end", "radius")) for node in fields["joints"].items()
    ]
    if not joints:
        fields["joints"].expected("at least a root and one more joint")
    units = fields.read("units", lambda node: node.one_of(UNITS), None)
    up = fields.read("up", lambda node: node.one_of(AXES), None)
    try:
        skeleton = _skeleton(joints, units, up)
    except SkeletonError as error:
        fields["joints"].fail(str(error))
    pairs = fields["map"].entries(entry_place) if "map" in fields else {}
    for key, node in pairs.items():
        if key not in skeleton.keys:
            node.fail(f"the target has no such joint; {closest(key, skeleton.keys)}")
    joint_map = {key: node.text_or_null() for key, node in pairs.items()}
    radii = {number: fields["radius"].positive() for number, fields in enumerate(joints) if "radius" in fields}
    return Target(with_bones(skeleton, document.path, "joints"), joint_map, name, radii=radii)


def _skeleton(joints: Sequence[Fields], units: str | None, up: str | None) -> Skeleton:
    names = tuple(joint["name"].name() for joint in joints)
    ends = [joint.read("end", Node.flag, False) for joint in joints]
    for joint, end in zip(joints, ends, strict=True):
        if end and "radius" in joint:
            joint["radius"].fail("an End Site moves no part of the body; give the radius of its parent")
    return Skeleton(
        names=names,
        parents=np.array(_parents([joint["parent"] for joint in joints], names)),
        offsets=np.array([joint["offset"].numbers(3) for joint in joints]),
        channels=tuple(map(_channels, joints, ends)),
        end_sites=np.array(ends),
        units=units,
        up=up,
    )


def _channels(joint: Mapping[str, Node], end: bool) -> tuple[str, ...]:
    """The channels of a joint: those in the file, else the usual ones."""
    if "channels" in joint:
        return tuple(node.text() for node in joint["channels"].items())
    return () if end else DEFAULT_ROTATIONS if joint["parent"].value is not None else DEFAULT_ROOT


def _parents(nodes: Sequence[Node], names: Sequence[str]) -> list[int]:
    """The index of each joint's parent, (joints,), -1 for the root."""
    roots = [node for node in nodes if node.value is None]
    if not roots:
        nodes[0].expected("null, since the first joint is the root")
    if nodes[0].value is not None:
        roots[0].fail("the root must be the first joint")
    if len(roots) > 1:
        roots[1].expected(f"the name of a joint, since {names[0]!r} is the root")
    parents, known = [-1], {names[0]: [0]}
    for node in nodes[1:]:
        parents.append(_parent(node, names, parents, known))
        known.setdefault(names[len(parents) - 1], []).append(len(parents) - 1)
    return parents


def _parent(node: Node, names: Sequence[str], parents: Sequence[int], known: Mapping[str, Sequence[int]]) -> int:
    """The joint that a node refers to, among the earlier ones, `known` by name."""
    matches = matching_joints(node.text(), names, parents, known)
    if not matches and node.text() in names:
        node.fail(f"expected the name of an earlier joint, found {node.text()!r}, which is not one")
    if not matches:
        node.fail(f"no joint {node.text()!r}; {closest(node.text(), names)}")
    if len(matches) > 1:
        paths = quoted(f"{names[parents[joint]]}/{names[joint]}" for joint in matches)
        node.fail(f"{node.text()!r} may be {paths}; write the parents too, as in these")
    return matches[0]


def matching_joints(
    reference: str, names: Sequence[str], parents: Sequence[int], known: Mapping[str, Sequence[int]]
) -> list[int]:
    """Return the joints, among those `known`, that `name`, `parent/name` and so on matches; a full path its own."""
    ends = (reference[start:] for start in (0, *(slash.end() for slash in re.finditer("/", reference))))
    joints = sorted(joint for name in ends for joint in known.get(name, ()))
    tops = {joint: _top(reference, joint, names, parents) for joint in joints}
    whole = [joint for joint, top in tops.items() if top == 0]
    return whole if len(whole) == 1 else [joint for joint, top in tops.items() if top >= 0]


def _top(reference: str, joint: int, names: Sequence[str], parents: Sequence[int]) -> int:
    """The joint at which a reference's path to a joint begins; -1 if the reference does not match the joint."""
    path = names[joint]
    while path != reference and parents[joint] >= 0 and reference.endswith(f"/{path}"):
        joint = parents[joint]
        path = f"{names[joint]}/{path}"
    return joint if path == reference else -1


def skeleton_to_json(
    skeleton: Skeleton, name: str, joint_map: JointMap | None = None, radii: Mapping[int, float] | None = None
) -> str:
    """Return the text of a skeleton file (full form); a SkeletonError if "/" in names makes a parent ambiguous."""
    head = HEADER | {"name": name, "units": skeleton.units, "up": skeleton.up}
    parents = _references(skeleton)
    joints = [_joint(skeleton, joint, parents[joint], (radii or {}).get(joint)) for joint in range(len(skeleton))]
    document = {key: value for key, value in head.items() if value is not None} | {"joints": joints}
    return f"{on_lines(document | ({'map': dict(joint_map)} if joint_map else {}), 2)}\n"


def _references(skeleton: Skeleton) -> list[str | None]:
    """The key of each joint's parent, as the file refers to it; None for the root."""
    references: list[str | None] = []
    known: dict[str, list[int]] = {}
    parents = skeleton.parents.tolist()
    for joint, parent in enumerate(parents):
        key = skeleton.keys[parent] if joint else None
        if key is not None and matching_joints(key, skeleton.names, parents, known) != [parent]:
            raise SkeletonError(f"{key!r} may mean several joints because of the '/' in names; rename one")
        references.append(key)
        known.setdefault(skeleton.names[joint], []).append(joint)
    return references


def _joint(skeleton: Skeleton, joint: int, parent: str | None, radius: float | None) -> dict[str, object]:
    entry = {"name": skeleton.names[joint], "parent": parent, "offset": skeleton.offsets[joint].tolist()}
    entry |= {"end": True} if skeleton.end_sites[joint] else {"channels": skeleton.channels[joint]}
    return entry if radius is None else entry | {"radius": float(f"{radius:.6g}")}
