"""HTML pages as single files, with only their own scripts, that load nothing; and the page on all clips of a batch."""

from __future__ import annotations

import html
import json
import math
import os.path
import re
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from importlib.metadata import version
from importlib.resources import files
from types import MappingProxyType
from typing import Literal, TypedDict
from urllib.parse import quote

from distretarget.measure.metrics import COLUMNS, as_data

VERSION = version("distretarget")
LIBRARY = "three.min.js"
PLAYER = (
    "dom.js",
    "motion.js",
    "bodies.js",
    "stage.js",
    "playback.js",
    "timeline.js",
    "marks.js",
    "film.js",
    "player.js",
)
# The styles and modules of each kind of page, in order of import; its body is the file KIND.html.
STYLES = {
    "clip": ("style.css", "player.css", "clip.css"),
    "audit": ("style.css", "index.css", "audit.css"),
    "index": ("style.css", "player.css", "index.css"),
    "scene": ("style.css", "player.css"),
    "framed": ("style.css", "player.css", "framed.css"),
}
SCRIPTS = {
    "clip": (*PLAYER, "tables.js", "metrics.js", "clip.js"),
    "audit": (),
    "index": (*PLAYER, "metrics.js", "index.js"),
    "scene": (*PLAYER, "tables.js", "scene.js"),
    "framed": (*PLAYER, "framed.js"),
}
IMPORT = re.compile(r"^import .*?;\n|^export (?=\w)", re.MULTILINE | re.DOTALL)
HALVES = re.compile("[\ud800-\udfff]")  # surrogates, which file names may contain and UTF-8 cannot encode
ESCAPES = {ord(character): f"\\u{ord(character):04x}" for character in "<>&\u2028\u2029"}
ABSOLUTE = re.compile(r"^(?:/|[A-Za-z]:[/\\]|\\\\).*?([^/\\]*[/\\])$", re.DOTALL)  # a folder, and its name
METRIC_COLUMNS = tuple(name for name, (_, one) in COLUMNS.items() if "page over clips" in one.places)
FIELDS = ("clip", "link", "stage", "target", "done", "frames", "seconds", "warnings", "error", *METRIC_COLUMNS)


def html_page(kind: str, title: str, data: Mapping[str, object], **content: str) -> str:
    """The HTML of a page; scripts read `data`; a name with "stage" needs a player; `content` is HTML."""
    played = kind == "framed" or any(name.startswith("stage") for name in data)
    modules = [asset(name) for name in SCRIPTS[kind] if played or name not in PLAYER[1:]]
    scripts = [asset(LIBRARY)] * played + ["'use strict';\n" + "\n".join(IMPORT.sub("", one) for one in modules)]
    parts = content | {
        "title": html.escape(HALVES.sub("\ufffd", title)),
        "style": "\n".join(map(asset, STYLES[kind])),
        "hashes": " ".join(f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'" for script in scripts),
        "scripts": "\n".join(f"<script>{script}</script>" for script in scripts),
        "data": "\n".join(
            f'<script type="application/json" id="{name}">{script_json(value)}</script>' for name, value in data.items()
        ),
    }
    player = asset("player.html") if played else ""
    template = asset("page.html").replace("{{body}}", asset(f"{kind}.html")).replace("{{player}}", player)
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], template)


def script_json(value: object) -> str:
    """JSON for a script element: none of its characters can end the element or begin a comment."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return HALVES.sub(lambda half: f"\\u{ord(half[0]):04x}", text).translate(ESCAPES)


def asset(name: str, package: str = __package__) -> str:
    """Return the text of a file that comes with a package."""
    return files(package).joinpath(name).read_text(encoding="utf-8")


class ClipRecord(TypedDict):
    """The data of a clip on the page over all clips."""

    input: str  # path of the clip
    output: str  # path of the result, relative to the folder of results, with slashes
    target: str  # path of the target's file
    frames: int  # number of retargeted frames
    seconds: float  # time of retargeting [s]
    metrics: Mapping[str, float | None]  # by `COLUMNS`; None where nothing was measured; empty if it failed
    warnings: list[str]  # a line each
    status: Literal["done", "failed"]
    error: str  # why it failed; empty if it did not


def index_page(
    records: Sequence[ClipRecord],
    links: Mapping[str, str],
    title: str,
    stages: Mapping[str, object] = MappingProxyType({}),
) -> str:
    """The HTML of the page over clips, from their records; `links` to reports, and player data, are by output."""
    table = _table(records, links, [*stages])
    data = {"batch": {**table, "version": VERSION}, "registry": as_data("the source", "the result")}
    return html_page("index", title, data | {f"stage-{k}": stage for k, stage in enumerate(stages.values())})


def _table(records: Sequence[ClipRecord], links: Mapping[str, str], played: Sequence[str]) -> dict[str, object]:
    """The records in few bytes: folders, targets and warnings once, and for each clip a row of `FIELDS`."""
    targets = list(dict.fromkeys(record["target"] for record in records))
    folder, target_folder = folder_of(record["input"] for record in records), folder_of(targets)
    warnings = list(dict.fromkeys(text for record in records for text in record["warnings"]))
    target_at, warning_at = ({text: k for k, text in enumerate(texts)} for texts in (targets, warnings))
    rows = [
        [
            record["input"][len(folder) :],
            _url(links.get(record["output"])),
            played.index(record["output"]) if record["output"] in played else None,
            target_at[record["target"]],
            *((1, record["frames"], _number(record["seconds"])) if record["status"] == "done" else (0, None, None)),
            [warning_at[text] for text in record["warnings"]],
            _reason(record),
            *(_number(record["metrics"].get(name)) for name in METRIC_COLUMNS),
        ]
        for record in records
    ]
    names = [target[len(target_folder) :] for target in targets]
    shown = ABSOLUTE.sub(r"\1", folder)
    return {"folder": shown, "targets": names, "warnings": warnings, "fields": FIELDS, "rows": rows}


def _number(value: object) -> float | None:
    """A number with six digits, unless it is whole; None for anything else."""
    if isinstance(value, int):
        return value
    return float(f"{value:.6g}") if isinstance(value, float) and math.isfinite(value) else None


def folder_of(paths: Iterable[str]) -> str:
    """Return the common prefix of all paths, up to and including its last slash or backslash."""
    common = os.path.commonprefix(list(paths))  # noqa: RUF071 (by letters, as paths may be of any system)
    return common[: max(common.rfind("/"), common.rfind("\\")) + 1]


def _reason(record: ClipRecord) -> str | None:
    """Why a clip failed, without the names of clip and target, which the page shows anyway."""
    if record["status"] == "done":
        return None
    error = str(record["error"] or "no reason given")
    if error.startswith(f"{record['input']}:"):
        error = re.sub(r"^:(\d+): ", r": line \1: ", error.removeprefix(record["input"])).removeprefix(": ")
    return error.removeprefix(f"{record['target']}: ")


def _url(path: str | None) -> str | None:
    """The relative URL of a path, from the bytes of its name in the file system."""
    if path is None:
        return None
    try:
        return quote(path, errors="surrogateescape")
    except UnicodeEncodeError:  # half characters that stand for no byte, as in names on Windows
        return quote(path, errors="surrogatepass")
