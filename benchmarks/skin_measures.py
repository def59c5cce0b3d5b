"""The share of a posed skin inside the body, and the gaps between hands and other parts, measured by libigl.

The gaps between the skins of hand and hand, hand and hips, and hand and head in a source have to be defined, as a BVH
file has no skin. The skin is that of the average adult of anny. Its joints have the rotations of the rotation copy and
the positions of the source joints that drive them, so that wrists and head are where they were captured. The source is
scaled so that its leg and its trunk, from hip joints to shoulders, have together the length of the adult's. Joints of
the trunk, which rigs place differently, lie relative to the middle of the hip joints as in the copy, stretched to the
source's trunk; joints without a counterpart, such as fingers, follow their parents.
"""

from __future__ import annotations

from collections.abc import Sequence

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from skins import Skin, capped

from distretarget import Motion, RetargetResult
from distretarget.numerics.vectors import Array

Numbers = NDArray[np.intp]

PAIRS = (
    ("left hand", "right hand"),
    *((hand, part) for part in ("hips", "head") for hand in ("left hand", "right hand")),
)
NEAR = 1.5  # skins of the source that are closer than this are in contact [% of height]
UPPER_ARMS = ("leftUpperArm", "rightUpperArm")
TRUNK = ("hips", "spine", "chest", "upperChest", "neck")


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
