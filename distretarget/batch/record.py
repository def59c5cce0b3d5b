"""What is recorded of a clip, and its parts in two files: a line of the manifest, and a row of `metrics.csv`.

The settings that many clips share have a line of their own. A row is found by the hash of what it says, which is its
first cell, so that a damaged row is not used.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import sys
from collections.abc import Mapping
from importlib.metadata import version
from operator import itemgetter
from typing import Any, TypedDict, cast

from distretarget.batch.plan import Clip
from distretarget.measure.metrics import COLUMNS as METRICS
from distretarget.report.page import ClipRecord

VERSION = version("distretarget")
MOST = sys.float_info.max  # of a number in a line; JSON may have larger ones
# The keys of the two kinds of lines, by the kind of their values; a clip has the last ones unless they are empty.
OF_SETTINGS: dict[str, Any] = {"target": str, "target_hash": str, "options": dict, "version": str}
OF_CLIP: dict[str, Any] = {"input": str, "output": str, "status": str, "frames": int, "seconds": int | float}
UNLESS_EMPTY: dict[str, Any] = dict.fromkeys(("input_hash", "output_hash", "row", "error", "left_out"), str)
UNLESS_EMPTY["others"] = dict
ROW = ("row", "output", "verdict", "warnings", "notes", "alignment", *METRICS)  # the columns of a row
BETWEEN = " | "  # warnings of a clip, and notes
made_from = itemgetter("input_hash", "target_hash", "options", "version")  # what determines an output


class Measured(TypedDict):
    """What was measured of a clip.

    Attributes:
        metrics: by `measure.metrics.COLUMNS`; None where nothing was to be measured; empty of a clip that failed.
        verdict: on the result, in a sentence.
        warnings: a line each.
        notes: joints of the target without a counterpart, in a line, and which readers refuse the result.
        alignment: of the two bodies, as `alignment_text` has it.
    """

    metrics: Mapping[str, float | None]
    verdict: str
    warnings: list[str]
    notes: list[str]
    alignment: str


class ManifestRecord(ClipRecord, Measured):
    """What a manifest says of a clip. Hashes of files are "sha256:" and hexadecimal digits.

    Attributes:
        input_hash: of the clip's file; empty if it could not be read.
        output_hash: of the output; empty if there is none.
        others: the hashes of the other results, by their paths in the folder of results.
        target_hash: of the target's file.
        options: what else decides the output, as `Recipe.settings` says it.
        version: of the program.
        left_out: why there is no output, of a clip that fails the condition of `--keep`; else empty.
    """

    input_hash: str
    output_hash: str
    others: dict[str, str]
    target_hash: str
    options: dict[str, Any]
    version: str
    left_out: str


def new_record(clip: Clip, options: Mapping[str, object], input_hash: str = "") -> ManifestRecord:
    """Return the record of a clip that is not done: failed, without a reason; `options` decide its output."""
    line = {"input": str(clip.path), "output": clip.output, "status": "failed", "frames": 0, "seconds": 0.0}
    line["input_hash"] = input_hash
    target_hash = clip.target.file.hash if clip.target.file else ""
    settings = {"target": str(clip.target.path), "target_hash": target_hash, "options": options, "version": VERSION}
    return whole_record(line, settings, None)


def whole_record(clip: Mapping[str, Any], settings: Mapping[str, Any], measured: Measured | None) -> ManifestRecord:
    """Return the record of the line of a clip, its settings, and its row of metrics."""
    empty = {key: kind() for key, kind in UNLESS_EMPTY.items()}
    nothing = {"metrics": {}, "verdict": "", "warnings": [], "notes": [], "alignment": ""}
    record = {**empty, **clip, **settings, **(measured or nothing)}
    return cast(ManifestRecord, {key: record[key] for key in record if key not in ("settings", "row")})


def settings_line(record: ManifestRecord) -> tuple[str, bytes]:
    """Return the name of the settings of a clip, and their line."""
    settings = {key: record[key] for key in OF_SETTINGS}  # type: ignore[literal-required]
    name = hashlib.sha256(json.dumps(settings).encode()).hexdigest()[:12]
    return name, json.dumps({"settings": name, **settings}, allow_nan=False).encode()


def clip_line(record: ManifestRecord, settings: str, row: str) -> bytes:
    """Return the line of a clip, with the names of its settings and of its row of metrics, if any."""
    values = {**record, "settings": settings, "row": row}
    keys = (*OF_CLIP, "settings", *(key for key in UNLESS_EMPTY if values[key]))
    return json.dumps({key: values[key] for key in keys}, allow_nan=False).encode()


def parse_line(line: bytes) -> dict[str, Any] | None:
    """Return what a line says, of settings or of a clip; None if it is not whole or says something else."""
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or not isinstance(found.get("settings"), str):
        return None
    kinds = OF_SETTINGS if "options" in found else OF_CLIP
    if any(not isinstance(found.get(key), kind) for key, kind in kinds.items()):
        return None
    return found if kinds is OF_SETTINGS or _is_sound(found) else None


def _is_sound(clip: dict[str, Any]) -> bool:
    """Whether the values in a line of a clip can be."""
    optional = all(isinstance(clip.get(key, kind()), kind) for key, kind in UNLESS_EMPTY.items())
    hashes = optional and all(isinstance(each, str) for each in clip.get("others", {}).values())
    numbers = all(0 <= clip[key] <= MOST for key in ("frames", "seconds"))
    return hashes and numbers and clip["status"] in ("done", "failed")


def row_of(output: str, measured: Measured) -> bytes:
    """Return the row of an output."""
    warnings, notes = (BETWEEN.join(measured[key]) for key in ("warnings", "notes"))
    texts = [" ".join(each.splitlines()) for each in (output, measured["verdict"], warnings, notes)]
    row = io.StringIO()
    numbers = (measured["metrics"].get(name) for name in METRICS)
    csv.writer(row, lineterminator="").writerow([*texts, measured["alignment"], *numbers])
    content = row.getvalue().encode("utf-8", "surrogateescape")
    return _hash_of(content) + b"," + content


def parse_row(line: bytes) -> Measured | None:
    """Return what a row says; None if it is damaged, or of another version."""
    name, _, content = line.rstrip(b"\n").partition(b",")
    if name != _hash_of(content):
        return None
    _, verdict, warnings, notes, alignment, *cells = next(csv.reader([content.decode("utf-8", "surrogateescape")]))
    numbers = [float(cell) if cell else None for cell in cells]
    return Measured(
        metrics=dict(zip(METRICS, numbers, strict=True)),
        verdict=verdict,
        warnings=warnings.split(BETWEEN) if warnings else [],
        notes=notes.split(BETWEEN) if notes else [],
        alignment=alignment,
    )


def _hash_of(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest()[:16].encode()
