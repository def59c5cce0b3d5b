"""Read a character from a glTF file: nodes, skins, meshes, materials, VRM humanoid, an animation; and expressions,
morph target weights by name (of a face, say), taken from an animation to a character's meshes.

The name of an expression is that of a morph target, in `extras.targetNames` of its mesh, as exporters write it (ARKit's
52 names, say); of an expression of a VRM model, which sets the weights of several morph targets; or of an expression in
a VRM animation. Case does not matter, and VRM 0's names are translated to VRM 1.0's.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations, count
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from distretarget.character.animations import choose_animation
from distretarget.character.mesh import MeshPart
from distretarget.character.nodes import INFLUENCES, Animation, CharacterScene, Curve, Nodes, SkinBinding, sampled
from distretarget.errors import DistretargetError, FileError, SkeletonFileError, cut
from distretarget.io.gltf import INDICES, Gltf
from distretarget.io.json_node import Fields, Node
from distretarget.numerics.rotations import nearest_rotations
from distretarget.numerics.vectors import Array
from distretarget.skeleton import LARGEST, SMALLEST
from distretarget.skin.mesh import Material

REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}
KINDS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}  # accessor types of animation outputs by path
SHEAR = 2e-3  # numbers rounded to three decimals turn axes against each other by up to this [cosine]
FLOATS, KEY_TYPES = (5126,), (5126, 5120, 5121, 5122, 5123)  # component types of key times; of key values

DRACO = "KHR_draco_mesh_compression"
COMPRESSIONS = {DRACO: "Draco", "EXT_meshopt_compression": "meshopt"}
HUMANOIDS = ("VRMC_vrm", "VRMC_vrm_animation", "VRM")  # extensions of VRM 1.0, VRM animations, and VRM 0
VRM_0_THUMBS = {"ThumbProximal": "ThumbMetacarpal", "ThumbIntermediate": "ThumbProximal"}  # VRM 1.0's names by VRM 0's
Triangles = NDArray[np.intp]
TRIANGLES, STRIP, FAN = 4, 5, 6  # modes of primitives; the others are points and lines
JOINT_TYPES = (5121, 5123)  # component types of joint indices
FACE_LEFT_OUT = "the animation moves morph targets or expressions, such as those of a face; they are left out"
VRM_0 = {"joy": "happy", "sorrow": "sad", "fun": "relaxed", "a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh"}
VRM_0 |= {"blink_l": "blinkLeft", "blink_r": "blinkRight"}  # VRM 1.0's name of an expression by VRM 0's
PERCENT = 0.01  # weights of VRM 0 go up to 100


def gltf_scene(gltf: Gltf, clip: str | None = None, fps: float | None = None, animated: bool = True) -> CharacterScene:
    """Return the character in a glTF file, and if `animated` the animation named `clip`, or the only one, sampled at
    `fps` frames/s or at its own keys. A FileError or SkeletonFileError if the file is invalid or lacks the animation.
    """
    nodes, names = gltf_nodes(gltf), animation_names(gltf)
    chosen = choose_animation(gltf.path, names, clip) if animated else None
    animation = None if chosen is None else _animation(gltf, chosen, names[chosen], fps)
    skins, (kind, humanoid) = _skins(gltf), _humanoid(gltf)
    used = [] if animated else [node.text() for node in gltf.document.listed("extensionsUsed")]
    notes = [
        f"its mesh is compressed by {name}: it stays as it is in the result, but its skin is not read"
        for extension, name in COMPRESSIONS.items()
        if extension in used
    ]
    if chosen is not None and moves_face(gltf, chosen):
        notes.append(FACE_LEFT_OUT)
    return CharacterScene(
        gltf.path, nodes, skins, humanoid, names, animation, faces_negative_z=kind == "VRM", notes=tuple(notes)
    )


def animation_names(gltf: Gltf) -> tuple[str, ...]:
    """Return the names of the animations in a file; they may be empty or the same."""
    return tuple(entry.entries().read("name", Node.text, "") for entry in gltf.entries("animations"))


def gltf_nodes(gltf: Gltf) -> Nodes:
    """Return the nodes of a file; a SkeletonFileError if they are not valid."""
    entries = gltf.entries("nodes")
    names, children = [], []
    translations, rotations, scales = (np.empty((len(entries), len(rest))) for rest in REST.values())
    for number, entry in enumerate(entries):
        fields = entry.entries()
        translations[number], rotations[number], scales[number] = _transform(fields)
        names.append(fields.read("name", Node.text, ""))
        children.append([gltf.index("nodes", child) for child in fields.listed("children")])
    return Nodes(tuple(names), _parents(gltf, children), translations, rotations, scales)


def _parents(gltf: Gltf, children: list[list[int]]) -> NDArray[np.intp]:
    parents = np.full(len(children), -1)
    for number, below in enumerate(children):
        for place, child in enumerate(below):
            if parents[child] >= 0:
                node = gltf.entries("nodes")[number].entries().listed("children")[place]
                node.fail(f"nodes[{child}] is a child of nodes[{parents[child]}] already")
            parents[child] = number
    ancestors = parents.copy()  # pointer jumping: each step doubles the distance to a node's ancestor
    for _ in range(len(parents).bit_length() + 1):
        ancestors = np.where(ancestors >= 0, ancestors[ancestors], -1)
    if (cyclic := ancestors[ancestors >= 0]).size:
        raise SkeletonFileError(gltf.path, f"nodes[{cyclic.min()}].children", "lead back to the node itself")
    return parents


def _transform(fields: Fields) -> tuple[ArrayLike, ArrayLike, ArrayLike]:
    """Translation, rotation and scale of a node, from these properties or from its matrix."""
    if "matrix" in fields:
        matrix = np.array(fields["matrix"].numbers(16)).reshape(4, 4).T
        translation, rotation, scale = decomposed(matrix)
        if not ((np.abs(scale) >= SMALLEST) & (np.abs(scale) <= LARGEST)).all():
            fields["matrix"].fail(f"has an axis of length 0, or longer than {LARGEST:g}")
        _check_decomposed(fields, matrix, matrix[:3, :3] / scale)
        return translation, rotation, scale
    shift, turn, size = (fields[key].numbers(len(rest)) if key in fields else rest for key, rest in REST.items())
    length = math.hypot(*turn)
    if not length >= SMALLEST:
        fields.node.fail("has a rotation of length 0")
    return shift, [number / length for number in turn], size


def _check_decomposed(fields: Fields, matrix: Array, axes: Array) -> None:
    """Fail unless a matrix, (4, 4), is translation, rotation and scale; `axes` are the directions of its columns."""
    name, found = cut(fields.read("name", Node.text, "")), ""
    cosine = max((axes[:, a] @ axes[:, b] for a, b in combinations(range(3), 2)), key=abs)
    if not np.allclose(matrix[3], [0.0, 0.0, 0.0, 1.0], rtol=0.0, atol=SHEAR):
        found = f"gives {name!r} the last row {' '.join(f'{number:g}' for number in matrix[3])}, not 0 0 0 1"
    elif abs(cosine) > SHEAR:
        found = f"shears {name!r}: two of its axes are {np.degrees(np.arccos(cosine)):.1f} degrees apart, not 90"
    if found:
        fields["matrix"].fail(f"{found}; apply the node's transform in the program that exported it")


def decomposed(matrix: Array) -> tuple[Array, Array, Array]:
    """Translation, rotation (x y z w) and scale of a transform, (4, 4); the scale of a mirroring one is negative."""
    linear = matrix[:3, :3]
    scale = np.linalg.norm(linear, axis=0) * (-1.0 if np.linalg.det(linear) < 0 else 1.0)
    axes = linear / np.where(scale, scale, 1.0)
    return matrix[:3, 3], Rotation.from_matrix(nearest_rotations(axes[None])[0]).as_quat(), scale


def _skins(gltf: Gltf) -> tuple[SkinBinding, ...]:
    """The skins, each with the nodes whose mesh it moves; skins may share inverse bind matrices."""
    users: dict[int, list[int]] = defaultdict(list)
    for number, entry in enumerate(gltf.entries("nodes")):
        if "skin" in (fields := entry.entries()):
            users[gltf.index("skins", fields["skin"])].append(number)
    skins, binds = list[SkinBinding](), dict[int, Array]()
    for number, entry in enumerate(gltf.entries("skins")):
        fields = entry.entries()
        joints, matrices = np.array([gltf.index("nodes", node) for node in fields.listed("joints")]), None
        if not len(joints):
            entry.fail("has no joints")
        if "inverseBindMatrices" in fields:
            accessor = gltf.index("accessors", fields["inverseBindMatrices"])
            if accessor not in binds:
                numbers = gltf.numbers(fields["inverseBindMatrices"], "MAT4", FLOATS)
                binds[accessor] = numbers.reshape(-1, 4, 4).transpose(0, 2, 1).copy()
                binds[accessor][:, 3] = 0.0, 0.0, 0.0, 1.0  # as the specification demands
            matrices = binds[accessor][: len(joints)]
            if len(matrices) < len(joints):
                fields["inverseBindMatrices"].fail(f"{len(matrices)} matrices for {len(joints)} joints")
        skins.append(SkinBinding(joints, matrices, tuple(users[number])))
    return tuple(skins)


def _humanoid(gltf: Gltf) -> tuple[str, Mapping[str, int]]:
    """The extension with the VRM humanoid, and the nodes of its bones by VRM 1.0's names; both empty without one."""
    extensions = gltf.document.inner("extensions")
    key = next((key for key in HUMANOIDS if key in extensions), "")
    if not key:
        return "", {}
    humanoid, found = extensions[key].entries().inner("humanoid"), dict[str, int]()
    if key != "VRM":
        for bone, each in humanoid.inner("humanBones").items():
            found[bone] = gltf.index("nodes", each.entries().need("node"))
    for entry in humanoid.listed("humanBones") if key == "VRM" else ():
        fields = entry.entries()
        if "bone" not in fields or "node" not in fields:
            entry.fail('expected "bone" and "node"')
        bone = fields["bone"].text()
        thumb = next((new for old, new in VRM_0_THUMBS.items() if bone.endswith(old)), "")
        if fields["node"].value != -1.0:  # some programs write this for bones that the model lacks
            found[f"{bone.partition('Thumb')[0]}{thumb}" if thumb else bone] = gltf.index("nodes", fields["node"])
    if not found:
        extensions[key].fail("has no humanoid bones")
    return key, found


def _animation(gltf: Gltf, number: int, name: str, fps: float | None) -> Animation:
    entry = gltf.entries("animations")[number]
    fields = entry.entries()
    samplers = fields.listed("samplers")
    curves: dict[str, dict[int, Curve]] = {path: {} for path in KINDS}
    for channel in fields.listed("channels"):
        parts = channel.entries()
        target = parts.inner("target")
        path = target.read("path", Node.text, "")
        if path in KINDS and "node" in target:
            node = gltf.index("nodes", target["node"])
            sampler = samplers[parts.need("sampler").index(len(samplers) - 1, "samplers")]
            curves[path][node] = read_curve(gltf, sampler.entries(), KINDS[path])
    return sampled(gltf.path, name, curves, fps, most=gltf.size)


def moves_face(gltf: Gltf, number: int) -> bool:
    """Return whether an animation has keys for morph targets, or for a VRM animation's expression nodes."""
    nodes = nodes_of_expressions(gltf)
    channels = gltf.entries("animations")[number].entries().listed("channels")
    targets = [channel.entries().inner("target") for channel in channels]
    paths = {target.read("path", Node.text, "") for target in targets}
    return "weights" in paths or any(gltf.index("nodes", one["node"]) in nodes for one in targets if "node" in one)


def nodes_of_expressions(gltf: Gltf) -> Mapping[int, str]:
    """Return the names of a VRM animation's expressions by node; the X of the node's translation is the weight."""
    named = named_expressions(gltf, "VRMC_vrm_animation")
    return {gltf.index("nodes", each["node"]): name for name, each in named if "node" in each}


def named_expressions(gltf: Gltf, extension: str) -> Iterator[tuple[str, Fields]]:
    """Yield the preset and custom expressions of an extension of VRM 1.0, with their names."""
    expressions = gltf.document.inner("extensions").inner(extension).inner("expressions")
    for group in ("preset", "custom"):
        yield from ((name, each.entries()) for name, each in expressions.inner(group).items())


def read_curve(gltf: Gltf, fields: Fields, kind: str, width: int = 1) -> Curve:
    """Return a sampler's curve, with keys of a kind, of "SCALAR" `width` each; a SkeletonFileError if it is invalid."""
    times = gltf.numbers(fields.need("input"), "SCALAR", FLOATS)
    keys = gltf.numbers(fields.need("output"), kind, KEY_TYPES)
    interpolation = fields.read("interpolation", lambda node: node.one_of(("LINEAR", "STEP", "CUBICSPLINE")), "LINEAR")
    each = 3 if interpolation == "CUBICSPLINE" else 1
    count = each * (width if kind == "SCALAR" else 1)
    if not len(times) or len(keys) != count * len(times):
        fields["output"].fail(f"{len(keys)} values for {len(times)} keys; expected {count * max(len(times), 1)}")
    if (times[1:] < times[:-1]).any():
        fields["input"].fail("a key is earlier than the one before it")
    if kind == KINDS["rotation"] and not (np.linalg.norm(keys[each // 2 :: each], axis=1) >= SMALLEST).all():
        fields["output"].fail("has a rotation of length 0")
    return Curve(times, keys.reshape(len(times), each, -1), interpolation)


def gltf_parts(gltf: Gltf, skins: tuple[SkinBinding, ...]) -> Iterator[MeshPart]:
    """Yield the meshes at nodes, without morph targets; primitives with the same vertices are one part."""
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
    """The part made of primitives with the same vertices, moved by `skin`, or without one by `node`."""
    for primitive in primitives:
        if DRACO in primitive.inner("extensions"):
            raise FileError(gltf.path, f"{primitive.node.place} is compressed by Draco")
    attributes = primitives[0]["attributes"].entries()
    vertices = gltf.numbers(attributes["POSITION"], "VEC3")
    count, bones, to_bones = len(vertices), np.array([node]), None
    joints, weights = np.zeros((count, 1), np.intp), np.ones((count, 1))
    if skin:
        bones, to_bones = skin.joints, skin.inverse_binds
        joints, weights = _influences(gltf, primitives[0].node, attributes, count, len(bones))
    if to_bones is None:
        to_bones = np.tile(np.eye(4), (len(bones), 1, 1))
    triangles = [_triangles(gltf, primitive, count) for primitive in primitives]
    materials = [gltf.index("materials", each["material"]) if "material" in each else -1 for each in primitives]
    of_triangle = np.repeat(materials, [len(some) for some in triangles])
    uv = np.zeros((0, 2))
    if "TEXCOORD_0" in attributes and gltf.entries("images"):
        with suppress(DistretargetError):
            uv = gltf.numbers(attributes["TEXCOORD_0"], "VEC2")
    uv = uv if len(uv) == count else np.zeros((count, 2))
    return MeshPart(vertices, bones, to_bones, joints, weights, np.concatenate(triangles), of_triangle, uv)


def _influences(
    gltf: Gltf, place: Node, attributes: Fields, vertices: int, bones: int
) -> tuple[NDArray[np.intp], Array]:
    """The bones with the largest weights on each vertex, and these weights, (vertices, influences) each."""
    joints, weights = [], []
    for number in count():
        names = f"JOINTS_{number}", f"WEIGHTS_{number}"
        if not all(name in attributes for name in names):
            break
        joints.append(gltf.numbers(attributes[names[0]], "VEC4", JOINT_TYPES).astype(np.intp))
        weights.append(gltf.numbers(attributes[names[1]], "VEC4"))
        if not len(joints[-1]) == len(weights[-1]) == vertices:
            place.fail(f"has {len(joints[-1])} joints and {len(weights[-1])} weights for {vertices} vertices")
    if not joints:
        place.fail("has a skin, but no joints and weights")
    influences, shares = np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)
    if influences.shape[1] > INFLUENCES:
        most = np.argsort(-shares, axis=1, kind="stable")[:, :INFLUENCES]
        influences, shares = np.take_along_axis(influences, most, axis=1), np.take_along_axis(shares, most, axis=1)
    influences[shares == 0.0] = 0
    if influences.max(initial=0) >= bones:
        place.fail(f"has the joint {influences.max()}; its skin has {bones}")
    return influences, shares


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
    """Return the materials of a file; the default material stands for those that cannot be read."""
    materials = [Material()] * len(gltf.entries("materials"))
    for number, place in enumerate(gltf.entries("materials")):
        with suppress(DistretargetError):
            fields = place.entries()
            surface = fields.inner("pbrMetallicRoughness")
            numbers = [each.number() for each in surface.listed("baseColorFactor")]
            materials[number] = Material(
                colour=(*numbers, *(1.0, 1.0, 1.0, 1.0)[len(numbers) :])[:4],
                image=_image(gltf, surface, "baseColorTexture"),
                normal_map=_image(gltf, fields, "normalTexture"),
                mode=fields.read("alphaMode", Node.text, "OPAQUE"),
                cutoff=fields.read("alphaCutoff", Node.number, 0.5),
                two_sided=fields.read("doubleSided", Node.flag, False),
            )
    return tuple(materials)


def _image(gltf: Gltf, fields: Fields, key: str) -> bytes:
    """The content of a texture's image; empty if there is none."""
    if key not in fields:
        return b""
    source = gltf.entry("textures", fields[key].entries().need("index"))
    return bytes(gltf.image(source["source"])) if "source" in source else b""


class MorphTarget(NamedTuple):
    """A morph target of a node's mesh, and its weight while the expression is 1."""

    node: int
    number: int  # its index in the mesh
    weight: float


@dataclass(frozen=True, eq=False)
class Face:
    """The expressions that a character can have."""

    targets: Mapping[str, tuple[MorphTarget, ...]]  # by name in lower case
    rest_weights: Mapping[int, Array]  # by node, without an animation, (targets,)

    def weights(self, expressions: Mapping[str, Array]) -> Mapping[int, Array]:
        """Return morph target weights by node, (frames, targets), for weights of expressions by name, (frames,)."""
        result: dict[int, Array] = {}
        written = set()
        for name, values in expressions.items():
            for node, target, weight in self.targets.get(name.casefold(), ()):
                keys = result.setdefault(node, np.tile(self.rest_weights[node], (len(values), 1)))
                keys[:, target] = weight * values + (keys[:, target] if (node, target) in written else 0.0)
                written.add((node, target))
        return result


def face_of(gltf: Gltf) -> Face:
    """Return the expressions that the character of a file can have, without invalid ones."""
    targets: dict[str, list[MorphTarget]] = defaultdict(list)
    rest_weights, nodes_of_mesh = {}, defaultdict(list)
    for node, fields in enumerate(map(Node.entries, gltf.entries("nodes"))):
        if "mesh" not in fields:
            continue
        with suppress(DistretargetError):
            number, mesh = gltf.index("meshes", fields["mesh"]), gltf.entry("meshes", fields["mesh"])
            count = max((len(each.entries().listed("targets")) for each in mesh.listed("primitives")), default=0)
            weights = fields if "weights" in fields else mesh
            rest_weights[node] = np.array(weights["weights"].numbers(count) if "weights" in weights else [0.0] * count)
            nodes_of_mesh[number].append(node)
            for index, name in enumerate(_target_names(mesh)[:count]):
                targets[name.casefold()].append(MorphTarget(node, index, 1.0))
    morphs = {*targets}
    with suppress(DistretargetError):
        for name, target in [*_vrm(gltf, nodes_of_mesh)]:
            if name.casefold() not in morphs and target.number < len(rest_weights.get(target.node, ())):
                targets[name.casefold()].append(target)
    return Face({name: tuple(found) for name, found in targets.items()}, rest_weights)


def _target_names(mesh: Fields) -> list[str]:
    """The names of a mesh's morph targets; extras may hold anything."""
    with suppress(DistretargetError):
        return [each.text() for each in mesh.inner("extras").listed("targetNames")]
    return []


def _vrm(gltf: Gltf, nodes_of_mesh: Mapping[int, list[int]]) -> Iterator[tuple[str, MorphTarget]]:
    """Yield the names of a VRM model's expressions, 1.0 or 0, each with the morph targets that it sets."""
    for name, expression in named_expressions(gltf, "VRMC_vrm"):
        for bind in map(Node.entries, expression.listed("morphTargetBinds")):
            node = gltf.index("nodes", bind.need("node"))
            yield name, MorphTarget(node, bind.need("index").whole(), bind.read("weight", Node.number, 1.0))
    groups = gltf.document.inner("extensions").inner("VRM").inner("blendShapeMaster").listed("blendShapeGroups")
    for group in map(Node.entries, groups):
        preset, name = (group.read(key, Node.text, "") for key in ("presetName", "name"))
        name = VRM_0.get(preset, preset) if preset not in ("", "unknown") else name
        for bind in map(Node.entries, group.listed("binds")):
            weight = PERCENT * bind.read("weight", Node.number, 100.0)
            for node in nodes_of_mesh.get(gltf.index("meshes", bind.need("mesh")), ()):
                yield name, MorphTarget(node, bind.need("index").whole(), weight)


def find_expressions(gltf: Gltf, clip: str | None = None) -> Mapping[str, Curve]:
    """Return the weight curves of expressions by name, from the animation `clip`, without invalid and zero ones."""
    number = choose_animation(gltf.path, animation_names(gltf), clip)
    if number is None or not moves_face(gltf, number):
        return {}
    animation, stand_ins = gltf.entries("animations")[number].entries(), nodes_of_expressions(gltf)
    samplers, starts = animation.listed("samplers"), dict[int, float]()
    curves: dict[str, Curve] = {}
    for channel in map(Node.entries, animation.listed("channels")):
        with suppress(DistretargetError):
            target = channel.inner("target")
            path, node = target.need("path").text(), gltf.index("nodes", target.need("node"))
            sampler = samplers[channel.need("sampler").index(len(samplers) - 1, "samplers")].entries()
            if path in KINDS and (times := gltf.index("accessors", sampler.need("input"))) not in starts:
                starts[times] = gltf.numbers(sampler["input"], "SCALAR", FLOATS)[0]
            names = [stand_ins[node]] if path == "translation" and node in stand_ins else []
            if path == "weights":
                names = _target_names(gltf.entry("meshes", gltf.entries("nodes")[node].entries().need("mesh")))
            if names:
                curve = read_curve(gltf, sampler, KINDS.get(path, "SCALAR"), len(names))
                for index, name in enumerate(names):
                    curves.setdefault(name, replace(curve, keys=curve.keys[:, :, [index]]))
    first = min(starts.values(), default=0.0)
    return {name: replace(each, times=each.times - first) for name, each in curves.items() if each.keys.any()}
