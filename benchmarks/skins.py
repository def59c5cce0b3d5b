"""The skin of a character, read from its file and posed without the package's own code."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from distretarget import Body, Motion, Skeleton
from distretarget.numerics.vectors import Array

sys.path += [str(Path(__file__).resolve().parents[1] / folder) for folder in ("tests", "tools")]
from gltf_player import load, values

Numbers = NDArray[np.intp]

PARTS = ("hips", "chest", "head", "leg", "arm", "left forearm", "right forearm", "left hand", "right hand")
PART_OF_ROLE = {
    **dict.fromkeys(("hips", "spine"), "hips"),
    **dict.fromkeys(("chest", "upperChest", "neck", "Shoulder"), "chest"),
    "head": "head",
    **dict.fromkeys(("UpperLeg", "LowerLeg", "Foot", "Toes"), "leg"),
    "UpperArm": "arm",
    "LowerArm": "forearm",
    "Hand": "hand",
}  # other joints, such as fingers, belong to the part of their ancestor
OFF = 0.01  # tolerance between the joints of skin and skeleton in the bind pose [of the height]


@dataclass(frozen=True, eq=False)
class Skin:
    """The mesh of a character in its bind pose, aligned with the rest pose of its skeleton."""

    skeleton: Skeleton  # the joints that move it
    points: Array  # (points, 3) [file units]
    weights: csr_array  # (points, joints), skin weights
    triangles: Numbers  # (triangles, 3), counter-clockwise from outside
    parts: Numbers  # (points,), the part of the body that each point belongs to, a number of `PARTS`

    @classmethod
    def read(cls, path: Path, skeleton: Skeleton) -> Skin:
        """The skin in a character's file, for its skeleton; a ValueError if its joints are not of the bind pose."""
        document, buffer = load(path)
        pieces = list(_pieces(document, buffer, skeleton))
        starts = np.cumsum([0, *(len(piece.points) for piece in pieces)])
        widest = max(piece.joints.shape[1] for piece in pieces)
        points = np.concatenate([piece.points for piece in pieces])
        wider = [((0, 0), (0, widest - piece.joints.shape[1])) for piece in pieces]
        joints = np.concatenate([np.pad(piece.joints, more) for piece, more in zip(pieces, wider, strict=True)])
        weights = np.concatenate([np.pad(piece.weights, more) for piece, more in zip(pieces, wider, strict=True)])
        triangles = np.concatenate([piece.triangles + start for piece, start in zip(pieces, starts, strict=False)])
        binds = np.concatenate([piece.binds for piece in pieces])
        on = np.concatenate([piece.bound for piece in pieces])
        turn, scale, shift = _similarity(binds, skeleton.rest_positions[on])
        points = scale * turn.apply(points) + shift
        height = np.ptp(points[:, 1])
        off = np.linalg.norm(scale * turn.apply(binds) + shift - skeleton.rest_positions[on], axis=1).max()
        if off > OFF * max(height, np.ptp(skeleton.rest_positions, axis=0).max()):
            raise ValueError(f"{path.name}: its joints are up to {off:.3g} off those of the skeleton")
        kept, of_point = np.unique(
            np.hstack([points.round(7), joints, weights.round(5)]), axis=0, return_index=True, return_inverse=True
        )[1:]
        triangles = of_point.ravel()[triangles]
        whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
        rows = np.repeat(np.arange(len(kept)), joints.shape[1])
        shares = csr_array((weights[kept].ravel(), (rows, joints[kept].ravel())), shape=(len(kept), len(skeleton)))
        parts = parts_of(skeleton)[shares.argmax(axis=1)]
        skin = cls(skeleton, points[kept], shares, triangles[whole], parts)
        return skin if skin.volume > 0 else replace(skin, triangles=skin.triangles[:, ::-1])

    @property
    def volume(self) -> float:
        """The volume of the mesh in the bind pose [file units cubed]; negative if its triangles face inwards."""
        a, b, c = np.moveaxis(self.points[self.triangles] - self.points.mean(axis=0), 1, 0)
        return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6)

    @property
    def height(self) -> float:
        """The extent along Y, the file's up axis, in the bind pose [file units]."""
        return float(np.ptp(self.points[:, 1]))

    def of_parts(self, *parts: str) -> NDArray[np.bool_]:
        """(points,), whether each belongs to one of these parts; the name "hand" means both hands."""
        wanted = [number for number, part in enumerate(PARTS) if part in parts or part.split()[-1] in parts]
        return np.isin(self.parts, wanted)

    def posed(self, positions: Array, rotations: Array) -> Array:
        """The points in a frame by linear blend skinning, (points, 3), from positions and rotations of the joints."""
        matrices = Rotation.from_quat(rotations).as_matrix()
        shifts = positions - np.einsum("jab,jb->ja", matrices, self.skeleton.rest_positions)
        blended = (self.weights @ matrices.reshape(-1, 9)).reshape(-1, 3, 3)
        return np.einsum("pab,pb->pa", blended, self.points) + self.weights @ shifts

    def frames(self, motion: Motion, frames: Numbers) -> Iterator[Array]:
        """The points in some frames of a motion, (points, 3) each; the motion may have further joints."""
        order = [motion.skeleton.names.index(name) for name in self.skeleton.names]
        part = motion[frames]
        turns = part.world_rotations[:, order]
        for positions, rotations in zip(part.positions[:, order], turns, strict=True):
            yield self.posed(positions, rotations)


def parts_of(skeleton: Skeleton) -> Numbers:
    """(joints,), the part of the body that each joint moves, a number of `PARTS`."""
    anatomy = Body.of(skeleton).anatomy
    if anatomy is None:
        raise ValueError("the joints are not recognised as those of a human body")
    own = {}
    for role, joint in anatomy.roles.items():
        side = next((side for side in ("left", "right") if role.startswith(side)), "")
        if part := PART_OF_ROLE.get(role.removeprefix(side)):
            own[joint] = f"{side} {part}" if part in ("forearm", "hand") else part
    lines = map(skeleton.to_root, range(len(skeleton)))
    return np.array([PARTS.index(next((own[up] for up in line if up in own), "hips")) for line in lines])


@dataclass(frozen=True, eq=False)
class _Piece:
    """A primitive: arrays as in `Skin`, in mesh space, and the positions of its skin's joints in mesh space."""

    points: Array
    joints: Numbers
    weights: Array
    triangles: Numbers
    binds: Array  # (bound, 3)
    bound: Numbers  # (bound,), joints of the skeleton


def _pieces(document: dict, buffer: bytes, skeleton: Skeleton) -> Iterator[_Piece]:
    """The skinned primitives of a file that have triangles."""
    nodes = document["nodes"]
    above = {child: number for number, node in enumerate(nodes) for child in node.get("children", ())}
    names = {name: joint for joint, name in enumerate(skeleton.names)}

    def joint_of(node: int | None) -> int:
        """The joint of a node, or of the next one above it that is a joint of the skeleton."""
        while node is not None and nodes[node].get("name") not in names:
            node = above.get(node)
        return 0 if node is None else names[nodes[node]["name"]]

    for node in nodes:
        if "skin" not in node or "mesh" not in node:
            continue
        skin = document["skins"][node["skin"]]
        joints = np.array([joint_of(number) for number in skin["joints"]])
        own = [nodes[number].get("name") in names for number in skin["joints"]]
        binds = np.linalg.inv(values(document, buffer, skin["inverseBindMatrices"]))[:, :3, 3]
        for primitive in document["meshes"][node["mesh"]]["primitives"]:
            given = primitive["attributes"]
            if primitive.get("mode", 4) != 4 or "JOINTS_0" not in given:
                continue
            points = values(document, buffer, given["POSITION"])
            sets = [number for number in range(9) if f"JOINTS_{number}" in given]
            moved = np.hstack([values(document, buffer, given[f"JOINTS_{number}"]) for number in sets]).astype(int)
            weights = np.hstack([values(document, buffer, given[f"WEIGHTS_{number}"]) for number in sets])
            weights /= weights.sum(axis=1, keepdims=True)
            corners = (
                values(document, buffer, primitive["indices"]) if "indices" in primitive else np.arange(len(points))
            )
            triangles = corners.astype(int).reshape(-1, 3)
            yield _Piece(points, joints[moved], weights, triangles, binds[own], joints[own])


def _similarity(places: Array, wanted: Array) -> tuple[Rotation, float, Array]:
    """Turn, scale and shift that bring places onto others with the least sum of squares (Umeyama, 1991)."""
    middle, other = places.mean(axis=0), wanted.mean(axis=0)
    turn, _ = Rotation.align_vectors(wanted - other, places - middle)
    turned = turn.apply(places - middle)
    scale = float((turned * (wanted - other)).sum() / (turned**2).sum())
    return turn, scale, other - scale * turn.apply(middle)


def capped(triangles: Numbers, points: int) -> tuple[Numbers, list[Numbers]]:
    """Close the holes of a mesh: triangles from a new point in each, numbered from `points` on, and holes' points."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    keys = edges[:, 0] * points + edges[:, 1]
    rim = edges[~np.isin(keys, edges[:, 1] * points + edges[:, 0])]
    graph = coo_array((np.ones(len(rim)), (rim[:, 0], rim[:, 1])), shape=(points, points))
    _, hole = connected_components(graph, directed=False)
    found, number = np.unique(hole[rim[:, 0]], return_inverse=True)
    fans = np.column_stack([rim[:, 1], rim[:, 0], points + number])
    return fans, [np.unique(rim[number == n]) for n in range(len(found))]
