"""A plain glTF player for tests: where nodes and points of skinned meshes are at some times, by the specification.

Buffers are those of GLB, in the document, or in files beside the `.gltf`. Nothing here uses the package's own code of
glTF.
"""

from __future__ import annotations

import base64
import json
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from characters import chunks
from scipy.spatial.transform import Rotation

DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
SHAPES = {"SCALAR": (), "VEC2": (2,), "VEC3": (3,), "VEC4": (4,), "MAT4": (4, 4)}


def load(path: Path) -> tuple[dict, bytes]:
    """The JSON of a file, GLB or glTF, and all its buffers one after the other, to which the views in it lead."""
    data = path.read_bytes()
    document, binary = chunks(data) if data[:4] == b"glTF" else (json.loads(data), b"")
    buffers = [_buffer(entry.get("uri", ""), path.parent, binary) for entry in document.get("buffers", ())]
    starts = np.cumsum([0, *map(len, buffers)]).tolist()
    for view in document.get("bufferViews", ()):
        view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
    return document, b"".join(buffers)


def _buffer(uri: str, folder: Path, binary: bytes) -> bytes:
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    return (folder / unquote(uri)).read_bytes() if uri else binary


def values(document: dict, buffer: bytes, number: int) -> np.ndarray:
    """The elements of an accessor, (count, ...), as the numbers that they stand for; matrices row by row."""
    entry = document["accessors"][number]
    dtype, shape = np.dtype(DTYPES[entry["componentType"]]), SHAPES[entry["type"]]

    def read(view: int, offset: int, dtype: np.dtype, shape: tuple[int, ...], count: int) -> np.ndarray:
        at = document["bufferViews"][view]
        size = dtype.itemsize * int(np.prod(shape))
        start, stride = at.get("byteOffset", 0) + offset, at.get("byteStride", size)
        rows = [buffer[start + n * stride :][:size] for n in range(count)]
        return np.frombuffer(b"".join(rows), dtype).reshape(count, *shape)

    found = np.zeros((entry["count"], *shape), dtype)
    if "bufferView" in entry:
        found = read(entry["bufferView"], entry.get("byteOffset", 0), dtype, shape, entry["count"]).copy()
    if sparse := entry.get("sparse"):
        at, kept = sparse["indices"], sparse["values"]
        index = read(
            at["bufferView"], at.get("byteOffset", 0), np.dtype(DTYPES[at["componentType"]]), (), sparse["count"]
        )
        found[index] = read(kept["bufferView"], kept.get("byteOffset", 0), dtype, shape, sparse["count"])
    if entry.get("normalized"):
        found = np.maximum(found / np.iinfo(dtype).max, -1.0)
    return (found.transpose(0, 2, 1) if shape == (4, 4) else found).astype(float)


def sampled(keys: np.ndarray, found: np.ndarray, kind: str, times: np.ndarray, rotations: bool) -> np.ndarray:
    """Values of a sampler at some times, (times, n)."""
    if kind == "CUBICSPLINE":
        found = found.reshape(len(keys), 3, -1)
    before = np.clip(np.searchsorted(keys, times, side="right") - 1, 0, len(keys) - 1)
    after = np.minimum(before + 1, len(keys) - 1)
    gap = keys[after] - keys[before]
    share = np.clip(np.divide(times - keys[before], gap, out=np.zeros(len(times)), where=gap > 0), 0, 1)[:, None]
    if kind == "STEP":
        return found[before]
    if kind == "CUBICSPLINE":
        t, d = share, gap[:, None]
        made = (2 * t**3 - 3 * t**2 + 1) * found[before, 1] + d * (t**3 - 2 * t**2 + t) * found[before, 2]
        made += (-2 * t**3 + 3 * t**2) * found[after, 1] + d * (t**3 - t**2) * found[after, 0]
        return made / np.linalg.norm(made, axis=1, keepdims=True) if rotations else made
    if not rotations:
        return (1 - share) * found[before] + share * found[after]
    start, end = Rotation.from_quat(found[before]), Rotation.from_quat(found[after])
    return (start * Rotation.from_rotvec((start.inv() * end).as_rotvec() * share)).as_quat()


def worlds(document: dict, buffer: bytes, animation: int | str | None, times: np.ndarray) -> np.ndarray:
    """(times, nodes, 4, 4), the world matrices of all nodes in an animation, by number or name; None: without one."""
    nodes, times = document["nodes"], np.asarray(times, float)
    moving: dict[tuple[int, str], np.ndarray] = {}
    if isinstance(animation, str):
        animation = [entry.get("name") for entry in document["animations"]].index(animation)
    entry = {"channels": []} if animation is None else document["animations"][animation]
    for channel in entry["channels"]:
        sampler, path = entry["samplers"][channel["sampler"]], channel["target"]["path"]
        keys, found = (values(document, buffer, sampler[name]) for name in ("input", "output"))
        kind = sampler.get("interpolation", "LINEAR")
        if path != "weights" and "node" in channel["target"]:
            moving[channel["target"]["node"], path] = sampled(keys, found, kind, times, path == "rotation")
    made = np.tile(np.eye(4), (len(times), len(nodes), 1, 1))
    usual = {"translation": (0, 0, 0), "rotation": (0, 0, 0, 1), "scale": (1, 1, 1)}
    for number, node in enumerate(nodes):
        if "matrix" in node:
            made[:, number] = np.reshape(node["matrix"], (4, 4)).T
            continue
        shift, turn, scale = (
            moving.get((number, path), np.array(node.get(path, usual[path]), float)) for path in usual
        )
        turns = Rotation.from_quat(np.broadcast_to(turn, (len(times), 4))).as_matrix()
        made[:, number, :3, :3] = turns * np.broadcast_to(scale, (len(times), 3))[:, None, :]
        made[:, number, :3, 3] = shift
    waiting = [(child, number) for number, node in enumerate(nodes) for child in node.get("children", ())]
    below = dict.fromkeys(range(len(nodes)), -1) | dict(waiting)
    done: set[int] = set()

    def place(number: int) -> None:
        if number not in done and below[number] >= 0:
            place(below[number])
            made[:, number] = made[:, below[number]] @ made[:, number]
        done.add(number)

    for number in range(len(nodes)):
        place(number)
    return made


def skinned(document: dict, buffer: bytes, placed: np.ndarray) -> list[np.ndarray]:
    """The points of each skinned primitive, (times, points, 3), for world matrices of nodes, (times, nodes, 4, 4)."""
    found = []
    for node in document["nodes"]:
        if "skin" not in node or "mesh" not in node:
            continue
        skin = document["skins"][node["skin"]]
        binds = values(document, buffer, skin["inverseBindMatrices"])
        bones = placed[:, skin["joints"]] @ binds
        for primitive in document["meshes"][node["mesh"]]["primitives"]:
            names = ("POSITION", "JOINTS_0", "WEIGHTS_0")
            points, joints, weights = (values(document, buffer, primitive["attributes"][name]) for name in names)
            matrices = np.einsum("pk,tpkij->tpij", weights, bones[:, joints.astype(int)])
            found.append(np.einsum("tpij,pj->tpi", matrices[..., :3, :3], points) + matrices[..., :3, 3])
    return found
