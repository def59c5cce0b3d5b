"""Where on a part of a body something touches it, in the part's own coordinates: along its axis, and round it."""

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
THINNEST = 0.1  # what is nearer to the axis counts as so far from it [lengths of the axis]
SHOULDERS = ("leftUpperArm", "rightUpperArm")
# The roles of the joints in whose middles the axis of each part begins and ends.
BONES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "trunk": (("leftUpperLeg", "rightUpperLeg"), SHOULDERS),
    "head": (SHOULDERS, ("head",)),
}
BONES |= {f"{side} thigh": ((f"{side}UpperLeg",), (f"{side}LowerLeg",)) for side in SIDES}
BONES |= {f"{side} shin": ((f"{side}LowerLeg",), (f"{side}Foot",)) for side in SIDES}
PARTS = tuple(BONES)
# (segments,), the number in `PARTS` of what each belongs to; -1 for arms, feet and the neck, which have none
PART_OF = np.array(
    [PARTS.index(part) if (part := "trunk" if name in TRUNK else name) in PARTS else -1 for name in SEGMENTS]
)


@dataclass(frozen=True, eq=False)
class PartFrames:
    """The axes of the parts of a body in its reference pose; rows of parts that the body has not are nan."""

    joints: Numbers  # (segments,), a joint that moves each; 0 for a segment that the body has not
    rest: Array  # (segments, 3), the place of that joint in the rest pose [file units]
    placed: Array  # (segments, 3), the same in the reference pose [file units]
    turns: Array  # (segments, 4), how it turns from the one to the other
    starts: Array  # (parts, 3), where each axis begins [file units]
    axes: Array  # (parts, 3, 3), along it, to its front and to its side, as rows
    lengths: Array  # (parts,), of the axes [file units]

    def coordinates(self, segments: Numbers, places: Array) -> Array:
        """Return where places, (n, 3), in the rest pose of segments, (n,), are on their parts, (n, 3): along the axis
        [its lengths], round it from the front [rad], and how far from it [lengths]; nan where a part has no axis.
        """
        part = PART_OF[segments]
        if not len(places):
            return np.zeros((0, 3))
        turned = Rotation.from_quat(self.turns[segments]).apply(places - self.rest[segments])
        posed = turned + self.placed[segments]
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
    ends[head, 0], ends[head, 1] = ends[head, 1], 2.0 * ends[head, 1] - ends[head, 0]  # from its joint as far up again
    bones = ends[:, 1] - ends[:, 0]
    along = normalised(bones)
    fronts = normalised(np.stack([level(reference.axes[:, 2], axis) for axis in along]))
    axes = np.stack([along, fronts, np.cross(along, fronts)], axis=1)
    return PartFrames(
        joints=joints,
        rest=body.skeleton.rest_positions[joints],
        placed=reference.positions[joints],
        turns=reference.rotations[joints],
        starts=ends[:, 0],
        axes=axes,
        lengths=lengths(bones),
    )


def difference(source: Array, result: Array) -> Array:
    """Return how far coordinates of a result, (n, 3), are off those of its source, (n, 3), along and round the part, in
    half widths of the result's part there, (n,).
    """
    thick = np.maximum(result[:, 2], THINNEST)
    round_ = np.abs(np.remainder(result[:, 1] - source[:, 1] + np.pi, 2.0 * np.pi) - np.pi)
    return np.asarray(np.hypot((result[:, 0] - source[:, 0]) / thick, round_))
