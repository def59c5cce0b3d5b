"""HTML pages as single files that need no other: a template, its styles and scripts, and JSON data."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping
from importlib.resources import files

# The styles and scripts of each kind of page; its body is the file KIND.html.
STYLES = {"clip": ["style.css"], "index": ["style.css", "index.css"], "scene": ["style.css", "scene.css"]}
SCRIPTS = {
    "clip": [
        *("base.js", "figures.js", "data.js", "camera.js", "playback.js", "skeletons.js", "player.js", "curves.js"),
        *("heatmap.js", "tables.js"),
    ],
    "index": ["base.js", "figures.js", "index.js"],
    "scene": ["base.js", "camera.js", "playback.js", "scene.js"],
}
HALVES = re.compile("[\ud800-\udfff]")  # half characters, which file names may contain and UTF-8 cannot encode
ESCAPES = {ord(character): f"\\u{ord(character):04x}" for character in "<>&\u2028\u2029"}


def html_page(kind: str, title: str, data: Mapping[str, object]) -> str:
    """The HTML of a "clip", "index" or "scene" page. Its scripts read `data` by name."""
    parts = {
        "title": html.escape(HALVES.sub("\ufffd", title)),
        "style": "\n".join(map(_asset, STYLES[kind])),
        "script": "\n".join(map(_asset, SCRIPTS[kind])),
        "data": "\n".join(
            f'<script type="application/json" id="{name}">{script_json(value)}</script>' for name, value in data.items()
        ),
    }
    template = _asset("page.html").replace("{{body}}", _asset(f"{kind}.html"))
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], template)


def script_json(value: object) -> str:
    """JSON for a script element: none of its characters can end the element or begin a comment."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return HALVES.sub(lambda half: f"\\u{ord(half[0]):04x}", text).translate(ESCAPES)


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
