"""The report on a clip: an HTML page with source and result, or A and B of a diff, in a player, and their metrics."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from distretarget.body.build import capsules_of
from distretarget.body.skin_anchors import AnchoredSkin
from distretarget.checks import check_kind
from distretarget.errors import DistretargetError
from distretarget.io.files import write_whole
from distretarget.io.input_file import InputFile
from distretarget.io.reading import parse_full_target
from distretarget.matching.matching import Matching
from distretarget.measure.contacts import CONTACT_DISTANCE, FAR_ALONG
from distretarget.measure.diff import Diff, turned_note
from distretarget.measure.metrics import BY_KEY, as_data, metrics_at
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array
from distretarget.pipeline.found_contacts import MarkedContact, marked_contacts
from distretarget.pipeline.result import RetargetResult
from distretarget.report.actors import Role, encoded, to_y_up
from distretarget.report.diff_document import About, Table, Values, document
from distretarget.report.page import html_page
from distretarget.report.stage import Jump, ShownBody, bodies_in_motion, facing, rows_of_body, timeline
from distretarget.skin.capsules import Capsules
from distretarget.skin.mesh import SkinnedMesh
from distretarget.target import LoadedTarget, Target

Meshes = tuple[SkinnedMesh | None, SkinnedMesh | None]
TOUCHING = (
    "Two regions of the body, such as a hand and the head, touch if D of their nearest joints is below "
    f"{CONTACT_DISTANCE:g} and at least {FAR_ALONG} joints lie on the path between them. Regions joined by a bone do "
    "not count, nor do two feet while one of them rests."
)


def write_report(
    path: str | Path,
    compared: RetargetResult | Diff,
    *,
    source_name: str = "source",
    result_name: str = "result",
    overwrite: bool = False,
) -> None:
    """Write the report on a run or a diff: one HTML file that any browser opens without a network.

    `source_name` and `result_name` are the names of the two motions, A and B of a diff, in the report.

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


def run_page(
    result: RetargetResult, about: About, target: LoadedTarget | None = None, source: InputFile | None = None
) -> str:
    """The HTML of the report on a run; `target` and `source` have the meshes to show."""
    diff, copy = run_diff(result), result.tracks["rotation_copy"]
    about = replace(about, rotation_copy=copy, verdict=result.verdict, warnings=result.warnings)
    body = shown_result("", result, meshes_of(result, target, source))
    return _page(diff, document(diff, about), body, marked_contacts(result))


def run_motions(result: RetargetResult, meshes: Meshes) -> dict[str, object]:
    """Return the motions for the player of `run_page`; `meshes` as by `meshes_of`."""
    return _motions(shown_result("", result, meshes), result.world.up_vector)


def run_axes(result: RetargetResult) -> list[dict[str, object] | None]:
    """Return each joint's axes for anchors (`AnchoredSkin.axes_at`) in the player's rest pose, and part; or None."""
    body, turn, unit = result.matching.target, to_y_up(result.world.up_vector), _units(result.matching)[1]
    skin = AnchoredSkin.of(body, result.skins.target.capsules if result.skins else None)
    found = list[dict[str, object] | None]()
    for joint, region in enumerate(body.regions.of_joint.tolist()):
        axes, name = skin.axes_at(joint), body.regions.names[region] if region >= 0 else ""
        first = body.roles.get(name, int((body.regions.of_joint == region).argmax()))
        name = name if skin.part_of(joint) == skin.part_of(first) else body.skeleton.keys[joint]
        if axes is None:
            found.append(None)
            continue
        start, directions, length = axes
        shown = {"start": turn.apply(start / unit).tolist(), "directions": turn.apply(directions).tolist()}
        found.append({"name": name, **shown, "length": length / unit})
    return found


def run_timeline(result: RetargetResult, marked: Sequence[MarkedContact]) -> dict[str, object]:
    """Return the timeline of `run_page` without the worst frames; `marked` are the contacts of the result."""
    return _timeline(run_diff(result), shown_result("", result), marked)


def meshes_of(result: RetargetResult, target: LoadedTarget | None, source: InputFile | None) -> Meshes:
    """Return the meshes to show for source and target; None for one without."""
    mesh = result.mesh
    if mesh is None and isinstance(target, Target):
        hips, own = result.baseline.match.hips, target.mesh()
        mesh = hips.mesh(own) if hips and own else own
    return _mesh_of(source, result.source), mesh


def shown_result(name: str, result: RetargetResult, meshes: Meshes | None = None) -> ShownBody:
    """Return the performer of a result, with its rotation copy; by default in the result's own meshes."""
    skins = result.skins and (result.skins.source.capsules, result.skins.target.capsules)
    return ShownBody(
        name=name,
        motions=(result.source, *map(result.baseline.match.on_body, (result.rotation_copy, result.motion))),
        matching=result.matching,
        skins=skins or _capsules(result.matching),
        meshes=meshes or (None, result.mesh),
    )


def shown_diff(name: str, diff: Diff) -> ShownBody:
    """Return the performer of a diff."""
    motions = diff.a[: len(diff)], diff.b
    return ShownBody(name=name, motions=motions, matching=diff.matching, skins=_capsules(diff.matching))


def _capsules(matching: Matching) -> tuple[Capsules, Capsules]:
    return capsules_of(matching.source), capsules_of(matching.target)


def _mesh_of(file: InputFile | None, motion: Motion) -> SkinnedMesh | None:
    """The mesh in the file of a motion; None if it has none, or one for other joints or another rest pose."""
    if file is None or not file.format.has_characters:
        return None
    try:
        target = parse_full_target(file)
    except DistretargetError:
        return None
    own, shown = target.skeleton, motion.skeleton
    same = own.keys == shown.keys and np.allclose(
        own.rest_positions, shown.rest_positions, atol=1e-6 * own.lengths.sum()
    )
    return target.mesh() if same else None


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


def diff_page(diff: Diff, document: Values) -> str:
    """The HTML of the report on a diff, from its document."""
    return _page(diff, document, shown_diff("", diff))


def _page(diff: Diff, document: Values, body: ShownBody, marked: Sequence[MarkedContact] = ()) -> str:
    """The page on a diff with motions of a body in its player, first that of A, then those of B's body."""
    source, result = ("source ", "result ") if document["metrics"]["rotation_copy"] else ("", "")
    title = f"{result}{document['b']['file']} against {source}{document['a']['file']}"
    frames = document["frames"]
    keys = [key for metric in metrics_at("curve") for key in (metric.key, f"{metric.key}_source") if key in frames[0]]
    data = {
        "document": {**document, "frames": None, "touching": TOUCHING},
        "contact-table": contact_table(document),
        "columns": {key: encoded([np.nan if row[key] is None else row[key] for row in frames], "<f4") for key in keys},
        "registry": as_data("A", "B"),
        "stage": {**_motions(body, diff.up), **_timeline(diff, body, marked, _worst(document))},
    }
    return html_page("clip", title, data)


def _timeline(
    diff: Diff, body: ShownBody, marked: Sequence[MarkedContact], jumps: Iterable[Jump] = ()
) -> dict[str, object]:
    edges = (np.flatnonzero(np.diff(diff.matching.source.shots_of(diff.a))) + 1).tolist()
    cuts = [{"frame": frame, "kind": "Cuts", "text": f"frame {frame}"} for frame in edges]
    return timeline(rows_of_body(body, diff, marked), [*jumps, *cuts])


def _motions(body: ShownBody, up: Array) -> dict[str, object]:
    sides: dict[str, Role] = {"A": "source", "B": "result"}
    if len(body.motions) > len(sides):
        sides = {"Source": "source", "Copied rotations": "copy", "Result": "result"}
    matching = body.matching
    assert matching
    return bodies_in_motion([body], sides, up, _units(matching), facing(matching.target, body.motions[-1], up))


def _units(matching: Matching) -> tuple[float, float]:
    """The units of length of source and target in the page, two legs each [file units]."""
    a, b = (2.0 * leg for leg in matching.leg_lengths)
    return a or matching.source.unit or 1.0, b or matching.target.unit or 1.0


def contact_table(document: Values) -> Table:
    """The table of contacts between regions, in D."""
    rows: list[list[str | int]] = []
    for one in document["contacts"]:
        numbers = [f"{one['distance_a']:.3f}", f"{one['distance_b']:.3f}", f"{one['error']:.3f}"]
        joints = " \u2013 ".join(key.rpartition(":")[2] for key in one["joints_b"])
        rows.append([one["regions"], joints, str(one["frames"]), *numbers, one["worst_frame"]])
    columns = ["regions", "nearest joints", "frames", "D in A", "D in B", "error", "worst frame"]
    return Table(title="Contacts", columns=columns, rows=rows)


def _worst(document: Values) -> Iterator[dict[str, Any]]:
    """The worst frame of each metric that has one."""
    for key, frame in document["worst"].items():
        metric = BY_KEY[key]
        value = None if frame is None else document["frames"][frame][key]
        if value is not None and value > metric.least:
            name = f"{metric.label[0].upper()}{metric.label[1:]}"
            text = f"{name} {metric.factor * value:.3g} {metric.symbol}".rstrip()
            yield {"frame": frame, "kind": "Worst frames", "text": f"{text} \u00b7 {frame}"}
