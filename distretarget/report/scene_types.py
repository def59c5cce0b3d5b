"""The types of the drawing data of a page, key by key; its scripts read them.

Arrays are base64 of little-endian numbers.
"""

from __future__ import annotations

from typing import TypedDict


class Drawing(TypedDict):
    """One motion, as it is drawn. `points` are the joints that the matrices show, of A and B in the same order.

    Attributes:
        names: the keys of the joints.
        parents: the parent of each joint, -1 for the root.
        points: the joint that each point is.
        feet: ankle and toe of the first leg, then of the second; empty without legs.
        tau: (points, points), lengths of the paths between points [drawn units], in base64 of 32-bit floats.
        offset, scale: three numbers each; a position is offset + scale * number.
        positions: (drawn frames, joints, 3), the numbers, in base64 of 16-bit integers.
    """

    names: list[str]
    parents: list[int]
    points: list[int]
    feet: list[int]
    tau: str
    offset: list[float]
    scale: list[float]
    positions: str


class ContactDrawing(TypedDict):
    """A row of the contact timeline.

    Attributes:
        pair: the two points that touch.
        a, b: the spans of frames in which they do in A and in B: the first frame, and the frame after the last.
    """

    pair: list[int]
    a: list[list[int]]
    b: list[list[int]]


class Scene(TypedDict):
    """What the page draws. Both motions have y up, the floor at 0, and twice the leg length as the unit.

    Attributes:
        step: one frame in how many is drawn.
        notes: what a reader should know about the drawing.
        near: two joints touch where D is below this ...
        far_along: ... and the path between them has at least this number of joints.
        facing: the direction that B faces in its first frame, as the angle about y from z [rad].
        a, b: the two motions.
        bones: per bone of B its upper and lower joint, then those of the same bone in A, or -1 and -1.
        pelvis: the joint of the pelvis in A and in B.
        sizes: (points, points), the numbers of joints on the paths between points, at most 255, in base64 of bytes.
        stance: (frames,), whether each of the `feet` rests in A, one bit for each, in base64 of bytes.
        largest_difference: |D_a - D_b| that hardly any pair of points exceeds, where the colours end.
        pairs: the two points of each of the worst pairs.
        contacts: the pairs that touch in the most frames.
    """

    step: int
    notes: list[str]
    near: float
    far_along: int
    facing: float
    a: Drawing
    b: Drawing
    bones: list[list[int]]
    pelvis: list[int]
    sizes: str
    stance: str
    largest_difference: float
    pairs: list[list[int]]
    contacts: list[ContactDrawing]
