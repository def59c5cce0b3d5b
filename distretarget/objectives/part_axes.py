"""Axes of the parts of a body, and the rays out of them on which a touch is at the same place of the body.

A part has an axis. What touches it is at some height along it, in lengths of the axis, and on some side of it, as an
angle round it. On the target's part the same height and angle are a ray out of its axis: what is on that ray touches
the same place, however thick the part is.
"""

from __future__ import annotations

from collections.abc import Mapping
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
PARTS |= {part: (part,) for part in ARM_PARTS}
ARMS = tuple((f"{side}UpperArm", f"{side}LowerArm", f"{side}Hand") for side in SIDES)
ROLES = ("leftUpperLeg", "rightUpperLeg", "leftLowerLeg", "rightLowerLeg", "head", *ARMS[0], *ARMS[1])


class Axes(NamedTuple):
    """The axes of the parts of a body, in the order of `PARTS`."""

    starts: Array  # (frames, parts, 3), where each begins [file units]
    directions: Array  # (frames, parts, 3, 3), along it, to the front and to the left, as rows
    lengths: Array  # (frames, parts) [file units]


@dataclass(frozen=True, eq=False)
class Landmarks:
    """What the axes of a body's parts are found from."""

    joints: Mapping[str, int]  # of `ROLES`
    head: Array  # (3, 3), the directions of the head's axes, as rows, while its joint is not turned
    head_length: float  # [file units]
    fronts: Mapping[str, Array]  # (3,), the front of each upper arm and forearm while its joint is not turned, by role

    @classmethod
    def of(cls, body: Body, head_length: float) -> Landmarks | None:
        """Return those of a body; None where it lacks any."""
        roles = body.roles
        if not roles.keys() >= {*ROLES} or head_length <= 0.0:
            return None
        up, front = body.reference.axes[:, 1], body.reference.axes[:, 2]
        turned = Rotation.from_quat(body.reference.rotations[roles["head"]]).inv()
        head = turned.apply(np.stack([up, front, np.cross(up, front)]))
        arms = {role: body.reference.rotations[roles[role]] for arm in ARMS for role in arm[:2]}
        fronts = {role: Rotation.from_quat(turn).inv().apply(front) for role, turn in arms.items()}
        return cls({role: roles[role] for role in ROLES}, head, head_length, fronts)

    def axes(self, motion: Motion) -> Axes:
        """Return the axes in each frame of a motion."""
        at = {role: motion.positions[:, joint] for role, joint in self.joints.items()}
        hips, arms = (0.5 * (at[f"left{part}"] + at[f"right{part}"]) for part in ("UpperLeg", "UpperArm"))
        across = at["leftUpperArm"] - at["rightUpperArm"], at["leftUpperLeg"] - at["rightUpperLeg"]
        starts = [hips, at["leftUpperLeg"], at["rightUpperLeg"], at["head"]]
        ends = [arms, at["leftLowerLeg"], at["rightLowerLeg"]]
        head = Rotation.from_quat(motion.world_rotations_of(self.joints["head"])).as_matrix()
        of_head = np.einsum("fij,kj->fki", head, self.head)
        bones, sides = [end - start for start, end in zip(starts, ends, strict=False)], across[:1] + 2 * across[1:]
        directions = [*map(_directions, bones, sides), of_head]
        sizes = [*map(lengths, bones), np.full(len(motion), self.head_length)]
        for top, end in (bone for arm in ARMS for bone in pairwise(arm)):
            bone = at[end] - at[top]
            front = Rotation.from_quat(motion.world_rotations_of(self.joints[top])).apply(self.fronts[top])
            starts.append(at[top])
            directions.append(_directions(bone, cross(bone, front)))
            sizes.append(lengths(bone))
        return Axes(np.stack(starts, axis=1), np.stack(directions, axis=1), np.stack(sizes, axis=1))


def _directions(along: Array, left: Array) -> Array:
    """(frames, 3, 3), the unit vectors along an axis, to its front and to its left."""
    along = normalised(along)
    front = normalised(cross(left, along))
    return np.stack([along, front, cross(along, front)], axis=1)


def rays(source: Axes, target: Axes, touching: Array) -> tuple[Array, Array, Array]:
    """Return where on the target's axes the rays of points of the source, (frames, hands, parts, 3) [file units],
    begin, and their directions, of the same shape, and the heights, (frames, hands, parts) [lengths of the axes].
    """
    off = touching - source.starts[:, None]
    along, front, left = np.moveaxis(np.einsum("fpij,fhpj->fhpi", source.directions, off), 3, 0)
    heights = along / np.maximum(source.lengths, np.finfo(float).tiny)[:, None]
    to_places = (heights * target.lengths[:, None])[..., None] * target.directions[:, None, :, 0]
    out = front[..., None] * target.directions[:, None, :, 1] + left[..., None] * target.directions[:, None, :, 2]
    return target.starts[:, None] + to_places, normalised(out), heights
