"""What is recorded of a clip."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from operator import itemgetter
from typing import Any

from distretarget.batch.plan import PlannedClip
from distretarget.report.page import ClipRecord

VERSION = version("distretarget")
made_from = itemgetter("input_hash", "target_hash", "options", "version")  # what determines a result


class BatchRecord(ClipRecord):
    """What became of a clip. Hashes of files are "sha256:" and hexadecimal digits.

    Attributes:
        input_hash: of the clip's file; empty if it could not be read.
        output_hash: of the result; empty if there is none.
        others: the hashes of the other results, by their paths in the folder of results.
        target_hash: of the target's file.
        options: what else decides the result, as `Recipe.settings` says it.
        version: of the program.
        verdict: on the result, in a sentence.
        notes: joints of the target without a counterpart, in a line, and which readers refuse the result.
        alignment: of the two bodies, as `alignment_text` has it.
    """

    input_hash: str
    output_hash: str
    others: dict[str, str]
    target_hash: str
    options: dict[str, Any]
    version: str
    verdict: str
    notes: list[str]
    alignment: str


def new_record(clip: PlannedClip, options: Mapping[str, Any], input_hash: str = "") -> BatchRecord:
    """Return the record of a clip that is not done: failed, without a reason; `options` decide its results."""
    return BatchRecord(
        input=str(clip.path),
        output=clip.output,
        target=str(clip.target.path),
        frames=0,
        seconds=0.0,
        metrics={},
        warnings=[],
        status="failed",
        error="",
        input_hash=input_hash,
        output_hash="",
        others={},
        target_hash=clip.target.file.hash if clip.target.file else "",
        options=dict(options),
        version=VERSION,
        verdict="",
        notes=[],
        alignment="",
    )


def results_of(record: BatchRecord) -> dict[str, str]:
    """Return the hashes of all results of a clip, by their paths in the folder of results."""
    return {record["output"]: record["output_hash"], **record["others"]}
