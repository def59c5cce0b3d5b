"""The report on a scene, or on the diff of two: a player of both sides, and tables of gaps and figures.

Lines in the player join what touches.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from distretarget.checks import check_kind
from distretarget.errors import SettingsError
from distretarget.io.files import write_whole
from distretarget.matching.matching import Matching
from distretarget.measure.diff import Diff
from distretarget.measure.scene_gaps import TOUCH_DISTANCE, SceneDiff
from distretarget.motion import Motion
from distretarget.numerics.time_series import spans_of
from distretarget.pipeline.result import RetargetResult
from distretarget.report.diff_document import About, document
from distretarget.report.page import drawn_step, html_page, packed, upright
from distretarget.report.scene_diff_document import SceneDiffDocument, Table, figure_table, gap_table, scene_document
from distretarget.scene.retargeting import SceneResult

Array = NDArray[np.float64]
Line = tuple[tuple[int, int], list[int], list[int], int, int]
"""Joints that touch: their two bodies, the joints on the left, those on the right, the first drawn frame, the end."""
NO_GAP = "\u2013"  # where two never touch


@dataclass(frozen=True, eq=False, kw_only=True)
class ShownBody:
    """A performer or a prop, with its motions on the two sides of the page."""

    name: str
    left: Motion
    right: Motion
    joints: tuple[NDArray[np.intp], NDArray[np.intp]]  # that may touch others, on the left and on the right
    prop: bool = False

    @classmethod
    def of_performer(cls, name: str, left: Motion, right: Motion, matching: Matching) -> ShownBody:
        """A performer, whose driven joints may touch others."""
        joints = matching.body_joints
        return cls(name=name, left=left, right=right, joints=(matching.drivers[joints], joints))

    @classmethod
    def of_prop(cls, name: str, left: Motion, right: Motion) -> ShownBody:
        """A prop, all of whose joints may touch others."""
        joints = np.arange(len(left.skeleton))
        return cls(name=name, left=left, right=right, joints=(joints, joints), prop=True)


def write_scene_report(
    path: str | Path,
    compared: SceneResult | SceneDiff,
    names: Sequence[str],
    *,
    a_name: str = "A",
    b_name: str = "B",
    overwrite: bool = False,
) -> None:
    """Write the report on a scene or on the diff of two: one HTML file that any browser opens without a network.

    `names` are those of the performers, then of the props. `a_name` and `b_name` are what the report of a diff calls
    the two scenes.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written.
        SettingsError: `compared` has the wrong type, or `names` does not name each performer and prop differently.
    """
    check_kind("compared", compared, SceneResult, SceneDiff)
    performers = len(compared.results if isinstance(compared, SceneResult) else compared.performers)
    count = performers + len(compared.props)
    if len(names) != count or len({*names}) != count:
        raise SettingsError(f"names is {list(names)}; expected {count} different names, performers before props")
    if isinstance(compared, SceneResult):
        html = scene_page(compared, names)
    else:
        about = About(a=a_name, b=b_name)
        pairs = zip(names[:performers], compared.performers, strict=True)
        documents = {name: document(one, about) for name, one in pairs}
        html = scene_diff_page(compared, scene_document(compared, documents, names[performers:], about))
    write_whole(path, html, overwrite)


def scene_page(result: SceneResult, names: Sequence[str]) -> str:
    """The HTML of the report on a scene: its source and its result; `names` are as in `write_scene_report`."""
    bodies = [
        ShownBody.of_performer(name, one.source, one.motion, one.matching)
        for name, one in zip(names, result.results, strict=False)
    ]
    props = zip(names[len(bodies) :], result.props, strict=True)
    bodies += [ShownBody.of_prop(name, prop.source, prop.motion) for name, prop in props]
    title, tables = " and ".join(names), [_gaps_of_result(result, names)]
    return _player_page(title, ("Source", "Result"), bodies, result.results[0], result.world_scale, tables)


def scene_diff_page(diff: SceneDiff, document: SceneDiffDocument) -> str:
    """The HTML of the report on the diff of two scenes, A and B."""
    frames = slice(len(diff))
    bodies = [
        ShownBody.of_performer(name, one.a[frames], one.b[frames], one.matching)
        for name, one in zip(document["performers"], diff.performers, strict=True)
    ]
    bodies += [ShownBody.of_prop(name, a, b) for name, (a, b) in zip(document["props"], diff.props, strict=True)]
    title, sides = f"{document['b']} against {document['a']}", (f"A: {document['a']}", f"B: {document['b']}")
    tables = [gap_table(document), figure_table(document)]
    return _player_page(title, sides, bodies, diff.performers[0], diff.world_scale, tables)


def _gaps_of_result(result: SceneResult, names: Sequence[str]) -> Table:
    rows: list[list[str | int]] = []
    for (i, j), gap in result.gaps.items():
        copy = result.copy_gaps[i, j]
        numbers = [f"{100 * mean:.1f}" for mean in (gap.a, copy.b, gap.b, gap.worst)] if gap and copy else [NO_GAP] * 4
        rows.append([f"{names[i]} and {names[j]}", str(gap.frames if gap else 0), *numbers])
    title = "Mean gap where they touch in the source, in % of a leg of the source\u2019s world"
    return {
        "title": title,
        "columns": ["between", "frames", "source", "rotation copy", "result", "worst 1 %"],
        "rows": rows,
    }


def _player_page(
    title: str,
    sides: tuple[str, str],
    bodies: Sequence[ShownBody],
    first: RetargetResult | Diff,
    scale: float,
    tables: Sequence[Table],
) -> str:
    """The HTML of the page; `sides` are the titles of its sides, `bodies` are performers before props.

    Both sides are drawn in units of twice the leg length that the `first` performer has on the left; `scale` is in
    units of the right side per unit of the left, along the floor. Lines join what touches on the left.
    """
    leg, up = first.matching.leg_lengths[0] or first.matching.source.unit / 2.0, first.world.up_vector
    frames, joints = len(bodies[0].left), sum(len(b.left.skeleton) + len(b.right.skeleton) for b in bodies)
    step = drawn_step(frames, joints)
    pairs = [(i, j) for i, j in combinations(range(len(bodies)), 2) if not bodies[i].prop]
    scene = {
        "frame_count": frames,
        "frame_time": bodies[0].right.frame_time,
        "step": step,
        "drawn": -(-frames // step),
        "facing": _facing(bodies, up),
        "near": TOUCH_DISTANCE / 2.0,
        "sides": sides,
        "bodies": [
            {
                "name": body.name,
                "prop": body.prop,
                "sides": [_drawing(body.left, up, 2.0 * leg, step), _drawing(body.right, up, 2.0 * leg * scale, step)],
            }
            for body in bodies
        ],
        "lines": [line for pair in pairs for line in _lines(pair, bodies, TOUCH_DISTANCE * leg, step)],
        "tables": tables,
    }
    return html_page("scene", title, {"scene": scene})


def _drawing(motion: Motion, up: Array, unit: float, step: int) -> dict[str, object]:
    positions = motion.positions[::step] / unit
    return packed(motion.skeleton, upright(up).apply(positions.reshape(-1, 3)).reshape(positions.shape))


def _facing(bodies: Sequence[ShownBody], up: Array) -> float:
    """The angle about y that shows the first two performers side by side [rad]."""
    if len(bodies) < 2 or bodies[1].prop:
        return 0.6
    middles = [body.left.positions.mean(axis=(0, 1)) for body in bodies[:2]]
    x, _, z = upright(up).apply(middles[1] - middles[0])
    return math.atan2(-z, x)


def _lines(pair: tuple[int, int], bodies: Sequence[ShownBody], near: float, step: int) -> Iterator[Line]:
    """What touches between two bodies: each joint of the first within `near` of the second, with the nearest joint."""
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
            for first, end in spans_of(touch[:, k] & (nearest[:, k] == point)).tolist():
                yield pair, before, after, first, end
