"""The skins of source and target: their surfaces as balls and capsules, and where these are in the frames of a clip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.body.arms import Arm
from distretarget.body.body import Body
from distretarget.matching.matching import Matching
from distretarget.motion import Motion
from distretarget.skin.balls import Balls, balls_of, ordered
from distretarget.skin.capsules import Capsules
from distretarget.skin.displacement import Displaced

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class BodySkin:
    """The skin of one body. Lengths of `balls` are in body units, all others in file units."""

    capsules: Capsules  # ordered by segment
    balls: Balls  # the same, and the balls of the limbs
    displaced: Displaced  # how they move with elbows and wrists
    of_joint: Numbers  # (joints,), the segment of each joint, that of its nearest ancestor with a capsule; -1 for none
    shares: tuple[Numbers, Array]  # (joints, 2) each, the displaced joints that move each joint, and their shares
    unit: float  # the body unit
    joints: Numbers  # (displaced joints,), elbows and wrists
    anchors: Numbers  # (displaced joints,), the shoulder of each

    @classmethod
    def of(cls, body: Body, capsules: Capsules) -> BodySkin:
        """Return the skin of a body with these capsules."""
        capsules, pose, skeleton = ordered(capsules), body.reference, body.skeleton
        turned = Rotation.from_quat(pose.rotations[capsules.joints]).as_matrix()
        posed = np.einsum("cij,cej->cei", turned, capsules.ends) + pose.positions[capsules.joints, None]
        scaled = Capsules(capsules.joints, capsules.ends / body.unit, capsules.radii / body.unit, capsules.segments)
        balls = balls_of(scaled, posed / body.unit)
        shares = _Shares(body.arms, pose.positions, [set(skeleton.subtree(arm.shoulder)) for arm in body.arms])
        t, on = balls.places[:, None], balls.carriers
        centres = (1.0 - t) * posed[on, 0] + t * posed[on, 1]
        ends = [shares.of_points(capsules.joints, posed[:, end]) for end in range(2)]
        own = dict(zip(capsules.joints.tolist(), capsules.segments.tolist(), strict=True))
        of_joint = [next((own[a] for a in skeleton.line(joint) if a in own), -1) for joint in range(len(skeleton))]
        return cls(
            capsules=capsules,
            balls=balls,
            displaced=Displaced(
                *shares.of_points(capsules.joints[on], centres),
                np.stack([numbers for numbers, _ in ends], axis=1),
                np.stack([shares for _, shares in ends], axis=1),
                2 * len(body.arms),
            ),
            of_joint=np.array(of_joint, np.intp),
            shares=shares.of_points(np.arange(len(skeleton)), pose.positions),
            unit=body.unit,
            joints=np.array([joint for arm in body.arms for joint in (arm.elbow, arm.wrist)], np.intp),
            anchors=np.array([arm.shoulder for arm in body.arms for _ in range(2)], np.intp),
        )

    def turned(self, motion: Motion) -> Array:
        """Return the ends of the capsules less their joints in each frame, (frames, capsules, 2, 3) [body units]."""
        return self.capsules.turned(motion) / self.unit

    def posed(self, motion: Motion) -> Array:
        """Return the ends of the capsules in each frame, (frames, capsules, 2, 3) [body units]."""
        return self.capsules.posed(motion) / self.unit

    def displacements_of_joints(self, displacements: Array, joints: Numbers) -> Array:
        """Return how far joints move, (frames, joints, 3), with those of elbows and wrists, (frames, displaced, 3)."""
        numbers, shares = (each[joints] for each in self.shares)
        moved = np.zeros((len(displacements), len(joints), 3))
        for k in range(2):
            moved += np.where(numbers[:, k] >= 0, shares[:, k], 0.0)[:, None] * displacements[:, numbers[:, k]]
        return moved


@dataclass(frozen=True)
class _Shares:
    """How points of arms move with elbows and wrists: the joints `below` each shoulder in the reference pose."""

    arms: tuple[Arm, ...]
    places: Array
    below: list[set[int]]

    def of_points(self, joints: Numbers, points: Array) -> tuple[Numbers, Array]:
        """For points, (points, 3), carried by `joints`, (points,): the numbers of the displaced joints that move each
        and their shares, (points, 2) each; -1 and 0 where there is none.
        """
        numbers, shares = np.full((len(joints), 2), -1), np.zeros((len(joints), 2))
        for k, (joint, point) in enumerate(zip(joints.tolist(), points, strict=True)):
            for number, (arm, below) in enumerate(zip(self.arms, self.below, strict=True)):
                if joint in below:
                    numbers[k] = 2 * number, 2 * number + 1
                    upper = self._along(arm.shoulder, arm.elbow, point)
                    lower = self._along(arm.elbow, arm.wrist, point)
                    shares[k] = (1.0 - lower, lower) if upper >= 1.0 or lower > 0.0 else (upper, 0.0)
        return numbers, shares

    def _along(self, a: int, b: int, point: Array) -> float:
        """How far a point is along the bone from joint a to joint b, 0 to 1."""
        bone = self.places[b] - self.places[a]
        square = float(bone @ bone)
        return float(np.clip((point - self.places[a]) @ bone / square, 0.0, 1.0)) if square else 1.0


@dataclass(frozen=True, eq=False)
class Skins:
    """The skins of source and target."""

    source: BodySkin
    target: BodySkin

    @classmethod
    def of(cls, matching: Matching, source: Capsules, target: Capsules) -> Skins | None:
        """Return the skins of a source and its target; None where a body has no capsules or no arms."""
        if not len(source) or not len(target) or not matching.target.arms:
            return None
        return cls(BodySkin.of(matching.source, source), BodySkin.of(matching.target, target))
