"""The skin of a body as it is measured: points on its parts, and the solids that they may sink into."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.body.segments import find_segments
from distretarget.measure.part_frames import PartFrames, find_part_frames
from distretarget.measure.skin_depths import PARTS, Patches, find_depths
from distretarget.measure.skin_shapes import SkinPoints, one_by_one, patches_of, points_of_capsules, points_of_mesh
from distretarget.measure.solid_depths import Solids
from distretarget.measure.solids import solids_of_capsules, solids_of_mesh
from distretarget.numerics.vectors import Flags
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.mesh import SkinnedMesh

OWN_ARM = ("hand", "forearm", "upper arm")
LEG = ("thigh", "shin", "foot")
TRUNK = ("chest", "belly", "pelvis")
# What is nearer to the top of a part than this is skin that folds as it bends [lengths of its bone].
FOLDS = {"upper arm": ("UpperArm", "LowerArm", 0.45), "thigh": ("UpperLeg", "LowerLeg", 0.35)}


def are_parts(side: str, parts: tuple[str, ...]) -> list[bool]:
    """(segments,), whether each segment is one of these parts; those with sides, on this side."""
    return [segment in {*parts, *(f"{side} {part}" for part in parts)} for segment in SEGMENTS]


def _can_touch(part: str) -> list[bool]:
    """(segments,), what a part of the body can touch, or sink into, that is no neighbour of it."""
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
    can_touch: Flags  # (parts, segments), whether the body has both, and they are no neighbours
    frames: PartFrames  # in which the places of touches are


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
    """The skin of these points but those that are inside in the bind pose, and those where skin folds."""
    rest, unturned = body.skeleton.rest_positions, body.skeleton.unturned
    reach = np.where(TOUCHABLE[points.parts], 0.0, -np.inf)
    depths = find_depths(one_by_one(points), solids, (rest[None], unturned[None]), reach[None])[0][0]
    points = points[(depths.max(axis=1, initial=0.0) <= 0.0) & ~_folds(points, body)]
    there = np.isin(np.arange(len(SEGMENTS)), np.append(solids.groups[:-1, 1], solids.segments))
    can_touch = TOUCHABLE & there & np.isin(np.arange(len(PARTS)), points.parts)[:, None]
    return Skin(patches_of(points, rest), solids, body.height, can_touch, find_part_frames(body))


def _folds(points: SkinPoints, body: Body) -> Flags:
    """(points,), whether each is near the top of an upper arm or thigh, where skin folds as it bends."""
    roles, rest = body.roles, body.skeleton.rest_positions
    places = (points.weights[..., None] * (rest[points.joints] + points.offsets)).sum(axis=1)
    folds = np.zeros(len(points), bool)
    for side, (part, (top, end, share)) in product(SIDES, FOLDS.items()):
        if roles.keys() >= {side + top, side + end}:
            bone = rest[roles[side + end]] - rest[roles[side + top]]
            near = (places - rest[roles[side + top]]) @ bone < share * (bone @ bone)
            folds |= (points.parts == PARTS.index(f"{side} {part}")) & near
    return folds
