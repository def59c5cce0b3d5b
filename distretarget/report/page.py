"""HTML pages as single files, with only their own scripts, that load nothing; and the page on all clips of a batch."""

from __future__ import annotations

import html
import json
import re
from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from importlib.metadata import version
from importlib.resources import files

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
