"""The page of a run: the result and the rotation copy against the source."""

from __future__ import annotations

from dataclasses import replace

from distretarget.measure.diff import Diff, turned_note
from distretarget.report.document import About, document
from distretarget.report.page import page
from distretarget.run_summary import Figures


def run_page(run: Figures, about: About) -> str:
    """The HTML of the report on a run, with A its source and B its result; `about` says nothing of the copy."""
    result, up = run.result, run.result.world.up_vector
    notes = turned_note(result.world)
    diff = Diff(result.source, result.motion, result.matching, up, result.written_stress, run.reached, notes)
    return page(diff, document(diff, replace(about, copy=run.copied, copy_stress=result.copy_stress)))
