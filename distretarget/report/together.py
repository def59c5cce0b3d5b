"""The report on a scene: all performers and things in one player, with lines between what touches."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from distretarget.measure.across import NEAR
from distretarget.motion import Motion
from distretarget.report.page import filled
from distretarget.report.scene import drawn_step, in_base64, quantised, spans, upright
from distretarget.scene import SceneResult

Array = NDArray[np.float64]
Line = tuple[tuple[int, int], list[int], list[int], int, int]
"""Two points that touch: their bodies, the joint of either in the source and in the result, the first drawn frame, and
the one after the last.
"""


class Side(TypedDict):
    """Positions of a body; each is offset + scale * number, the numbers in base64 of 16-bit integers."""

    offset: list[float]
    scale: list[float]
    positions: str


class BodyDrawing(TypedDict):
    """A performer or a thing, with the parent of each joint, -1 for the root, in the source and in the result."""

    name: str
    thing: bool
    parents: list[list[int]]
    source: Side
    result: Side


@dataclass(frozen=True, eq=False)
class _Body:
    """A performer or a thing: its motions, in the source and in the result, and the joints that may touch."""

    source: Motion
    result: Motion
    joints: tuple[NDArray[np.intp], NDArray[np.intp]]
    thing: bool


def scene_page(result: SceneResult, names: Sequence[str]) -> str:
    """The HTML of the report on a scene; `names` are those of performers and things."""
    bodies = [*_performers(result), *_things(result)]
    frames, joints = len(bodies[0].source), sum(len(b.source.skeleton) + len(b.result.skeleton) for b in bodies)
    step = drawn_step(frames, joints)
    first = result.results[0]
    unit = 2.0 * first.matching.leg_lengths[0] or 1.0
    up = first.world.up_vector
    drawings = [
        _drawing(name, body, up, unit, result.world_scale, step) for name, body in zip(names, bodies, strict=True)
    ]
    data = {
        "frame_count": frames,
        "frame_time": first.source.frame_time,
        "step": step,
        "drawn": -(-frames // step),
        "facing": _across_them(bodies, up),
        "near": NEAR / 2.0,
        "bodies": drawings,
        "lines": [line for pair in result.across for line in _lines(pair, bodies, NEAR * unit / 2.0, step)],
        "gaps": list(_gaps(result, names)),
    }
    return filled(
        "together.html",
        " and ".join(names),
        styles=["style.css", "together.css"],
        scripts=["together.js"],
        data={"scene": data},
    )


def _performers(result: SceneResult) -> Iterator[_Body]:
    for one in result.results:
        joints = one.matching.body_joints
        yield _Body(one.source, one.motion, (one.drivers[joints], joints), thing=False)


def _things(result: SceneResult) -> Iterator[_Body]:
    for thing in result.things:
        joints = np.arange(len(thing.motion.skeleton))
        yield _Body(thing.source, thing.motion, (joints, joints), thing=True)


def _drawing(name: str, body: _Body, up: Array, unit: float, scale: float, step: int) -> BodyDrawing:
    turn = upright(up)
    sides = [
        _side(turn.apply((motion.positions[::step] / size).reshape(-1, 3)).reshape(-1, len(motion.skeleton), 3))
        for motion, size in ((body.source, unit), (body.result, unit * scale))
    ]
    parents = [motion.skeleton.parents.tolist() for motion in (body.source, body.result)]
    return {"name": name, "thing": body.thing, "parents": parents, "source": sides[0], "result": sides[1]}


def _side(positions: Array) -> Side:
    numbers, offset, scale = quantised(positions)
    return {"offset": offset.tolist(), "scale": scale.tolist(), "positions": in_base64(numbers, "<i2")}


def _across_them(bodies: Sequence[_Body], up: Array) -> float:
    """The angle about y from which the first two performers are seen side by side [rad]."""
    if len(bodies) < 2 or bodies[1].thing:
        return 0.6
    middles = [body.source.positions.mean(axis=(0, 1)) for body in bodies[:2]]
    x, _, z = upright(up).apply(middles[1] - middles[0])
    return math.atan2(-z, x)


def _lines(pair: tuple[int, int], bodies: Sequence[_Body], near: float, step: int) -> Iterator[Line]:
    """What touches between two bodies: of the joints of either that are nearer than `near`, each with its nearest."""
    one, other = (bodies[number] for number in pair)
    a = one.source.positions[::step][:, one.joints[0]]
    b = other.source.positions[::step][:, other.joints[0]]
    nearest, touch = np.zeros(a.shape[:2], np.intp), np.zeros(a.shape[:2], bool)
    for frame, (x, y) in enumerate(zip(a, b, strict=True)):
        gaps = np.linalg.norm(x[:, None] - y, axis=-1)
        nearest[frame], touch[frame] = gaps.argmin(axis=1), gaps.min(axis=1) < near
    for k in range(a.shape[1]):
        for point in np.unique(nearest[touch[:, k], k]).tolist():
            before, after = ([int(p[k]), int(q[point])] for p, q in zip(one.joints, other.joints, strict=True))
            for first, end in spans(touch[:, k] & (nearest[:, k] == point)):
                yield pair, before, after, first, end


def _gaps(result: SceneResult, names: Sequence[str]) -> Iterator[list[str]]:
    """The rows of the table of gaps."""
    for (i, j), across in result.across.items():
        leg = result.results[i].matching.leg_lengths[0] or 1.0
        means = (across.source, across.rotation_copy, across.result)
        numbers = [f"{100 * gap / leg:.1f}" if across.frames else "\u2013" for gap in means]
        yield [f"{names[i]} and {names[j]}", str(across.frames), *numbers]
