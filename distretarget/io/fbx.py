"""Read FBX files with ufbx in a separate process: nodes, skins and an animation, in the file's own axes and units."""

from __future__ import annotations

import importlib.util
import io
import json
import math
import os
import signal
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.character.mesh import MeshPart
from distretarget.character.nodes import INFLUENCES, Animation, CharacterScene, Nodes, SkinBinding
from distretarget.errors import FileError, MissingPackageError
from distretarget.numerics.vectors import Array
from distretarget.skeleton import LARGEST, METRES, SMALLEST
from distretarget.skin.mesh import Material

Content = TypeVar("Content")
Read = dict[str, Any]

UP = ("X", "-X", "Y", "-Y", "Z", "-Z")  # in the order of ufbx
ROOT = Path(__file__).resolve().parents[2]
COMMAND = (
    sys.executable,
    "-P",  # do not import modules from the current folder
    "-c",
    f"import sys; sys.path.insert(0, {str(ROOT)!r}); from distretarget.io.fbx_process import main; main()",
)
SECONDS, SECONDS_PER_BYTE = 120.0, 2e-6  # time limit of the process: for any file, and per byte [s]
ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "MKL", "OMP")}  # each thread takes memory
ADVICE = "open the file in Blender and export it as GLB"
EXIT_CODES = {0xC0000005: "access violation", 0xC00000FD: "stack overflow"}  # of Windows
MESH_ARRAYS = (
    ("vertices", "normals", "uv"),  # a row per vertex
    ("triangles", "materials"),  # per triangle
    ("bones", "to_bones"),  # per bone
    ("influenced", "influencing", "weights"),  # per influence of a bone on a vertex
)
SINGULAR = 1e-12  # a bind matrix with a smaller determinant, its axes being of length 1, has no inverse


def parse_fbx(
    content: bytes, path: str | Path, clip: str | None = None, fps: float | None = None, with_animation: bool = True
) -> CharacterScene:
    """Return the nodes of an FBX file, its skins, or its bind pose if it has none, and unless `with_animation` is false
    the animation named `clip` (`choose_animation`), at its keys if these are evenly spaced, else at the file's frame
    rate, or at `fps`. Transforms are as FBX evaluates them, at the pivots of nodes. A MissingPackageError without the
    package ufbx, a FileError if the file is invalid, its reader stopped, or has no such animation.
    """
    return _parsed(content, path, {"clip": clip, "fps": fps, "with_animation": with_animation}, _scene)


def fbx_mesh(
    content: bytes, path: str | Path, with_looks: bool = False
) -> tuple[Nodes, list[MeshPart], tuple[Material, ...], tuple[str, ...]]:
    """Return the nodes of an FBX file, their meshes, and with looks materials and image files; errors as before."""
    return _parsed(content, path, {"with_mesh": True, "with_looks": with_looks}, _mesh)


def _parsed(
    content: bytes, path: str | Path, request: Mapping[str, Any], convert: Callable[[str | Path, Read], Content]
) -> Content:
    """`convert` of the arrays that the process returns for a request."""
    if importlib.util.find_spec("ufbx") is None:
        raise MissingPackageError("reading FBX needs the package ufbx; pip install 'distretarget[fbx]'", path)
    arrays = _read(content, path, request)
    try:
        return convert(path, arrays)
    except (ValueError, KeyError, IndexError, TypeError, OverflowError) as error:
        raise FileError(path, f"the FBX reader returned no valid content; {ADVICE}") from error


def _read(content: bytes, path: str | Path, request: Mapping[str, Any]) -> Read:
    """The arrays and header values that the process returns; see `fbx_process.py`."""
    seconds = SECONDS + SECONDS_PER_BYTE * len(content)
    try:
        done = subprocess.run(
            [*COMMAND, json.dumps(request)],
            input=content,
            capture_output=True,
            timeout=seconds,
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            env=os.environ | ONE_THREAD,
        )
    except subprocess.TimeoutExpired:
        _stopped(path, f"no answer after {seconds:.0f} s")
    except OSError as error:
        _stopped(path, error.strerror or str(error))
    if code := done.returncode:
        last_line = done.stderr.decode(errors="replace").split("\n")[-2:][0].strip()[:200]
        name = (signal.strsignal(-code) or "").lower() if code < 0 else ""
        _stopped(path, name or EXIT_CODES.get(code & 0xFFFFFFFF, last_line or f"exit status {code}"))
    try:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as file:
            arrays: Read = dict(file)
        header: Read = json.loads(arrays.pop("header").tobytes())
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile):
        _stopped(path, "its output is cut short")
    if "fault" in header:
        raise FileError(path, header["fault"])
    return arrays | header


def _stopped(path: str | Path, why: str) -> NoReturn:
    raise FileError(path, f"the FBX reader stopped ({why}); {ADVICE}") from None


def _nodes(path: str | Path, read: Read) -> Nodes:
    names, parents = tuple(read["names"]), read["parents"].astype(np.intp)
    return Nodes(names, parents, *_parts(path, read, read["transforms"], np.arange(len(names))))


def _mesh(path: str | Path, read: Read) -> tuple[Nodes, list[MeshPart], tuple[Material, ...], tuple[str, ...]]:
    """The result of `fbx_mesh`, from the arrays that the process returned."""
    nodes = _nodes(path, read)
    if not len(read["sizes"]):
        return nodes, [], (), ()
    if not all(np.isfinite(read[name]).all() for name in (*MESH_ARRAYS[0], "to_bones", "weights", "colours")):
        raise FileError(path, "has a mesh with numbers that are not finite; export it again")
    read["to_bones"][:, :3, 3] -= read["pivots"][read["bones"]]
    ends = np.cumsum(read["sizes"], axis=0)[:-1].T
    split = {name: np.split(read[name], at) for at, names in zip(ends, MESH_ARRAYS, strict=True) for name in names}
    parts = []
    for row in (dict(zip(split, each, strict=True)) for each in zip(*split.values(), strict=True)):
        joints, weights = influences_of(len(row["vertices"]), *(row.pop(name) for name in MESH_ARRAYS[3]))
        row["normals"] = row["normals"] if row["normals"].any() else None
        parts.append(MeshPart(**row, joints=joints, weights=weights))
    image_of, names = read["image_of"].tolist(), read["image_names"]
    images = [part.tobytes() for part in np.split(read["images"], np.cumsum(read["image_sizes"])[:-1])]
    colours = map(tuple, read["colours"].clip(0.0, 1.0).tolist())
    materials = [
        Material(colour=colour, image=images[n] if n >= 0 else b"") for colour, n in zip(colours, image_of, strict=True)
    ]
    return nodes, parts, tuple(materials), tuple("" if n < 0 or images[n] else names[n] for n in image_of)


def influences_of(
    vertices: int, influenced: NDArray[np.intp], influencing: NDArray[np.intp], weights: Array
) -> tuple[NDArray[np.intp], Array]:
    """Return the bones with the largest weights on each vertex, and these weights, (vertices, influences) each; the
    arguments have an entry for each influence of a bone on a vertex.
    """
    order = np.lexsort([-weights, influenced])
    influenced, influencing, weights = influenced[order], influencing[order], weights[order]
    rank = np.arange(len(influenced)) - np.searchsorted(influenced, influenced)
    chosen = rank < INFLUENCES
    joints = np.zeros((vertices, int(rank[chosen].max(initial=0)) + 1), np.intp)
    of_joints = np.zeros(joints.shape)
    joints[influenced[chosen], rank[chosen]] = influencing[chosen]
    of_joints[influenced[chosen], rank[chosen]] = weights[chosen]
    return joints, of_joints


def _scene(path: str | Path, read: Read) -> CharacterScene:
    nodes, unit = _nodes(path, read), read["unit"]
    units = (name for name, metres in METRES.items() if unit and math.isclose(unit, metres, rel_tol=1e-6))
    return CharacterScene(
        path=path,
        nodes=nodes,
        skins=_skins(nodes, read),
        humanoid={},
        animations=tuple(read["animations"]),
        animation=_animation(path, nodes, read) if "chosen" in read else None,
        units=next(units, None),
        up=dict(enumerate(UP)).get(read["up"]),
    )


def _parts(path: str | Path, read: Read, transforms: Array, numbers: NDArray[np.intp]) -> tuple[Array, Array, Array]:
    """Translations from pivot to pivot, unit quaternions and scales of nodes, from `transforms`, (..., nodes, 10)."""
    pivots, unapplied = read["pivots"], read["unapplied"][numbers]
    parent_pivots = np.vstack([pivots, np.zeros(3)])[read["parents"][numbers]]
    translations, rotations, scales = np.split(transforms, [3, 7], axis=-1)
    if not all((np.abs(part) <= LARGEST).all() for part in (transforms, pivots, unapplied)):
        raise FileError(path, f"has a node at a place, angle or scale that is not finite, or beyond {LARGEST:g}")
    sizes = np.linalg.norm(rotations, axis=-1, keepdims=True)
    if not (sizes > 0.0).all():
        raise FileError(path, "has a node without a rotation; export it again")
    rotations, scaled = rotations / sizes, scales * pivots[numbers]
    if pivots.any():
        turned = Rotation.from_quat(rotations.reshape(-1, 4)).apply(scaled.reshape(-1, 3))
        translations = translations + turned.reshape(translations.shape) - parent_pivots
    for node in np.flatnonzero(unapplied.any(axis=(1, 2))):
        before, after = Rotation.from_euler("xyz", unapplied[node], degrees=True)
        full = Rotation.from_quat(rotations[..., node, :].reshape(-1, 4))
        rotations[..., node, :] = (before.inv() * full * after).as_quat().reshape(rotations[..., node, :].shape)
    return np.asarray(translations), np.asarray(rotations), scales


def _skins(nodes: Nodes, read: Read) -> tuple[SkinBinding, ...]:
    """The skins; without any, one for each tree of bones, with the file's bind pose."""
    ends = np.cumsum(read["counts"])[:-1]
    found = zip(np.split(read["joints"], ends), np.split(read["binds"], ends), strict=True)
    skins = tuple(_skin(joints, binds, read["pivots"]) for joints, binds in found if len(joints))
    if skins:
        return skins
    posed = np.zeros((len(nodes), 4, 4))
    posed[read["posed"][::-1]] = read["poses"][::-1]  # the first pose counts
    is_bone, top = read["is_bone"], np.full(len(nodes) + 1, -1)  # the topmost bone of each tree
    for node, parent in enumerate(nodes.parents.tolist()):
        top[node] = node if is_bone[node] and top[parent] < 0 else top[parent]
    trees = [np.flatnonzero(is_bone & (top[:-1] == highest)) for highest in np.unique(top[:-1][is_bone])]
    return tuple(_skin(bones, posed[bones], read["pivots"]) for bones in trees)


def _skin(joints: NDArray[np.intp], binds: Array, pivots: Array) -> SkinBinding:
    """A skin from its joints and their world matrices in the bind pose, (joints, 4, 4)."""
    joints, first = np.unique(joints.astype(np.intp), return_index=True)
    if not binds.any():
        return SkinBinding(joints, None)
    binds = binds[first]
    binds[:, :3, 3] += (binds[:, :3, :3] @ pivots[joints, :, None])[..., 0]
    return SkinBinding(joints, np.array([_inverse(bind) for bind in binds]))


def _inverse(matrix: Array) -> Array:
    """The inverse of a matrix (4, 4); zeros if it has none."""
    if not (np.abs(matrix) <= LARGEST).all():
        return np.zeros((4, 4))
    sizes = np.linalg.norm(matrix[:3, :3], axis=0)
    regular = (sizes > SMALLEST).all() and abs(np.linalg.det(matrix[:3, :3] / sizes)) > SINGULAR
    return np.asarray(np.linalg.inv(matrix) if regular else np.zeros((4, 4)), np.float64)


def _animation(path: str | Path, nodes: Nodes, read: Read) -> Animation:
    parts = _parts(path, read, read["frames"], read["moving"])
    translations, rotations, scales = (
        {
            node: np.ascontiguousarray(part[:, index])
            for index, node in enumerate(read["moving"].tolist())
            if np.any(part[:, index] != rest[node])
        }
        for part, rest in zip(parts, (nodes.translations, nodes.rotations, nodes.scales), strict=True)
    )
    name, step = read["animations"][read["chosen"]], f"{read['step']:.9g}"
    return Animation(name, len(read["frames"]), step, translations, rotations, scales)
