"""The page of a run: result and rotation copy measured against the source."""

from __future__ import annotations

from dataclasses import replace

from distretarget.measure.diff import Diff, turned_note
from distretarget.report.document import About, document
from distretarget.report.page import page
from distretarget.run_summary import Figures


def run_page(figures: Figures, about: About) -> str:
    """The HTML of the report on a run: A is its source, B its result; the rotation copy is added to `about`."""
    run, up = figures.run, figures.run.world.up_vector
    notes = turned_note(run.world)
    diff = Diff(run.source, run.motion, run.matching, up, run.written_stress, figures.result, notes)
    return page(diff, document(diff, replace(about, rotation_copy=figures.sides["rotation_copy"])))
