"""Axes of body parts, and the rays out of them that map a point of contact from one body to another.

A point of contact on a part is given by its height along the part's axis, in lengths of the axis, and its angle round
the axis. On another body, the same height and angle are a ray out of the part's axis; a contact on that ray is at the
same place of the body, however thick the part is.
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
ARMS = tuple((f"{side}UpperArm", f"{side}LowerArm", f"{side}Hand") for side in SIDES)
ROLES = ("leftUpperLeg", "rightUpperLeg", "leftLowerLeg", "rightLowerLeg", "head", *ARMS[0], *ARMS[1])


class Axes(NamedTuple):
    """The axes of the parts of a body, in the order of `PARTS`."""

    starts: Array  # (frames, parts, 3), where each axis begins [file units]
    directions: Array  # (frames, parts, 3, 3), unit vectors along it, to the part's front and to its left, as rows
    lengths: Array  # (frames, parts) [file units]


class Tip(NamedTuple):
    """A part at the end of a chain, without a joint at its far end: the head, or a hand."""

    joint: int  # that moves it
    axes: Array  # (3, 3), its directions, as rows, while its joint is not turned
    length: float  # [file units]


@dataclass(frozen=True, eq=False)
class Landmarks:
    """The joints and directions from which the axes of a body's parts are found."""

    joints: Mapping[str, int]  # joint index by role, for `ROLES`
    tips: tuple[Tip, ...]  # head, left hand and right hand
    fronts: Mapping[str, Array]  # (3,), front of each upper arm and forearm while its joint is not turned, by role

    @classmethod
    def of(cls, body: Body, lengths: Sequence[float]) -> Landmarks | None:
        """Return the landmarks of a body with these lengths of head and hands; None if it lacks any but the hands."""
        roles, pose = body.roles, body.reference
        if not roles.keys() >= {*ROLES} or lengths[0] <= 0.0:
            return None
        up, front = pose.axes[:, 1], pose.axes[:, 2]

        def unturned(role: str, *directions: Array) -> Array:
            return Rotation.from_quat(pose.rotations[roles[role]]).inv().apply(np.stack(directions))

        axes = [unturned("head", up, front, np.cross(up, front))]
        for _, middle, end in ARMS:
            along = (pose.positions[roles[end]] - pose.positions[roles[middle]])[None]
            axes.append(unturned(end, *_directions(along, np.cross(along, front))[0]))
        joints = [roles[role] for role in ("head", *(arm[-1] for arm in ARMS))]
        fronts = {role: unturned(role, front)[0] for arm in ARMS for role in arm[:2]}
        return cls({role: roles[role] for role in ROLES}, tuple(map(Tip, joints, axes, lengths)), fronts)

    def axes(self, motion: Motion) -> Axes:
        """Return the axes in each frame of a motion."""
        at = {role: motion.positions[:, joint] for role, joint in self.joints.items()}
        hips, arms = (0.5 * (at[f"left{part}"] + at[f"right{part}"]) for part in ("UpperLeg", "UpperArm"))
        across = at["leftUpperArm"] - at["rightUpperArm"], at["leftUpperLeg"] - at["rightUpperLeg"]
        of_tips = [np.einsum("fij,kj->fki", _matrices(motion, tip.joint), tip.axes) for tip in self.tips]
        starts = [hips, at["leftUpperLeg"], at["rightUpperLeg"], at["head"]]
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


def _matrices(motion: Motion, joint: int) -> Array:
    """(frames, 3, 3), the world rotations of a joint."""
    return Rotation.from_quat(motion.world_rotations_of(joint)).as_matrix()


def _directions(along: Array, left: Array) -> Array:
    """(frames, 3, 3), the unit vectors along an axis, to its front and to its left, as rows."""
    along = normalised(along)
    front = normalised(cross(left, along))
    return np.stack([along, front, cross(along, front)], axis=1)


def rays(source: Axes, target: Axes, touching: Array) -> tuple[Array, Array, Array]:
    """Return the rays on the target for points of contact on the source, (frames, hands, parts, 3) [file units]: their
    starts on the target's axes and their directions, of the same shape, and the heights along the axes, (frames, hands,
    parts) [lengths of the axes].
    """
    off = touching - source.starts[:, None]
    along, front, left = np.moveaxis(np.einsum("fpij,fhpj->fhpi", source.directions, off), 3, 0)
    heights = along / np.maximum(source.lengths, np.finfo(float).tiny)[:, None]
    to_places = (heights * target.lengths[:, None])[..., None] * target.directions[:, None, :, 0]
    out = front[..., None] * target.directions[:, None, :, 1] + left[..., None] * target.directions[:, None, :, 2]
    return target.starts[:, None] + to_places, normalised(out), heights
