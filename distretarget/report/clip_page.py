"""The report on a clip: an HTML page that plays a source and its result, or A and B of a diff, beside their figures."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from distretarget.checks import check_kind
from distretarget.io.files import write_whole
from distretarget.measure.diff import Diff, turned_note
from distretarget.measure.figures import as_data
from distretarget.pipeline.result import RetargetResult
from distretarget.report.diff_document import About, DiffDocument, document
from distretarget.report.drawing import diff_drawing
from distretarget.report.page import html_page


def write_report(
    path: str | Path,
    compared: RetargetResult | Diff,
    *,
    source_name: str = "source",
    result_name: str = "result",
    overwrite: bool = False,
) -> None:
    """Write the report on a run or a diff: one HTML file that any browser opens, without a network.

    `source_name` and `result_name` are what the report calls the two motions, A and B of a diff.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written.
        SettingsError: `compared` is something else.
    """
    check_kind("compared", compared, RetargetResult, Diff)
    about = About(a=source_name, b=result_name, command="", version=version("distretarget"))
    if isinstance(compared, RetargetResult):
        html = run_page(compared, about)
    else:
        html = diff_page(compared, document(compared, about))
    write_whole(path, html, overwrite)


def run_page(result: RetargetResult, about: About) -> str:
    """The HTML of the report on a run: A is its source, B its result; rotation copy, verdict and warnings are added to
    `about`.
    """
    diff, copy = run_diff(result), result.tracks["rotation_copy"]
    about = replace(about, rotation_copy=copy, verdict=result.verdict, warnings=result.warnings)
    return diff_page(diff, document(diff, about))


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
    """The HTML of the report on a diff, with its document embedded unchanged."""
    source, result = ("source ", "result ") if document["figures"]["rotation_copy"] else ("", "")
    title = f"{result}{document['b']['file']} against {source}{document['a']['file']}"
    return html_page(
        "clip", title, {"document": document, "drawing": diff_drawing(diff), "registry": as_data("A", "B")}
    )
