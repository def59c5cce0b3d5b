"""The report on a clip: an HTML page that plays a source and its result, or A and B of a diff, with their metrics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.body.legs import leg_length
from distretarget.body.thickness import capsules_of
from distretarget.checks import check_kind
from distretarget.io.files import write_whole
from distretarget.measure.contacts import CONTACT_DISTANCE, FAR_ALONG
from distretarget.measure.diff import Diff, turned_note
from distretarget.measure.metrics import BY_KEY, as_data, metrics_at
from distretarget.motion import Motion
from distretarget.pipeline.result import RetargetResult
from distretarget.report.actors import Actor, Role, lowest_skin, packed, thinned, upright
from distretarget.report.diff_document import About, DiffDocument, document
from distretarget.report.page import html_page
from distretarget.report.scene_diff_document import Table
from distretarget.report.timeline_rows import Row, rows_of
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh
from distretarget.target import LoadedTarget, Target

Array = NDArray[np.float64]

TOUCHING = (
    "Two regions of the body, such as a hand and the head, touch if D of their nearest joints is below "
    f"{CONTACT_DISTANCE:g} and at least {FAR_ALONG} joints lie on the path between them. Regions joined by a bone do "
    "not count, nor do two feet while one of them rests."
)
JUMPS = 12  # contacts that a menu lists


def write_report(
    path: str | Path,
    compared: RetargetResult | Diff,
    *,
    source_name: str = "source",
    result_name: str = "result",
    overwrite: bool = False,
) -> None:
    """Write the report on a run or a diff: one HTML file that any browser opens without a network.

    `source_name` and `result_name` are what the report calls the two motions, A and B of a diff.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written.
        SettingsError: `compared` has the wrong type.
    """
    check_kind("compared", compared, RetargetResult, Diff)
    about = About(a=source_name, b=result_name)
    if isinstance(compared, RetargetResult):
        html = run_page(compared, about)
    else:
        html = diff_page(compared, document(compared, about))
    write_whole(path, html, overwrite)


def run_page(result: RetargetResult, about: About, target: LoadedTarget | None = None) -> str:
    """The HTML of the report on a run: its source, its rotation copy and its result; `target` has the mesh to show, if
    the result was made without it.
    """
    diff, copy = run_diff(result), result.tracks["rotation_copy"]
    about = replace(about, rotation_copy=copy, verdict=result.verdict, warnings=result.warnings)
    skins = (result.skins.source.capsules, result.skins.target.capsules) if result.skins else _skins(diff)
    moving: list[tuple[str, Role, Motion]] = [
        ("Source", "source", diff.a),
        ("Copied rotations", "copy", result.rotation_copy),
        ("Result", "result", diff.b),
    ]
    mesh = target.mesh() if result.mesh is None and isinstance(target, Target) else result.mesh
    return _page(diff, document(diff, about), moving, skins, mesh)


def run_diff(result: RetargetResult) -> Diff:
    """The result of a run, B, measured against its source, A."""
    return Diff(
        a=result.source,
        b=result.motion,
        matching=result.matching,
        world=result.world,
        stress=result.written_stress,
        comparison=result.comparison,
        notes=turned_note(result.world),
        run_tracks=result.run_tracks,
    )


def diff_page(diff: Diff, document: DiffDocument) -> str:
    """The HTML of the report on a diff, from its document."""
    moving: list[tuple[str, Role, Motion]] = [("A", "source", diff.a), ("B", "result", diff.b)]
    return _page(diff, document, moving, _skins(diff), None)


def _skins(diff: Diff) -> tuple[Capsules, Capsules]:
    """The surfaces of A and B; those of average adults."""
    return capsules_of(diff.matching.source), capsules_of(diff.matching.target)


def _page(
    diff: Diff,
    document: DiffDocument,
    moving: Sequence[tuple[str, Role, Motion]],
    skins: tuple[Capsules, Capsules],
    mesh: SkinnedMesh | None,
) -> str:
    """The page on a diff that plays motions, first that of A; the others are those of B's body."""
    actors = [*_actors(diff, moving, skins, mesh)]
    rows = rows_of(diff, skins[1], range(len(actors)))
    source, result = ("source ", "result ") if document["metrics"]["rotation_copy"] else ("", "")
    title = f"{result}{document['b']['file']} against {source}{document['a']['file']}"
    frames = document["frames"]
    keys = [key for metric in metrics_at("curve") for key in (metric.key, f"{metric.key}_source") if key in frames[0]]
    stage = {
        "sides": [title for title, _, _ in moving],
        "frames": len(diff),
        "frame_time": diff.b.frame_time,
        "facing": facing(diff.matching.target, diff.b, diff.up),
        "rows": [row.data for row in rows],
        "jumps": [*_worst(document), *contact_jumps(rows), *_cuts(diff)],
        **thinned(actors),
    }
    data = {
        "document": {**document, "frames": None, "touching": TOUCHING},
        "contact-table": contact_table(document),
        "columns": {key: packed([np.nan if row[key] is None else row[key] for row in frames], "<f4") for key in keys},
        "registry": as_data("A", "B"),
        "stage": stage,
    }
    return html_page("clip", title, data)


def _actors(
    diff: Diff,
    moving: Sequence[tuple[str, Role, Motion]],
    skins: tuple[Capsules, Capsules],
    mesh: SkinnedMesh | None,
) -> Iterator[Actor]:
    """The actors, in units of twice the leg length of each body; those of B stand on one floor."""
    matching, floor = diff.matching, lowest_skin(diff.b, skins[1], mesh, diff.up)
    legs = matching.legs or (None, None)
    for side, (name, role, motion) in enumerate(moving):
        body = matching.target if side else matching.source
        own = legs[1] if side else legs[0]
        yield Actor(
            name=name,
            side=side,
            role=role,
            motion=motion,
            body=body,
            capsules=skins[1] if side else skins[0],
            mesh=mesh if side else None,
            turn=upright(diff.up),
            unit=(2 * leg_length(body.skeleton, own) if own else 0.0) or body.unit or 1.0,
            floor=floor if side else lowest_skin(motion, skins[0], None, diff.up),
        )


def facing(body: Body, motion: Motion, up: Array) -> float:
    """Return where a body faces in the first frame, as an angle from z about y [rad]; 0 without legs."""
    if body.legs is None:
        return 0.0
    left, right = (motion.positions[0, leg.hip] for leg in body.legs)
    front = upright(up).apply(np.cross(left - right, up))
    return float(np.arctan2(front[0], front[2]))


def contact_table(document: DiffDocument) -> Table:
    """The contacts of each two regions, in D."""
    rows: list[list[str | int]] = []
    for one in document["contacts"]:
        numbers = [f"{one['distance_a']:.3f}", f"{one['distance_b']:.3f}", f"{one['error']:.3f}"]
        joints = " \u2013 ".join(key.rpartition(":")[2] for key in one["joints_b"])
        rows.append([one["regions"], joints, str(one["frames"]), *numbers, one["worst_frame"]])
    columns = ["regions", "nearest joints", "frames", "D in A", "D in B", "error", "worst frame"]
    return {"title": "Contacts", "columns": columns, "rows": rows}


def _worst(document: DiffDocument) -> Iterator[dict[str, Any]]:
    """The worst frame of each metric that has one."""
    for key, frame in document["worst"].items():
        metric = BY_KEY[key]
        value = None if frame is None else document["frames"][frame][key]
        if value is not None and value > metric.least:
            name = f"{metric.label[0].upper()}{metric.label[1:]}"
            text = f"{name} {metric.factor * value:.3g} {metric.symbol}".rstrip()
            yield {"frame": frame, "kind": "Worst frames", "text": f"{text} \u00b7 {frame}"}


def contact_jumps(rows: Sequence[Row]) -> Iterator[dict[str, Any]]:
    """The beginnings of the first contacts of a timeline, for a menu."""
    starts = sorted((row.spans[0][0], row.name) for row in rows if row.kind == "contact")
    for frame, name in starts[:JUMPS]:
        yield {"frame": frame, "kind": "Contacts", "text": f"{name} \u00b7 {frame}"}


def _cuts(diff: Diff) -> Iterator[dict[str, Any]]:
    for frame in (np.flatnonzero(np.diff(diff.matching.source.shots_of(diff.a))) + 1).tolist():
        yield {"frame": frame, "kind": "Cuts", "text": f"frame {frame}"}
