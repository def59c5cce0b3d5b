"""The report on a scene, or on the diff of two: a player of both sides, and tables of gaps and metrics; and the diff as
one document, for JSON, or CSV with a row for each frame.

Rows of the timeline are the contacts between performers and props. `scene_diff.schema.json` describes every key of the
document.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from distretarget.body.segments import find_segments
from distretarget.checks import check_kind
from distretarget.errors import SettingsError
from distretarget.io.files import write_whole
from distretarget.measure.diff import Diff, SceneDiff
from distretarget.measure.gaps import TOUCH_DISTANCE, SkinContact, SkinContacts
from distretarget.measure.metrics import BY_KEY, METRICS
from distretarget.numerics.vectors import Array, lengths
from distretarget.pipeline.found_contacts import MarkedContact, marked_contacts
from distretarget.report.actors import Role, to_y_up
from distretarget.report.clip_page import run_diff, shown_diff, shown_result
from distretarget.report.diff_document import About, Table, Values, csv_text, document, judged, rounded
from distretarget.report.page import VERSION, html_page
from distretarget.report.stage import Row, ShownBody, bodies_in_motion, margin_of, rows_of_body, timeline
from distretarget.scene.retargeting import SceneResult
from distretarget.skin.capsules import SEGMENTS

Pair = tuple[int, int]
GAP_ERROR = "gap_error"  # the metric of a whole scene
OTHER: Role = "other"  # the role of all performers of a scene
NO_GAP = "\u2013"  # in cells of two that never touch
OFF = 50.0 * TOUCH_DISTANCE  # the error of a gap that is still kept well [% of leg length]


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

    `names` are those of the performers, then of the props. `a_name` and `b_name` are the names of the two scenes in the
    report on a diff.

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
    bodies = [shown_result(name, one) for name, one in zip(names, result.results, strict=False)]
    measured = [(run_diff(one), marked_contacts(one)) for one in result.results]
    props = zip(names[len(bodies) :], result.props, strict=True)
    bodies += [ShownBody(name=name, motions=(prop.source, prop.copy, prop.motion)) for name, prop in props]
    tables = [table for table in (_skin_gaps_of(result, names), _gaps_of(result, names)) if table["rows"]]
    sides, title = ("Source", "Copied rotations", "Result"), " and ".join(names)
    return _player_page(title, sides, bodies, measured, result.world_scale, tables, result.skin_gaps)


def scene_diff_page(diff: SceneDiff, document: Values) -> str:
    """The HTML of the report on the diff of two scenes, A and B."""
    bodies = [shown_diff(name, one) for name, one in zip(document["performers"], diff.performers, strict=True)]
    bodies += [ShownBody(name=name, motions=pair) for name, pair in zip(document["props"], diff.props, strict=True)]
    title, sides = f"{document['b']} against {document['a']}", (f"A: {document['a']}", f"B: {document['b']}")
    tables = [gap_table(document), metric_table(document)]
    return _player_page(title, sides, bodies, [(one, ()) for one in diff.performers], diff.world_scale, tables, {})


def _skin_gaps_of(result: SceneResult, names: Sequence[str]) -> Table:
    """The table of gaps between skins; without rows if fewer than two performers have skins."""
    rows: list[list[str | int]] = []
    for (i, j), gap in result.skin_gaps.items():
        cells = [f"{gap.error:.1f}", gap.worst.frame, " - ".join(gap.worst.parts)] if gap else [NO_GAP] * 3
        overlap, frames = result.overlaps[i, j], str(gap.frames if gap else 0)
        rows.append([f"{names[i]} and {names[j]}", frames, *cells, f"{overlap.depth:.1f}", overlap.frame])
    title = "Gaps between skins that touch in the source: their difference from the source\u2019s, in % of the height"
    columns = ["between", "frames", "mean", "worst frame", "parts", "overlap", "deepest frame"]
    return Table(title=title, columns=columns, rows=rows)


def _gaps_of(result: SceneResult, names: Sequence[str]) -> Table:
    """The table of gaps between joints, for pairs of which not both have skins."""
    rows: list[list[str | int]] = []
    for (i, j), gap in result.gaps.items():
        if (i, j) not in result.skin_gaps:
            copy = result.copy_gaps[i, j]
            means = (gap.a, copy.b, gap.b, gap.worst) if gap and copy else ()
            numbers = [f"{100 * mean:.1f}" for mean in means] or [NO_GAP] * 4
            rows.append([f"{names[i]} and {names[j]}", str(gap.frames if gap else 0), *numbers])
    title = "Mean gap where they touch in the source, in % of a leg of the source\u2019s world"
    columns = ["between", "frames", "source", "rotation copy", "result", "worst 1 %"]
    return Table(title=title, columns=columns, rows=rows)


def _player_page(
    title: str,
    sides: tuple[str, ...],
    bodies: Sequence[ShownBody],
    measured: Sequence[tuple[Diff, Sequence[MarkedContact]]],
    scale: float,
    tables: Sequence[Table],
    skin_gaps: Mapping[tuple[int, int], SkinContacts | None],
) -> str:
    """The HTML of a page with `sides`, titles, of `bodies`, performers before props, and of performers the diff and
    contacts, `measured`. The unit of length is twice the first leg; `scale` is in units of other sides per unit of the
    first.
    """
    first, _ = measured[0]
    leg, up = first.matching.source.leg, first.up
    rows: list[Row] = []
    for pair in combinations(range(len(bodies)), 2):
        if pair in skin_gaps:
            rows += _skins(pair, bodies, skin_gaps[pair])
        elif bodies[pair[0]].matching:
            rows += _touching(pair, bodies, leg, scale)
    units, roles = (2.0 * leg, 2.0 * leg * scale), dict.fromkeys(sides, OTHER)
    for number, (diff, marked) in enumerate(measured):
        rows += rows_of_body(bodies[number], diff, marked, number, len(bodies))
    stage = {**bodies_in_motion(bodies, roles, up, units, _facing(bodies, up)), **timeline(rows)}
    return html_page("scene", title, {"stage": stage, "numbers": tables})


def _facing(bodies: Sequence[ShownBody], up: Array) -> float:
    """The angle about y that shows the first two performers side by side [rad]."""
    if len(bodies) < 2 or not bodies[1].matching:
        return 0.0
    middles = [body.motions[0].positions.mean(axis=(0, 1)) for body in bodies[:2]]
    x, _, z = to_y_up(up).apply(middles[1] - middles[0])
    return math.atan2(-z, x) - 0.55


def _skins(pair: Pair, bodies: Sequence[ShownBody], gap: SkinContacts | None) -> Iterator[Row]:
    """A row for each two parts of two performers whose skins touch on the first side, with the error of their gap."""
    touches: dict[tuple[str, str], list[SkinContact]] = defaultdict(list)
    for touch in gap.touches if gap else ():
        touches[touch.parts].append(touch)
    for parts, found in touches.items():
        values = np.full(len(bodies[pair[0]].motions[0]), np.nan)
        values[[touch.frame for touch in found]] = [touch.error for touch in found]
        ends = [end for at, part in zip(pair, parts, strict=True) for end in _joint_of(bodies[at], part)]
        name = " - ".join(f"{bodies[at].name}'s {part}" for at, part in zip(pair, parts, strict=True))
        points = _marks(pair, bodies, ends)
        yield Row(name, "contact", values, margin_of("skin_gap"), BY_KEY["skin_gap"].symbol, points)


def _joint_of(body: ShownBody, part: str) -> Iterator[tuple[int, int]]:
    """The first joint of a performer's segment, on the first side and on the others; none if nothing drives it."""
    matching = body.matching
    assert matching
    joints = matching.body_joints
    for joint in joints[find_segments(matching.target).of_joint[joints] == SEGMENTS.index(part)][:1].tolist():
        yield int(matching.drivers[joint]), joint


def _marks(pair: Pair, bodies: Sequence[ShownBody], ends: Sequence[tuple[int, int]]) -> list[list[tuple[int, int]]]:
    """For each side the joints of two bodies with a mark between them, from `ends` on the first and the other sides."""
    both = [*zip(pair, ends, strict=True)] if len(ends) == len(pair) else []
    sides = range(len(bodies[pair[0]].motions))
    return [[(side * len(bodies) + at, end[min(side, 1)]) for at, end in both] for side in sides]


def _touching(pair: Pair, bodies: Sequence[ShownBody], leg: float, scale: float) -> Iterator[Row]:
    """A row for each two regions of two bodies whose joints touch on the first side, with the error of their gap."""
    one, other = (bodies[number] for number in pair)
    of = [_joints(body) for body in (one, other)]
    a, b = (body.motions[0].positions[:, own] for body, (own, _) in zip((one, other), of, strict=True))
    last = [body.motions[-1].positions for body in (one, other)]
    off: dict[str, Array] = defaultdict(lambda: np.full(len(a), np.nan))
    joints: dict[str, list[tuple[int, int]]] = {}
    for frame, (x, y) in enumerate(zip(a, b, strict=True)):
        gaps = lengths(x[:, None] - y)
        for k in np.flatnonzero(gaps.min(axis=1) < TOUCH_DISTANCE * leg).tolist():
            n = int(gaps[k].argmin())
            ends = [(int(first[at]), int(others[at])) for (first, others), at in zip(of, (k, n), strict=True)]
            (_, u), (_, v) = ends
            gap = float(np.linalg.norm(last[0][frame, u] - last[1][frame, v])) / scale
            name = f"{_region(one, u)} - {_region(other, v)}"
            off[name][frame] = np.fmin(off[name][frame], 100.0 * abs(gap - gaps[k, n]) / leg)
            joints.setdefault(name, ends)
    for name, values in off.items():
        yield Row(name, "contact", values, OFF, BY_KEY["hips_height"].symbol, _marks(pair, bodies, joints[name]))


def _joints(body: ShownBody) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The joints that may touch others, on the first side and on the others: the driven ones, and all of a prop."""
    if body.matching is None:
        joints = np.arange(len(body.motions[0].skeleton))
        return joints, joints
    return body.matching.drivers[body.matching.body_joints], body.matching.body_joints


def _region(body: ShownBody, joint: int) -> str:
    """The name of the region of a joint of B, with the body's; only the body's for a prop."""
    regions = body.matching.regions if body.matching else None
    return f"{body.name}'s {regions.names[regions.of_joint[joint]]}" if regions else body.name


def scene_document(diff: SceneDiff, performers: Mapping[str, Values], props: Sequence[str], about: About) -> Values:
    """The diff of two scenes as JSON values; `about` has the limits of `GAP_ERROR`."""
    means: Sequence[float | None] = [rounded(100.0 * gap) for gap in diff.mean_gaps or ()] or [None] * 3
    names = [*performers, *props]
    return {
        "format": "distretarget-scene-diff",
        "version": 1,
        "a": about.a,
        "b": about.b,
        "program": {"version": VERSION, "command": about.command},
        "world_scale": diff.world_scale,
        **dict(zip(("gap_a", "gap_b", "gap_error"), means, strict=True)),
        "limits": [judged(key, limit, means[-1]) for key, limit in about.limits],
        "performers": dict(performers),
        "props": list(props),
        "gaps": [
            {
                "between": [names[number] for number in gap.between],
                "regions": list(gap.regions),
                "joints": list(gap.joints),
                "worst_frame": gap.worst_frame,
                "frames": gap.frames,
                **{f"gap_{key}": rounded(100.0 * getattr(gap, key)) for key in ("a", "b", "worst", "error")},
            }
            for gap in diff.gaps
        ],
    }


def scene_csv(document: Values) -> str:
    """The frames of all performers as CSV: a row of keys, then a row for each performer and frame."""
    performers = document["performers"].items()
    return csv_text([{"performer": name, **frame} for name, one in performers for frame in one["frames"]])


def gap_table(document: Values) -> Table:
    """The gaps between regions that touch in A, the longest contact first."""
    rows: list[list[str | int]] = []
    for gaps in document["gaps"]:
        parts = zip(gaps["between"], gaps["regions"], strict=True)
        touching = " - ".join(f"{name}'s {region}" if region else name for name, region in parts)
        numbers = [f"{gaps[key]:.1f}" for key in ("gap_a", "gap_b", "gap_worst", "gap_error")]
        rows.append([touching, str(gaps["frames"]), *numbers, gaps["worst_frame"]])
    columns = ["between", "frames", "A", "B", "worst 1 % in B", "error", "worst frame"]
    return Table(title="Mean gap where they touch in A, in % of a leg of A\u2019s world", columns=columns, rows=rows)


def metric_table(document: Values) -> Table:
    """The metrics of all performers: of A, where it has one, and of B."""
    sides = [one["metrics"][side] for one in document["performers"].values() for side in ("source", "result")]
    rows: list[list[str | int]] = []
    for metric in METRICS:
        name = f"{metric.label}, {metric.symbol}" if metric.symbol else metric.label
        rows.append([name, *(metric.brief(side.get(metric.key)) for side in sides)])
    columns = ["metric", *(f"{name} {side}" for name in document["performers"] for side in "AB")]
    return Table(title="Metrics of each performer", columns=columns, rows=rows)
