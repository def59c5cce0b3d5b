"""The report as one HTML file that needs no other: document, drawing data, style and script."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files

from distretarget.measure.diff import Diff
from distretarget.measure.figures import as_data
from distretarget.report.document_types import DiffDocument
from distretarget.report.drawing import diff_drawing

SCRIPTS = ("base.js", "data.js", "camera.js", "skeletons.js", "player.js", "curves.js", "heatmap.js", "tables.js")
HALVES = re.compile("[\ud800-\udfff]")  # half characters, which file names may contain and UTF-8 cannot encode
ESCAPES = {ord(character): f"\\u{ord(character):04x}" for character in "<>&\u2028\u2029"}


def page(diff: Diff, document: DiffDocument) -> str:
    """The HTML of the report on a diff, with the diff's `document` embedded unchanged."""
    source, result = ("source ", "result ") if document["figures"]["rotation_copy"] else ("", "")
    title = f"{result}{document['b']['file']} against {source}{document['a']['file']}"
    data = {"document": document, "drawing": diff_drawing(diff), "registry": as_data("A", "B")}
    return filled("template.html", title, styles=["style.css"], scripts=SCRIPTS, data=data)


def filled(
    template: str, title: str, *, styles: Sequence[str], scripts: Sequence[str], data: Mapping[str, object]
) -> str:
    """Fill the head of all pages and the template of one: its title, the files of its style and script, and named JSON
    data.
    """
    parts = {
        "title": html.escape(HALVES.sub("\ufffd", title)),
        "style": "\n".join(map(_asset, styles)),
        "script": "\n".join(map(_asset, scripts)),
        **{name: script_json(value) for name, value in data.items()},
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], _asset("head.html") + _asset(template))


def script_json(value: object) -> str:
    """JSON for a script element: none of its characters can end the element or begin a comment."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return HALVES.sub(lambda half: f"\\u{ord(half[0]):04x}", text).translate(ESCAPES)


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
