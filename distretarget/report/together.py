"""The page of a scene: all performers and props in one player on both sides, and lines between what touches."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from distretarget.measure.scene_gaps import TOUCH_DISTANCE
from distretarget.motion import Motion
from distretarget.report.drawing import drawn_step, in_base64, quantised, spans, upright
from distretarget.report.page import filled

Array = NDArray[np.float64]
Line = tuple[tuple[int, int], list[int], list[int], int, int]
"""Two points that touch: their bodies, the joint of either on the left and on the right, the first drawn frame, and the
one after the last.
"""


class DrawnPositions(TypedDict):
    """Positions of a body; each is offset + scale * number, the numbers in base64 of 16-bit integers."""

    offset: list[float]
    scale: list[float]
    positions: str


class BodyDrawing(TypedDict):
    """A performer or a prop, with the parent of each joint, -1 for the root, on the left and on the right."""

    name: str
    prop: bool
    parents: list[list[int]]
    sides: list[DrawnPositions]


class Table(TypedDict):
    """A table below the player. The number of a frame, in a cell of its own, becomes a button that goes there."""

    title: str
    columns: list[str]
    rows: list[list[str | int]]


@dataclass(frozen=True, eq=False, kw_only=True)
class ShownBody:
    """A performer or a prop as the page shows it.

    Attributes:
        name: what it is called.
        left, right: its motions on both sides, frame by frame.
        joints: the joints that may touch, on the left and on the right.
        prop: whether it is a prop.
    """

    name: str
    left: Motion
    right: Motion
    joints: tuple[NDArray[np.intp], NDArray[np.intp]]
    prop: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Stage:
    """The world that the page shows.

    Attributes:
        sides: what the left and the right side are called.
        up: (3,), the unit vector up on both.
        leg: the length of a leg on the left [file units].
        scale: units of the right side per unit of the left, along the floor.
    """

    sides: tuple[str, str]
    up: Array
    leg: float
    scale: float


def together_page(title: str, bodies: Sequence[ShownBody], stage: Stage, tables: Sequence[Table]) -> str:
    """The HTML of the page; performers come before props. Lines join what touches on the left."""
    frames, joints = len(bodies[0].left), sum(len(b.left.skeleton) + len(b.right.skeleton) for b in bodies)
    step = drawn_step(frames, joints)
    pairs = [(i, j) for i, j in combinations(range(len(bodies)), 2) if not bodies[i].prop]
    data = {
        "frame_count": frames,
        "frame_time": bodies[0].right.frame_time,
        "step": step,
        "drawn": -(-frames // step),
        "facing": _across_them(bodies, stage.up),
        "near": TOUCH_DISTANCE / 2.0,
        "sides": stage.sides,
        "bodies": [_drawing(body, stage, step) for body in bodies],
        "lines": [line for pair in pairs for line in _lines(pair, bodies, TOUCH_DISTANCE * stage.leg, step)],
        "tables": tables,
    }
    return filled(
        "together.html", title, styles=["style.css", "together.css"], scripts=["together.js"], data={"scene": data}
    )


def _drawing(body: ShownBody, stage: Stage, step: int) -> BodyDrawing:
    """The body with twice the length of a leg as the unit, of each side's own world."""
    turn, unit = upright(stage.up), 2.0 * stage.leg
    sides = [
        _side(turn.apply((motion.positions[::step] / size).reshape(-1, 3)).reshape(-1, len(motion.skeleton), 3))
        for motion, size in ((body.left, unit), (body.right, unit * stage.scale))
    ]
    parents = [motion.skeleton.parents.tolist() for motion in (body.left, body.right)]
    return {"name": body.name, "prop": body.prop, "parents": parents, "sides": sides}


def _side(positions: Array) -> DrawnPositions:
    numbers, offset, scale = quantised(positions)
    return {"offset": offset.tolist(), "scale": scale.tolist(), "positions": in_base64(numbers, "<i2")}


def _across_them(bodies: Sequence[ShownBody], up: Array) -> float:
    """The angle about y from which the first two performers are seen side by side [rad]."""
    if len(bodies) < 2 or bodies[1].prop:
        return 0.6
    middles = [body.left.positions.mean(axis=(0, 1)) for body in bodies[:2]]
    x, _, z = upright(up).apply(middles[1] - middles[0])
    return math.atan2(-z, x)


def _lines(pair: tuple[int, int], bodies: Sequence[ShownBody], near: float, step: int) -> Iterator[Line]:
    """What touches between two bodies: of the joints of either that are nearer than `near`, each with its nearest."""
    one, other = (bodies[number] for number in pair)
    a = one.left.positions[::step][:, one.joints[0]]
    b = other.left.positions[::step][:, other.joints[0]]
    nearest, touch = np.zeros(a.shape[:2], np.intp), np.zeros(a.shape[:2], bool)
    for frame, (x, y) in enumerate(zip(a, b, strict=True)):
        gaps = np.linalg.norm(x[:, None] - y, axis=-1)
        nearest[frame], touch[frame] = gaps.argmin(axis=1), gaps.min(axis=1) < near
    for k in range(a.shape[1]):
        for point in np.unique(nearest[touch[:, k], k]).tolist():
            before, after = ([int(p[k]), int(q[point])] for p, q in zip(one.joints, other.joints, strict=True))
            for first, end in spans(touch[:, k] & (nearest[:, k] == point)):
                yield pair, before, after, first, end
