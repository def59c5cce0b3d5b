"""The skin of a body for measurements: coordinates on its parts; points on them, in patches with bounding balls, which
leave out most pairs that are far apart; the solids that the points may sink into; and a surface with lowest heights.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.body.segments import find_segments
from distretarget.body.soles import Sole
from distretarget.measure.skin_depths import PARTS, Patches, find_depths
from distretarget.measure.solid_depths import Solids
from distretarget.measure.solids import solids_of_capsules, solids_of_mesh, strongest, welded
from distretarget.motion import Motion
from distretarget.numerics.parallel import in_blocks
from distretarget.numerics.vectors import Array, Flags, Numbers, bisected, farthest_points, lengths, level, normalised
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.mesh import SkinnedMesh, outermost

# points of each part at most
MOST = {"hand": 256, "forearm": 128, "upper arm": 48, "thigh": 48, "shin": 32, "foot": 32, "head": 64}
PATCH = 8  # most points of a patch
BLENDED = 1.2  # room in a bounding ball for points that other joints move as well [radii of a patch]
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))  # between neighbouring points of a spiral over a surface [rad]

TRUNK = ("chest", "belly", "pelvis")  # one part: where one ends and the next begins differs between rigs
THINNEST = 0.1  # least distance from the axis to divide by [lengths of the axis]
SHOULDERS = ("leftUpperArm", "rightUpperArm")
# The axis of each part, from the middle of joints to the middle of other joints, by their roles.
BONES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "trunk": (("leftUpperLeg", "rightUpperLeg"), SHOULDERS),
    "head": (SHOULDERS, ("head",)),
}
BONES |= {f"{side} thigh": ((f"{side}UpperLeg",), (f"{side}LowerLeg",)) for side in SIDES}
BONES |= {f"{side} shin": ((f"{side}LowerLeg",), (f"{side}Foot",)) for side in SIDES}
TOUCHED = tuple(BONES)
# (segments,), the part of each segment, an index into `TOUCHED`; -1 for arms, feet and the neck
PART_OF = np.array(
    [TOUCHED.index(part) if (part := "trunk" if name in TRUNK else name) in TOUCHED else -1 for name in SEGMENTS]
)

ALONE = 0.99  # a joint with at least this skin weight moves a vertex alone


@dataclass(frozen=True, eq=False)
class PartFrames:
    """The axes of the parts of a body in its reference pose; nan for parts that the body does not have."""

    joints: Numbers  # (segments,), a joint that moves each segment; 0 for one that the body does not have
    rest: Array  # (segments, 3), the position of that joint in the rest pose [file units]
    reference: Array  # (segments, 3), its position in the reference pose [file units]
    turns: Array  # (segments, 4), its rotation from the rest pose to the reference pose
    starts: Array  # (parts, 3), where each axis begins [file units]
    axes: Array  # (parts, 3, 3), unit vectors along the axis, to the front and to the side, as rows
    lengths: Array  # (parts,), of the axes [file units]

    def coordinates(self, segments: Numbers, points: Array) -> Array:
        """Return where points, (n, 3), of segments, (n,), in the rest pose are on their parts, (n, 3): along the axis
        [its lengths], round it from the front [rad], away from it [its lengths]; nan for no part.
        """
        part = PART_OF[segments]
        if not len(points):
            return np.zeros((0, 3))
        turned = Rotation.from_quat(self.turns[segments]).apply(points - self.rest[segments])
        posed = turned + self.reference[segments]
        along, front, side = np.einsum("nij,nj->in", self.axes[part], posed - self.starts[part]) / self.lengths[part]
        found = np.stack([along, np.arctan2(side, front), np.hypot(front, side)], axis=1)
        return np.where((part >= 0)[:, None], found, np.nan)


def find_part_frames(body: Body) -> PartFrames:
    """Return the axes of the parts of a body."""
    reference, roles, of_joint = body.reference, body.roles, find_segments(body).of_joint
    known = np.isin(np.arange(len(SEGMENTS)), of_joint)
    joints = np.where(known, (of_joint == np.arange(len(SEGMENTS))[:, None]).argmax(axis=1), 0)
    ends = np.full((len(TOUCHED), 2, 3), np.nan)
    for part, bone in enumerate(BONES.values()):
        on = [[roles[role] for role in end if role in roles] for end in bone]
        if all(on):
            ends[part] = [reference.positions[each].mean(axis=0) for each in on]
    head = TOUCHED.index("head")
    ends[head, 0], ends[head, 1] = ends[head, 1], 2.0 * ends[head, 1] - ends[head, 0]  # beyond its joint
    bones = ends[:, 1] - ends[:, 0]
    along = normalised(bones)
    fronts = normalised(np.stack([level(reference.axes[:, 2], axis) for axis in along]))
    axes = np.stack([along, fronts, np.cross(along, fronts)], axis=1)
    return PartFrames(
        joints=joints,
        rest=body.skeleton.rest_positions[joints],
        reference=reference.positions[joints],
        turns=reference.rotations[joints],
        starts=ends[:, 0],
        axes=axes,
        lengths=lengths(bones),
    )


def difference(source: Array, result: Array) -> Array:
    """How far coordinates of a result are from its source's, (n, 3) each, along and round it [half widths], (n,)."""
    thick = np.maximum(result[:, 2], THINNEST)
    angle = np.abs(np.remainder(result[:, 1] - source[:, 1] + np.pi, 2.0 * np.pi) - np.pi)
    return np.asarray(np.hypot((result[:, 0] - source[:, 0]) / thick, angle))


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points of the skin, bound to joints as a mesh is."""

    parts: Numbers  # (points,), an index into `PARTS`
    joints: Numbers  # (points, influences), the joints that move a point, the strongest first
    weights: Array  # (points, influences), their shares, which sum to 1
    offsets: Array  # (points, influences, 3), from each of these joints to the point in the rest pose [file units]
    edges: Numbers  # (edges, 2), edges of the mesh between two points

    def __len__(self) -> int:
        return len(self.parts)

    def __getitem__(self, chosen: Flags | Numbers) -> SkinPoints:
        """Return some of the points, with the edges between them."""
        numbers = np.full(len(self), -1)
        numbers[chosen] = np.arange(len(self.parts[chosen]))
        edges = numbers[self.edges]
        edges = edges[(edges >= 0).all(axis=1)]
        return SkinPoints(self.parts[chosen], self.joints[chosen], self.weights[chosen], self.offsets[chosen], edges)

    def places(self, rest: Array) -> Array:
        """Return where the points are with joints at `rest`, (joints, 3), (points, 3) [file units]."""
        return np.asarray((self.weights[..., None] * (rest[self.joints] + self.offsets)).sum(axis=1))


def points_of_mesh(mesh: SkinnedMesh, skeleton: Skeleton, segments: Numbers) -> SkinPoints:
    """Return the vertices of a mesh on `PARTS`, one at each place; `segments`, (joints,), are those of joints."""
    joints, weights = strongest(mesh)
    triangles, of_vertex = welded(mesh), segments[joints[:, 0]]
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    offsets = mesh.vertices[:, None] - skeleton.rest_positions[joints]
    points = SkinPoints(of_vertex, joints, weights, offsets, edges)
    return points[np.unique(triangles[np.isin(of_vertex[triangles], range(len(PARTS)))])]


def points_of_capsules(capsules: Capsules) -> SkinPoints:
    """Return points spread over the capsules of each part."""
    joints, offsets, parts = [], [], []
    for part in range(len(PARTS)):
        on = np.flatnonzero(capsules.segments == part)
        for capsule in on.tolist():
            points = _spiral(capsules.ends[capsule], capsules.radii[capsule], max(_most(part) // len(on), 4))
            joints += [capsules.joints[capsule]] * len(points)
            parts += [part] * len(points)
            offsets.append(points)
    moved = np.array(joints, np.intp)[:, None]
    places = np.concatenate([np.zeros((0, 3)), *offsets])[:, None]
    return SkinPoints(np.array(parts, np.intp), moved, np.ones(moved.shape), places, np.zeros((0, 2), np.intp))


def _most(part: int) -> int:
    """The number of points of a part, at most."""
    return MOST[PARTS[part].removeprefix("left ").removeprefix("right ")]


def _spiral(ends: Array, radii: Array, count: int) -> Array:
    """Points on a tapered capsule, (count, 3), on a spiral from one tip to the other."""
    (start, end), (first, last) = ends, radii
    length = float(lengths(end - start))
    along = normalised(end - start) if length else np.array([0.0, 1.0, 0.0])
    across = normalised(np.cross(along, np.eye(3)[np.abs(along).argmin()]))
    places = -first + (np.arange(count) + 0.5) / count * (first + length + last)
    angles = GOLDEN_ANGLE * np.arange(count)
    on_axis = np.clip(places, 0.0, length)
    radii = first + (last - first) * (on_axis / length if length else 0.0)
    beyond = places - on_axis
    radii = np.sqrt(np.maximum(radii**2 - beyond**2, 0.0))
    around = np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * np.cross(along, across)
    return np.asarray(start + places[:, None] * along + radii[:, None] * around)


def patches_of(points: SkinPoints, rest: Array) -> Patches:
    """Return points in patches; `rest`, (joints, 3), are the positions of the joints in the rest pose."""
    joints, offsets = points.joints[:, 0], points.offsets[:, 0]
    places = rest[joints] + offsets
    parts, patches, balls = [0], [], []
    order: list[int] = []
    counts = np.zeros(len(points))
    for part in range(len(PARTS)):
        on = np.flatnonzero(points.parts == part)
        chosen = on
        if len(on):
            chosen = on[farthest_points(places[on], _most(part))]
            counts[chosen] = np.bincount(KDTree(places[chosen]).query(places[on])[1], minlength=len(chosen))
        for joint in np.unique(joints[chosen]).tolist():
            for patch in bisected(offsets, chosen[joints[chosen] == joint], PATCH):
                middle = offsets[patch].mean(axis=0)
                patches.append((joint, len(order)))
                balls.append((*middle, BLENDED * lengths(offsets[patch] - middle).max()))
                order.extend(patch.tolist())
        parts.append(len(patches))
    in_patches = np.array(order, np.intp)
    points = points[np.append(in_patches, np.setdiff1d(np.arange(len(points)), in_patches))]
    edges = points.edges[(points.parts[points.edges] == points.parts[points.edges[:, :1]]).all(axis=1)]
    both_ways = np.concatenate([edges, edges[:, ::-1]])  # within a part
    both_ways = both_ways[np.argsort(both_ways[:, 0], kind="stable")]
    return Patches(
        parts=np.array(parts, np.intp),
        patches=np.array([*patches, (-1, len(order))], np.intp),
        balls=np.array(balls).reshape(-1, 4),
        joints=points.joints,
        bound=np.concatenate([points.offsets, points.weights[..., None]], axis=2),
        counts=counts[in_patches],
        first=np.searchsorted(both_ways[:, 0], np.arange(len(points) + 1)),
        neighbours=np.ascontiguousarray(both_ways[:, 1]),
    )


def one_by_one(points: SkinPoints) -> Patches:
    """Return points as patches of one point each, each a part of its own."""
    rows = np.arange(len(points) + 1)
    bound = np.concatenate([points.offsets, points.weights[..., None]], axis=2)
    balls = np.column_stack([points.offsets[:, 0], np.zeros(len(points))])
    patches = np.column_stack([np.append(points.joints[:, 0], -1), rows])
    no_neighbours = np.zeros(len(rows), np.intp), np.zeros(0, np.intp)
    return Patches(rows, patches, balls, points.joints, bound, np.ones(len(points)), *no_neighbours)


OWN_ARM = ("hand", "forearm", "upper arm")
LEG = ("thigh", "shin", "foot")
# Skin folds as a limb bends up to this distance from its top [lengths of the bone].
FOLDS = {"upper arm": ("UpperArm", "LowerArm", 0.45), "thigh": ("UpperLeg", "LowerLeg", 0.35)}


def are_parts(side: str, parts: tuple[str, ...]) -> list[bool]:
    """(segments,), whether each segment is one of `parts`; paired ones only on this side."""
    return [segment in {*parts, *(f"{side} {part}" for part in parts)} for segment in SEGMENTS]


def _can_touch(part: str) -> list[bool]:
    """(segments,), whether a part of the body can touch or sink into each segment; never into its neighbours."""
    side = part.split()[0]
    if part.endswith(OWN_ARM[:2]):
        return [not own for own in are_parts(side, OWN_ARM)]
    if part.endswith("upper arm"):
        return [name in (*TRUNK, "head") or name.endswith(LEG) for name in SEGMENTS]
    if part == "head":
        return [name in TRUNK or name.endswith(LEG) for name in SEGMENTS]
    return are_parts("right" if side == "left" else "left", LEG)


# (parts, segments), the segments that each part can touch
TOUCHABLE = np.array([_can_touch(part) for part in PARTS])


@dataclass(frozen=True, eq=False)
class Skin:
    """The skin of a body: points on its parts, and the solids that they may sink into."""

    patches: Patches  # the points, in the order of parts
    solids: Solids  # the inside of its capsules or of its mesh
    height: float  # of the body [file units]
    can_touch: Flags  # (parts, segments), `TOUCHABLE`, if the body has both
    frames: PartFrames  # for the coordinates of touches
    middles: Array  # (parts, 3), of the points of each, from its joint in `frames` in the rest pose [file units]


def find_skin(body: Body, capsules: Capsules, mesh: SkinnedMesh | None = None) -> Skin:
    """Return the skin of a body, by its mesh, or else by its capsules."""
    if mesh is None:
        return _skin(points_of_capsules(capsules), solids_of_capsules(capsules, body.skeleton), body)
    return _skin(*_of_mesh(mesh, body.skeleton, tuple(find_segments(body).of_joint.tolist())), body)


@lru_cache(maxsize=4)
def _of_mesh(mesh: SkinnedMesh, skeleton: Skeleton, segments: tuple[int, ...]) -> tuple[SkinPoints, Solids]:
    """Points and inside of a mesh, cached for a batch of clips with the same target."""
    of_joint = np.array(segments, np.intp)
    return points_of_mesh(mesh, skeleton, of_joint), solids_of_mesh(mesh, skeleton, of_joint)


def _skin(points: SkinPoints, solids: Solids, body: Body) -> Skin:
    """The skin of these points, without those that are inside in the bind pose or where skin folds."""
    rest, unturned = body.skeleton.rest_positions, body.skeleton.rest_rotations
    reach = np.where(TOUCHABLE[points.parts], 0.0, -np.inf)
    depths = find_depths(one_by_one(points), solids, (rest[None], unturned[None]), reach[None])[0][0]
    points = points[(depths.max(axis=1, initial=0.0) <= 0.0) & ~_folds(points, body)]
    exists = np.isin(np.arange(len(SEGMENTS)), np.append(solids.groups[:-1, 1], solids.segments))
    can_touch = TOUCHABLE & exists & np.isin(np.arange(len(PARTS)), points.parts)[:, None]
    frames, places = find_part_frames(body), points.places(rest)
    middles, counts = np.zeros((len(PARTS), 3)), np.bincount(points.parts, minlength=len(PARTS))
    np.add.at(middles, points.parts, places - rest[frames.joints[points.parts]])
    middles /= np.maximum(counts, 1)[:, None]
    return Skin(patches_of(points, rest), solids, body.height, can_touch, frames, middles)


def _folds(points: SkinPoints, body: Body) -> Flags:
    """(points,), whether each is near the top of an upper arm or thigh, where skin folds as it bends."""
    roles, rest = body.roles, body.skeleton.rest_positions
    places = points.places(rest)
    folds = np.zeros(len(points), bool)
    for side, (part, (top, end, share)) in product(SIDES, FOLDS.items()):
        if roles.keys() >= {side + top, side + end}:
            bone = rest[roles[side + end]] - rest[roles[side + top]]
            near = (places - rest[roles[side + top]]) @ bone < share * (bone @ bone)
            folds |= (points.parts == PARTS.index(f"{side} {part}")) & near
    return folds


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface as balls on the joints of a skeleton; those of a mesh are its vertices and have no radius."""

    centres: SkinnedMesh  # the centres of the balls as vertices, without triangles
    radii: Array  # (balls,) [file units]
    rest: Array  # (joints, 3), the positions of the joints in the rest pose [file units]
    of_mesh: bool
    rigid: Flags  # (balls,), whether each is on a rigid piece of a mesh that has others which bend

    @property
    def without_gear(self) -> Surface:
        """The surface without the rigid pieces on joints that carry other skin as well: wings, a pack, a scabbard."""
        of_skin = self.centres.carriers[~self.rigid]
        on = np.flatnonzero(~(self.rigid & np.isin(self.centres.carriers, of_skin)))
        some = _without_triangles(self.centres, on)
        return replace(self, centres=some, radii=self.radii[on], rigid=self.rigid[on])

    def on(self, joints: Iterable[int]) -> Numbers:
        """The numbers of the balls that some joints carry."""
        return np.flatnonzero(np.isin(self.centres.carriers, [*joints]))

    def lowest(self, motion: Motion, joints: Iterable[int], up: Array) -> Array:
        """(frames,), the height of the lowest point that joints carry, along `up`, (3,) [file units]; else infinite."""
        on = self.on(joints)
        some, radii = _without_triangles(self.centres, on), self.radii[on]
        return in_blocks(
            lambda block: (some.heights(motion[block], up) - radii).min(axis=1, initial=np.inf), len(motion)
        )

    def below_sole(self, sole: Sole) -> float:
        """The thickness of a flat foot below its lowest joint [file units]; 0 for a foot without skin."""
        on = self.on(sole.joints.tolist())
        if not len(on):
            return 0.0
        joints = self.rest[sole.joints] @ sole.normal
        return float(joints.min() - (self.centres.vertices[on] @ sole.normal - self.radii[on]).min())


def _without_triangles(mesh: SkinnedMesh, on: Numbers) -> SkinnedMesh:
    """Some vertices of a mesh."""
    return SkinnedMesh(mesh.vertices[on], mesh.joints[on], mesh.weights[on], mesh.triangles[:0])


def find_surface(skeleton: Skeleton, capsules: Capsules, mesh: SkinnedMesh | None) -> Surface:
    """Return the surface of a body: of its mesh, else of its capsules."""
    return surface_of_capsules(capsules, skeleton) if mesh is None else surface_of_mesh(mesh, skeleton)


@lru_cache(maxsize=4)
def surface_of_mesh(mesh: SkinnedMesh, skeleton: Skeleton) -> Surface:
    """Return the surface of a mesh: the vertices of each joint, and of its rigid pieces, that can be the outermost."""
    rigid = _on_rigid_pieces(mesh)
    kinds = 2 * mesh.carriers + rigid
    groups = [np.flatnonzero(kinds == kind) for kind in np.unique(kinds)]
    on = np.concatenate([group[outermost(mesh.vertices[group])] for group in groups])
    rest, some = skeleton.rest_positions, _without_triangles(mesh, on)
    return Surface(some, np.zeros(len(on)), rest, of_mesh=True, rigid=rigid[on])


def _on_rigid_pieces(mesh: SkinnedMesh) -> Flags:
    """(vertices,), whether each is on a connected piece that one joint moves alone, if there are pieces that bend."""
    bends = np.zeros(mesh.pieces.max(initial=-1) + 1, bool)
    joint_of = np.zeros(len(bends), np.intp)
    joint_of[mesh.pieces] = mesh.carriers
    bends[mesh.pieces[(mesh.carriers != joint_of[mesh.pieces]) | (mesh.weights.max(axis=1) < ALONE)]] = True
    return np.asarray(~bends[mesh.pieces] & bends.any())


def surface_of_capsules(capsules: Capsules, skeleton: Skeleton) -> Surface:
    """Return the surface of capsules: the lowest point of each is that of one of its ends."""
    joints, rest = np.repeat(capsules.joints, 2)[:, None], skeleton.rest_positions
    centres = (capsules.ends + rest[capsules.joints, None]).reshape(-1, 3)
    balls = SkinnedMesh(centres, joints, np.ones(joints.shape), np.zeros((0, 3), np.intp))
    return Surface(balls, capsules.radii.ravel(), rest, of_mesh=False, rigid=np.zeros(len(centres), bool))
