"""glTF files with faults: characters of all kinds, mutated in structure, bytes and numbers. A seed makes a file."""

from __future__ import annotations

import base64
import copy
import functools
import json
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tests", "tools")]
import characters as made
from bodies import SAMPLES
from gltf_file import glb
from scipy.spatial.transform import Rotation

from distretarget import read_bvh

Draw = np.random.Generator
Document = dict[str, Any]

FRAMES = 5  # of the animations
LARGEST = 4_000_000  # limit of a repeated value [bytes]
ODD_NUMBERS = (
    *(0, -1, 1, 2, 3, 65535, 65536, 10**9, 2**31, 2**32 - 1, 2**53, 2**63, 2**64, 10**30, -(2**31), 10**400),
    *(0.5, -0.5, 1e-3, 1e-30, 1e-160, 1e-320, 1e12, 1.1e12, 1e30, 1e200, 1e308, float("nan"), float("inf"), -0.0),
)
ODD_NAMES = (
    *("", " ", "a\nb", "a\0b", "\u2028", "{", "}", "Hips", "Left Upper Arm", "mixamorig:Hips", "a/b", "/", "..", "#2"),
    *("x" * 5000, "\U0001f9b4", "\ud800", "\udc80", "end", "End Site", "MOTION", "JOINT a", "-", "--clip", "%s", "\\"),
    *("rotation", "LINEAR", "STEP", "CUBICSPLINE", "MAT4", "VEC3", "SCALAR", "data:,", "data:;base64,AAA", "a.bin"),
)
ODD_FLOATS = (0.0, -0.0, 1.0, -1.0, 1e-45, 1e-30, 1e-12, 1e-3, 1e3, 1e6, 1e12, 1e20, 3e38, np.nan, np.inf, -np.inf)


# ---- whole files


@cache
def _bones() -> tuple[made.Bones, made.Performance]:
    motion = read_bvh(SAMPLES / "walk.bvh")[:FRAMES]
    return made.Bones.of(motion.skeleton), made.Performance.of(motion)


def _animated(options: dict[str, Any], **animation: Any) -> made.Character:
    bones, walk = _bones()
    hero = made.character(bones, **options)
    hero.animate("walk", walk, **animation)
    return hero


def _vrm_0() -> made.Character:
    bones, walk = _bones()
    hero = made.character(bones.turned(made.LOOKING_BACK))
    hero.animate("walk", walk.turned(made.LOOKING_BACK))
    return made.as_vrm0(hero)


def _two_skins() -> made.Character:
    bones, _ = _bones()
    count = len(bones.names)
    meshes = [made.box_mesh(bones, range(count // 2)), made.box_mesh(bones, range(count // 2 - 2, count))]
    hero = _animated({"meshes": meshes, "all_joints": False})
    hero.animate("still", _bones()[1][:1])
    return hero


def _rolled() -> Rotation:
    bones, _ = _bones()
    return bones.along_bones(np.linspace(-2, 2, len(bones.names)))


WHOLE: dict[str, Callable[[], made.Character]] = {
    "plain": lambda: _animated({}),
    "armature": lambda: _animated({"axes": _rolled(), "above": made.ARMATURE}),
    "matrices": lambda: _animated({"axes": _rolled(), "above": made.ARMATURE, "matrices": True}),
    "scales": lambda: _animated({"axes": _rolled(), "scales": {0: 2.0, 3: 0.25, 9: 10.0}}, scales=True),
    "helpers": lambda: _animated({"helpers": [0, 4, 12], "under": False, "above": made.ARMATURE}),
    "two skins": _two_skins,
    "steps": lambda: _animated({}, interpolation="STEP", all_translations=True),
    "splines": lambda: _animated({}, interpolation="CUBICSPLINE", all_translations=True, flipped=True),
    "small numbers": lambda: _animated({}, rotations="i2", still=False),
    "bytes": lambda: _animated({}, rotations="i1"),
    "strides": lambda: _animated({}, stride=24),
    "sparse": lambda: _animated({}, sparse=True),
    "without mesh": lambda: _animated({"meshes": None}),
    "VRM 1": lambda: made.as_vrm1(_animated({}), springs=["LeftToe"]),
    "VRM 0": _vrm_0,
    "VRMA": lambda: made.as_vrma(_animated({"meshes": None})),
    "unknown parts": lambda: made.with_unknown_parts(_animated({"axes": _rolled()})),
}
SUFFIXES = {"VRM 1": ".vrm", "VRM 0": ".vrm", "VRMA": ".vrma"}


@cache
def whole(name: str) -> tuple[Document, bytes]:
    """The document and buffer of a whole file, by a key of `WHOLE`."""
    return made.chunks(WHOLE[name]().glb())


def _one(draw: Draw, choices: Sequence[Any]) -> Any:
    return choices[draw.integers(len(choices))]


# ---- places in a document

PARTS = ("nodes", "skins", "animations", "accessors", "bufferViews", "buffers", "extensions", "asset")
Place = tuple[Any, Any]  # what holds a value, and its key or number


def _places(draw: Draw, document: Document) -> Place:
    """A random place in a document, most often one that the reader uses."""
    keys = [key for key in PARTS if key in document] if draw.random() < 0.9 else list(document)
    if not keys or draw.random() < 0.03:
        keys = list(document) or ["asset"]
    holder, key = document, _one(draw, keys)
    while isinstance(value := holder.get(key) if isinstance(holder, dict) else holder[key], dict | list) and value:
        if draw.random() < 0.12:
            break
        holder, key = value, (list(value) if isinstance(value, dict) else range(len(value)))[draw.integers(len(value))]
    return holder, key


def _odd(draw: Draw, document: Document) -> Any:
    """A random value of any type, most often a number."""
    holder, key = _places(draw, document)
    number, name, count = _one(draw, ODD_NUMBERS), _one(draw, ODD_NAMES), _one(draw, (1, 3, 4, 16))
    numbers = [ODD_NUMBERS[n] for n in draw.integers(len(ODD_NUMBERS), size=count)]
    others = (None, True, False, [], {}, [[]], [{}], {"": None})
    near = int(draw.integers(-1, 60))
    return _one(draw, (number, number, number, name, _one(draw, others), numbers, near, copy.deepcopy(holder[key])))


def _replace(draw: Draw, document: Document) -> None:
    holder, key = _places(draw, document)
    holder[key] = _odd(draw, document)


def _remove(draw: Draw, document: Document) -> None:
    holder, key = _places(draw, document)
    del holder[key]


def _double(draw: Draw, document: Document) -> None:
    """An entry twice, or a key with another name."""
    holder, key = _places(draw, document)
    if isinstance(holder, list):
        holder.insert(draw.integers(len(holder) + 1), copy.deepcopy(holder[key]))
    else:
        holder[_one(draw, ODD_NAMES)] = copy.deepcopy(holder[key])


def _swap(draw: Draw, document: Document) -> None:
    (one, first), (other, second) = _places(draw, document), _places(draw, document)
    kept = copy.deepcopy(one[first])
    one[first] = copy.deepcopy(other[second])
    if isinstance(other, dict) or second < len(other):
        other[second] = kept


def _nudge(draw: Draw, document: Document) -> None:
    """A number a little or much off."""
    for _ in range(50):
        holder, key = _places(draw, document)
        value = holder[key]
        if isinstance(value, int | float) and not isinstance(value, bool):
            small = value if abs(value) < 10**300 else 1e300  # an integer may have more digits than a float
            steps = [small + 1, small - 1, -small, small * 1000, small * 1e-9, small * 1e13]
            holder[key] = steps[draw.integers(6)]
            return


def _entries(document: Document, *keys: str) -> list[Document]:
    """The objects of some lists of a document."""
    return [entry for key in keys for entry in document.get(key, ()) if isinstance(entry, dict)]


def _rename(draw: Draw, document: Document) -> None:
    """Odd names of nodes, bones and animations."""
    entries = _entries(document, _one(draw, ("nodes", "animations")))
    for number in draw.integers(len(entries), size=draw.integers(1, 9)) if entries else ():
        entries[number]["name"] = _one(draw, ODD_NAMES)


def _transform(draw: Draw, document: Document) -> None:
    """Odd transforms of a node."""
    if nodes := _entries(document, "nodes"):
        node, size = _one(draw, nodes), _one(draw, ODD_FLOATS)
        key, count = _one(draw, (("translation", 3), ("rotation", 4), ("scale", 3), ("matrix", 16)))
        node[key] = (size * draw.choice([0, 1, -1, 0.3], count)).tolist()


def _retarget(draw: Draw, document: Document) -> None:
    """Change a reference: a child, a joint, an accessor, a view ..."""
    entries = _entries(document, "nodes", "skins")
    lists = [entry[key] for entry in entries for key in ("children", "joints") if isinstance(entry.get(key), list)]
    found: list[Place] = [(each, number) for each in lists for number in range(len(each))]
    for key in ("skin", "mesh", "inverseBindMatrices", "input", "output", "sampler", "bufferView", "buffer", "node"):
        found += [(entry, key) for entry in _objects(document) if key in entry]
    if found:
        holder, key = _one(draw, found)
        holder[key] = int(draw.integers(-1, 40)) if draw.random() < 0.8 else _odd(draw, document)


def _objects(value: Any) -> list[dict[str, Any]]:
    """All objects of a document."""
    waiting, found = [value], []
    for each in waiting:
        if isinstance(each, dict):
            found.append(each)
            waiting.extend(each.values())
        elif isinstance(each, list):
            waiting.extend(each)
    return found


def _line_of_nodes(draw: Draw, document: Document, many: int) -> None:
    """A long chain of nodes below one of the document, whose last may be a joint of the first skin."""
    nodes, name = document["nodes"], _one(draw, ("a", "", "Hips"))
    first = len(nodes)
    nodes += [{"name": name, "translation": [0, 0.1, 0], "children": [first + n + 1]} for n in range(many)]
    nodes.append({})
    nodes[draw.integers(first)]["children"] = [first]
    if draw.random() < 0.5:
        document["skins"][0]["joints"][0] = len(nodes) - 1


def _grow(draw: Draw, document: Document) -> None:
    """Grow something: a long chain of nodes, many entries or keys, deep nesting, long names and animations."""
    many = int(draw.choice([30, 300, 1200, 5000, 30000], p=[0.4, 0.3, 0.2, 0.08, 0.02]))
    kind, (holder, key) = draw.integers(6), _places(draw, document)
    if kind == 0:
        _line_of_nodes(draw, document, many)
    elif kind == 1:
        entries = document[_one(draw, (*PARTS[:6], "meshes"))]
        entries += _times(_one(draw, entries), many)
    elif kind == 2:
        holder[key] = functools.reduce(lambda deep, _: [deep], range(min(many, 900)), 0)
    elif kind == 3 and isinstance(holder, list):
        holder += _times(holder[key], many)
    elif kind == 3:
        holder[key] = "n" * (20 * many)
    elif kind == 4:
        for name in ("channels", "samplers"):
            document["animations"][0][name] *= max(many // 30, 2)
    elif isinstance(holder, dict):
        holder |= {f"key {n}": 0 for n in range(many)}


def _times(value: Any, many: int) -> list[Any]:
    """A value many times, within `LARGEST`."""
    return [copy.deepcopy(value)] * min(many, LARGEST // len(json.dumps(value)))


STRUCTURE = (_replace, _replace, _remove, _remove, _double, _swap, _nudge, _rename, _transform, _retarget, _retarget)


# ---- numbers and bytes


def _numbers(draw: Draw, document: Document, buffer: bytearray) -> None:
    """Odd numbers in accessors of animations and skins."""
    used = [entry["inverseBindMatrices"] for entry in document.get("skins", ()) if "inverseBindMatrices" in entry]
    samplers = [sampler for animation in document["animations"] for sampler in animation["samplers"]]
    used = sorted({*used, *(sampler[key] for sampler in samplers for key in ("input", "output"))})
    accessor = document["accessors"][used[0] if draw.random() < 0.3 else _one(draw, used)]
    view = document["bufferViews"][accessor.get("bufferView", 0)]
    start, length = view.get("byteOffset", 0), view["byteLength"] // 4 * 4
    values = np.frombuffer(buffer, "<f4", length // 4, start).copy()
    kind = draw.integers(6)
    at = draw.integers(len(values), size=draw.integers(1, 5))
    if kind <= 1:
        values[at] = [ODD_FLOATS[n] for n in draw.integers(len(ODD_FLOATS), size=len(at))]
    elif kind == 2:
        values[:] = values[::-1] if draw.random() < 0.5 else _one(draw, ODD_FLOATS)
    elif kind == 3:
        values *= np.float32(_one(draw, ODD_FLOATS))
    elif kind == 4:
        first = at[0] // 4 * 4
        values[first : first + 4] = 0
    else:
        values[at] = values[at[::-1]]
    buffer[start : start + length] = values.tobytes()


def _bytes(draw: Draw, content: bytes) -> bytes:
    """Bits flipped, bytes removed or inserted, or the end cut off; most often in the headers."""
    result = bytearray(content)
    for _ in range(draw.integers(1, 5)):
        near = int(draw.choice([28, 2000, len(result) or 1]))
        at = int(draw.integers(min(near, len(result)) or 1))
        kind = draw.integers(5)
        if kind <= 1 and result:
            result[at] ^= 1 << draw.integers(8)
        elif kind == 2:
            del result[at : at + draw.integers(1, 9)]
        elif kind == 3:
            result[at:at] = draw.bytes(int(draw.integers(1, 9)))
        else:
            del result[at if draw.random() < 0.3 else len(result) - int(draw.integers(1, 40)) :]
    return bytes(result)


def _packed(draw: Draw, document: Document, buffer: bytes, as_text: bool) -> bytes:
    """The file, as GLB or as .gltf with the buffer in it."""
    if as_text:
        if isinstance(buffers := document.get("buffers"), list) and buffers and isinstance(buffers[0], dict):
            buffers[0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
        return json.dumps(document).encode("utf-8", "surrogatepass")
    text = json.dumps(document, ensure_ascii=bool(draw.random() < 0.9)).encode("utf-8", "surrogatepass")
    return glb(text, buffer)


@np.errstate(all="ignore")
def mutated(seed: int) -> tuple[str, bytes]:
    """A file's suffix and content."""
    draw = np.random.default_rng(seed)
    name = _one(draw, list(WHOLE))
    document, binary = whole(name)
    document, buffer = copy.deepcopy(document), bytearray(binary)
    choice = draw.random()
    if choice < 0.25:
        _numbers(draw, document, buffer)
    elif choice < 0.85:
        for _ in range(draw.choice([1, 2, 3, 6], p=[0.6, 0.2, 0.1, 0.1])):
            change = _grow if draw.random() < 0.05 else _one(draw, STRUCTURE)
            try:
                change(draw, document)
            except (LookupError, TypeError, AttributeError, RecursionError):
                continue  # the document has become too odd for this change
    as_text = bool(draw.random() < 0.15)
    content = _packed(draw, document, bytes(buffer), as_text)
    if choice >= 0.85:
        content = _bytes(draw, content)
    return ".gltf" if as_text else SUFFIXES.get(name, ".glb"), content
