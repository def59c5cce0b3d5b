"""The actors of a player: motions and bodies as JSON values with packed arrays.

In a page y is up, the floor is at height 0, and lengths are in units that the page chooses. World rotations are 16-bit
numbers and bones are exact, so that no error adds up along a chain of joints: joints are off by less than 0.1 mm on a
body of 1.7 m. Rows of numbers that change little from frame to frame are stored as differences and compressed.
"""

from __future__ import annotations

import json
import zlib
from base64 import b64encode
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.measure.solids import strongest
from distretarget.motion import Motion
from distretarget.numerics.quaternions import least_rotation
from distretarget.numerics.rotations import continuous
from distretarget.numerics.vectors import Array
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import Looks, Material, SkinnedMesh

Quaternion = tuple[float, ...]
Role = Literal["source", "copy", "result", "other", "prop"]

BUDGET = 8_000_000  # most characters for the rotations of all actors; longer clips are shown with fewer frames
IMAGES = 4_000_000  # most bytes for the images of a character
MEDIA = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp"}  # images by how they begin
FLOOR_FRAMES = 48  # frames from which the height of the floor is found
FLOOR_PERCENTILE = 10.0  # the floor is at this percentile of the lowest heights of the skin in these frames [%]
STICK = 0.009  # radius of bones without skin [body units]
STILL = 1e-7  # joints whose rotations relative to their parents change by less do not turn [quaternions]
HASH = 32  # digits of a hash
ENDS = ("leftHand", "rightHand", "leftFoot", "rightFoot")  # roles of joints whose paths can be shown


@dataclass(frozen=True, eq=False, kw_only=True)
class Actor:
    """A body, or a prop, in motion."""

    name: str  # of the file or the performer
    side: int  # the number of its view
    role: Role  # decides its colour
    motion: Motion
    body: Body | None  # the body in motion; None for a prop
    capsules: Capsules | None  # its surface, if it has no mesh; without either its bones are drawn
    mesh: SkinnedMesh | None
    turn: Rotation  # from the axes of the file to those of the page
    unit: float  # the unit of length of the page [file units]
    floor: float  # the height of the floor, along the axis that points up [file units]


def lowest_skin(motion: Motion, capsules: Capsules | None, mesh: SkinnedMesh | None, up: Array) -> float:
    """Return the height of the floor under a motion, by the lowest points of its skin [file units]."""
    some = motion[np.unique(np.linspace(0, len(motion) - 1, FLOOR_FRAMES).astype(np.intp))]
    if mesh is not None:
        heights = mesh.heights(some, up)
    elif capsules is not None and len(capsules):
        heights = (capsules.posed(some) @ up - capsules.radii).reshape(len(some), -1)
    else:
        heights = some.positions @ up
    return float(np.percentile(heights.min(axis=1), FLOOR_PERCENTILE))


def thinned(actors: Sequence[Actor], budget: int = BUDGET) -> dict[str, Any]:
    """Return the actors of a page as `actors_data`, with as many frames as the budget allows."""
    data, step = actors_data(actors, 1), 1
    while (size := sum(len(actor["rotations"]) for actor in data["actors"])) > budget:
        step *= -(-size // budget)
        data = actors_data(actors, step)
    return data


def actors_data(actors: Sequence[Actor], step: int) -> dict[str, Any]:
    """Return the actors of a page, with one frame in `step`, and their bodies, each once; all have hashes."""
    bodies: list[dict[str, Any]] = []
    known: dict[tuple[int, bytes, bytes, float], int] = {}
    data = []
    for actor in actors:
        skeleton, turn = actor.motion.skeleton, actor.turn.as_quat().tobytes()
        key = id(actor.mesh or actor.capsules or skeleton), skeleton.rest_positions.tobytes(), turn, actor.unit
        if key not in known:
            known[key] = len(bodies)
            bodies.append(_hashed(_body_data(actor)))
        data.append(_hashed({**_actor_data(actor, step), "body": known[key]}))
    return {"actors": data, "bodies": bodies}


def without_known(data: Mapping[str, Any], hashes: Collection[str]) -> dict[str, Any]:
    """Return the data of a player with hashes in place of actors and bodies that it has already."""
    short = {key: [one["hash"] if one["hash"] in hashes else one for one in data[key]] for key in ("actors", "bodies")}
    return {**data, **short}


def _hashed(data: dict[str, Any]) -> dict[str, Any]:
    return {**data, "hash": sha256(json.dumps(data).encode()).hexdigest()[:HASH]}


def _actor_data(actor: Actor, step: int) -> dict[str, Any]:
    motion, skeleton, body, turn = actor.motion[::step], actor.motion.skeleton, actor.body, actor.turn
    path = (_turned(turn, motion.root_positions) - [0.0, actor.floor, 0.0]) / actor.unit
    moving = motion.moving
    roles = body.roles if body else {}
    return {
        "name": actor.name,
        "side": actor.side,
        "role": actor.role,
        "frameTime": motion.frame_time,
        "step": step,
        "names": list(skeleton.keys),
        "parents": skeleton.parents.tolist(),
        "offsets": encoded(_turned(turn, skeleton.offsets) / actor.unit, "<f4"),
        "path": encoded(path, "<f4"),  # (frames, 3), of the root
        **_rotations_data(actor.motion, step, _key(turn)),
        "moving": moving.joints.tolist() if moving else [],
        "translations": encoded(_turned(turn, moving.translations) / actor.unit if moving else [], "<f4"),
        "centre": roles.get("hips", 0) if body is None or body.pelvis_joint is None else body.pelvis_joint,
        "ends": [roles[role] for role in ENDS if role in roles],
    }


@lru_cache(maxsize=4)
def _rotations_data(motion: Motion, step: int, turn: Quaternion) -> dict[str, Any]:
    """The rotations of a motion, turned by a quaternion; cached for other results with the same source and copy."""
    motion, by = motion[::step], Rotation.from_quat(turn)
    turning = np.flatnonzero(np.ptp(motion.rotations, axis=0).max(axis=1) > STILL)
    turning = np.union1d(turning, [0])
    still = np.setdiff1d(np.arange(len(motion.skeleton)), turning)
    world, fixed = motion.world_rotations[:, turning], motion.rotations[0, still]
    numbers = np.rint(32767 * continuous(_turned_axes(by, world))).reshape(len(world), -1).T
    steps = np.diff(numbers, axis=1, prepend=0.0).astype(np.int64).astype(np.int16)  # sums wrap round at 16 bits
    return {
        "turning": turning.tolist(),
        "rotations": encoded(steps, "<i2"),  # (joints x 4, frames), of `turning`, in the world
        "still": still.tolist(),
        "fixed": encoded(_turned_axes(by, fixed), "<f4"),  # (joints, 4), of `still`, relative to their parents
    }


def _body_data(actor: Actor) -> dict[str, Any]:
    """The surface of an actor in its rest pose: its mesh, or tapered capsules for body and bones."""
    rest, unit, turn = actor.motion.skeleton.rest_positions, actor.unit, actor.turn
    bind = encoded(_turned(turn, rest) / unit, "<f4")  # (joints, 3)
    if actor.mesh is not None:
        return {"bind": bind, "mesh": _mesh_data(actor.mesh.whole or actor.mesh, _key(turn), unit)}
    solid = [] if actor.capsules is None else [(actor.capsules.joints, actor.capsules.ends, actor.capsules.radii)]
    bones = _bones(actor, solid[0][0] if solid else np.zeros(0, np.intp))
    joints, ends, radii = (np.concatenate(parts) for parts in zip(*solid, bones, strict=True))
    places = _turned(turn, rest[joints][:, None] + ends) / unit
    return {
        "bind": bind,
        "carriers": joints.tolist(),
        "ends": encoded(places, "<f4"),  # (capsules, 2, 3), in the rest pose
        "radii": encoded(radii / unit, "<f4"),  # (capsules, 2)
    }


def _bones(actor: Actor, covered: NDArray[np.intp]) -> tuple[NDArray[np.intp], Array, Array]:
    """The bones as thin capsules, as in `Capsules`; without those above the hips, and of joints that are `covered`."""
    skeleton, body = actor.motion.rigid_skeleton, actor.body
    others = [*body.above_hips, *body.handles] if body else []
    lower = np.flatnonzero((skeleton.lengths > 0) & (skeleton.parents >= 0) & ~np.isin(skeleton.parents, covered))
    lower = lower[~(np.isin(lower, others) | np.isin(skeleton.parents[lower], others))]
    ends = np.stack([np.zeros((len(lower), 3)), skeleton.offsets[lower]], axis=1)
    return skeleton.parents[lower], ends, np.full((len(lower), 2), STICK * actor.unit)


@lru_cache(maxsize=2)
def _mesh_data(mesh: SkinnedMesh, turn: Quaternion, unit: float) -> dict[str, Any]:
    """The mesh in few bits, with its triangles in the order of its materials; cached for results on the same mesh."""
    vertices = _turned(Rotation.from_quat(turn), mesh.vertices) / unit
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    scale = float((high - low).max() / 65535) or 1.0
    joints, weights = strongest(mesh)
    looks = mesh.looks if mesh.looks and mesh.looks.materials else None
    materials = [*_materials(looks)] if looks else []
    triangles = [mesh.triangles[looks.of_triangle == one["number"]] for one in materials] if looks else [mesh.triangles]
    return {
        "offset": low.tolist(),
        "scale": scale,
        "vertices": encoded(np.rint((vertices - low) / scale), "<u2"),
        "normals": encoded(np.rint(127 * _normals(vertices, mesh.triangles)), "<i1"),
        "joints": encoded(joints, "<u2"),
        "weights": encoded(np.rint(65535 * weights), "<u2"),
        "triangles": encoded(np.concatenate(triangles), "<u4"),
        "materials": materials,
        "uv": encoded(looks.uv, "<f4") if looks and any(one["image"] or one["normal_map"] for one in materials) else "",
    }


def _materials(looks: Looks) -> Iterator[dict[str, Any]]:
    """The materials in use, by the number of their triangles, most first; images only up to `IMAGES` in total."""
    counts = np.bincount(looks.of_triangle + 1, minlength=len(looks.materials) + 1)
    numbers = [number for number in np.argsort(-counts, kind="stable").tolist() if counts[number]]
    materials = [looks.materials[number - 1] if number else Material() for number in numbers]
    addresses = [*_addresses([*(one.image for one in materials), *(one.normal_map for one in materials)])]
    for k, (number, material) in enumerate(zip(numbers, materials, strict=True)):
        yield {
            "number": number - 1,
            "triangles": int(counts[number]),
            "colour": material.colour,
            "image": addresses[k],
            "normal_map": addresses[len(materials) + k],
            "mode": material.mode,
            "cutoff": material.cutoff,
            "two_sided": material.two_sided,
        }


def _addresses(images: Sequence[bytes]) -> Iterator[str]:
    """The data URLs of images; empty for those that no longer fit in `IMAGES`."""
    room = IMAGES
    for image in images:
        kind = next((kind for head, kind in MEDIA.items() if image.startswith(head)), "")
        shown = bool(kind) and len(image) <= room
        room -= shown * len(image)
        yield f"data:{kind};base64,{b64encode(image).decode('ascii')}" if shown else ""


def _normals(vertices: Array, triangles: NDArray[np.intp]) -> Array:
    """(vertices, 3), smooth unit normals; vertices at one place share theirs."""
    _, place = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
    corners = place.reshape(-1)[triangles]
    first, second, third = np.moveaxis(vertices[triangles], 1, 0)
    faces = np.cross(second - first, third - first)
    sums = np.stack([np.bincount(corners.ravel(), np.repeat(faces[:, k], 3), len(vertices)) for k in range(3)], axis=1)
    normals = sums[place.reshape(-1)]
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30))


def to_y_up(up: Array) -> Rotation:
    """The rotation that turns `up`, (3,), to y."""
    return Rotation.from_quat(least_rotation(up[None], np.array([[0.0, 1.0, 0.0]]))[0])


def _key(turn: Rotation) -> Quaternion:
    """A rotation as a key of a cache."""
    return tuple(turn.as_quat().tolist())


def _turned(turn: Rotation, places: Array) -> Array:
    """Places, (..., 3), turned."""
    return np.asarray(places @ turn.as_matrix().T)


def _turned_axes(turn: Rotation, rotations: Array) -> Array:
    """Rotations, (..., 4), with their axes turned."""
    return np.concatenate([_turned(turn, rotations[..., :3]), rotations[..., 3:]], axis=-1)


def encoded(array: Any, dtype: str) -> str:
    """An array for the page: little-endian numbers, as planes of their bytes, compressed, in base64."""
    numbers = np.ascontiguousarray(array, dtype)
    planes = numbers.view(np.uint8).reshape(-1, numbers.itemsize).T
    return b64encode(zlib.compress(planes.tobytes(), 6)).decode("ascii")
