"""The record of a clip, and its packed form in the database: about 450 bytes, with all metrics."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from copy import deepcopy
from functools import lru_cache
from operator import itemgetter
from typing import Any, cast

import numpy as np

from distretarget.batch.plan import PlannedClip
from distretarget.measure.metrics import COLUMNS
from distretarget.report.page import VERSION, ClipRecord

made_from = itemgetter("input_hash", "target_hash", "options", "version")  # the values that determine a result
# Keys and defaults of the parts of a packed record.
SETTINGS: dict[str, Any] = {"target": "", "target_hash": "", "options": {}, "version": ""}
RIG: dict[str, Any] = {"notes": [], "alignment": ""}
CLIP: dict[str, Any] = dict.fromkeys(("input", "output", "status", "error", "input_hash", "output_hash", "verdict"), "")
CLIP |= {"frames": 0, "seconds": 0.0, "others": {}, "warnings": []}
MOST_BYTES = 1 << 24  # of an unpacked part; a longer one is damaged
MOST = 1e15  # frames, or seconds
WORDS = (  # the preset dictionary of the compression: texts that most parts contain
    b'"error":"others":{"warnings":["feet skate no more than in the source; "seconds":0.0,"frames":"verdict":"'
    b"There are no self-contacts to keep; feet do not skate; hips height kept within 0.1 % of a leg; largest direction "
    b'error: Left, 0. degrees at frame "input":"output":".bvh","status":"done","input_hash":"sha256:","output_hash":"'
    b"sha256:"
)
Packed = tuple[str, str, bytes, bytes]


class BatchRecord(ClipRecord):
    """The outcome of a clip. Hashes of files are "sha256:" and hexadecimal digits.

    Attributes:
        input_hash: of the clip's file; empty if it could not be read.
        output_hash: of the result; empty if there is none.
        others: the hashes of the other results by their paths in the folder of results.
        target_hash: of the target's file.
        options: all settings that influence the result, see `Recipe.settings`.
        version: of the program.
        verdict: on the result, a sentence.
        notes: joints of the target without a source, and which programs cannot read the result, a line each.
        alignment: of the two bodies, see `alignment_text`.
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
    """Return the record of a clip before it is done, with the status "failed" and no error."""
    paths = {"input": str(clip.path), "output": clip.output, "target": str(clip.target.path), "input_hash": input_hash}
    target_hash = clip.target.file.hash if clip.target.file else ""
    made_by = {"target_hash": target_hash, "options": dict(options), "version": VERSION}
    empty = deepcopy(SETTINGS | RIG | CLIP)  # records must not share lists
    return cast(BatchRecord, empty | {"metrics": {}, "status": "failed"} | paths | made_by)


def results_of(record: BatchRecord) -> dict[str, str]:
    """Return the hashes of all results of a clip by their paths in the folder of results."""
    return {record["output"]: record["output_hash"], **record["others"]}


def packed(record: BatchRecord) -> Packed:
    """Pack a record: settings, and values of the rig, as JSON that clips share; others and metrics, compressed."""
    values = cast(dict[str, Any], record)
    settings = json.dumps({**{key: values[key] for key in SETTINGS}, "columns": [*COLUMNS]})
    rig = json.dumps({key: values[key] for key in RIG})
    clip = json.dumps({key: values[key] for key in CLIP if values[key]}, separators=(",", ":"))
    measured = record["metrics"]
    numbers = [np.nan if measured.get(name) is None else measured[name] for name in COLUMNS if measured]
    return settings, rig, packed_part(clip.encode()), packed_part(np.array(numbers, "<f4").tobytes())


def unpacked(settings: str, rig: str, clip: bytes, metrics: bytes) -> BatchRecord:
    """Return the record that was packed in these parts; a ValueError if they are damaged."""
    try:
        return _unpacked(settings, rig, clip, metrics)
    except (TypeError, RecursionError, zlib.error) as error:
        raise ValueError from error


def _unpacked(settings: str, rig: str, clip: bytes, metrics: bytes) -> BatchRecord:
    shared = _shared(settings, rig)
    numbers = [each if abs(each) < MOST else None for each in np.frombuffer(_inflated(metrics), "<f4").tolist()]
    found = dict(zip(shared["columns"] if numbers else (), numbers, strict=True))
    own = _checked(json.loads(_inflated(clip)), CLIP)
    record = {**shared, **own, "metrics": found}
    del record["columns"]
    return cast(BatchRecord, record)


@lru_cache(maxsize=256)
def _shared(settings: str, rig: str) -> Mapping[str, Any]:
    return _checked(json.loads(settings), SETTINGS | {"columns": []}) | _checked(json.loads(rig), RIG)


def _checked(found: object, empty: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a part, completed by defaults; a ValueError if one has the wrong type or is out of bounds."""
    values = {**empty, **found} if isinstance(found, dict) else {}
    for key, default in empty.items():
        value: Any = values.get(key)
        if isinstance(default, int | float):
            is_valid = isinstance(value, int | float) and 0 <= value <= MOST
        else:
            texts = [*value.values()] if key == "others" and isinstance(value, dict) else value
            is_text = not isinstance(texts, list) or all(isinstance(each, str) for each in texts)
            is_valid = type(value) is type(default) and is_text
        if not is_valid:
            raise ValueError(f"{key} cannot be {value!r}")
    return values


def packed_part(content: bytes) -> bytes:
    """Return the content of a part, compressed."""
    pack = zlib.compressobj(9, wbits=-zlib.MAX_WBITS, zdict=WORDS)  # raw: saves a header of six bytes
    return pack.compress(content) + pack.flush()


def _inflated(content: bytes) -> bytes:
    unpack = zlib.decompressobj(-zlib.MAX_WBITS, zdict=WORDS)
    found = unpack.decompress(content, MOST_BYTES)
    if not unpack.eof:
        raise ValueError("is not whole")
    return found
