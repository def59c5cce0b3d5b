"""Undersides: how far the skin reaches below the joints that a body stands, kneels, leans or sits on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple, TypeVar, cast

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.body.segments import find_segments
from distretarget.body.soles import Sole
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.vectors import Array, Numbers, lengths, normalised
from distretarget.rig import rig_cached
from distretarget.skin.capsules import SEGMENTS, Capsules
from distretarget.skin.fit import OFF_SKIN, distances
from distretarget.skin.mesh import SkinnedMesh, outermost

T = TypeVar("T")

AROUND = 1.5  # a joint can rest on skin nearer than this [radii of its capsule there], ...
WHOLE = ("head", "chest", "belly", "pelvis")  # ... on all skin of these segments within `OFF_SKIN` mean radii, ...
BEYOND = 4.0  # ... and the last joint of a finger on skin nearer than this [radii of its capsule there]
# A foot has a heel if the skin behind the ankle reaches deeper than this share of the depth of the sole: 0.86 and more
# with a heel, 0.3 without.
HEEL = 0.5
DIRECTIONS = 60  # the skin about a joint is reduced to its outermost vertices in so many directions


class BoundBalls(NamedTuple):
    """Balls that are skinned to joints with weights w. With joints at x, world rotations R and rest positions r, the
    height of a ball's centre, at p in the rest pose, is the sum over joints of w (x + R (p - r)) . up, which is linear
    in R^T up and x . up.
    """

    joints: list[int]  # the joints that move the balls
    linear: Array  # (4 joints, balls), the factors of R^T up and x . up of each joint in the heights
    radii: Array  # (balls,)


@dataclass(frozen=True, eq=False)
class Underside:
    """The skin of one body about its joints: its mesh, or without one its capsules."""

    body: Body
    capsules: Capsules
    mesh: SkinnedMesh | None = None

    @cached_property
    def segments(self) -> Numbers:
        """(joints,), the segment of each joint; -1 for none."""
        return find_segments(self.body).of_joint

    def below(self, motion: Motion, joints: Numbers, up: Array) -> Array:
        """Return the depth below each joint of the lowest skin about it, (frames, joints) [file units]; 0 without."""
        heights, result = heights_of(motion.positions, joints, up), np.zeros((len(motion), len(joints)))
        skins = [self._cached(self._skin_about, joint) for joint in joints.tolist()]
        known = [column for column, skin in enumerate(skins) if skin is not None]
        for column, lowest in zip(known, _lowest(motion, [skin for skin in skins if skin], up), strict=True):
            result[:, column] = heights[:, column] - lowest
        return result

    def lowest(self, motion: Motion, joints: Numbers, up: Array) -> Array:
        """Return the height of the lowest skin about any of the joints, (frames,) [file units]."""
        return np.asarray((heights_of(motion.positions, joints, up) - self.below(motion, joints, up)).min(axis=1))

    def reach(self, joint: int) -> float:
        """Return the largest possible `below` for a joint of trunk or head [file units]; 0 for other joints."""
        return self._cached(self._reach, joint)

    def foot(self, ankle: int) -> Numbers:
        """Return the vertices of a foot that can be its lowest, on its convex hulls; none without a mesh."""
        joints = tuple(self.body.skeleton.subtree_at(ankle))
        return _outermost(self.mesh, joints) if self.mesh else np.zeros(0, np.intp)

    def lowest_of_foot(self, motion: Motion, ankle: int, up: Array) -> Array:
        """Return the height of the lowest vertex of a foot, (frames,) [file units]; infinite without vertices."""
        skin = self._of_vertices(self.foot(ankle))
        return _lowest(motion, [skin], up)[0] if skin else np.full(len(motion), np.inf)

    def has_heel(self, ankle: int, sole: Sole) -> bool:
        """Return whether the skin of a flat foot reaches more than halfway down to the sole behind the ankle."""
        points, radii = self._cached(self._points_of_foot, ankle)
        away = points - self.body.skeleton.rest_positions[ankle]
        heights = away @ sole.normal - radii
        behind = away @ (sole.direction - (sole.direction @ sole.normal) * sole.normal) <= 0.0
        return bool(heights[behind].min(initial=0.0) < HEEL * heights.min(initial=0.0))

    def thickness(self, ankle: int, sole: Sole) -> float:
        """Return the depth of the skin of a flat foot below its lowest joint [file units]; 0 without skin."""
        points, radii = self._cached(self._points_of_foot, ankle)
        rest = self.body.skeleton.rest_positions[ankle] @ sole.normal - sole.ankle
        return float(rest - (points @ sole.normal - radii).min()) if len(points) else 0.0

    @property
    def _rest_ends(self) -> Array:
        """(capsules, 2, 3), the ends of the capsules in the rest pose."""
        return np.asarray(self.capsules.ends + self.body.skeleton.rest_positions[self.capsules.joints, None])

    def _cached(self, find: Callable[[int], T], joint: int) -> T:
        """The cached result of one of the methods below for a joint."""
        found, key = vars(self).setdefault("_found", {}), (find.__name__, joint)
        if key not in found:
            found[key] = find(joint)
        return cast(T, found[key])

    def _reach(self, joint: int) -> float:
        whole = self._whole_about(joint)
        away = lengths(self._rest_ends[whole] - self.body.skeleton.rest_positions[joint]) + self.capsules.radii[whole]
        return AROUND * float(away.max(initial=0.0))

    def _points_of_foot(self, ankle: int) -> tuple[Array, Array]:
        """The skin of a foot in the rest pose as balls: centres, (points, 3), and radii, (points,)."""
        if self.mesh is not None:
            on = self.foot(ankle)
            return self.mesh.vertices[on], np.zeros(len(on))
        of_foot = np.isin(self.capsules.joints, self.body.skeleton.subtree(ankle))
        return self._rest_ends[of_foot], self.capsules.radii[of_foot]

    def _of_vertices(self, on: Numbers) -> BoundBalls | None:
        """Vertices of the mesh as balls; None without any."""
        if self.mesh is None or not len(on):
            return None
        return self._balls(self.mesh.vertices[on], self.mesh.joints[on], self.mesh.weights[on], np.zeros(len(on)))

    def _skin_about(self, joint: int) -> BoundBalls | None:
        """The skin about a joint; None where there is none."""
        near, t, radii = self._capsules_about(joint)
        if not len(near):
            return None
        if self.mesh is not None:
            on = self._vertices_about(self.mesh, joint, (BEYOND if self._is_tip(joint) else AROUND) * radii.max())
            if len(on):
                return self._of_vertices(on)
        whole = self._whole_about(joint)
        on, t = np.concatenate([near, whole, whole]), np.concatenate([t, np.zeros(len(whole)), np.ones(len(whole))])
        ends, radii, shares = self._rest_ends[on], self.capsules.radii[on], np.stack([1.0 - t, t], axis=1)
        centres, carriers = (shares[..., None] * ends).sum(axis=1), self.capsules.joints[on][:, None]
        return self._balls(centres, carriers, np.ones(carriers.shape), (shares * radii).sum(axis=1))

    def _balls(self, points: Array, joints: Numbers, weights: Array, radii: Array) -> BoundBalls:
        """Balls from centres in the rest pose, (balls, 3), their joints and weights, (balls, n), and radii."""
        rest, moving = self.body.skeleton.rest_positions, np.unique(joints[weights > 0.0]).tolist()
        shares = [np.where(joints == joint, weights, 0.0).sum(axis=1) for joint in moving]
        bound = [np.column_stack([points - rest[joint], np.ones(len(points))]) for joint in moving]
        linear = np.concatenate([share * each.T for share, each in zip(shares, bound, strict=True)])
        return BoundBalls(moving, linear, radii)

    def _capsules_about(self, joint: int) -> tuple[Numbers, Array, Array]:
        """The capsules about a joint that nearly contain it, its position along each, 0 to 1, and the radius there."""
        skeleton, ends = self.body.skeleton, self._rest_ends
        bone = ends[:, 1] - ends[:, 0]
        off = skeleton.rest_positions[joint] - ends[:, 0]
        square = (bone**2).sum(axis=1)
        t = np.clip(np.divide((off * bone).sum(axis=1), square, out=np.zeros(len(bone)), where=square > 0.0), 0.0, 1.0)
        radii = (1.0 - t) * self.capsules.radii[:, 0] + t * self.capsules.radii[:, 1]
        near = lengths(off - t[:, None] * bone) < AROUND * radii
        near &= np.isin(self.capsules.segments, self._segments_about(joint))
        return np.flatnonzero(near), t[near], radii[near]

    def _is_tip(self, joint: int) -> bool:
        """Whether a joint is the last of a hand or finger, which has skin beyond it."""
        name = SEGMENTS[self.segments[joint]] if self.segments[joint] >= 0 else ""
        return not self.body.skeleton.children[joint] and name.endswith("hand")

    def _segments_about(self, joint: int) -> Numbers:
        """The segments of a joint, its parent and its children, without duplicates."""
        skeleton = self.body.skeleton
        around = self.segments[[joint, max(skeleton.parents.item(joint), 0), *skeleton.children[joint]]]
        return np.asarray(np.unique(around[around >= 0]))

    def _whole_about(self, joint: int) -> Numbers:
        """The capsules of those segments about a joint that are in `WHOLE`."""
        segments = [number for number in self._segments_about(joint).tolist() if SEGMENTS[number] in WHOLE]
        return np.flatnonzero(np.isin(self.capsules.segments, segments))

    def _vertices_about(self, mesh: SkinnedMesh, joint: int, reach: float) -> Numbers:
        """The outermost vertices of skin nearer to a joint than `reach`, and of all skin of segments in `WHOLE`."""
        segments, away = self.segments[mesh.carriers], mesh.vertices - self.body.skeleton.rest_positions[joint]
        near, chosen = lengths(away) < reach, [np.zeros(0, np.intp)]
        whole = self._whole_about(joint)
        if len(whole):
            radii, on = self.capsules.radii[whole], np.isin(segments, self.capsules.segments[whole])
            off_skin, _ = distances(mesh.vertices[on], self._rest_ends[whole], radii)
            near[on] = off_skin < OFF_SKIN * radii.mean()
        for segment in self._segments_about(joint).tolist():
            own = np.flatnonzero(near & (segments == segment))
            chosen.append(own[np.unique((away[own] @ _directions().T).argmax(axis=0))] if len(own) else own)
        return np.concatenate(chosen)


@dataclass(frozen=True, eq=False)
class Undersides:
    """The undersides of source and target."""

    source: Underside
    target: Underside
    # the mean `thickness` of both feet, for source and target [file units]; 0 without legs
    soles: tuple[float, float]
    # whether the target's feet stand on its mesh: it shows both soles, and the source is another rig
    feet_on_mesh: bool

    @classmethod
    def of(
        cls,
        matching: Matching,
        capsules: tuple[Capsules, Capsules],
        mesh: SkinnedMesh | None,
        source_mesh: SkinnedMesh | None = None,
    ) -> Undersides:
        """Return the undersides of source and target with these capsules and, where they have them, their meshes."""
        source = _underside(matching.source, capsules[0], source_mesh)
        target = _underside(matching.target, capsules[1], mesh)
        feet = [*zip(*matching.legs, matching.soles, strict=True)] if matching.legs else []
        thick = [[source.thickness(a.ankle, x), target.thickness(b.ankle, y)] for a, b, (x, y) in feet]
        mean, mean_of_target = np.mean(thick or np.zeros((1, 2)), axis=0).tolist()
        on_mesh = bool(feet) and not matching.is_same_rig and all(len(target.foot(b.ankle)) for _, b, _ in feet)
        return cls(source, target, (mean, mean_of_target), on_mesh)


def _lowest(motion: Motion, skins: Sequence[BoundBalls], up: Array) -> list[Array]:
    """The height of the lowest ball of each skin in each frame of a motion, (frames,)."""
    joints, lowest = sorted({joint for skin in skins for joint in skin.joints}), [np.empty(len(motion)) for _ in skins]
    heights = {joint: motion.positions[:, joint] @ up for joint in joints}
    for block in blocks_of(len(motion)) if joints else ():
        world = np.stack([motion.world_rotations_of(joint)[block] for joint in joints])
        turned = Rotation.from_quat(world.reshape(-1, 4)).inv().apply(up).reshape(len(joints), -1, 3)
        poses = {j: np.column_stack([each, heights[j][block]]) for j, each in zip(joints, turned, strict=True)}
        for skin, found in zip(skins, lowest, strict=True):
            moved = np.concatenate([poses[joint] for joint in skin.joints], axis=1)
            found[block] = (moved @ skin.linear - skin.radii).min(axis=1)
    return lowest


@rig_cached
def _underside(body: Body, capsules: Capsules, mesh: SkinnedMesh | None) -> Underside:
    return Underside(body, capsules, mesh)


@lru_cache(maxsize=8)
def _outermost(mesh: SkinnedMesh, joints: tuple[int, ...]) -> Numbers:
    """The vertices that some joints move most; for each joint only those on their convex hull in the rest pose."""
    groups = [np.flatnonzero(mesh.carriers == joint) for joint in joints]
    return np.concatenate([group[outermost(mesh.vertices[group])] for group in groups])


def _directions() -> Array:
    """(directions, 3), unit vectors all around, on a spiral (Swinbank and Purser 2006)."""
    z = 1.0 - (2.0 * np.arange(DIRECTIONS) + 1.0) / DIRECTIONS
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(DIRECTIONS)
    return normalised(np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1))
