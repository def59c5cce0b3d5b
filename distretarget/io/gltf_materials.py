"""The colours and textures of the materials in a glTF file."""

from __future__ import annotations

from distretarget.errors import DistretargetError
from distretarget.io.gltf import Gltf, dotted
from distretarget.io.json_node import Fields, Node
from distretarget.skin.mesh import Material

IMAGES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp"}  # by how they begin


def gltf_materials(gltf: Gltf) -> tuple[Material, ...]:
    """Return the materials of a file; what of one cannot be read is plain."""
    return tuple(_material(gltf, place) for place in gltf.entries("materials"))


def _material(gltf: Gltf, place: Node) -> Material:
    try:
        fields = place.entries(dotted)
        surface = fields.read("pbrMetallicRoughness", lambda node: node.entries(dotted), Fields())
        numbers = [number.number() for number in surface.listed("baseColorFactor")]
        image, kind = _image(gltf, surface)
        return Material(
            colour=(*numbers, *(1.0, 1.0, 1.0, 1.0)[len(numbers) :])[:4],
            image=image,
            kind=kind,
            mode=fields.read("alphaMode", Node.text, "OPAQUE"),
            cutoff=fields.read("alphaCutoff", Node.number, 0.5),
            two_sided=fields.read("doubleSided", Node.flag, False),
        )
    except DistretargetError:
        return Material()


def _image(gltf: Gltf, surface: Fields) -> tuple[bytes, str]:
    """The content of the image of a base colour and its type; empty where it is not in the file."""
    if "baseColorTexture" not in surface:
        return b"", ""
    texture = surface["baseColorTexture"].entries(dotted)
    if "source" not in (source := gltf.entry("textures", texture["index"])):
        return b"", ""
    content = bytes(gltf.image(source["source"]))
    return content, next((kind for head, kind in IMAGES.items() if content.startswith(head)), "")
