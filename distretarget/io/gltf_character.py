"""The character of an FBX file as a GLB: its nodes, its mesh with normals, places on images and weights, and the base
colours of its materials (glTF 2.0 specification, 3.7).

A node above all others brings the file's axes and units to those of glTF. Nodes keep their names, numbers and
transforms, so that an animation of the FBX file's nodes is one of these.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from distretarget.body.axes import axis_vector
from distretarget.character.character import Character
from distretarget.character.mesh import whole_mesh
from distretarget.character.nodes import Nodes
from distretarget.errors import FileError
from distretarget.io.fbx import fbx_looks
from distretarget.io.files import check_inside, read_bytes
from distretarget.io.formats import GLB_MARK
from distretarget.io.gltf import BINARY_CHUNK, CHUNK_HEADER, COMPONENTS, HEADER, JSON_CHUNK, Gltf, parse_gltf
from distretarget.io.input_file import InputFile
from distretarget.numerics.rotations import least
from distretarget.numerics.vectors import Array, Numbers
from distretarget.skeleton import METRES
from distretarget.skin.mesh import Looks, Material, SkinnedMesh

IMAGES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}  # by how they begin
FLOAT, SHORT, INT = 5126, 5123, 5125
PER_SET = 4  # joints of a vertex in a set of glTF
LEAST_WEIGHT = 1e-4  # lesser weights move nothing that is seen
LEFT_OUT = "of the FBX file's materials only base colours and their images are in the result, and no morph targets"


def gltf_character(file: InputFile, character: Character) -> tuple[Gltf, tuple[str, ...]]:
    """Return the character of an FBX file as glTF, and what of it is left out, a line each.

    Raises:
        FileError: the file has no mesh that its joints move, or a number that cannot be written.
    """
    nodes, parts, materials, files = fbx_looks(file.content, file.path)
    materials, missing = _with_images(file, materials, files)
    mesh = whole_mesh(character, nodes, parts, materials)
    if mesh is None or mesh.looks is None:
        raise FileError(file.path, "has no mesh to write; write .bvh")
    document = _Document()
    document.add_nodes(character, nodes)
    document.add_mesh(character, mesh, mesh.looks, Path(file.path).stem)
    return parse_gltf(document.content, file.path), (LEFT_OUT, *missing)


def _with_images(
    file: InputFile, materials: Sequence[Material], files: Sequence[str]
) -> tuple[tuple[Material, ...], tuple[str, ...]]:
    """The materials with images that are in files beside the FBX file, and a line for each that is not found, or of a
    kind that glTF does not have.
    """
    found, missing = [], []
    for material, name in zip(materials, files, strict=True):
        image = material.image or _beside(file, name)
        known = any(image.startswith(mark) for mark in IMAGES)
        if (image or name) and not known:
            why = "is neither PNG nor JPEG" if image else "is not beside it"
            missing.append(f"an image of the FBX file is left out: {name or 'one in it'!r} {why}")
        found.append(Material(colour=material.colour, image=image if known else b""))
    return tuple(found), tuple(dict.fromkeys(missing))


def _beside(file: InputFile, name: str) -> bytes:
    """The content of a file beside another, by its path there, or by its name alone; empty if there is none."""
    if not name or not file.has_folder:
        return b""
    folder, path = Path(file.path).parent, name.replace("\\", "/")
    for each in dict.fromkeys((path, path.rsplit("/", 1)[-1])):
        try:
            check_inside(folder / each, folder)
            return read_bytes(folder / each)
        except FileError:
            continue
    return b""


class _Document:
    """A GLB in the making: the lists of its document, and its binary chunk."""

    def __init__(self) -> None:
        self._lists: dict[str, list[dict[str, object]]] = {}
        self._binary = bytearray()
        self._images: dict[bytes, int] = {}

    @property
    def content(self) -> bytes:
        """The whole file."""
        document = {
            "asset": {"version": "2.0", "generator": "distretarget"},
            "scene": 0,
            "buffers": [{"byteLength": len(self._binary)}],
            **self._lists,
        }
        text = json.dumps(document, allow_nan=False, separators=(",", ":")).encode()
        chunks = [(JSON_CHUNK, text + b" " * (-len(text) % 4)), (BINARY_CHUNK, bytes(self._binary))]
        size = HEADER.size + sum(CHUNK_HEADER.size + len(chunk) for _, chunk in chunks)
        parts = [CHUNK_HEADER.pack(len(chunk), kind) + chunk for kind, chunk in chunks]
        return HEADER.pack(GLB_MARK, 2, size) + b"".join(parts)

    def add_nodes(self, character: Character, nodes: Nodes) -> None:
        """Add the nodes of a file, below one that brings them to metres and Y up."""
        below: dict[int, list[int]] = {}
        for node, parent in enumerate(nodes.parents.tolist()):
            below.setdefault(parent, []).append(node)
        top, skeleton = len(nodes), character.skeleton
        for node, name in enumerate(nodes.names):
            self._add(
                "nodes",
                _node(name, nodes.translations[node], nodes.rotations[node], nodes.scales[node], below.get(node)),
            )
        up = axis_vector(skeleton.up or "Y")
        scale = np.full(3, METRES[skeleton.units] if skeleton.units else 1.0)
        turn = least(up[None], axis_vector("Y")[None]).as_quat()
        self._add("nodes", _node("Armature", np.zeros(3), turn, scale, below[-1]))
        self._add("scenes", {"nodes": [top, top + 1]})

    def add_mesh(self, character: Character, mesh: SkinnedMesh, looks: Looks, name: str) -> None:
        """Add the mesh, with a node, its skin and its materials."""
        binds, joints = character.bind_transforms, character.joint_nodes.tolist()
        inverse = np.linalg.inv(np.array([binds[joint] for joint in joints]))
        matrices = self._numbers(np.swapaxes(inverse, 1, 2).reshape(-1, 16), "MAT4")
        self._add("skins", {"joints": joints, "inverseBindMatrices": matrices})
        self._add("nodes", {"name": name or "Mesh", "mesh": 0, "skin": 0})
        vertices = mesh.vertices + character.skeleton.offsets[0]
        least, most = _exact(vertices.min(axis=0)), _exact(vertices.max(axis=0))
        attributes = {"POSITION": self._numbers(vertices, "VEC3", min=least, max=most)}
        if looks.normals is not None and np.linalg.norm(looks.normals, axis=1).min() > 0.5:
            attributes["NORMAL"] = self._numbers(looks.normals, "VEC3")
        if looks.uv.any():
            attributes["TEXCOORD_0"] = self._numbers(looks.uv * [1.0, -1.0] + [0.0, 1.0], "VEC2")
        for number, (joints_of, weights) in enumerate(_sets(mesh)):
            attributes[f"JOINTS_{number}"] = self._numbers(joints_of, "VEC4", SHORT)
            attributes[f"WEIGHTS_{number}"] = self._numbers(weights, "VEC4")
        primitives = []
        for material in np.unique(looks.of_triangle).tolist():
            own = mesh.triangles[looks.of_triangle == material]
            primitive: dict[str, object] = {
                "attributes": attributes,
                "indices": self._numbers(own.ravel(), "SCALAR", INT),
            }
            if material >= 0:
                primitive["material"] = self._material(looks.materials[material], "TEXCOORD_0" in attributes)
            primitives.append(primitive)
        self._add("meshes", {"name": name or "Mesh", "primitives": primitives})

    def _material(self, material: Material, has_places: bool) -> int:
        surface: dict[str, object] = {
            "baseColorFactor": list(material.colour),
            "metallicFactor": 0.0,
            "roughnessFactor": 0.9,
        }
        if material.image and has_places:
            surface["baseColorTexture"] = {"index": self._texture(material.image)}
        entry: dict[str, object] = {"pbrMetallicRoughness": surface, "doubleSided": True}
        return self._add("materials", entry | ({"alphaMode": "BLEND"} if material.colour[3] < 1.0 else {}))

    def _texture(self, image: bytes) -> int:
        if image not in self._images:
            kind = next(kind for mark, kind in IMAGES.items() if image.startswith(mark))
            source = self._add("images", {"bufferView": self._view(image), "mimeType": kind})
            self._images[image] = self._add("textures", {"source": source})
        return self._images[image]

    def _numbers(self, values: Array | Numbers, kind: str, component: int = FLOAT, **entry: object) -> int:
        """Add an accessor with some numbers, and return its number."""
        data = np.ascontiguousarray(values, COMPONENTS[component]).tobytes()
        accessor = {"bufferView": self._view(data), "componentType": component, "count": len(values), "type": kind}
        return self._add("accessors", accessor | entry)

    def _view(self, data: bytes) -> int:
        """Add bytes to the binary chunk, and return the number of the view of them."""
        view = self._add("bufferViews", {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)})
        self._binary += data + bytes(-len(data) % 4)
        return view

    def _add(self, key: str, entry: dict[str, object]) -> int:
        """Add an entry to a list of the document, and return its number."""
        entries = self._lists.setdefault(key, [])
        entries.append(entry)
        return len(entries) - 1


def _node(
    name: str, translation: Array, rotation: Array, scale: Array, children: list[int] | None
) -> dict[str, object]:
    """A node with its transform, as far as that is not the usual one."""
    entry: dict[str, object] = {"name": name} if name else {}
    for key, value, usual in (
        ("translation", translation, [0, 0, 0]),
        ("rotation", rotation, [0, 0, 0, 1]),
        ("scale", scale, [1, 1, 1]),
    ):
        if (value != usual).any():
            entry[key] = _exact(value)
    return entry | ({"children": children} if children else {})


def _exact(values: Array) -> list[float]:
    """Numbers as they are in single precision."""
    return [float(value) for value in values.astype(np.float32)]


def _sets(mesh: SkinnedMesh) -> Iterator[tuple[Numbers, Array]]:
    """Yield joints and weights of vertices, (vertices, 4) each, four a time; weights add up to 1 in single precision,
    and joints without weight are 0.
    """
    order = np.argsort(-mesh.weights, axis=1, kind="stable")
    weights = np.take_along_axis(mesh.weights, order, axis=1)
    used = max(int((weights > LEAST_WEIGHT).sum(axis=1).max()), 1)
    weights = np.where(weights > LEAST_WEIGHT, weights, 0.0)[:, :used]
    weights = weights / weights.sum(axis=1, keepdims=True)
    joints = np.where(weights > 0.0, np.take_along_axis(mesh.joints, order, axis=1)[:, :used], 0)
    lacking = -used % PER_SET
    weights, joints = (np.pad(each, ((0, 0), (0, lacking))) for each in (weights, joints))
    for first in range(0, used, PER_SET):
        yield joints[:, first : first + PER_SET], weights[:, first : first + PER_SET]
