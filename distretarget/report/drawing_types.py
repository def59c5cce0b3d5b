"""The types of the drawing data of a page, key by key; its scripts read them.

Arrays are base64 of little-endian numbers.
"""

from __future__ import annotations

from typing import TypedDict


class MotionDrawing(TypedDict):
    """One motion, as it is drawn. `points` are the joints that the matrices show, of A and B in the same order.

    Attributes:
        names: the keys of the joints.
        parents: the parent of each joint, -1 for the root.
        points: the joint that each point is.
        resting: the joints that rest on the world in some frame of A: with legs first ankle and toe of each.
        tau: (points, points), lengths of the paths between points [drawn units], in base64 of 32-bit floats.
        offset, scale: three numbers each; a position is offset + scale * number.
        positions: (drawn frames, joints, 3), the numbers, in base64 of 16-bit integers.
    """

    names: list[str]
    parents: list[int]
    points: list[int]
    resting: list[int]
    tau: str
    offset: list[float]
    scale: list[float]
    positions: str


class ContactDrawing(TypedDict):
    """A row of the contact timeline: two regions of the body.

    Attributes:
        pair: the two points of them that are nearest in A in the worst frame.
        a, b: the spans of frames in which they touch in A and in B: the first frame, and the frame after the last.
    """

    pair: list[int]
    a: list[list[int]]
    b: list[list[int]]


class DiffDrawing(TypedDict):
    """What the page draws. Both motions have y up, the floor at 0, and twice the leg length as the unit.

    Attributes:
        step: one frame in how many is drawn.
        notes: what a reader should know about the drawing.
        near: two regions touch where D of their nearest points is below this ...
        far_along: ... and the path between these has at least this number of joints.
        regions: the region of the body that each point is in, -1 for none.
        neighbours: (regions, regions), which regions are neighbours; these are never said to touch.
        foot_regions: the regions of the two feet, which do not touch while one of them rests; empty without legs.
        facing: the direction that B faces in its first frame, as the angle about y from z [rad].
        a, b: the two motions.
        bone_errors: (drawn frames, joints of B), the direction error of the bone above each joint, in half degrees, at
            most 254; 255 where it has none; in base64 of bytes.
        pelvis: the joint of the pelvis in A and in B.
        sizes: (points, points), the numbers of joints on the paths between points, at most 255, in base64 of bytes.
        rests: (frames, bytes), whether each of the `resting` joints rests in A, one bit for each, those of the first
            joints lowest, in base64 of bytes.
        largest_difference: |D_a - D_b| that hardly any pair of points exceeds, where the colours end.
        contacts: the regions that touch in A, in the order of the document.
    """

    step: int
    notes: list[str]
    near: float
    far_along: int
    regions: list[int]
    neighbours: list[list[bool]]
    foot_regions: list[int]
    facing: float
    a: MotionDrawing
    b: MotionDrawing
    bone_errors: str
    pelvis: list[int]
    sizes: str
    rests: str
    largest_difference: float
    contacts: list[ContactDrawing]
