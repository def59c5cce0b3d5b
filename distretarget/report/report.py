"""The report on a run or a diff: an HTML file that shows both motions, and the figures of quality beside them."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from distretarget.checks import check_kind
from distretarget.io.files import write_whole
from distretarget.measure.diff import Diff, turned_note
from distretarget.pipeline.result import RetargetResult
from distretarget.report.document import About, document
from distretarget.report.page import page


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
        html = page(compared, document(compared, about))
    write_whole(path, html, overwrite)


def run_page(result: RetargetResult, about: About) -> str:
    """The HTML of the report on a run: A is its source, B its result; rotation copy, verdict and warnings are added to
    `about`.
    """
    diff, copy = run_diff(result), result.tracks["rotation_copy"]
    about = replace(about, rotation_copy=copy, verdict=result.verdict, warnings=result.warnings)
    return page(diff, document(diff, about))


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
