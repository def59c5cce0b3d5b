"""The report on a scene, or on the diff of two: a player of both sides, and tables of gaps and metrics.

Rows of its timeline say what touches between performers and props.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from distretarget.body.thickness import capsules_of
from distretarget.checks import check_kind
from distretarget.errors import SettingsError
from distretarget.io.files import write_whole
from distretarget.measure.diff import Diff
from distretarget.measure.metrics import BY_KEY
from distretarget.measure.scene_gaps import TOUCH_DISTANCE, SceneDiff
from distretarget.motion import Motion
from distretarget.numerics.vectors import lengths
from distretarget.pipeline.found_contacts import MarkedContact, marked_contacts
from distretarget.pipeline.result import RetargetResult
from distretarget.report.actors import Actor, lowest_skin, thinned, upright
from distretarget.report.clip_page import contact_jumps, run_diff
from distretarget.report.diff_document import About, document
from distretarget.report.page import html_page
from distretarget.report.scene_diff_document import SceneDiffDocument, Table, gap_table, metric_table, scene_document
from distretarget.report.timeline_rows import Row, rows_of
from distretarget.scene.retargeting import SceneResult
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh

Array = NDArray[np.float64]
NO_GAP = "\u2013"  # where two never touch
OFF = 50.0 * TOUCH_DISTANCE  # a gap that is farther off than this is not kept well [% of leg length]


@dataclass(frozen=True, eq=False, kw_only=True)
class ShownBody:
    """A performer or a prop.

    Attributes:
        name: its name.
        motions: on each side of the page, first in A or the source.
        joints: those that may touch others, on the first side and on the others.
        measured: a performer's last motion against its first; None for a prop.
        skins: the surface on the first side and on the others.
        mesh: on the others.
        marked: a performer's contacts that were found, dropped and added.
    """

    name: str
    motions: tuple[Motion, ...]
    joints: tuple[NDArray[np.intp], NDArray[np.intp]]
    measured: Diff | None = None
    skins: tuple[Capsules | None, Capsules | None] = (None, None)
    mesh: SkinnedMesh | None = None
    marked: tuple[MarkedContact, ...] = ()

    @classmethod
    def of_performer(cls, name: str, measured: Diff, result: RetargetResult | None = None) -> ShownBody:
        """A performer, whose driven joints may touch others; as its result shows it, if it was made here."""
        matching, frames = measured.matching, len(measured)
        skins = (capsules_of(matching.source), capsules_of(matching.target))
        if result and result.skins:
            skins = (result.skins.source.capsules, result.skins.target.capsules)
        return cls(
            name=name,
            motions=(measured.a[:frames], *([result.rotation_copy] if result else []), measured.b[:frames]),
            joints=(matching.drivers[matching.body_joints], matching.body_joints),
            measured=measured,
            skins=skins,
            mesh=result.mesh if result else None,
            marked=marked_contacts(result) if result else (),
        )

    @classmethod
    def of_prop(cls, name: str, *motions: Motion) -> ShownBody:
        """A prop, all of whose joints may touch others."""
        joints = np.arange(len(motions[0].skeleton))
        return cls(name=name, motions=motions, joints=(joints, joints))

    def region(self, joint: int) -> str:
        """The name of a body's region that one of the joints of B is in; empty for a prop."""
        regions = self.measured.matching.regions if self.measured else None
        return f"'s {regions.names[regions.of_joint[joint]]}" if regions else ""


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
    pairs = zip(names, result.results, strict=False)
    bodies = [ShownBody.of_performer(name, run_diff(one), one) for name, one in pairs]
    props = zip(names[len(bodies) :], result.props, strict=True)
    bodies += [ShownBody.of_prop(name, prop.source, prop.copy, prop.motion) for name, prop in props]
    title, tables = " and ".join(names), [_gaps_of_result(result, names)]
    sides = ("Source", "Copied rotations", "Result")
    return _player_page(title, sides, bodies, result.results[0], result.world_scale, tables)


def scene_diff_page(diff: SceneDiff, document: SceneDiffDocument) -> str:
    """The HTML of the report on the diff of two scenes, A and B."""
    bodies = [
        ShownBody.of_performer(name, one) for name, one in zip(document["performers"], diff.performers, strict=True)
    ]
    bodies += [ShownBody.of_prop(name, a, b) for name, (a, b) in zip(document["props"], diff.props, strict=True)]
    title, sides = f"{document['b']} against {document['a']}", (f"A: {document['a']}", f"B: {document['b']}")
    tables = [gap_table(document), metric_table(document)]
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
    sides: tuple[str, ...],
    bodies: Sequence[ShownBody],
    first: RetargetResult | Diff,
    scale: float,
    tables: Sequence[Table],
) -> str:
    """The HTML of the page; `sides` are the titles of its sides, `bodies` are performers before props.

    All sides are shown in units of twice the leg length that the `first` performer has on the first; `scale` is in
    units of the other sides per unit of the first, along the floor.
    """
    leg, up = first.matching.leg_lengths[0] or first.matching.source.unit / 2.0, first.world.up_vector
    rows = [
        row
        for pair in combinations(range(len(bodies)), 2)
        if bodies[pair[0]].measured
        for row in _touching(pair, bodies, leg, scale)
    ]
    for number, body in enumerate(bodies):
        if body.measured:
            actors = range(number, len(sides) * len(bodies), len(bodies))
            rows += rows_of(body.measured, body.skins[1], actors, f"{body.name}: ", body.marked)
    stage = {
        "sides": sides,
        "frames": len(bodies[0].motions[0]),
        "frame_time": bodies[0].motions[-1].frame_time,
        "facing": _facing(bodies, up),
        "rows": [row.data for row in rows],
        "jumps": [*contact_jumps(rows)],
        **thinned([*_actors(bodies, up, 2.0 * leg, 2.0 * leg * scale)]),
    }
    return html_page("scene", title, {"stage": stage, "numbers": tables})


def _actors(bodies: Sequence[ShownBody], up: Array, first_unit: float, unit: float) -> Iterator[Actor]:
    """The performers and props on all sides; all that stand in one world have one floor, that of its last side."""
    lowest = [
        min(
            lowest_skin(one.motions[-other], one.skins[other], one.mesh if other else None, up)
            for one in bodies
            if one.measured
        )
        for other in (0, 1)
    ]
    for side in range(len(bodies[0].motions)):
        other = min(side, 1)
        for body in bodies:
            matching = body.measured.matching if body.measured else None
            yield Actor(
                name=body.name,
                side=side,
                role="other" if matching else "prop",
                motion=body.motions[side],
                body=(matching.source, matching.target)[other] if matching else None,
                capsules=body.skins[other],
                mesh=body.mesh if other else None,
                turn=upright(up),
                unit=unit if other else first_unit,
                floor=lowest[other],
            )


def _facing(bodies: Sequence[ShownBody], up: Array) -> float:
    """The angle about y that shows the first two performers side by side [rad]."""
    if len(bodies) < 2 or not bodies[1].measured:
        return 0.0
    middles = [body.motions[0].positions.mean(axis=(0, 1)) for body in bodies[:2]]
    x, _, z = upright(up).apply(middles[1] - middles[0])
    return math.atan2(-z, x) - 0.55


def _touching(pair: tuple[int, int], bodies: Sequence[ShownBody], leg: float, scale: float) -> Iterator[Row]:
    """A row for each two regions of two bodies of which joints touch on the first side: how far the gap is off."""
    one, other = (bodies[number] for number in pair)
    a, b = (body.motions[0].positions[:, body.joints[0]] for body in (one, other))
    last = [body.motions[-1].positions for body in (one, other)]
    off: dict[str, Array] = defaultdict(lambda: np.full(len(a), np.inf))
    joints: dict[str, tuple[int, int]] = {}
    for frame, (x, y) in enumerate(zip(a, b, strict=True)):
        gaps = lengths(x[:, None] - y)
        for k in np.flatnonzero(gaps.min(axis=1) < TOUCH_DISTANCE * leg).tolist():
            n = int(gaps[k].argmin())
            u, v = int(one.joints[1][k]), int(other.joints[1][n])
            gap = float(np.linalg.norm(last[0][frame, u] - last[1][frame, v])) / scale
            name = f"{one.name}{one.region(u)} - {other.name}{other.region(v)}"
            off[name][frame] = min(off[name][frame], 100.0 * abs(gap - gaps[k, n]) / leg)
            joints.setdefault(name, (k, n))
    for name, values in off.items():
        points = [
            [
                (side * len(bodies) + at, int(bodies[at].joints[min(side, 1)][k]))
                for at, k in zip(pair, joints[name], strict=True)
            ]
            for side in range(len(one.motions))
        ]
        yield Row(
            name, "contact", np.where(np.isfinite(values), values, np.nan), OFF, BY_KEY["contact_gap"].symbol, points
        )
