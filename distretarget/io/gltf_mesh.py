"""The meshes of a glTF file, with the nodes that move them and the materials that colour them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import count

import numpy as np
from numpy.typing import NDArray

from distretarget.character.mesh import MeshPart
from distretarget.character.nodes import SkinBinding
from distretarget.errors import DistretargetError, FileError
from distretarget.io.gltf import Gltf
from distretarget.io.json_node import Fields, Node
from distretarget.numerics.vectors import Array
from distretarget.skin.mesh import Material

Triangles = NDArray[np.intp]

TRIANGLES, STRIP, FAN = 4, 5, 6  # modes of primitives; the others are points and lines
WHOLE_NUMBERS = (5121, 5123)  # components of joints
INDICES = (5121, 5123, 5125)
INFLUENCES = 8  # the bones that move a vertex most; others do not count
DRACO = "KHR_draco_mesh_compression"


def gltf_parts(gltf: Gltf, skins: tuple[SkinBinding, ...]) -> Iterator[MeshPart]:
    """Yield the meshes at the nodes of a file, without morph targets; primitives that share vertices are one part. A
    FileError or SkeletonFileError if a mesh is compressed or not valid.
    """
    for node, entry in enumerate(gltf.entries("nodes")):
        fields = entry.entries()
        if "mesh" not in fields:
            continue
        skin = skins[gltf.index("skins", fields["skin"])] if "skin" in fields else None
        groups: dict[tuple[object, ...], list[Fields]] = defaultdict(list)
        for place in gltf.entry("meshes", fields["mesh"]).listed("primitives"):
            primitive = place.entries()
            attributes = primitive.inner("attributes")
            if "POSITION" in attributes and primitive.read("mode", Node.whole, TRIANGLES) in (TRIANGLES, STRIP, FAN):
                groups[tuple((name, attributes[name].whole()) for name in sorted(attributes))].append(primitive)
        for primitives in groups.values():
            yield _part(gltf, primitives, node, skin)


def _part(gltf: Gltf, primitives: Sequence[Fields], node: int, skin: SkinBinding | None) -> MeshPart:
    """The part of primitives with the same vertices, which a skin moves, or else the node where they are."""
    for primitive in primitives:
        if DRACO in primitive.inner("extensions"):
            raise FileError(gltf.path, f"{primitive.node.place} is compressed by Draco")
    attributes = primitives[0]["attributes"].entries()
    vertices = gltf.numbers(attributes["POSITION"], "VEC3")
    bones = np.array([node]) if skin is None else skin.joints
    to_bones = skin.inverse_binds if skin else None
    joints, weights = np.zeros((len(vertices), 1), np.intp), np.ones((len(vertices), 1))
    if skin:
        joints, weights = _influences(gltf, primitives[0].node, attributes, len(vertices), len(bones))
    triangles = [_triangles(gltf, primitive, len(vertices)) for primitive in primitives]
    materials = [gltf.index("materials", each["material"]) if "material" in each else -1 for each in primitives]
    return MeshPart(
        vertices,
        bones,
        np.tile(np.eye(4), (len(bones), 1, 1)) if to_bones is None else to_bones,
        joints,
        weights,
        np.concatenate(triangles),
        np.repeat(materials, [len(some) for some in triangles]),
        _uv(gltf, attributes, len(vertices)),
    )


def _uv(gltf: Gltf, attributes: Fields, vertices: int) -> Array:
    """(vertices, 2), the places of the vertices on images; zeros where the file does not say them."""
    if "TEXCOORD_0" in attributes and gltf.entries("images"):
        with suppress(DistretargetError):
            uv = gltf.numbers(attributes["TEXCOORD_0"], "VEC2")
            if len(uv) == vertices:
                return uv
    return np.zeros((vertices, 2))


def _influences(
    gltf: Gltf, place: Node, attributes: Fields, vertices: int, bones: int
) -> tuple[NDArray[np.intp], Array]:
    """The bones that move each vertex most and their weights, (vertices, influences) each."""
    joints, weights = [], []
    for number in count():
        names = f"JOINTS_{number}", f"WEIGHTS_{number}"
        if not all(name in attributes for name in names):
            break
        joints.append(gltf.numbers(attributes[names[0]], "VEC4", WHOLE_NUMBERS).astype(np.intp))
        weights.append(gltf.numbers(attributes[names[1]], "VEC4"))
        if not len(joints[-1]) == len(weights[-1]) == vertices:
            place.fail(f"has {len(joints[-1])} joints and {len(weights[-1])} weights for {vertices} vertices")
    if not joints:
        place.fail("has a skin, but no joints and weights")
    every, shares = np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)
    if every.shape[1] > INFLUENCES:
        most = np.argsort(-shares, axis=1, kind="stable")[:, :INFLUENCES]
        every, shares = np.take_along_axis(every, most, axis=1), np.take_along_axis(shares, most, axis=1)
    every[shares == 0.0] = 0
    if every.max(initial=0) >= bones:
        place.fail(f"has the joint {every.max()}; its skin has {bones}")
    return every, shares


def _triangles(gltf: Gltf, primitive: Fields, vertices: int) -> Triangles:
    """The triangles of a primitive, (triangles, 3)."""
    indices = np.arange(vertices)
    if "indices" in primitive:
        indices = gltf.numbers(primitive["indices"], "SCALAR", INDICES).astype(np.intp)
        if indices.max(initial=-1) >= vertices:
            primitive.node.fail(f"has the index {indices.max()}; it has {vertices} vertices")
    mode = primitive.read("mode", Node.whole, TRIANGLES)
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    if len(indices) < 3:
        return np.zeros((0, 3), np.intp)
    if mode == FAN:
        return np.stack([np.full(len(indices) - 2, indices[0]), indices[1:-1], indices[2:]], axis=1)
    strip = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    strip[1::2] = strip[1::2, [1, 0, 2]]
    return strip


def gltf_materials(gltf: Gltf) -> tuple[Material, ...]:
    """Return the materials of a file; what of one cannot be read is plain."""
    return tuple(_material(gltf, place) for place in gltf.entries("materials"))


def _material(gltf: Gltf, place: Node) -> Material:
    try:
        fields = place.entries()
        surface = fields.inner("pbrMetallicRoughness")
        numbers = [number.number() for number in surface.listed("baseColorFactor")]
        return Material(
            colour=(*numbers, *(1.0, 1.0, 1.0, 1.0)[len(numbers) :])[:4],
            image=_image(gltf, surface, "baseColorTexture"),
            normal_map=_image(gltf, fields, "normalTexture"),
            mode=fields.read("alphaMode", Node.text, "OPAQUE"),
            cutoff=fields.read("alphaCutoff", Node.number, 0.5),
            two_sided=fields.read("doubleSided", Node.flag, False),
        )
    except DistretargetError:
        return Material()


def _image(gltf: Gltf, fields: Fields, key: str) -> bytes:
    """The content of the image of a texture; empty where there is none."""
    if key not in fields:
        return b""
    source = gltf.entry("textures", fields[key].entries().need("index"))
    return bytes(gltf.image(source["source"])) if "source" in source else b""
