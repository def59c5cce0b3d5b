"""The process that reads an FBX file with ufbx: bytes on standard input, arrays and a JSON header on standard output.

ufbx is C code on untrusted bytes: if it crashes, only this process does, and `io/fbx.py` reports an error. The Python
binding, ufbx 0.0.5, returns elements (nodes, curves, animations ...) without increasing their reference count, so that
Python would free elements in use; `_held` adds the missing reference. Nothing is ever freed; the process just ends.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import sys
from array import array
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from distretarget.character.animations import choose_animation, frame_count, frame_times, own_rate
from distretarget.errors import FileError
from distretarget.numerics.vectors import Array

if TYPE_CHECKING:
    import ufbx

Element = TypeVar("Element")

TRANSFORMS = frozenset({"Lcl Translation", "Lcl Rotation", "Lcl Scaling"})
FREE_SAMPLES = 1_000_000  # allowed keys, and samples [frames x nodes], of a file of any size; larger ones: one per byte
SAME_KEY = 1e-4  # keys closer than this belong to one frame [s]
SLOWEST, FASTEST = 1.0, 1000.0  # plausible frame rates in a file's settings [frames/s]
PROBES = 16  # keys of a curve that are compared with another curve's
FREE_MEMORY, MEMORY_PER_BYTE = 1 << 30, 40  # memory limit: for any file, and per byte of it [bytes]

_increase = ctypes.pythonapi.Py_IncRef
_increase.argtypes, _increase.restype = [ctypes.py_object], None


def main() -> None:
    """Read the file's bytes from standard input and write an npz to standard output: see `_content`."""
    gc.disable()  # it would meet elements with wrong reference counts
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # other output goes to standard error
    data = sys.stdin.buffer.read()
    _limit_memory(len(data))
    try:
        content = _content(data, **json.loads(sys.argv[1]))
    except FileError as error:
        content = {"fault": error.reason}
    except MemoryError:
        content = {"fault": "needs more memory than a file of its size should"}
    arrays = {name: value for name, value in content.items() if isinstance(value, np.ndarray)}
    header = json.dumps({name: value for name, value in content.items() if name not in arrays})
    np.savez(output, allow_pickle=False, header=np.frombuffer(header.encode(), np.uint8), **arrays)
    output.flush()
    os._exit(0)  # without freeing what ufbx holds


def _limit_memory(size: int) -> None:
    """Limit the memory of this process and disable core files, if the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for limit, wanted in ((resource.RLIMIT_AS, FREE_MEMORY + MEMORY_PER_BYTE * size), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(limit)[1]
        if hard != resource.RLIM_INFINITY:
            wanted = min(wanted, hard)
        try:
            resource.setrlimit(limit, (wanted, hard))
        except (OSError, ValueError):  # macOS refuses some limits
            continue


def _content(
    data: bytes,
    clip: str | None = None,
    fps: float | None = None,
    with_animation: bool = False,
    with_mesh: bool = False,
    with_looks: bool = False,
) -> dict[str, Any]:
    """The arrays and header values of a file; or a FileError."""
    scene = _load(data, with_mesh, with_looks)
    nodes = list(_each(scene.nodes))[1:]  # without the root that ufbx adds
    stacks = [stack for stack in _each(scene.anim_stacks) if next(_curves(stack), None) is not None]
    names = [stack.name for stack in stacks]
    content = _static(scene, nodes) | {"animations": names}
    chosen = choose_animation("", names, clip) if with_animation else None
    if chosen is not None:
        limit = max(FREE_SAMPLES, len(data))
        content |= {"chosen": chosen} | _sampled(scene, nodes, stacks[chosen], fps, limit)
    if with_mesh:
        content |= _meshes(nodes, with_looks) | _materials(_each(scene.materials) if with_looks else ())
    return content


def _load(data: bytes, with_mesh: bool, with_images: bool) -> ufbx.Scene:
    """Return the scene; helper nodes or scales compensate for scale that is inherited in an unusual way."""
    import ufbx

    try:
        scene = ufbx.load_memory(
            data,
            file_format=ufbx.FileFormat.FBX,
            ignore_geometry=not with_mesh,
            ignore_embedded=not with_images,
            inherit_mode_handling=ufbx.InheritModeHandling.COMPENSATE,
        )
    except ufbx.OutOfMemoryError as error:
        raise MemoryError from error
    except ufbx.UfbxError as error:
        fault = str(error).splitlines()[0].lower()
        raise FileError("", f"is not a valid FBX file: {fault}; export it again") from error
    return _held(scene)


def _held(element: Element) -> Element:
    """Return an element that ufbx has just returned, with the reference that it lacks."""
    if element is not None:
        _increase(element)
    return element


def _each(elements: Any) -> Iterator[Any]:
    return (_held(elements[index]) for index in range(len(elements)))


def _static(scene: ufbx.Scene, nodes: list[ufbx.Node]) -> dict[str, Any]:
    """The nodes, the skins, and the matrices of the bind poses, which an animation does not change."""
    import ufbx

    number = {node.typed_id: index for index, node in enumerate(nodes)}
    parents = (_held(node.parent) for node in nodes)
    skins = [_clusters(skin, number) for skin in _each(scene.skin_deformers)]
    joints = [pair for skin in skins for pair in skin]
    poses = [pose for pose in _each(scene.poses) if pose.is_bind_pose]
    posed = [(_held(bone.bone_node), bone.bone_to_world) for pose in poses for bone in _each_part(pose.bone_poses)]
    found = [(number[node.typed_id], matrix) for node, matrix in posed if node.typed_id in number]
    settings = scene.settings
    return {
        "names": [node.name for node in nodes],
        "unit": settings.unit_meters if settings.props.find_prop("UnitScaleFactor") else None,
        "up": int(settings.axes.up),
        "parents": np.array([number.get(parent.typed_id, -1) if parent else -1 for parent in parents], np.int64),
        "transforms": np.array([_ten(node.local_transform) for node in nodes]).reshape(-1, 10),
        "pivots": np.array([_pivot(node) for node in nodes]).reshape(-1, 3),
        "unapplied": np.array([_unapplied_rotations(node) for node in nodes]).reshape(-1, 2, 3),
        "is_bone": np.array([node.attrib_type == ufbx.ElementType.BONE for node in nodes], bool),
        "joints": np.array([joint for joint, _ in joints], np.int64),
        "binds": _matrices(cluster.bind_to_world for _, cluster in joints),
        "counts": np.array([len(skin) for skin in skins], np.int64),
        "posed": np.array([node for node, _ in found], np.int64),
        "poses": _matrices(matrix for _, matrix in found),
    }


def _clusters(skin: ufbx.SkinDeformer, number: dict[int, int]) -> list[tuple[int, ufbx.SkinCluster]]:
    """The bones of a skin, each with the cluster of vertices that it moves."""
    pairs = [(_held(cluster.bone_node), cluster) for cluster in _each(skin.clusters)]
    return [(number[bone.typed_id], each) for bone, each in pairs if bone is not None and bone.typed_id in number]


def _meshes(nodes: list[ufbx.Node], with_looks: bool) -> dict[str, Any]:
    """The meshes at nodes, their arrays concatenated; "sizes" has their lengths, a row per mesh."""
    number = {node.typed_id: index for index, node in enumerate(nodes)}
    rows = [row for node in nodes if (row := _mesh(node, number, with_looks)) is not None]
    sizes = [[len(row[name]) for name in ("vertices", "triangles", "bones", "influenced")] for row in rows]
    arrays = {name: np.concatenate([row[name] for row in rows]) for name in (rows[0] if rows else ())}
    return arrays | {"sizes": np.array(sizes, np.int64).reshape(-1, 4)}


def _mesh(node: ufbx.Node, number: dict[int, int], with_looks: bool) -> dict[str, NDArray[Any]] | None:
    """The triangulated mesh at a node, by default its only bone; or None. With looks, a vertex per distinct corner."""
    mesh = _held(node.mesh)
    if mesh is None or not len(mesh.vertices):
        return None
    skin = next(_each(mesh.skin_deformers), None)
    if skin is None:
        bones, matrices = [number[node.typed_id]], [node.geometry_to_node]
        vertices, weights = [np.arange(len(mesh.vertices))], [np.ones(len(mesh.vertices))]
    else:
        clusters = [(bone, cluster) for bone, cluster in _clusters(skin, number) if len(cluster.vertices)]
        bones, matrices = [bone for bone, _ in clusters], [cluster.geometry_to_bone for _, cluster in clusters]
        vertices = [_whole(cluster.vertices) for _, cluster in clusters]
        weights = [np.array(memoryview(cluster.weights)) for _, cluster in clusters]
    if not bones:
        return None
    keys, looks = [_whole(mesh.vertex_indices)], []
    for values, size in ((mesh.vertex_normal, 3), (mesh.vertex_uv, 2)):
        exist = with_looks and values.exists and len(values.values) > 0
        keys.append(_whole(values.indices) if exist else np.zeros(len(keys[0]), np.int64))
        looks.append(np.array([list(each) for each in _each_part(values.values)]) if exist else np.zeros((1, size)))
    distinct = keys[0]
    for each in keys[1:]:
        distinct = np.unique(distinct * (each.max(initial=0) + 1) + each, return_inverse=True)[1]
    _, first, of_corner = np.unique(distinct, return_index=True, return_inverse=True)
    of_vertex, of_normal, of_uv = (each[first] for each in keys)
    corners, faces = _corners(mesh)
    own = [_held(material).typed_id for material in _each(node.materials)] if with_looks else []
    of_face = _whole(mesh.face_material) if own else np.zeros(0, np.int64)
    rows, counts = _rows_of(of_vertex, np.concatenate(vertices))
    return {
        "vertices": np.array(memoryview(mesh.vertices)).reshape(-1, 3)[of_vertex],
        "normals": looks[0][of_normal],
        "uv": looks[1][of_uv],
        "triangles": of_corner[corners],
        "materials": np.array(own)[np.minimum(of_face[faces], len(own) - 1)] if len(of_face) else 0 * faces - 1,
        "bones": np.array(bones, np.int64),
        "to_bones": _matrices(matrices),
        "influenced": np.repeat(np.arange(len(of_vertex)), counts),
        "influencing": np.repeat(np.arange(len(bones)), [len(each) for each in vertices])[rows],
        "weights": np.concatenate(weights)[rows],
    }


def _rows_of(wanted: NDArray[np.int64], values: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The indices in `values` of each `wanted` number, concatenated, and how many it has."""
    order = np.argsort(values, kind="stable")
    begins, ends = (np.searchsorted(values[order], wanted, side) for side in ("left", "right"))
    counts = ends - begins
    return order[np.repeat(begins - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())], counts


def _whole(numbers: Any) -> NDArray[np.int64]:
    return np.array(list(numbers), np.int64)


def _materials(materials: Iterable[ufbx.Material]) -> dict[str, Any]:
    """Colours, (materials, 4); the index of each material's image, or -1; the images, and the names of their files."""
    colours, image_of = [], []
    images: list[bytes] = []
    names: list[str] = []
    for material in materials:
        base = material.pbr.base_color if material.pbr.base_color.has_value else material.fbx.diffuse_color
        colour = [*base.value_vec4][:3] if base.has_value else [0.8] * 3
        opacity = material.pbr.opacity
        colours.append([*colour, opacity.value_vec4[0] if opacity.has_value else 1.0])
        texture = _held(base.texture)
        image_of.append(-1 if texture is None else len(names))
        if texture is not None:
            colours[-1][:3] = [1.0] * 3
            images.append(bytes(texture.content))
            names.append(texture.relative_filename or texture.filename)
    return {
        "colours": np.array(colours, float).reshape(-1, 4),
        "image_of": np.array(image_of, np.int64),
        "images": np.frombuffer(b"".join(images), np.uint8),
        "image_sizes": np.array([len(image) for image in images], np.int64),
        "image_names": names,
    }


def _corners(mesh: ufbx.Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The corners of a mesh's triangles, (triangles, 3), and the face of each triangle."""
    faces = np.array([(face.index_begin, face.num_indices) for face in _each_part(mesh.faces)], np.int64).reshape(-1, 2)
    whole = np.flatnonzero(faces[:, 1] > 2)
    begins, counts = faces[whole].T
    first = np.repeat(begins, counts - 2)
    place = np.arange(len(first)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    return np.stack([first, first + place + 1, first + place + 2], axis=1), np.repeat(whole, counts - 2)


def _pivot(node: ufbx.Node) -> Array:
    """The point about which a node turns, in its own space, (3,)."""
    turning, scaling, offset = (_vector(node, name) for name in ("RotationPivot", "ScalingPivot", "ScalingOffset"))
    scale = _vector(node, "Lcl Scaling", 1.0)
    return np.asarray(scaling + (turning - scaling - offset) / np.where(scale == 0.0, 1.0, scale))


def _unapplied_rotations(node: ufbx.Node) -> Array:
    """The pre- and post-rotation of a node if FBX does not apply them but ufbx 0.0.5 does, (2, 3), angles about fixed
    axes x, y, z [degrees]; zeros for most nodes. See https://github.com/ufbx/ufbx/pull/260.
    """
    active, limit_only = node.props.find_prop("RotationActive"), node.props.find_prop("RotationSpaceForLimitOnly")
    if (active is None or active.value_int) and (limit_only is None or not limit_only.value_int):
        return np.zeros((2, 3))
    return np.array([_vector(node, "PreRotation"), _vector(node, "PostRotation")])


def _vector(node: ufbx.Node, name: str, default: float = 0.0) -> Array:
    prop = node.props.find_prop(name)
    return np.full(3, default) if prop is None else np.array(prop.value_vec4)[:3]


def _each_part(parts: Any) -> Iterator[Any]:
    """Yield the items of a list of ufbx that are no elements; these have correct reference counts."""
    return (parts[index] for index in range(len(parts)))


def _ten(transform: ufbx.Transform) -> list[float]:
    return [*transform.translation, *transform.rotation, *transform.scale]


def _matrices(matrices: Iterable[Any]) -> Array:
    """Matrices for column vectors, (matrices, 4, 4), from those of ufbx, four columns of three numbers."""
    columns = np.array([[list(column) for column in matrix] for matrix in matrices], float).reshape(-1, 4, 3)
    whole = np.tile(np.eye(4), (len(columns), 1, 1))
    whole[:, :3] = columns.transpose(0, 2, 1)
    return whole


def _curves(stack: ufbx.AnimStack) -> Iterator[tuple[ufbx.Node, ufbx.AnimCurve]]:
    """Yield the curves of an animation that have keys, each with the node that it moves."""
    import ufbx

    for layer in _each(stack.layers):
        for channel in _each_part(layer.anim_props):
            node, value = _held(channel.element), _held(channel.anim_value)
            if isinstance(node, ufbx.Node) and channel.prop_name in TRANSFORMS and value is not None:
                for curve in map(_held, value.curves):
                    if curve is not None and len(curve.keyframes):
                        yield node, curve


def _sampled(
    scene: ufbx.Scene, nodes: list[ufbx.Node], stack: ufbx.AnimStack, fps: float | None, limit: int
) -> dict[str, Any]:
    """The nodes that move, their transforms in "frames", (frames, nodes, 10), and the step [s]; or a FileError."""
    import ufbx

    keys, moving = _keys(stack, limit)
    begin, end = stack.time_begin, stack.time_end
    inside = keys[(keys >= begin - SAME_KEY) & (keys <= end + SAME_KEY)]
    keys = inside if len(inside) > 1 else keys  # the keys in the animation's own time span, if it has several
    stated = scene.settings.frames_per_second
    rate = fps or own_rate(keys, stated if SLOWEST <= stated <= FASTEST else None)
    chosen = []
    for index, node in enumerate(nodes):
        parent = _held(node.parent)  # the scale of another node may move this one
        follows_scale = node.is_scale_helper or (parent is not None and _held(parent.scale_helper) is not None)
        if node.typed_id in moving or follows_scale:
            chosen.append(index)
    frames = frame_count(keys, rate)
    if not frames * len(chosen) <= limit:
        raise FileError("", f"the animation {stack.name!r} would have {frames:.0f} frames; ask for fewer with --fps")
    times = frame_times(keys, rate)
    anim, parts = _held(stack.anim), [nodes[index] for index in chosen]
    samples = np.empty((len(times), len(parts), 10))
    for frame, time in enumerate(times.tolist()):
        row = [_ten(ufbx.evaluate_transform(anim, node, time)) for node in parts]
        samples[frame] = np.reshape(row, (-1, 10))
    return {"moving": np.array(chosen, np.int64), "frames": samples, "step": 1.0 / rate}


def _keys(stack: ufbx.AnimStack, limit: int) -> tuple[Array, set[int]]:
    """Return the times of all keys, sorted [s], and the nodes that move; equal curves are known by `PROBES` keys."""
    times, seen = array("d"), set()
    count, moving = 0, set()
    for node, curve in _curves(stack):
        moving.add(node.typed_id)
        keys = curve.keyframes
        count += len(keys)
        if count > limit:
            raise FileError("", f"the animation {stack.name!r} has more than {limit} keys; export it with fewer")
        probes = np.linspace(0, len(keys) - 1, PROBES).astype(int).tolist()
        signature = (len(keys), *(keys[probe].time for probe in probes))
        if signature not in seen:
            seen.add(signature)
            times.extend(keys[index].time for index in range(len(keys)))
    sorted_times: Array = np.unique(np.array(times))
    return sorted_times[np.diff(sorted_times, prepend=-np.inf) > SAME_KEY], moving
