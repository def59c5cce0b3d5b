"""The page of a run: result and rotation copy measured against the source."""

from __future__ import annotations

from dataclasses import replace

from distretarget.measure.diff import Diff, turned_note
from distretarget.report.document import About, document
from distretarget.report.page import page
from distretarget.result import RetargetResult


def run_page(result: RetargetResult, about: About) -> str:
    """The HTML of the report on a run: A is its source, B its result; the rotation copy is added to `about`."""
    up, notes = result.world.up_vector, turned_note(result.world)
    diff = Diff(
        a=result.source,
        b=result.motion,
        matching=result.matching,
        up=up,
        stress=result.written_stress,
        comparison=result.comparison,
        notes=notes,
    )
    return page(diff, document(diff, replace(about, rotation_copy=result.tracks["rotation_copy"])))
