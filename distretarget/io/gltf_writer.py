"""Write glTF 2.0: add animations to a file and leave its other bytes unchanged (specification, 3.11); and convert the
character of an FBX file to a GLB, with its mesh and the base colours of its materials (3.7).

An added node above those of the FBX file converts axes and units. The FBX file's nodes keep their names, order and
transforms, so that an animation of them can be written without a change.
"""

from __future__ import annotations

import base64
import json
import mimetypes
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from pathlib import Path
from typing import Literal

import numpy as np

from distretarget.body.axes import axis_vector
from distretarget.character.character import Character
from distretarget.character.mesh import assembled
from distretarget.character.nodes import Animation, Nodes
from distretarget.errors import FileError
from distretarget.io.fbx import fbx_mesh
from distretarget.io.files import check_inside, read_bytes
from distretarget.io.gltf import BINARY_CHUNK, CHUNK_HEADER, COMPONENTS, DATA_URI, GLB_MARK, HEADER, JSON_CHUNK, Gltf
from distretarget.io.gltf_scene import REST, gltf_nodes
from distretarget.io.input_file import InputFile
from distretarget.io.json_node import (
    Edit,
    Fields,
    Member,
    Node,
    added,
    changed,
    compact,
    edited,
    members,
    without_garbage_collection,
)
from distretarget.numerics.rotations import least
from distretarget.numerics.vectors import Array, Numbers
from distretarget.skeleton import METRES
from distretarget.skin.mesh import Looks, Material, SkinnedMesh

Mode = Literal["add", "replace"]
Parts = Sequence[bytes | memoryview]
Top = Mapping[str, Member]
"""The members of a document's top level by key."""
Entries = list[dict[str, object]]
"""The entries of a list of a document."""
Tracks = dict[tuple[str, int], Array]
"""The keys of an animation's channels by (path, node), the path being "rotation", say."""

ALIGNED = 4  # accessors of floats, and chunks, begin at multiples of this [bytes]
LARGEST_GLB = 2**32 - 1  # the header's length field has 32 bits [bytes]
OCTETS = "application/octet-stream"
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}  # accessor types by the width of an element
NOTHING = memoryview(b"")
SINGLE_KEY = 1, "0"  # frames and frame time of a track with one key
IMAGES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}  # MIME types by the first bytes
FLOAT, SHORT, INT = 5126, 5123, 5125
PER_SET = 4  # influences on a vertex in one pair of JOINTS_n and WEIGHTS_n
LEAST_WEIGHT = 1e-4  # smaller weights have no visible effect and are left out
LEFT_OUT = "of the FBX file's materials only base colours and their images are in the result, and no morph targets"


class _BufferWriter:
    """New data for a buffer with `existing` bytes, with buffer views and accessors, numbered after those that exist."""

    def __init__(self, buffer: int = 0, existing: memoryview = NOTHING, views: int = 0, accessors: int = 0) -> None:
        self.views: list[dict[str, object]] = []
        self.accessors: list[dict[str, object]] = []
        self._buffer, self._existing, self._firsts = buffer, existing, (views, accessors)
        self._new = bytearray()
        self._times: dict[tuple[int, str], int] = {}

    @property
    def content(self) -> Parts:
        """The content of the buffer, in parts."""
        return [self._existing, *_padding(self._existing, b"\0"), bytes(self._new)]

    def view(self, data: bytes) -> int:
        """Add bytes; return the index of their view."""
        start = _aligned(len(self._existing)) + len(self._new)
        self.views.append({"buffer": self._buffer, "byteOffset": start, "byteLength": len(data)})
        self._new += data + bytes(-len(data) % ALIGNED)
        return self._firsts[0] + len(self.views) - 1

    def add(self, values: Array | Numbers, component: int = FLOAT, **entry: object) -> int:
        """Add numbers, (n,) or (n, width); return the index of their accessor."""
        view = self.view(np.ascontiguousarray(values, COMPONENTS[component]).tobytes())
        kind = KINDS[values.shape[1] if values.ndim > 1 else 1]
        accessor = {"bufferView": view, "componentType": component, "count": len(values), "type": kind}
        self.accessors.append(accessor | entry)
        return self._firsts[1] + len(self.accessors) - 1

    def times(self, frames: int, frame_time_text: str) -> int:
        """Return the index of the accessor with the times of frames, which animations share."""
        if (frames, frame_time_text) not in self._times:
            times = (np.arange(frames) * float(frame_time_text)).astype("<f4").astype(float)
            self._times[frames, frame_time_text] = self.add(times, min=[times[0]], max=[times[-1]])
        return self._times[frames, frame_time_text]


def animated(
    gltf: Gltf,
    animations: Sequence[Animation],
    mode: Mode = "add",
    as_binary: bool = True,
    embedded: Callable[[Node], bytes] | None = None,
    own: int | None = None,
) -> Parts:
    """Return the content of a file with animations added, or in place of its own, in parts: a GLB, or JSON. `embedded`
    returns the file that a URI names, to embed it. Animations beyond the file's `own` get a rest key for each channel
    that only new ones have. A FileError if a GLB would be too large.
    """
    nodes, buffers, binary = gltf_nodes(gltf), gltf.entries("buffers"), gltf.binary
    extends = binary is not None and bool(buffers) and "uri" not in (first := buffers[0].entries())
    if extends:
        first.need("byteLength").whole()
    in_chunk = as_binary and (extends or not buffers)
    counts = len(gltf.entries("bufferViews")), len(gltf.entries("accessors"))
    numbers = _BufferWriter(0 if extends else len(buffers), binary if binary and extends else NOTHING, *counts)
    with without_garbage_collection():
        top = {str(each.key): each for each in members(gltf.text, 0)}
    entries = [*_animation_entries(gltf, animations, numbers, nodes, mode)]
    completing = [] if own is None else [*_completing(gltf, top, animations, numbers, nodes, own)]
    content = numbers.content
    buffer = {"byteLength": sum(map(len, content))} | ({} if in_chunk else {"uri": _data_uri(content)})
    edits = [
        *completing,
        _listed(gltf.text, top, "bufferViews", numbers.views),
        _listed(gltf.text, top, "accessors", numbers.accessors),
        _listed(gltf.text, top, "animations", entries, replaces=mode == "replace"),
        changed(gltf.text, next(members(gltf.text, top["buffers"].start)), buffer)
        if extends
        else _listed(gltf.text, top, "buffers", [buffer]),
        *_without_matrices(gltf, top, animations, nodes),
        *(_embedding(gltf, top, embedded) if embedded else ()),
    ]
    document = edited(gltf.text_to_copy, edits).encode()
    return _glb(gltf, document, content if in_chunk else None) if as_binary else [document]


def _animation_entries(
    gltf: Gltf, animations: Sequence[Animation], numbers: _BufferWriter, nodes: Nodes, mode: Mode
) -> Iterator[dict[str, object]]:
    """Yield the entries of animations, whose data are added to `numbers`. A rest key for each channel that only others
    have resets what the previous animation moved.
    """
    existing = gltf.entries("animations") if mode == "add" else []
    taken = {entry.entries().read("name", Node.text, "") for entry in existing} - {""}
    moved = {target for entry in existing for target in _targets(gltf, entry.entries())}
    moved.update(*map(_tracks, animations))
    for animation in animations:
        tracks = _tracks(animation)
        times = dict.fromkeys(tracks, numbers.times(animation.frames, animation.frame_time_text))
        if at_rest := _rest_keys(moved - tracks.keys(), animation.posed, nodes):
            times |= dict.fromkeys(at_rest, numbers.times(*SINGLE_KEY))
        tracks |= at_rest
        channels = [*_channels(tracks)]
        samplers = [{"input": times[target], "output": numbers.add(keys)} for target, keys in tracks.items()]
        name = free_name(animation.name, taken)
        taken.add(name)
        entry: dict[str, object] = {"name": name, "channels": channels, "samplers": samplers}
        yield entry | ({"extras": dict(animation.extras)} if animation.extras else {})


def _completing(
    gltf: Gltf, top: Top, animations: Sequence[Animation], numbers: _BufferWriter, nodes: Nodes, own: int
) -> Iterator[Edit]:
    """The edits that give the file's animations after its `own` a rest key for each channel that only new ones have."""
    moved, posed = set[tuple[str, int]]().union(*map(_tracks, animations)), {*animations[0].posed}
    for entry, fields in [*_entries(gltf, top, "animations")][own:]:
        if at_rest := _rest_keys(moved.difference(_targets(gltf, fields)), posed, nodes):
            old = json.loads(gltf.text[entry.start : entry.end])
            samplers = [{"input": numbers.times(*SINGLE_KEY), "output": numbers.add(keys)} for keys in at_rest.values()]
            channels = [*old["channels"], *_channels(at_rest, len(old["samplers"]))]
            yield changed(gltf.text, entry, {"channels": channels, "samplers": old["samplers"] + samplers})


def _rest_keys(targets: Set[tuple[str, int]], posed: Set[int], nodes: Nodes) -> Tracks:
    """One key, the node's own transform, for each of the targets (path, node) whose node is among the `posed`."""
    own = {"translation": nodes.translations, "rotation": nodes.rotations, "scale": nodes.scales}
    return {(path, node): own[path][[node]] for path, node in sorted(targets) if path in own and node in posed}


def _channels(tracks: Tracks, first: int = 0) -> Iterator[dict[str, object]]:
    """Yield the channels of tracks; their samplers are numbered from `first`."""
    for number, (path, node) in enumerate(tracks, start=first):
        yield {"sampler": number, "target": {"node": node, "path": path}}


def _tracks(animation: Animation) -> Tracks:
    tracks: Tracks = {("translation", node): keys for node, keys in animation.translations.items()}
    tracks |= {("rotation", node): keys for node, keys in animation.rotations.items()}
    return tracks | {("weights", node): keys.ravel() for node, keys in animation.weights.items()}


def _targets(gltf: Gltf, animation: Fields) -> Iterator[tuple[str, int]]:
    """The targets of an animation of the file, (path, node) each."""
    for channel in animation.listed("channels"):
        target = channel.entries().inner("target")
        if "node" in target:
            yield target.read("path", Node.text, ""), gltf.index("nodes", target["node"])


def free_name(name: str, taken: set[str]) -> str:
    """Return a name that is not taken: the name itself, or with the first free number from 2 behind it."""
    number, free = 1, name
    while free in taken:
        number += 1
        free = f"{name} {number}"
    return free


def _listed(text: str, top: Top, key: str, entries: Sequence[Mapping[str, object]], replaces: bool = False) -> Edit:
    """The edit that adds entries to a list of the document, or replaces its entries; a new list comes last."""
    texts = [compact(entry) for entry in entries]
    if key not in top:
        end = max(each.end for each in top.values())
        return end, end, f',"{key}":[{",".join(texts)}]'
    if replaces:
        return top[key].start, top[key].end, f"[{','.join(texts)}]"
    return added(text, top[key].start, texts)


def _without_matrices(gltf: Gltf, top: Top, animations: Sequence[Animation], nodes: Nodes) -> Iterator[Edit]:
    """The edits that replace the matrices of animated nodes by translation, rotation and scale."""
    moving = {node for animation in animations for node in (*animation.rotations, *animation.translations)}
    transforms = zip(nodes.translations, nodes.rotations, nodes.scales, strict=True)
    for number, ((entry, node), parts) in enumerate(zip(_entries(gltf, top, "nodes"), transforms, strict=True)):
        if number in moving and "matrix" in node:
            new = {key: part.tolist() for key, part in zip(REST, parts, strict=True)}
            yield changed(gltf.text, entry, new, without="matrix")


def _embedding(gltf: Gltf, top: Top, embedded: Callable[[Node], bytes]) -> Iterator[Edit]:
    """The edits that embed the files of buffers and images in the document."""
    for key in ("buffers", "images"):
        for entry, fields in _entries(gltf, top, key):
            uri = fields.read("uri", Node.text, DATA_URI)
            if not uri.startswith(DATA_URI):
                kind = OCTETS if key == "buffers" else mimetypes.guess_type(uri)[0] or OCTETS
                yield changed(gltf.text, entry, {"uri": _data_uri([embedded(fields["uri"])], kind)})


def _entries(gltf: Gltf, top: Top, key: str) -> Iterator[tuple[Member, Fields]]:
    """Yield the entries of a list of the document, with their values."""
    if key in top:
        for entry, node in zip(members(gltf.text, top[key].start), gltf.entries(key), strict=True):
            yield entry, node.entries()


def _data_uri(content: Parts, kind: str = OCTETS) -> str:
    return f"{DATA_URI}{kind};base64,{base64.b64encode(b''.join(content)).decode('ascii')}"


def _glb(gltf: Gltf, document: bytes, content: Parts | None) -> Parts:
    """A GLB with a document, a binary chunk if `content` is one, and the other chunks of `gltf` unchanged."""
    chunks: list[tuple[int, Parts]] = [(JSON_CHUNK, [document, *_padding(document, b" ")])]
    if content is not None:
        chunks.append((BINARY_CHUNK, content))
    replaced = 2 if gltf.binary is not None and content is not None else 1
    chunks += [(kind, [chunk]) for kind, chunk in gltf.chunks[replaced:]]
    size = HEADER.size + sum(CHUNK_HEADER.size + sum(map(len, chunk)) for _, chunk in chunks)
    if size > LARGEST_GLB:
        raise FileError(gltf.path, "with this animation it would be larger than 4 GB, the most of a GLB")
    parts: list[bytes | memoryview] = [HEADER.pack(GLB_MARK, 2, size)]
    for kind, chunk in chunks:
        parts += [CHUNK_HEADER.pack(sum(map(len, chunk)), kind), *chunk]
    return parts


def _aligned(size: int) -> int:
    return -(-size // ALIGNED) * ALIGNED


def _padding(content: bytes | memoryview, filler: bytes) -> list[bytes]:
    """The bytes that pad a content to a multiple of `ALIGNED`."""
    return [filler * (_aligned(len(content)) - len(content))]


def gltf_character(file: InputFile, character: Character) -> tuple[Gltf, tuple[str, ...]]:
    """Return the character of an FBX file as glTF, and a line on each thing left out; a FileError without a mesh."""
    nodes, parts, materials, files = fbx_mesh(file.content, file.path, with_looks=True)
    materials, missing = _with_images(file, materials, files)
    mesh = assembled(character, nodes, parts, materials)
    if mesh is None or mesh.looks is None:
        raise FileError(file.path, "has no mesh to write; write .bvh")
    numbers, name = _BufferWriter(), Path(file.path).stem or "Mesh"
    lists = {"nodes": _nodes(character, nodes, name), "scenes": [{"nodes": [len(nodes), len(nodes) + 1]}]}
    lists |= {"bufferViews": numbers.views, "accessors": numbers.accessors}
    lists |= _mesh(character, mesh, mesh.looks, name, numbers)
    content = b"".join(numbers.content)
    document = {"asset": {"version": "2.0", "generator": "distretarget"}, "scene": 0}
    document |= {"buffers": [{"byteLength": len(content)}], **{key: some for key, some in lists.items() if some}}
    text = json.dumps(document, allow_nan=False, separators=(",", ":")).encode()
    padded = b"".join([text, *_padding(text, b" ")])
    chunks = ((JSON_CHUNK, memoryview(padded)), (BINARY_CHUNK, memoryview(content)))
    return Gltf(file.path, chunks), (LEFT_OUT, *missing)


def _with_images(
    file: InputFile, materials: Sequence[Material], files: Sequence[str]
) -> tuple[tuple[Material, ...], tuple[str, ...]]:
    """The materials, with images read from files beside the FBX file, and a line for each image left out."""
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
    """The content of a file by its path relative to another file, or else by its bare name; empty if there is none."""
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


def _nodes(character: Character, nodes: Nodes, mesh: str) -> Entries:
    """The nodes of a file, one above them that converts to metres and Y up, and one with the mesh."""
    children_of: dict[int, list[int]] = {}
    for node, parent in enumerate(nodes.parents.tolist()):
        children_of.setdefault(parent, []).append(node)
    skeleton = character.skeleton
    turn = least(axis_vector(skeleton.up or "Y")[None], axis_vector("Y")[None]).as_quat()
    scale = np.full(3, METRES[skeleton.units] if skeleton.units else 1.0)
    rows = zip(nodes.names, nodes.translations, nodes.rotations, nodes.scales, strict=True)
    entries: Entries = []
    for node, (name, *transform) in enumerate([*rows, ("Armature", np.zeros(3), turn, scale)]):
        values = zip(REST.items(), transform, strict=True)
        entry: dict[str, object] = {"name": name} if name else {}
        entry |= {key: _single(value) for (key, default), value in values if (value != default).any()}
        children = children_of.get(node if node < len(nodes) else -1)
        entries.append(entry | ({"children": children} if children else {}))
    return [*entries, {"name": mesh, "mesh": 0, "skin": 0}]


def _mesh(character: Character, mesh: SkinnedMesh, looks: Looks, name: str, data: _BufferWriter) -> dict[str, Entries]:
    """The lists of a document with a mesh, its skin and its materials; the numbers in them are added to `data`."""
    binds, joints = character.bind_transforms, character.joint_nodes.tolist()
    inverse = np.linalg.inv(np.array([binds[joint] for joint in joints]))
    skin = {"joints": joints, "inverseBindMatrices": data.add(np.swapaxes(inverse, 1, 2).reshape(-1, 16))}
    vertices = mesh.vertices + character.skeleton.offsets[0]
    extremes = [_single(each(axis=0)) for each in (vertices.min, vertices.max)]
    attributes = {"POSITION": data.add(vertices, min=extremes[0], max=extremes[1])}
    if looks.normals is not None and np.linalg.norm(looks.normals, axis=1).min() > 0.5:
        attributes["NORMAL"] = data.add(looks.normals)
    if looks.uv.any():
        attributes["TEXCOORD_0"] = data.add(looks.uv * [1.0, -1.0] + [0.0, 1.0])
    for number, (joints_of, weights) in enumerate(_sets(mesh)):
        attributes[f"JOINTS_{number}"] = data.add(joints_of, SHORT)
        attributes[f"WEIGHTS_{number}"] = data.add(weights)
    lists: dict[str, Entries] = {"skins": [skin], "images": [], "textures": [], "materials": []}
    textures: dict[bytes, int] = {}  # texture index by image
    primitives: Entries = []
    for number in np.unique(looks.of_triangle).tolist():
        own = mesh.triangles[looks.of_triangle == number]
        primitives.append({"attributes": attributes, "indices": data.add(own.ravel(), INT)})
        if number < 0:
            continue
        material = looks.materials[number]
        surface: dict[str, object] = {"baseColorFactor": list(material.colour), "metallicFactor": 0.0}
        surface["roughnessFactor"] = 0.9
        if material.image and looks.uv.any():
            if material.image not in textures:
                textures[material.image] = len(textures)
                kind = next(kind for mark, kind in IMAGES.items() if material.image.startswith(mark))
                lists["textures"].append({"source": len(lists["images"])})
                lists["images"].append({"bufferView": data.view(material.image), "mimeType": kind})
            surface["baseColorTexture"] = {"index": textures[material.image]}
        blend = {"alphaMode": "BLEND"} if material.colour[3] < 1.0 else {}
        primitives[-1]["material"] = len(lists["materials"])
        lists["materials"].append({"pbrMetallicRoughness": surface, "doubleSided": True, **blend})
    return lists | {"meshes": [{"name": name, "primitives": primitives}]}


def _single(values: Array) -> list[float]:
    """Numbers rounded to single precision."""
    return [float(value) for value in values.astype(np.float32)]


def _sets(mesh: SkinnedMesh) -> Iterator[tuple[Numbers, Array]]:
    """Yield joints and weights of vertices in sets of four, (vertices, 4) each; weights add up to 1 over all sets."""
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
