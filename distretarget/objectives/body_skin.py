"""The skins of a source and its target: capsules, the balls of limbs, and the surface of a mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths
from distretarget.objectives.arm_overlap import ArmOverlap
from distretarget.objectives.part_axes import Landmarks
from distretarget.rig import rig_cached
from distretarget.skeleton import Skeleton
from distretarget.skin.balls import NEVER, Balls, balls_of
from distretarget.skin.capsules import IS_ARM, SEGMENTS, Capsules
from distretarget.skin.limbs import Limb, shares_of
from distretarget.skin.mesh import SkinnedMesh
from distretarget.skin.surface import SurfaceSamples
from distretarget.skin.tangents import LEAST_SHARE, Displaced

PRESSED = 0.01  # hands and forearms on the same body sink in as deep as in the source, up to this [body units]
ALIKE = 1e-3  # the largest relative difference of radii that still counts as one body
IS_TRUNK = np.array([name in ("chest", "belly", "pelvis") for name in SEGMENTS])


@dataclass(frozen=True, eq=False)
class BodySkin:
    """The skin of one body. Lengths of `balls` are in body units, all others in file units."""

    capsules: Capsules  # ordered by segment
    balls: Balls  # of the limbs, and the capsules in body units
    limbs: tuple[Limb, ...]  # arms, then legs
    displaced: Displaced  # how the balls move with middle and end of each limb
    of_joint: Numbers  # (joints,), the segment of each joint or of its nearest ancestor with a capsule; -1 for none
    overlap: ArmOverlap  # of arms and trunk
    landmarks: Landmarks | None  # from which the axes of body parts are found
    unit: float  # the body unit
    surface: SurfaceSamples | None = None  # of the mesh, if there is one

    def on_mesh(self, mesh: SkinnedMesh | None, skeleton: Skeleton) -> BodySkin:
        """Return the skin with the surface of a mesh that is bound to the joints of `skeleton`."""
        if not mesh:
            return self
        balls = _overlapping(self.balls, self.overlap.by_build, self.capsules)
        return replace(self, balls=balls, surface=_surface_of(mesh, skeleton, self))

    @classmethod
    def of(cls, body: Body, capsules: Capsules) -> BodySkin:
        """Return the skin of a body with these capsules."""
        pose, skeleton = body.reference, body.skeleton
        capsules = capsules[np.argsort(capsules.segments, kind="stable")]
        posed = pose.places(capsules.joints, capsules.ends)
        in_units = replace(capsules, ends=capsules.ends / body.unit, radii=capsules.radii / body.unit)
        balls = balls_of(in_units, posed / body.unit)
        own = dict(zip(capsules.joints.tolist(), capsules.segments.tolist(), strict=True))
        of_joint = [next((own[a] for a in skeleton.to_root(joint) if a in own), -1) for joint in range(len(skeleton))]
        limbs = body.limbs
        ends = [shares_of(limbs, skeleton, pose.positions, capsules.joints, posed[:, end]) for end in range(2)]
        of_capsule, shares = ends[0][0], np.stack([share for _, share in ends], axis=1)
        t, on = balls.fractions[:, None], balls.carriers
        moving = (1.0 - t) * shares[on, 0] + t * shares[on, 1]
        is_leg = np.array([limb.top in {leg.hip for leg in body.legs or ()} for limb in limbs] + [True])
        moving[is_leg[of_capsule[on]], 1] = 0.0  # feet are not displaced
        is_trunk = IS_TRUNK[capsules.segments]
        overlap = ArmOverlap.of(body, balls, posed / body.unit, is_trunk, limbs, of_capsule[on], moving)
        balls = _overlapping(balls, overlap.of_balls, capsules)
        balls.gap_offsets[(moving**2).sum(axis=1) < LEAST_SHARE**2] = NEVER
        mutual = np.equal(*IS_ARM[balls.pairs].T)  # arms displace arms and legs displace legs, but arms no legs
        head = capsules.segments == SEGMENTS.index("head")
        tips = [2.0 * float(capsules.radii[head].mean()) if head.any() else 0.0]
        for side in SIDES:
            hand, wrist = posed[capsules.segments == SEGMENTS.index(f"{side} hand")], body.roles.get(f"{side}Hand")
            known = len(hand) and wrist is not None
            tips.append(2.0 * float(lengths(hand.mean(axis=(0, 1)) - pose.positions[wrist])) if known else 0.0)
        return cls(
            capsules=capsules,
            balls=balls,
            limbs=limbs,
            displaced=Displaced(of_capsule, shares, mutual),
            of_joint=np.array(of_joint, np.intp),
            overlap=overlap,
            landmarks=Landmarks.of(body, posed[head], tips),
            unit=body.unit,
        )

    @property
    def can_touch(self) -> Flags:
        """(joints, joints), whether the parts of the body that two joints belong to can touch."""
        of_parts = np.zeros((len(SEGMENTS) + 1,) * 2, bool)  # the last is for joints without a segment
        first, second = self.balls.pairs.T
        of_parts[first, second] = of_parts[second, first] = True
        return np.asarray(of_parts[np.ix_(self.of_joint, self.of_joint)])

    def between(self, one: Numbers | Flags, other: Numbers | Flags) -> Numbers:
        """Return the indices of the segment pairs between two parts of the body, given by their joints."""
        a, b = (np.setdiff1d(self.of_joint[joints], [-1]) for joints in (one, other))
        first, second = self.balls.pairs.T
        on = (np.isin(first, a) & np.isin(second, b)) | (np.isin(first, b) & np.isin(second, a))
        return np.flatnonzero(on)

    def thickness(self, joint: int) -> float:
        """Return the mean radius of the segment that a joint belongs to [body units]."""
        radii = self.balls.cap_radii[self.capsules.segments == self.of_joint[joint]]
        return float(radii.mean()) if radii.size else 0.0

    def balls_of(self, segment: int) -> Numbers:
        """Return the indices of the balls of a segment."""
        return np.arange(*self.balls.of_ball[segment : segment + 2])

    def centres(self, ends: Array, segment: int) -> Array:
        """Return the centres of the balls of a segment, (frames, balls, 3); `ends` are what `posed` returns [body
        units].
        """
        on = self.balls_of(segment)
        ends, t = ends[:, self.balls.carriers[on]], self.balls.fractions[on, None]
        return np.asarray((1.0 - t) * ends[:, :, 0] + t * ends[:, :, 1])

    def posed(self, motion: Motion) -> Array:
        """Return the ends of the capsules' axes in each frame, (frames, capsules, 2, 3) [body units]."""
        posed = self.capsules.posed(motion)
        posed /= self.unit
        return posed


def _overlapping(balls: Balls, overlap: Array, capsules: Capsules) -> Balls:
    """The balls, which may overlap the capsules of the trunk by `overlap`, (balls,), more [body units]."""
    more, offsets = np.outer(overlap, IS_TRUNK[capsules.segments]), balls.gap_offsets
    return balls._replace(gap_offsets=np.where(offsets < NEVER, offsets - more, offsets))


@dataclass(frozen=True, eq=False)
class Skins:
    """The skins of source and target."""

    source: BodySkin
    target: BodySkin

    @property
    def are_alike(self) -> bool:
        """Whether source and target are the same body, at any scale, and both have a mesh."""
        one, other = (np.sort(skin.capsules.radii / skin.unit, axis=0) for skin in (self.source, self.target))
        known = self.source.surface is not None and self.target.surface is not None
        return known and one.shape == other.shape and bool(np.allclose(one, other, rtol=ALIKE, atol=0.0))

    @property
    def least_gap(self) -> float:
        """The least gap of contacts [body units]: if source and target are one body, skin may be pressed in."""
        return -PRESSED if self.are_alike else 0.0

    def on_meshes(self, source: SkinnedMesh | None, target: SkinnedMesh | None, matching: Matching) -> Skins:
        """Return the skins with the surfaces of the two meshes."""
        return replace(
            self,
            source=self.source.on_mesh(source, matching.source.skeleton),
            target=self.target.on_mesh(target, matching.target.skeleton),
        )

    @classmethod
    def of(cls, matching: Matching, source: Capsules, target: Capsules) -> Skins | None:
        """Return the skins of the two matched bodies; None if either has no capsules."""
        if not len(source) or not len(target):
            return None
        return cls(_skin_of(matching.source, source), _skin_of(matching.target, target))


@rig_cached
def _skin_of(body: Body, capsules: Capsules) -> BodySkin:
    return BodySkin.of(body, capsules)


@lru_cache(maxsize=4)
def _surface_of(mesh: SkinnedMesh, skeleton: Skeleton, skin: BodySkin) -> SurfaceSamples:
    """The surface of a mesh, cached for a batch of clips with the same target."""
    return SurfaceSamples.of(mesh, skeleton, skin.of_joint, skin.capsules)
