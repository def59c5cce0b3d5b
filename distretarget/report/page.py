"""HTML pages as single files: a template, its styles and scripts, JSON data, and motions packed to be small.

Packed arrays are base64 of little-endian numbers.
"""

from __future__ import annotations

import html
import json
import re
from base64 import b64encode
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from distretarget.numerics.rotations import least_rotation
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

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
BUDGET = 5_000_000  # most bytes for the packed positions of all motions of a page; longer clips are drawn in part
STEPS = 65_535  # steps of a quantised coordinate across the bounding box
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


def drawn_step(frames: int, joints: int) -> int:
    """Return n so that every n-th frame of this number of joints fits in `BUDGET`."""
    return max(1, -(-frames * joints * 3 * 2 // BUDGET))


def quantised(positions: Array) -> tuple[NDArray[np.int16], Array, Array]:
    """Quantise positions (frames, joints, 3) in their bounding box: 16-bit numbers, offset (3,) and scale (3,).

    A position is offset + scale * number, with an error of at most half a step; the box has `STEPS` of them.
    """
    low, high = positions.min(axis=(0, 1)), positions.max(axis=(0, 1))
    scale = (high - low) / STEPS
    numbers = np.rint((positions - low) / np.where(scale > 0, scale, 1.0)) - (STEPS + 1) // 2
    return numbers.astype(np.int16), low + scale * ((STEPS + 1) // 2), scale


def packed(skeleton: Skeleton, positions: Array) -> dict[str, Any]:
    """Pack positions (frames, joints, 3) in few bytes, as offset + scale * number, with the parents of the joints."""
    numbers, offset, scale = quantised(positions)
    return {
        "parents": skeleton.parents.tolist(),
        "offset": offset.tolist(),
        "scale": scale.tolist(),
        "positions": in_base64(numbers, "<i2"),
    }


def upright(up: Array) -> Rotation:
    """The rotation that turns `up`, (3,), to y."""
    return Rotation.from_quat(least_rotation(up[None], np.array([[0.0, 1.0, 0.0]]))[0])


def in_base64(array: NDArray[Any], dtype: str) -> str:
    """An array as text for the players, with numbers of the given type."""
    return b64encode(np.ascontiguousarray(array, dtype).tobytes()).decode("ascii")
