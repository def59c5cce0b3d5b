"""How far hands and forearms sink into a body, and how well the gaps between skins that touch are kept."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.body.segments import find_segments
from distretarget.measure.hanging import hangs
from distretarget.measure.metrics import Track, Tracks
from distretarget.measure.skin_depths import LIMBS, Clusters, Patches, find_depths
from distretarget.measure.skin_places import PLACE_OF
from distretarget.measure.skin_shapes import (
    SkinPoints,
    clusters_of,
    inner_balls,
    patches_of,
    points_of_capsules,
    points_of_mesh,
)
from distretarget.motion import Motion
from distretarget.numerics.parallel import blocks_of, over_blocks
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules, no_capsules
from distretarget.skin.fit import distances
from distretarget.skin.mesh import SkinnedMesh

TOUCHING = 1.0  # skins nearer than this in the source touch [% of height]
GRAZING = 0.1  # points that are less deep than this lie on the skin [% of height]
VISIBLE = 1.0  # in frames with more than this inside, skin is inside [% of the vertices]
OWN_ARM = ("hand", "forearm", "upper arm")
BESIDE_ARM = ("chest", "belly", "pelvis", "thigh", "shin")  # a hanging arm is near these, which is no contact


def _are(limb: str, parts: tuple[str, ...]) -> list[bool]:
    """(segments,), whether each segment is one of these parts; those with sides, on the side of the limb."""
    return [segment in {*parts, *(f"{limb.split()[0]} {part}" for part in parts)} for segment in SEGMENTS]


# (limbs, segments), the parts of the body that a limb can touch, all but its own arm; and those beside its arm.
TOUCHABLE = ~np.array([_are(limb, OWN_ARM) for limb in LIMBS])
BESIDE = np.array([_are(limb, BESIDE_ARM) for limb in LIMBS])
# (limbs,), the hand of each: what a forearm touches in the source, its hand may touch in the result, since the two meet
# at the wrist, which is not at the same place of every mesh.
HAND = np.array([LIMBS.index(f"{limb.split()[0]} hand") for limb in LIMBS])


@dataclass(frozen=True, eq=False)
class Skin:
    """The skin of a body: points on its hands and forearms, and the solid parts that they may sink into."""

    patches: Patches  # the points, in the order of limbs
    clusters: Clusters  # capsules, or many more balls inside a mesh
    height: float  # of the body [file units]
    can_touch: Flags  # (limbs, segments), whether the body has both, and they are no neighbours


def find_skin(body: Body, capsules: Capsules, mesh: SkinnedMesh | None = None) -> Skin:
    """Return the skin of a body, by its mesh, or else by its capsules, without points inside in the bind pose."""
    if mesh is not None:
        return _of_mesh(mesh, body.skeleton, tuple(find_segments(body).of_joint.tolist()), body.height)
    return _skin(points_of_capsules(capsules), capsules, body.skeleton.rest_positions, body.height)


def no_skin() -> Skin:
    """Return the skin of a body whose thickness is not known."""
    return _skin(points_of_capsules(no_capsules()), no_capsules(), np.zeros((0, 3)), 1.0)


@lru_cache(maxsize=4)
def _of_mesh(mesh: SkinnedMesh, skeleton: Skeleton, segments: tuple[int, ...], height: float) -> Skin:
    """The skin of a mesh, cached for a batch of clips with the same target."""
    of_joint = np.array(segments, np.intp)
    points, balls = points_of_mesh(mesh, skeleton, of_joint), inner_balls(mesh, skeleton, of_joint)
    return _skin(points, balls, skeleton.rest_positions, height)


def _skin(points: SkinPoints, solid: Capsules, rest: Array, height: float) -> Skin:
    """The skin without the points inside while the joints are at `rest`, (joints, 3)."""
    outside = np.ones(len(points), bool)
    places, ends = rest[points.joints[:, 0]] + points.offsets[:, 0], rest[solid.joints][:, None] + solid.ends
    for limb in range(len(LIMBS)):
        on, others = points.limbs == limb, TOUCHABLE[limb, solid.segments]
        if on.any() and others.any():
            outside[on] = distances(places[on], ends[others], solid.radii[others])[0] > 0.0
    points = points[outside]
    there = np.zeros(len(SEGMENTS), bool)
    there[solid.segments] = True
    can_touch = TOUCHABLE & there & np.isin(np.arange(len(LIMBS)), points.limbs)[:, None]
    return Skin(patches_of(points), clusters_of(solid), height, can_touch)


@dataclass(frozen=True, eq=False, kw_only=True)
class SkinMeasured:
    """The skin of hands and forearms of a result. Arrays have no frames where its thickness is not known."""

    deepest: Array  # (frames, limbs), how deep each is inside other parts of the body [% of height]
    inside: Array  # (frames,), how much of them is [% of the vertices]
    # (frames, limbs), the mean error of its gaps to what it touches in the source, in proportion to the heights; what
    # overlaps there may just touch; a forearm's gap is the least of forearm and hand [% of height]
    gap_error: Array
    touching: Numbers  # (frames, limbs), the number of parts of the body that it touches there

    @property
    def tracks(self) -> Tracks:
        """The values of the metrics of skin."""
        return {
            "skin_depth": Track(self.deepest, parts=LIMBS),
            "skin_frames": Track(np.where(self.inside > VISIBLE, 100.0, 0.0)),
            "skin_gap": Track(self.gap_error, self.touching > 0, LIMBS),
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class SourceSkin:
    """What touches in a source, which the skin of results is measured against."""

    target: Skin  # the skin of results
    touches: Numbers  # (3, contacts), frame, limb and segment, by frames
    gaps: Array  # (contacts,), how far apart they are, negative where they overlap [% of height]

    def in_result(self, result: Motion) -> SkinMeasured:
        """The skin of a result with the same number of frames."""
        skin = self.target
        frames = len(result) if skin.can_touch.any() else 0
        shape = frames, len(LIMBS)
        deepest, vertices, gaps = np.zeros(shape), np.zeros(frames), np.zeros(len(self.gaps))

        def measure(block: slice) -> None:
            rows = slice(*np.searchsorted(self.touches[0], (block.start, block.stop)))
            frame, limb, segment = self.touches[:, rows] - np.array([[block.start], [0], [0]])
            reach = np.tile(np.where(skin.can_touch, 0.0, -np.inf), (block.stop - block.start, 1, 1))
            there = PLACE_OF[segment][:, None] == PLACE_OF
            for part, either in product(range(len(SEGMENTS)), (limb, HAND[limb])):
                reach[frame[there[:, part]], either[there[:, part]], part] = np.inf
            depths, vertices[block] = _depths(skin, result, block, _of_first(reach))
            deepest[block] = np.maximum(depths, 0.0).max(axis=2)
            of_arm = np.maximum(depths[frame, limb], depths[frame, HAND[limb]])
            gaps[rows] = -np.where(there, of_arm, -np.inf).max(axis=1, initial=-np.inf)

        if frames:
            over_blocks(measure, *result.positions.shape[:2])
        to_percent = 100.0 / skin.height
        cell = self.touches[0] * len(LIMBS) + self.touches[1]
        counts = np.bincount(cell, minlength=frames * len(LIMBS))
        too_far = to_percent * gaps - np.maximum(self.gaps, 0.0)
        too_near = self.gaps - to_percent * gaps
        errors = np.bincount(cell, np.maximum(np.maximum(too_far, too_near), 0.0), minlength=frames * len(LIMBS))
        return SkinMeasured(
            deepest=to_percent * deepest,
            inside=100.0 * vertices / max(skin.patches.counts.sum(), 1.0),
            gap_error=(errors / np.maximum(counts, 1)).reshape(shape),
            touching=counts.reshape(shape),
        )


def find_source_skin(source: Motion, body: Body, up: Array, skin: Skin, target: Skin) -> SourceSkin:
    """Find what touches in a source; `skin` is that of its `body`, `up`, (3,), the unit vector up."""
    found = [np.zeros((3, 0), np.intp)], [np.zeros(0)]
    both = skin.can_touch & target.can_touch
    if both.any():
        hanging = _hanging(source, body, up)
        reach = np.where(skin.can_touch, TOUCHING / 100.0 * skin.height, -np.inf)[None]
        for block in blocks_of(len(source)):
            depths, _ = _depths(skin, source, block, reach)
            touching = (depths > -reach) & both & ~(hanging[block, :, None] & BESIDE)
            for place in np.unique(PLACE_OF):  # where a limb touches several parts of one place, the nearest counts
                on = np.flatnonzero(place == PLACE_OF)
                some = np.where(touching[:, :, on], depths[:, :, on], -np.inf)
                touching[:, :, on] &= some == some.max(axis=2, keepdims=True)
            rows = np.nonzero(touching)
            found[0].append(np.stack([rows[0] + block.start, *rows[1:]]))
            frame, limb, segment = rows
            of_arm = np.maximum(depths[rows], depths[frame, HAND[limb], segment])
            found[1].append(-100.0 / skin.height * of_arm)
    return SourceSkin(target=target, touches=np.concatenate(found[0], axis=1), gaps=np.concatenate(found[1]))


def _depths(skin: Skin, motion: Motion, frames: slice, reach: Array) -> tuple[Array, Array]:
    """`find_depths`, where two limbs meet those of the first of the two."""
    posed = motion.positions[frames], motion.world_rotations_in(frames)
    depths, inside = find_depths(skin.patches, skin.clusters, posed, reach, GRAZING / 100.0 * skin.height)
    return _of_first(depths), inside


def _of_first(of_limbs: Array) -> Array:
    """Values of limbs and segments, (frames, limbs, segments), those of two limbs being the larger of both ways."""
    between = of_limbs[:, :, : len(LIMBS)]  # the first segments are the limbs
    between[:] = np.maximum(between, between.transpose(0, 2, 1))
    return of_limbs


def _hanging(motion: Motion, body: Body, up: Array) -> Flags:
    """(frames, limbs), whether the arm of each limb hangs."""
    hanging, hips = np.zeros((len(motion), len(LIMBS)), bool), [leg.hip for leg in body.legs or ()]
    for side in SIDES:
        hand = body.anatomy.roles.get(f"{side}Hand") if body.anatomy else None
        for arm in body.arms:
            if arm.wrist == hand:
                own = [limb.startswith(side) for limb in LIMBS]
                hanging[:, own] = hangs(motion.positions, arm, hips, up)[:, None]
    return hanging
