"""Axes of body parts, and the rays out of them that map a point of contact from one body to another.

A point of contact on a part is given by its height along the part's axis, in lengths of the axis, and its angle round
the axis. On another body, the same height and angle are a ray out of the part's axis; a contact on that ray is at the
same place of the body, however thick the part is. On a head it is given by its direction from the middle, as rigs have
the joint of the head at different places of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, cross, lengths, normalised

PARTS = {"trunk": ("chest", "belly", "pelvis"), "left thigh": ("left thigh",), "right thigh": ("right thigh",)}
PARTS |= {"head": ("head", "neck")}  # each with its segments
ARM_PARTS = tuple(f"{side} {part}" for side in SIDES for part in ("upper arm", "forearm"))
ARM_PARTS += tuple(f"{side} hand" for side in SIDES)
PARTS |= {part: (part,) for part in ARM_PARTS}
IS_ROUND = np.array([part == "head" for part in PARTS])  # parts with rays from their middle, not from an axis
ARMS = tuple((f"{side}UpperArm", f"{side}LowerArm", f"{side}Hand") for side in SIDES)
ROLES = ("leftUpperLeg", "rightUpperLeg", "leftLowerLeg", "rightLowerLeg", "head", *ARMS[0], *ARMS[1])


class Axes(NamedTuple):
    """The axes of the parts of a body, in the order of `PARTS`."""

    starts: Array  # (frames, parts, 3), where each axis begins, and the middle of the head [file units]
    directions: Array  # (frames, parts, 3, 3), unit vectors along it, to the part's front and to its left, as rows
    lengths: Array  # (frames, parts) [file units]


class Tip(NamedTuple):
    """A part at the end of a chain, without a joint at its far end: the head, or a hand."""

    joint: int  # that moves it
    start: Array  # (3,), of its axis from the joint while this is not turned [file units]
    axes: Array  # (3, 3), its directions, as rows, while its joint is not turned
    length: float  # [file units]


@dataclass(frozen=True, eq=False)
class Landmarks:
    """The joints and directions from which the axes of a body's parts are found."""

    joints: Mapping[str, int]  # joint index by role, for `ROLES`
    tips: tuple[Tip, ...]  # head, left hand and right hand
    fronts: Mapping[str, Array]  # (3,), front of each upper arm and forearm while its joint is not turned, by role

    @classmethod
    def of(cls, body: Body, head: Array, lengths: Sequence[float]) -> Landmarks | None:
        """Return the landmarks of a body; None if it lacks any but the hands. `head`, (capsules, 2, 3), are the ends of
        the head's capsules in the body's reference pose, and `lengths` those of head and hands [file units].
        """
        roles, pose = body.roles, body.reference
        if not roles.keys() >= {*ROLES} or lengths[0] <= 0.0:
            return None
        up, front = pose.axes[:, 1], pose.axes[:, 2]

        def unturned(role: str, *directions: Array) -> Array:
            return Rotation.from_quat(pose.rotations[roles[role]]).inv().apply(np.stack(directions))

        axes = [unturned("head", up, front, np.cross(up, front))]
        starts = [*unturned("head", head.mean(axis=(0, 1)) - pose.positions[roles["head"]]), np.zeros(3), np.zeros(3)]
        for _, middle, end in ARMS:
            along = (pose.positions[roles[end]] - pose.positions[roles[middle]])[None]
            axes.append(unturned(end, *_directions(along, np.cross(along, front))[0]))
        joints = [roles[role] for role in ("head", *(arm[-1] for arm in ARMS))]
        fronts = {role: unturned(role, front)[0] for arm in ARMS for role in arm[:2]}
        return cls({role: roles[role] for role in ROLES}, tuple(map(Tip, joints, starts, axes, lengths)), fronts)

    def axes(self, motion: Motion) -> Axes:
        """Return the axes in each frame of a motion."""
        at = {role: motion.positions[:, joint] for role, joint in self.joints.items()}
        hips, arms = (0.5 * (at[f"left{part}"] + at[f"right{part}"]) for part in ("UpperLeg", "UpperArm"))
        across = at["leftUpperArm"] - at["rightUpperArm"], at["leftUpperLeg"] - at["rightUpperLeg"]
        turns = [Rotation.from_quat(motion.world_rotations_of(tip.joint)).as_matrix() for tip in self.tips]
        of_tips = [np.einsum("fij,kj->fki", turn, tip.axes) for turn, tip in zip(turns, self.tips, strict=True)]
        head = at["head"] + turns[0] @ self.tips[0].start
        starts = [hips, at["leftUpperLeg"], at["rightUpperLeg"], head]
        ends = [arms, at["leftLowerLeg"], at["rightLowerLeg"]]
        bones, sides = [end - start for start, end in zip(starts, ends, strict=False)], across[:1] + 2 * across[1:]
        directions = [*map(_directions, bones, sides), of_tips[0]]
        sizes = [*map(lengths, bones), np.full(len(motion), self.tips[0].length)]
        for top, end in (bone for arm in ARMS for bone in pairwise(arm)):
            bone = at[end] - at[top]
            front = Rotation.from_quat(motion.world_rotations_of(self.joints[top])).apply(self.fronts[top])
            starts.append(at[top])
            directions.append(_directions(bone, cross(bone, front)))
            sizes.append(lengths(bone))
        for (*_, wrist), tip, of_hand in zip(ARMS, self.tips[1:], of_tips[1:], strict=True):
            starts.append(at[wrist])
            directions.append(of_hand)
            sizes.append(np.full(len(motion), tip.length))
        return Axes(np.stack(starts, axis=1), np.stack(directions, axis=1), np.stack(sizes, axis=1))


def _directions(along: Array, left: Array) -> Array:
    """(frames, 3, 3), the unit vectors along an axis, to its front and to its left, as rows."""
    along = normalised(along)
    front = normalised(cross(left, along))
    return np.stack([along, front, cross(along, front)], axis=1)


def rays(source: Axes, target: Axes, touching: Array) -> tuple[Array, Array, Array]:
    """Return the rays on the target for points of contact on the source, (frames, hands, parts, 3) [file units]: their
    starts on the target's axes and their directions, of the same shape, and the heights of the starts along the axes,
    (frames, hands, parts) [lengths of the axes].
    """
    off = touching - source.starts[:, None]
    along, front, left = np.moveaxis(np.einsum("fpij,fhpj->fhpi", source.directions, off), 3, 0)
    heights = np.where(IS_ROUND, 0.0, along / np.maximum(source.lengths, np.finfo(float).tiny)[:, None])
    to_places = (heights * target.lengths[:, None])[..., None] * target.directions[:, None, :, 0]
    by = np.stack([np.where(IS_ROUND, along, 0.0), front, left], axis=3)
    out = np.einsum("fhpi,fpij->fhpj", by, target.directions)
    return target.starts[:, None] + to_places, normalised(out), heights
