"""The lines of a manifest: what is recorded of each clip, and which recipe its output was made by."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypedDict, cast

from distretarget.baseline.engine_root import RootFollows
from distretarget.baseline.world import RootOffset
from distretarget.batch.plan import Work
from distretarget.io.map_json import MapFile
from distretarget.objectives.resting_joints import Environment
from distretarget.pipeline.options import HoldMode, Objective, Options
from distretarget.report.index_page import ClipRecord


class RecordedOptions(TypedDict):
    """How a clip was retargeted.

    Attributes:
        objective, supports, environment, root_scale, source_up, target_up, root_offset, root_follows: the arguments of
            `retarget`.
        map: the key of the source joint by that of the target joint; None for no map.
    """

    objective: Objective
    supports: HoldMode
    environment: Environment
    root_scale: float | None
    source_up: str | None
    target_up: str | None
    root_offset: RootOffset | None
    root_follows: RootFollows | None
    map: Mapping[str, str | None] | None


class ManifestRecord(ClipRecord):
    """A line of a manifest. Hashes of files are "sha256:" and hexadecimal digits.

    Attributes:
        input_hash: the hash of the clip's file; None if it could not be read.
        output_hash: the hash of the output; None if there is none.
        target_hash: the hash of the target's file.
        options: how the clip was retargeted.
        notes: joints of the target without a counterpart, in a line.
        version: the version of the program.
    """

    input_hash: str | None
    output_hash: str | None
    target_hash: str
    options: RecordedOptions
    notes: list[str]
    version: str


@dataclass(frozen=True)
class Recipe:
    """What determines an output besides the clip and the target: options, map, and the version of the program."""

    options: Options
    map: MapFile
    version: str

    def recorded(self) -> RecordedOptions:
        """Return the options and the map as a line of the manifest has them."""
        return cast(RecordedOptions, asdict(self.options) | {"map": dict(self.map.pairs) or None})


def failed_record(work: Work, input_hash: str | None, recipe: Recipe) -> ManifestRecord:
    """Return the record of a clip that failed, yet without a reason."""
    return {
        "input": str(work.clip.path),
        "input_hash": input_hash,
        "output": work.place.as_posix(),
        "output_hash": None,
        "target": str(work.target.path),
        "target_hash": work.target.hash,
        "options": recipe.recorded(),
        "version": recipe.version,
        "frames": 0,
        "seconds": 0.0,
        "figures": {},
        "notes": [],
        "warnings": [],
        "status": "failed",
        "error": None,
    }


def read_records(
    path: Path, broken: Callable[[int], object] = lambda _line: None, start: int = 0
) -> Iterator[ManifestRecord]:
    """Yield the records of a manifest in order; none where there is no manifest.

    `broken` is called with the number of each line, from 1, that is neither a record nor blank. `start` is how much of
    the file is left out [bytes].
    """
    if not path.exists():
        return
    with path.open("rb") as file:
        file.seek(start)
        for number, line in enumerate(file, start=1):
            if (record := parse_record(line)) is not None:
                yield record
            elif line.strip():
                broken(number)


def parse_record(line: bytes) -> ManifestRecord | None:
    """Return the record in a line; None if the line is not a whole record."""
    value = _parsed(line)
    return cast(ManifestRecord, value) if _is_record(value) else None


def is_of_manifest(line: bytes) -> bool:
    """Return whether a line has the keys of a record, whatever their values."""
    value = _parsed(line)
    return isinstance(value, dict) and value.keys() >= ManifestRecord.__required_keys__


def _parsed(line: bytes) -> object:
    try:
        return json.loads(line)
    except (ValueError, RecursionError):
        return None


def _is_record(value: object) -> bool:
    match value:
        case {
            "input": str(),
            "input_hash": str() | None,
            "output": str(),
            "output_hash": str() | None,
            "target": str(),
            "target_hash": str(),
            "options": dict(),
            "version": str(),
            "frames": int(),
            "seconds": int() | float(),
            "figures": dict(figures),
            "notes": list(notes),
            "warnings": list(warnings),
            "status": "done" | "failed",
            "error": str() | None,
        }:
            return all(isinstance(text, str) for text in (*notes, *warnings)) and all(map(_is_side, figures.values()))
    return False


def _is_side(figures: object) -> bool:
    """Whether these are the figures of one side of a record."""
    return isinstance(figures, dict) and all(isinstance(value, int | float | None) for value in figures.values())
