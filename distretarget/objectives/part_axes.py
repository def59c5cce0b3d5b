"""Axes of the parts of a body, and the rays out of them on which hands lie on the same place of the body.

A part has an axis. A hand of the source is at some height along it, in lengths of the axis, and on some side of it, as
an angle round it. On the target's part the same height and angle are a ray out of its axis: a hand on that ray lies on
the same place, however thick the part is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.body import Body
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, cross, lengths, normalised

PARTS = {"trunk": ("chest", "belly", "pelvis"), "left thigh": ("left thigh",), "right thigh": ("right thigh",)}
PARTS |= {"head": ("head", "neck")}  # each with its segments
ROLES = ("leftUpperLeg", "rightUpperLeg", "leftUpperArm", "rightUpperArm", "leftLowerLeg", "rightLowerLeg", "head")


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

    @classmethod
    def of(cls, body: Body, head_length: float) -> Landmarks | None:
        """Return those of a body; None where it lacks any."""
        roles = body.anatomy.roles if body.anatomy else {}
        if not roles.keys() >= {*ROLES} or head_length <= 0.0:
            return None
        up, front = body.reference.axes[:, 1], body.reference.axes[:, 2]
        turned = Rotation.from_quat(body.reference.rotations[roles["head"]]).inv()
        head = turned.apply(np.stack([up, front, np.cross(up, front)]))
        return cls({role: roles[role] for role in ROLES}, head, head_length)

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
        directions = [_directions(bone, side) for bone, side in zip(bones, sides, strict=True)]
        sizes = [*map(lengths, bones), np.full(len(motion), self.head_length)]
        return Axes(np.stack(starts, axis=1), np.stack([*directions, of_head], axis=1), np.stack(sizes, axis=1))


def _directions(along: Array, left: Array) -> Array:
    """(frames, 3, 3), the unit vectors along an axis, to its front and to its left."""
    along = normalised(along)
    front = normalised(cross(left, along))
    return np.stack([along, front, cross(along, front)], axis=1)


def rays(source: Axes, target: Axes, hands: Array) -> tuple[Array, Array]:
    """Return where on the target's axes the rays of hands of the source, (frames, hands, 3) [file units], begin, and
    their directions, (frames, hands, parts, 3).
    """
    off = hands[:, :, None] - source.starts[:, None]
    along, front, left = np.moveaxis(np.einsum("fpij,fhpj->fhpi", source.directions, off), 3, 0)
    heights = along / np.maximum(source.lengths, np.finfo(float).tiny)[:, None] * target.lengths[:, None]
    places = target.starts[:, None] + heights[..., None] * target.directions[:, None, :, 0]
    out = front[..., None] * target.directions[:, None, :, 1] + left[..., None] * target.directions[:, None, :, 2]
    return places, normalised(out)
