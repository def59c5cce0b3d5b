"""The colours and textures of the materials in a glTF file."""

from __future__ import annotations

from distretarget.errors import DistretargetError
from distretarget.io.gltf import Gltf, dotted
from distretarget.io.json_node import Fields, Node
from distretarget.skin.mesh import Material


def gltf_materials(gltf: Gltf) -> tuple[Material, ...]:
    """Return the materials of a file; what of one cannot be read is plain."""
    return tuple(_material(gltf, place) for place in gltf.entries("materials"))


def _material(gltf: Gltf, place: Node) -> Material:
    try:
        fields = place.entries(dotted)
        surface = fields.read("pbrMetallicRoughness", lambda node: node.entries(dotted), Fields())
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
    source = gltf.entry("textures", fields[key].entries(dotted)["index"])
    return bytes(gltf.image(source["source"])) if "source" in source else b""
