"""Target skeleton files: a whole skeleton as JSON or BVH, or other lengths on the source's own skeleton."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from distretarget.body.axes import AXES
from distretarget.errors import BvhError, SkeletonError, SkeletonFileError, closest, quoted
from distretarget.io.bvh import parse_bvh, parse_bvh_skeleton
from distretarget.io.files import read_text
from distretarget.io.json_node import Node, entry_place, field_place, found, parse_json
from distretarget.matching.pairing import JointMap
from distretarget.motion import Motion
from distretarget.skeleton import POSITION_CHANNELS, ROTATION_CHANNELS, Skeleton

FORMAT = "distretarget-skeleton"
VERSION = 1
UNITS = ("mm", "cm", "m", "dm", "in", "ft")
CHANNELS = POSITION_CHANNELS + ROTATION_CHANNELS
JOINT_CHANNELS = ("Zrotation", "Xrotation", "Yrotation")
ROOT_CHANNELS = POSITION_CHANNELS + JOINT_CHANNELS

PARSED = 4  # targets that are kept, for the next clip
HEAD = ("format", "version", "name")
FULL = ("joints", "units", "up", "map")
SHORT = ("scale", "lengths", "factors")


@dataclass(frozen=True, eq=False)
class Target:
    """The skeleton to retarget to.

    Attributes:
        skeleton: the target's.
        map: source joint for target joint, by key, where the file has an explicit map; else empty.
        name: what the file calls the skeleton; empty where it says nothing.
        motion: of a BVH file that has a whole one; it may tell more of the rig than its rest pose.
    """

    skeleton: Skeleton
    map: JointMap
    name: str
    motion: Motion | None = None

    def for_source(self, source: Skeleton) -> Target:  # noqa: ARG002
        """Itself: a whole skeleton is the same for every source."""
        return self


@dataclass(frozen=True)
class SkeletonEdit:
    """Other bone lengths for a skeleton that is not in the file; a bone is named by its lower joint.

    Attributes:
        scale: of all bones.
        lengths: per joint key, the final length of its bone, whatever the scale [file units].
        factors: per joint key, what its bone's length is multiplied by, besides the scale.
        path: of the file, for errors.
    """

    scale: float
    lengths: Mapping[str, float]
    factors: Mapping[str, float]
    path: str | Path

    def for_source(self, source: Skeleton) -> Target:
        """The target for a source: the source's skeleton with these lengths; errors as in `apply`."""
        return Target(self.apply(source), {}, "")

    def apply(self, source: Skeleton) -> Skeleton:
        """The source's skeleton with these lengths and its own rest directions.

        Raises:
            SkeletonFileError: a joint that the source does not have, whose bone has no length to change,
                or which is in both `lengths` and `factors`; or no bone has a length in the end.
        """
        lengths = self.scale * source.lengths
        for key, factor in self.factors.items():
            lengths[self._bone("factors", key, source)] *= factor
        for key, length in self.lengths.items():
            lengths[self._bone("lengths", key, source)] = length
        if both := [entry_place("lengths", key) for key in self.lengths if key in self.factors]:
            raise SkeletonFileError(self.path, both[0], "is in factors too; give one of them")
        offsets = source.with_lengths(lengths).offsets.copy()
        offsets[0] *= self.scale
        return _with_bones(source.with_offsets(offsets), self.path)

    def _bone(self, field: str, key: str, source: Skeleton) -> int:
        """The number of the joint with this key, which must have a bone to change."""
        place = entry_place(field, key)
        if key not in source.keys:
            raise SkeletonFileError(self.path, place, f"no such joint; {closest(key, source.keys)}")
        joint = source.index(key)
        if not joint:
            raise SkeletonFileError(self.path, place, "the root has no bone; expected a joint with a parent")
        if source.lengths[joint] == 0:
            raise SkeletonFileError(self.path, place, "the bone has length 0 in the source, so no direction")
        return joint


def load_target(path: str | Path) -> Target | SkeletonEdit:
    """The target in a skeleton file (full or short form) or a BVH file, told apart by their content.

    `retarget` takes it as it is. Its `for_source` gives the skeleton for a certain source.

    Raises:
        FileError: the file cannot be read.
        SkeletonFileError: JSON that breaks the format.
        BvhError: anything else that is no BVH.
    """
    return parse_target(read_text(path), path)


def parse_target(text: str, path: str | Path) -> Target | SkeletonEdit:
    """The target in the text of a file, whose path is for errors; as `load_target`."""
    if not is_json(text):
        return _bvh_target(text, path)
    document = Node(path, "", parse_json(path, text))
    _check_head(document)
    fields = document.fields(HEAD[:2], (*HEAD[2:], *FULL, *SHORT))
    full = [key for key in FULL if key in fields]
    short = [key for key in SHORT if key in fields]
    if full and short:
        fields[short[0]].fail(f'cannot stand beside "{full[0]}"; expected {quoted(FULL)} or {quoted(SHORT)}')
    return _full(document, fields) if full else _edit(document, fields)


def load_full_target(path: str | Path) -> Target:
    """The target in a skeleton file of the full form or a BVH file; errors as in `load_target`.

    Raises:
        SkeletonFileError: also for the short form, which is no skeleton without a source.
    """
    target = load_target(path)
    if isinstance(target, SkeletonEdit):
        raise SkeletonFileError(path, "", 'has no "joints"; this short form needs a source to change')
    return target


def is_json(text: str) -> bool:
    """Whether the text of a file is meant as JSON; else it is BVH."""
    return text.lstrip().startswith(("{", "["))


def skeleton_to_json(skeleton: Skeleton, name: str, joint_map: JointMap | None = None) -> str:
    """The text of a skeleton file (full form) with everything in `skeleton` and the map, if it has entries; one joint
    and one pair per line.

    Raises:
        SkeletonError: a "/" in joint names leaves open which joint is a parent.
    """
    head = {"format": FORMAT, "version": VERSION, "name": name, "units": skeleton.units, "up": skeleton.up}
    lines = [f"  {_dump(key)}: {_dump(value)},\n" for key, value in head.items() if value is not None]
    joints = ",\n".join(f"    {_dump(_joint(skeleton, joint))}" for joint in range(len(skeleton)))
    pairs = f',\n  "map": {pairs_to_json(joint_map, "  ")}' if joint_map else ""
    return "{\n" + "".join(lines) + f'  "joints": [\n{joints}\n  ]{pairs}\n}}\n'


def pairs_to_json(joint_map: JointMap, indent: str = "") -> str:
    """The JSON object of a map, one pair per line, the lines below the first indented."""
    pairs = ",\n".join(f"{indent}  {_dump(key)}: {_dump(driver)}" for key, driver in joint_map.items())
    return f"{{\n{pairs}\n{indent}}}"


def _dump(value: object) -> str:
    """The JSON of a value on one line, with escapes only where UTF-8 has no character."""
    return json.dumps(value, ensure_ascii=False).encode("utf-8", "backslashreplace").decode()


def _joint(skeleton: Skeleton, joint: int) -> dict[str, object]:
    """The joint as the full form has it."""
    parent = int(skeleton.parents[joint])
    entry: dict[str, object] = {"name": skeleton.names[joint], "parent": None}
    if joint:
        entry["parent"] = key = skeleton.keys[parent]
        if _meant(key, skeleton.names, skeleton.parents[:joint].tolist()) != [parent]:
            raise SkeletonError(f"{key!r} may mean several joints because of the '/' in names; rename one")
    entry["offset"] = skeleton.offsets[joint].tolist()
    last = {"end": True} if skeleton.end_sites[joint] else {"channels": skeleton.channels[joint]}
    return entry | last


@lru_cache(maxsize=PARSED)
def _bvh_target(text: str, path: str | Path) -> Target:
    """The target in the text of a BVH file, whose MOTION may be missing or broken."""
    try:
        motion = parse_bvh(text, path)
    except BvhError:
        return Target(parse_bvh_skeleton(text, path), {}, "")
    return Target(motion.rigid_skeleton, {}, "", motion if len(motion) else None)


def _check_head(document: Node) -> None:
    """Raise unless the file names this format and version, and the name is a string."""
    fields = document.entries(field_place)
    for key, known in (("format", FORMAT), ("version", VERSION)):
        if key not in fields:
            document.fail(f'has no "{key}"; expected "{key}": {_dump(known)}')
        if isinstance(fields[key].value, bool) or fields[key].value != known:
            fields[key].expected(_dump(known))
    if "name" in fields:
        fields["name"].text()


def _edit(document: Node, fields: Mapping[str, Node]) -> SkeletonEdit:
    """The short form."""
    scale = fields["scale"].positive() if "scale" in fields else 1.0
    return SkeletonEdit(scale, _positives(fields, "lengths"), _positives(fields, "factors"), document.path)


def _positives(fields: Mapping[str, Node], key: str) -> dict[str, float]:
    return {name: node.positive() for name, node in fields[key].entries().items()} if key in fields else {}


def _full(document: Node, fields: Mapping[str, Node]) -> Target:
    """The full form."""
    if "joints" not in fields:
        document.fail('has no "joints"')
    joints = [node.fields(("name", "parent", "offset"), ("channels", "end")) for node in fields["joints"].items()]
    if not joints:
        fields["joints"].expected("at least a root and one bone")
    units = fields["units"].one_of(UNITS) if "units" in fields else None
    up = fields["up"].one_of(AXES) if "up" in fields else None
    try:
        skeleton = _skeleton(joints, units, up)
    except SkeletonError as error:
        fields["joints"].fail(str(error))
    name = fields["name"].text() if "name" in fields else ""
    return Target(_with_bones(skeleton, document.path, "joints"), _map(fields, skeleton), name)


def _skeleton(joints: Sequence[Mapping[str, Node]], units: str | None, up: str | None) -> Skeleton:
    names = tuple(joint["name"].name() for joint in joints)
    ends = ["end" in joint and joint["end"].flag() for joint in joints]
    if ends[0]:
        joints[0]["end"].fail("the root cannot be an End Site")
    parents = _parents([joint["parent"] for joint in joints], names, ends)
    offsets = [_offset(joint["offset"]) for joint in joints]
    channels = tuple(map(_channels, joints, ends))
    return Skeleton(names, np.array(parents), np.array(offsets), channels, np.array(ends), units, up)


def _offset(node: Node) -> list[float]:
    numbers = node.items()
    if len(numbers) != 3:
        node.expected("a list of three numbers")
    return [number.number() for number in numbers]


def _channels(joint: Mapping[str, Node], end: bool) -> tuple[str, ...]:
    """The joint's channels, those given or the usual ones."""
    if "channels" not in joint:
        usual = JOINT_CHANNELS if joint["parent"].value is not None else ROOT_CHANNELS
        return () if end else usual
    channels: list[str] = []
    for node in joint["channels"].items():
        if end:
            joint["channels"].fail("an End Site has no channels")
        if node.text() not in CHANNELS:
            node.fail(f"no channel {found(node.value)}; {closest(node.text(), CHANNELS)}")
        if node.text() in channels:
            node.fail(f"expected each channel once, found {found(node.value)} again")
        channels.append(node.text())
    return tuple(channels)


def _parents(nodes: Sequence[Node], names: Sequence[str], ends: Sequence[bool]) -> list[int]:
    """(joints,), the parent's number of each joint, -1 for the root."""
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
    """The joint that the node names, one of the first `len(parents)`."""
    meant = _meant(node.text(), names, parents)
    if not meant and node.text() in names:
        node.fail(f"expected a joint that stands before this one, found {node.text()!r}, which does not")
    if not meant:
        node.fail(f"no joint {node.text()!r}; {closest(node.text(), names)}")
    if len(meant) > 1:
        paths = quoted(f"{names[parents[joint]]}/{names[joint]}" for joint in meant)
        node.fail(f"{node.text()!r} may be {paths}; name the parents too, as in these")
    return meant[0]


def _meant(reference: str, names: Sequence[str], parents: Sequence[int]) -> list[int]:
    """The joints before the `len(parents)`th which `name`, `parent/name` and so on up may mean.

    One that is named all the way up from the root is meant before others. So each of `Skeleton.keys`
    means its joint, as long as the names themselves are without "/".
    """
    tops = {joint: _top(reference, joint, names, parents) for joint in range(len(parents))}
    whole = [joint for joint, top in tops.items() if top == 0]
    return whole if len(whole) == 1 else [joint for joint, top in tops.items() if top >= 0]


def _top(reference: str, joint: int, names: Sequence[str], parents: Sequence[int]) -> int:
    """The ancestor (or joint itself) at which the reference, read upwards from the joint, begins; else -1."""
    end = len(reference)
    while joint >= 0 and reference.endswith(names[joint], 0, end):
        end -= len(names[joint]) + 1
        if end < 0:
            return joint
        joint = parents[joint] if reference[end] == "/" else -1
    return -1


def _with_bones(skeleton: Skeleton, path: str | Path, place: str = "") -> Skeleton:
    """The skeleton itself, if it has bones that have a length."""
    if not skeleton.lengths.any():
        raise SkeletonFileError(path, place, "all bones have length 0; expected one or more that have not")
    return skeleton


def _map(fields: Mapping[str, Node], skeleton: Skeleton) -> JointMap:
    sources = fields["map"].entries() if "map" in fields else {}
    for key, node in sources.items():
        if key not in skeleton.keys:
            node.fail(f"the target has no such joint; {closest(key, skeleton.keys)}")
    return {key: node.text_or_null() for key, node in sources.items()}
