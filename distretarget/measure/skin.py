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
from distretarget.numerics.kinematics import world_rotations
from distretarget.numerics.parallel import blocks_of, mapper_for, over_blocks
from distretarget.numerics.vectors import Array, Flags, Numbers
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import SEGMENTS, Capsules, no_capsules
from distretarget.skin.fit import distances
from distretarget.skin.mesh import SkinnedMesh

TOUCHING = 1.0  # skins nearer than this in the source touch [% of height]
GRAZING = 0.1  # points that are less deep than this lie on the skin [% of height]
RATE = 30.0  # skin is measured about as often [1/s]
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
    seen: Numbers  # (some frames,), those that are measured; each holds up to the next
    touches: Numbers  # (3, contacts), which of these, limb and segment, by frames
    gaps: Array  # (contacts,), how far apart they are, negative where they overlap [% of height]

    def in_result(self, result: Motion) -> SkinMeasured:
        """The skin of a result with the same number of frames."""
        skin = self.target
        frames = len(self.seen) if skin.can_touch.any() else 0
        shape = frames, len(LIMBS)
        deepest, vertices, gaps = np.zeros(shape), np.zeros(frames), np.zeros(len(self.gaps))

        def measure(block: slice) -> None:
            rows = slice(*np.searchsorted(self.touches[0], (block.start, block.stop)))
            frame, limb, segment = self.touches[:, rows] - np.array([[block.start], [0], [0]])
            reach = np.tile(np.where(skin.can_touch, 0.0, -np.inf), (block.stop - block.start, 1, 1))
            there = PLACE_OF[segment][:, None] == PLACE_OF
            for part, either in product(range(len(SEGMENTS)), (limb, HAND[limb])):
                reach[frame[there[:, part]], either[there[:, part]], part] = np.inf
            depths, vertices[block] = _depths(skin, result, self.seen[block], _of_first(reach))
            deepest[block] = np.maximum(depths, 0.0).max(axis=2)
            of_arm = np.maximum(depths[frame, limb], depths[frame, HAND[limb]])
            gaps[rows] = -np.where(there, of_arm, -np.inf).max(axis=1, initial=-np.inf)

        if frames:
            over_blocks(measure, frames, len(skin.patches.counts))
        to_percent = 100.0 / skin.height
        cell = self.touches[0] * len(LIMBS) + self.touches[1]
        counts = np.bincount(cell, minlength=frames * len(LIMBS))
        too_far = to_percent * gaps - np.maximum(self.gaps, 0.0)
        too_near = self.gaps - to_percent * gaps
        errors = np.bincount(cell, np.maximum(np.maximum(too_far, too_near), 0.0), minlength=frames * len(LIMBS))
        last = np.searchsorted(self.seen, np.arange(len(result) if frames else 0), side="right") - 1
        return SkinMeasured(
            deepest=to_percent * deepest[last],
            inside=100.0 * vertices[last] / max(skin.patches.counts.sum(), 1.0),
            gap_error=(errors / np.maximum(counts, 1)).reshape(shape)[last],
            touching=counts.reshape(shape)[last],
        )


def find_source_skin(source: Motion, body: Body, up: Array, skin: Skin, target: Skin) -> SourceSkin:
    """Find what touches in a source; `skin` is that of its `body`, `up`, (3,), the unit vector up. About `RATE` frames
    a second are looked at, and all around the first and the last of each touch.
    """
    both = skin.can_touch & target.can_touch
    seen = _spread(np.arange(len(source)), 1.0 / (RATE * source.frame_time))
    if not both.any():
        return SourceSkin(target=target, seen=seen, touches=np.zeros((3, 0), np.intp), gaps=np.zeros(0))
    hanging = _hanging(source, body, up)
    reach = np.where(skin.can_touch, TOUCHING / 100.0 * skin.height, -np.inf)[None]

    def touch(frames: Numbers) -> tuple[Numbers, Array]:
        depths, _ = _depths(skin, source, frames, reach)
        touching = (depths > -reach) & both & ~(hanging[frames, :, None] & BESIDE)
        for place in np.unique(PLACE_OF):  # where a limb touches several parts of one place, the nearest counts
            on = np.flatnonzero(place == PLACE_OF)
            some = np.where(touching[:, :, on], depths[:, :, on], -np.inf)
            touching[:, :, on] &= some == some.max(axis=2, keepdims=True)
        frame, limb, segment = rows = np.nonzero(touching)
        of_arm = np.maximum(depths[rows], depths[frame, HAND[limb], segment])
        return np.stack([frames[frame], limb, segment]), -100.0 / skin.height * of_arm

    def touches_in(frames: Numbers) -> tuple[Numbers, Array]:
        side_by_side = mapper_for(len(frames), len(skin.patches.counts))
        found = [*side_by_side(touch, [frames[block] for block in blocks_of(len(frames))])]
        return np.concatenate([each for each, _ in found], axis=1), np.concatenate([gaps for _, gaps in found])

    touches, gaps = touches_in(seen)
    if len(between := _around_changes(seen, touches)):
        others, of_others = touches_in(between)
        touches, gaps, seen = np.hstack([touches, others]), np.append(gaps, of_others), np.union1d(seen, between)
        order = np.argsort(touches[0], kind="stable")
        touches, gaps = touches[:, order], gaps[order]
    touches[0] = np.searchsorted(seen, touches[0])
    return SourceSkin(target=target, seen=seen, touches=touches, gaps=gaps)


def _spread(frames: Numbers, step: float) -> Numbers:
    """Every so many of the frames, rounded, and the last."""
    return np.union1d(frames[:: max(round(step), 1)], frames[-1:])


def _around_changes(seen: Numbers, touches: Numbers) -> Numbers:
    """The frames between two of those that were `seen` in which not the same parts touch."""
    touching = np.zeros((len(seen), len(LIMBS), len(SEGMENTS)), bool)
    touching[np.searchsorted(seen, touches[0]), touches[1], touches[2]] = True
    changes = np.flatnonzero((touching[1:] != touching[:-1]).any(axis=(1, 2)))
    spans = [np.arange(seen[change] + 1, seen[change + 1]) for change in changes]
    return np.concatenate([np.zeros(0, np.intp), *spans])


def _depths(skin: Skin, motion: Motion, frames: Numbers, reach: Array) -> tuple[Array, Array]:
    """`find_depths` in some frames, where two limbs meet those of the first of the two."""
    posed = motion.positions[frames], world_rotations(motion.skeleton.parents, motion.rotations[frames])
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
