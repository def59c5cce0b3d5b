"""Coordinates of points on a part of a body: along its axis, round it, and away from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.body.segments import find_segments
from distretarget.numerics.vectors import Array, Numbers, lengths, level, normalised
from distretarget.skin.capsules import SEGMENTS

TRUNK = ("chest", "belly", "pelvis")  # one part: where one ends and the next begins differs between rigs
THINNEST = 0.1  # least distance from the axis to divide by [lengths of the axis]
SHOULDERS = ("leftUpperArm", "rightUpperArm")
# The axis of each part, from the middle of joints to the middle of other joints, by their roles.
BONES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "trunk": (("leftUpperLeg", "rightUpperLeg"), SHOULDERS),
    "head": (SHOULDERS, ("head",)),
}
BONES |= {f"{side} thigh": ((f"{side}UpperLeg",), (f"{side}LowerLeg",)) for side in SIDES}
BONES |= {f"{side} shin": ((f"{side}LowerLeg",), (f"{side}Foot",)) for side in SIDES}
PARTS = tuple(BONES)
# (segments,), the part of each segment, an index into `PARTS`; -1 for arms, feet and the neck
PART_OF = np.array(
    [PARTS.index(part) if (part := "trunk" if name in TRUNK else name) in PARTS else -1 for name in SEGMENTS]
)


@dataclass(frozen=True, eq=False)
class PartFrames:
    """The axes of the parts of a body in its reference pose; nan for parts that the body does not have."""

    joints: Numbers  # (segments,), a joint that moves each segment; 0 for one that the body does not have
    rest: Array  # (segments, 3), the position of that joint in the rest pose [file units]
    reference: Array  # (segments, 3), its position in the reference pose [file units]
    turns: Array  # (segments, 4), its rotation from the rest pose to the reference pose
    starts: Array  # (parts, 3), where each axis begins [file units]
    axes: Array  # (parts, 3, 3), unit vectors along the axis, to the front and to the side, as rows
    lengths: Array  # (parts,), of the axes [file units]

    def coordinates(self, segments: Numbers, points: Array) -> Array:
        """Return where points, (n, 3), of segments, (n,), in the rest pose are on their parts, (n, 3): along the axis
        [its lengths], round it from the front [rad], away from it [its lengths]; nan for no part.
        """
        part = PART_OF[segments]
        if not len(points):
            return np.zeros((0, 3))
        turned = Rotation.from_quat(self.turns[segments]).apply(points - self.rest[segments])
        posed = turned + self.reference[segments]
        along, front, side = np.einsum("nij,nj->in", self.axes[part], posed - self.starts[part]) / self.lengths[part]
        found = np.stack([along, np.arctan2(side, front), np.hypot(front, side)], axis=1)
        return np.where((part >= 0)[:, None], found, np.nan)


def find_part_frames(body: Body) -> PartFrames:
    """Return the axes of the parts of a body."""
    reference, roles, of_joint = body.reference, body.roles, find_segments(body).of_joint
    known = np.isin(np.arange(len(SEGMENTS)), of_joint)
    joints = np.where(known, (of_joint == np.arange(len(SEGMENTS))[:, None]).argmax(axis=1), 0)
    ends = np.full((len(PARTS), 2, 3), np.nan)
    for part, bone in enumerate(BONES.values()):
        on = [[roles[role] for role in end if role in roles] for end in bone]
        if all(on):
            ends[part] = [reference.positions[each].mean(axis=0) for each in on]
    head = PARTS.index("head")
    ends[head, 0], ends[head, 1] = ends[head, 1], 2.0 * ends[head, 1] - ends[head, 0]  # beyond its joint
    bones = ends[:, 1] - ends[:, 0]
    along = normalised(bones)
    fronts = normalised(np.stack([level(reference.axes[:, 2], axis) for axis in along]))
    axes = np.stack([along, fronts, np.cross(along, fronts)], axis=1)
    return PartFrames(
        joints=joints,
        rest=body.skeleton.rest_positions[joints],
        reference=reference.positions[joints],
        turns=reference.rotations[joints],
        starts=ends[:, 0],
        axes=axes,
        lengths=lengths(bones),
    )


def difference(source: Array, result: Array) -> Array:
    """How far coordinates of a result are from its source's, (n, 3) each, along and round it [half widths], (n,)."""
    thick = np.maximum(result[:, 2], THINNEST)
    angle = np.abs(np.remainder(result[:, 1] - source[:, 1] + np.pi, 2.0 * np.pi) - np.pi)
    return np.asarray(np.hypot((result[:, 0] - source[:, 0]) / thick, angle))
