"""HTML pages as single files: a template, its styles, the modules of its scripts in one scope, and JSON data.

A page runs no script but its own, by their hashes, and asks for nothing.
"""

from __future__ import annotations

import html
import json
import re
from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from importlib.resources import files

LIBRARY = "three.min.js"
PLAYER = (
    "dom.js",
    "motion.js",
    "bodies.js",
    "ground.js",
    "stage.js",
    "playback.js",
    "timeline.js",
    "marks.js",
    "player.js",
)
# The styles and modules of each kind of page, after those that they import; its body is the file KIND.html.
STYLES = {
    "clip": ("style.css", "player.css", "clip.css"),
    "audit": ("style.css", "index.css", "audit.css"),
    "index": ("style.css", "player.css", "index.css"),
    "scene": ("style.css", "player.css"),
}
SCRIPTS = {
    "clip": (*PLAYER, "tables.js", "metrics.js", "curves.js", "clip.js"),
    "audit": (),
    "index": (*PLAYER, "metrics.js", "index.js"),
    "scene": (*PLAYER, "tables.js", "scene.js"),
}
IMPORT = re.compile(r"^import .*?;\n|^export (?=\w)", re.MULTILINE | re.DOTALL)
HALVES = re.compile("[\ud800-\udfff]")  # half characters, which file names may contain and UTF-8 cannot encode
ESCAPES = {ord(character): f"\\u{ord(character):04x}" for character in "<>&\u2028\u2029"}


def html_page(kind: str, title: str, data: Mapping[str, object], **content: str) -> str:
    """The HTML of a "clip", "index", "scene" or "audit" page. Its scripts read `data` by name; a name that begins with
    "stage" is for the player. `content` is HTML for places of these names.
    """
    played = any(name.startswith("stage") for name in data)
    modules = [_asset(name) for name in SCRIPTS[kind] if played or name not in PLAYER[1:]]
    scripts = [_asset(LIBRARY)] * played + ["'use strict';\n" + "\n".join(IMPORT.sub("", one) for one in modules)]
    parts = content | {
        "title": html.escape(HALVES.sub("\ufffd", title)),
        "style": "\n".join(map(_asset, STYLES[kind])),
        "hashes": " ".join(f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'" for script in scripts),
        "scripts": "\n".join(f"<script>{script}</script>" for script in scripts),
        "data": "\n".join(
            f'<script type="application/json" id="{name}">{script_json(value)}</script>' for name, value in data.items()
        ),
    }
    player = _asset("player.html") if played else ""
    template = _asset("page.html").replace("{{body}}", _asset(f"{kind}.html")).replace("{{player}}", player)
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], template)


def script_json(value: object) -> str:
    """JSON for a script element: none of its characters can end the element or begin a comment."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return HALVES.sub(lambda half: f"\\u{ord(half[0]):04x}", text).translate(ESCAPES)


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
