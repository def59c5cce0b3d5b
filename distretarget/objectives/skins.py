"""The skins of source and target: their surfaces as balls and capsules, and where these are in the frames of a clip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.skin.balls import Balls, balls_of, ordered
from distretarget.skin.capsules import Capsules

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class BodySkin:
    """The skin of one body."""

    capsules: Capsules  # ordered by segment [file units]
    balls: Balls  # the same, and the balls of the limbs [body units]
    unit: float  # the body unit [file units]
    of_joint: Numbers  # (joints,), the segment of each joint, that of its nearest ancestor with a capsule; -1 for none

    @classmethod
    def of(cls, body: Body, capsules: Capsules) -> BodySkin:
        """Return the skin of a body with these capsules."""
        capsules = ordered(capsules)
        pose = body.reference
        turned = Rotation.from_quat(pose.rotations[capsules.joints]).as_matrix()
        posed = np.einsum("cij,cej->cei", turned, capsules.ends) + pose.positions[capsules.joints, None]
        scaled = Capsules(capsules.joints, capsules.ends / body.unit, capsules.radii / body.unit, capsules.segments)
        own = dict(zip(capsules.joints.tolist(), capsules.segments.tolist(), strict=True))
        skeleton = body.skeleton
        of_joint = [next((own[a] for a in skeleton.line(joint) if a in own), -1) for joint in range(len(skeleton))]
        return cls(capsules, balls_of(scaled, posed / body.unit), body.unit, np.array(of_joint, np.intp))

    def turned(self, motion: Motion) -> Array:
        """Return the ends of the capsules less their joints in each frame, (frames, capsules, 2, 3) [body units]."""
        return self.capsules.turned(motion) / self.unit


@dataclass(frozen=True, eq=False)
class Skins:
    """The skins of source and target."""

    source: BodySkin
    target: BodySkin

    @classmethod
    def of(cls, matching: Matching, source: Capsules, target: Capsules) -> Skins | None:
        """Return the skins of a source and the target it is matched to; None where a body has no capsules."""
        if not len(source) or not len(target):
            return None
        return cls(BodySkin.of(matching.source, source), BodySkin.of(matching.target, target))
