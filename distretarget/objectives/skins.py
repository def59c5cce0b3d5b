"""The skins of source and target: their surfaces as balls and capsules, and how these move with the limbs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.skin.balls import NEVER, Balls, balls_of, ordered
from distretarget.skin.capsules import IS_ARM, Capsules
from distretarget.skin.limbs import Limb, shares_of
from distretarget.skin.tangents import LEAST_SHARE, Displaced

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
Flags = NDArray[np.bool_]

LIMBS = (("UpperArm", "LowerArm", "Hand"), ("UpperLeg", "LowerLeg", "Foot"))


@dataclass(frozen=True, eq=False)
class BodySkin:
    """The skin of one body. Lengths of `balls` are in body units, all others in file units."""

    capsules: Capsules  # ordered by segment
    balls: Balls  # the same, and the balls of the limbs
    limbs: tuple[Limb, ...]  # arms, then legs
    displaced: Displaced  # how the balls move with middle and end of each limb
    of_joint: Numbers  # (joints,), the segment of each joint, that of its nearest ancestor with a capsule; -1 for none
    unit: float  # the body unit

    @classmethod
    def of(cls, body: Body, capsules: Capsules) -> BodySkin:
        """Return the skin of a body with these capsules."""
        capsules, pose, skeleton = ordered(capsules), body.reference, body.skeleton
        turned = Rotation.from_quat(pose.rotations[capsules.joints]).as_matrix()
        posed = np.einsum("cij,cej->cei", turned, capsules.ends) + pose.positions[capsules.joints, None]
        scaled = Capsules(capsules.joints, capsules.ends / body.unit, capsules.radii / body.unit, capsules.segments)
        balls = balls_of(scaled, posed / body.unit)
        own = dict(zip(capsules.joints.tolist(), capsules.segments.tolist(), strict=True))
        of_joint = [next((own[a] for a in skeleton.line(joint) if a in own), -1) for joint in range(len(skeleton))]
        limbs = limbs_of(body)
        ends = [shares_of(limbs, skeleton, pose.positions, capsules.joints, posed[:, end]) for end in range(2)]
        of_capsule, shares = ends[0][0], np.stack([share for _, share in ends], axis=1)
        t, on = balls.places[:, None], balls.carriers
        moving = (1.0 - t) * shares[on, 0] + t * shares[on, 1]
        is_leg = np.array([limb.top in {leg.hip for leg in body.legs or ()} for limb in limbs] + [True])
        moving[is_leg[of_capsule[on]], 1] = 0.0  # feet stay
        balls.spare[(moving**2).sum(axis=1) < LEAST_SHARE**2] = NEVER
        return cls(
            capsules=capsules,
            balls=balls,
            limbs=limbs,
            displaced=Displaced(of_capsule, shares, _mutual(balls)),
            of_joint=np.array(of_joint, np.intp),
            unit=body.unit,
        )

    def between(self, one: Numbers | Flags, other: Numbers | Flags) -> Numbers:
        """Return the pairs of segments of two parts of the body, given by their joints."""
        a, b = (np.setdiff1d(self.of_joint[joints], [-1]) for joints in (one, other))
        first, second = self.balls.pairs.T
        on = (np.isin(first, a) & np.isin(second, b)) | (np.isin(first, b) & np.isin(second, a))
        return np.flatnonzero(on)

    def thickness(self, joint: int) -> float:
        """Return the mean radius of the part of the body that a joint belongs to [body units]."""
        radii = self.balls.cap_radii[self.capsules.segments == self.of_joint[joint]]
        return float(radii.mean()) if radii.size else 0.0

    def posed(self, motion: Motion) -> Array:
        """Return the ends of the capsules in each frame, (frames, capsules, 2, 3) [body units]."""
        posed = self.capsules.posed(motion)
        posed /= self.unit
        return posed


def limbs_of(body: Body) -> tuple[Limb, ...]:
    """Return the limbs whose three joints are known, arms before legs."""
    roles = body.anatomy.roles if body.anatomy else {}
    named = [[side + part for part in parts] for parts in LIMBS for side in SIDES]
    known = [names for names in named if roles.keys() >= {*names}]
    return tuple(Limb(roles[top], roles[middle], roles[end], "Hand" in end) for top, middle, end in known)


def _mutual(balls: Balls) -> NDArray[np.bool_]:
    """(pairs,), whether both segments of a pair give way: arms to arms and legs to legs, but legs not to arms."""
    return np.asarray(IS_ARM[balls.pairs[:, 0]] == IS_ARM[balls.pairs[:, 1]])


@dataclass(frozen=True, eq=False)
class Skins:
    """The skins of source and target."""

    source: BodySkin
    target: BodySkin

    @classmethod
    def of(cls, matching: Matching, source: Capsules, target: Capsules) -> Skins | None:
        """Return the skins of a source and its target; None where a body has no capsules."""
        if not len(source) or not len(target):
            return None
        return cls(BodySkin.of(matching.source, source), _of_target(matching.target, target))


@lru_cache(maxsize=4)
def _of_target(body: Body, capsules: Capsules) -> BodySkin:
    """The skin of a target, kept for the next clip on it."""
    return BodySkin.of(body, capsules)
