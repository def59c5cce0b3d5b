"""What a glTF file says of a character: its nodes, skins, VRM humanoid and one of its animations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from distretarget.character.animations import choose_animation
from distretarget.character.nodes import Animation, CharacterScene, Nodes, SkinBinding
from distretarget.character.sampling import Curve, sampled
from distretarget.errors import SkeletonFileError
from distretarget.io.gltf import Gltf
from distretarget.io.json_node import Fields, Node
from distretarget.numerics.rotations import nearest_rotations
from distretarget.numerics.vectors import Array
from distretarget.skeleton import LARGEST, SMALLEST

REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}
KINDS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}  # of the outputs of animations
FLOATS, SIGNED = (5126,), (5126, 5120, 5121, 5122, 5123)  # components of key times; of keys

COMPRESSIONS = {"KHR_draco_mesh_compression": "Draco", "EXT_meshopt_compression": "meshopt"}
# The extensions with a humanoid: of VRM 1.0, VRM animations, and VRM 0.
HUMANOIDS = ("VRMC_vrm", "VRMC_vrm_animation", "VRM")
VRM_0_THUMBS = {"ThumbProximal": "ThumbMetacarpal", "ThumbIntermediate": "ThumbProximal"}  # VRM 1.0's names of them


def gltf_scene(gltf: Gltf, clip: str | None = None, fps: float | None = None, animated: bool = True) -> CharacterScene:
    """Return what a glTF file says of a character, with the animation named `clip`, or the only one, at `fps` frames/s
    or its own keys; without an animation if not `animated`. A FileError or SkeletonFileError if the file is not valid,
    or has no such animation.
    """
    nodes = gltf_nodes(gltf)
    names = animation_names(gltf)
    chosen = choose_animation(gltf.path, names, clip) if animated else None
    animation = None if chosen is None else _animation(gltf, chosen, names[chosen], fps)
    skins, (kind, humanoid) = _skins(gltf), _humanoid(gltf)
    used = [] if animated else [node.text() for node in gltf.document.listed("extensionsUsed")]
    notes = [
        f"its mesh is compressed by {name}: it stays as it is in the result, but its skin is not read"
        for extension, name in COMPRESSIONS.items()
        if extension in used
    ]
    if chosen is not None and _moves_face(gltf, chosen):
        notes.append("the animation moves morph targets or expressions, such as those of a face; they are left out")
    return CharacterScene(
        gltf.path, nodes, skins, humanoid, names, animation, looks_back=kind == "VRM", notes=tuple(notes)
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
    above = parents.copy()  # follow all lines upwards at once; each step doubles their length
    for _ in range(len(parents).bit_length() + 1):
        above = np.where(above >= 0, above[above], -1)
    if (above >= 0).any():  # all of these are in a circle
        raise SkeletonFileError(gltf.path, f"nodes[{above[above >= 0].min()}].children", "lead back to the node itself")
    return parents


def _transform(fields: Fields) -> tuple[ArrayLike, ArrayLike, ArrayLike]:
    """Translation, rotation and scale of a node, from these or its matrix."""
    if "matrix" in fields:
        translation, rotation, scale = decomposed(np.array(fields["matrix"].numbers(16)).reshape(4, 4).T)
        if not ((np.abs(scale) >= SMALLEST) & (np.abs(scale) <= LARGEST)).all():
            fields["matrix"].fail(f"has an axis of length 0, or longer than {LARGEST:g}")
        return translation, rotation, scale
    shift, turn, size = (fields[key].numbers(len(rest)) if key in fields else rest for key, rest in REST.items())
    length = math.hypot(*turn)
    if not length >= SMALLEST:
        fields.node.fail("has a rotation of length 0")
    return shift, [number / length for number in turn], size


def decomposed(matrix: Array) -> tuple[Array, Array, Array]:
    """Translation, rotation (x y z w) and scale of a transform, (4, 4), without its shear; the scale is negative in all
    axes where the transform mirrors.
    """
    linear = matrix[:3, :3]
    scale = np.linalg.norm(linear, axis=0) * (-1.0 if np.linalg.det(linear) < 0 else 1.0)
    axes = linear / np.where(scale, scale, 1.0)
    return matrix[:3, 3], Rotation.from_matrix(nearest_rotations(axes[None])[0]).as_quat(), scale


def _skins(gltf: Gltf) -> tuple[SkinBinding, ...]:
    """The skins, each with the nodes that show a mesh with it."""
    shown: dict[int, list[int]] = {}
    for number, entry in enumerate(gltf.entries("nodes")):
        fields = entry.entries()
        if "skin" in fields:
            shown.setdefault(gltf.index("skins", fields["skin"]), []).append(number)
    binds: dict[int, Array] = {}
    return tuple(_skin(gltf, entry, tuple(shown.get(n, ())), binds) for n, entry in enumerate(gltf.entries("skins")))


def _skin(gltf: Gltf, entry: Node, meshes: tuple[int, ...], binds: dict[int, Array]) -> SkinBinding:
    """A skin; `binds` keeps the inverse bind matrices of each accessor, which skins may share."""
    fields = entry.entries()
    joints = np.array([gltf.index("nodes", node) for node in fields.listed("joints")])
    if not len(joints):
        entry.fail("has no joints")
    if "inverseBindMatrices" not in fields:
        return SkinBinding(joints, None, meshes)
    accessor = gltf.index("accessors", fields["inverseBindMatrices"])
    if accessor not in binds:
        numbers = gltf.numbers(fields["inverseBindMatrices"], "MAT4", FLOATS)
        binds[accessor] = numbers.reshape(-1, 4, 4).transpose(0, 2, 1).copy()
        binds[accessor][:, 3] = 0.0, 0.0, 0.0, 1.0  # as the specification demands
    if len(binds[accessor]) < len(joints):
        fields["inverseBindMatrices"].fail(f"{len(binds[accessor])} matrices for {len(joints)} joints")
    return SkinBinding(joints, binds[accessor][: len(joints)], meshes)


def _humanoid(gltf: Gltf) -> tuple[str, Mapping[str, int]]:
    """The extension with the VRM humanoid, and the node of each bone by VRM 1.0's names of bones; empty without one."""
    extensions = gltf.document.inner("extensions")
    key = next((key for key in HUMANOIDS if key in extensions), "")
    if not key:
        return "", {}
    bones, found = extensions[key].entries().inner("humanoid").get("humanBones"), {}
    if bones and key == "VRM":
        found = dict(_vrm_0(gltf, bones))
    elif bones:
        found = {bone: gltf.index("nodes", each.entries().need("node")) for bone, each in bones.entries().items()}
    if not found:
        extensions[key].fail("has no humanoid bones")
    return key, found


def _vrm_0(gltf: Gltf, bones: Node) -> Iterator[tuple[str, int]]:
    for entry in bones.items():
        fields = entry.entries()
        if "bone" not in fields or "node" not in fields:
            entry.fail('expected "bone" and "node"')
        bone = fields["bone"].text()
        thumb = next((new for old, new in VRM_0_THUMBS.items() if bone.endswith(old)), "")
        side = bone.partition("Thumb")[0]
        if fields["node"].value != -1.0:  # some programs write bones that the model lacks so
            yield f"{side}{thumb}" if thumb else bone, gltf.index("nodes", fields["node"])


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
            curves[path][node] = _curve(gltf, sampler.entries(), path)
    return sampled(gltf.path, name, curves, fps, most=gltf.size)


def _moves_face(gltf: Gltf, number: int) -> bool:
    """Whether an animation has keys of morph targets or of nodes that stand for a VRM animation's expressions."""
    expressions = gltf.document.inner("extensions").inner("VRMC_vrm_animation").inner("expressions")
    each = (one.entries() for group in ("preset", "custom") for one in expressions.inner(group).values())
    nodes = {gltf.index("nodes", one["node"]) for one in each if "node" in one}
    channels = gltf.entries("animations")[number].entries().listed("channels")
    targets = [channel.entries().inner("target") for channel in channels]
    paths = {target.read("path", Node.text, "") for target in targets}
    return "weights" in paths or any(gltf.index("nodes", one["node"]) in nodes for one in targets if "node" in one)


def _curve(gltf: Gltf, fields: Fields, path: str) -> Curve:
    times = gltf.numbers(fields.need("input"), "SCALAR", FLOATS)
    keys = gltf.numbers(fields.need("output"), KINDS[path], SIGNED)
    interpolation = fields.read("interpolation", lambda node: node.one_of(("LINEAR", "STEP", "CUBICSPLINE")), "LINEAR")
    each = 3 if interpolation == "CUBICSPLINE" else 1
    if not len(times) or len(keys) != each * len(times):
        fields["output"].fail(f"{len(keys)} values for {len(times)} keys; expected {each * max(len(times), 1)}")
    if (times[1:] < times[:-1]).any():
        fields["input"].fail("a key is earlier than the one before it")
    if path == "rotation" and not (np.linalg.norm(keys[each // 2 :: each], axis=1) >= SMALLEST).all():
        fields["output"].fail("has a rotation of length 0")
    return Curve(times, keys.reshape(len(times), each, -1), interpolation)
