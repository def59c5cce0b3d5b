"""Write the descriptions of the figures of quality in `docs/diff.md` and `diff.schema.json`, from their registry.

python tools/make_figures.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from distretarget.measure.figures import FIGURES, SUFFIXES, Figure, figures_at

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "diff.md"
SCHEMA = ROOT / "distretarget" / "report" / "diff.schema.json"
FRAME = ("frame", "time", "contacts", "stance", "supports")  # keys of a frame in the document besides its figures
BEGIN, END = "<!-- figures: written by tools/make_figures.py -->\n", "<!-- end -->\n"
BEGIN_LIMITS = "<!-- limits: written by tools/make_figures.py -->\n"

Json = dict[str, Any]


def table() -> str:
    """The table of figures, in Markdown."""
    rows = ["| figure | | `--fail-over` is for |", "|---|---|---|"]
    for figure in FIGURES:
        formula = figure.comparison("A", "B").replace("|", r"\|") or "B"
        rows.append(f"| `{figure.key}` | {figure.explanation('A', 'B')} | {formula} |")
    return "\n".join(rows) + "\n"


def limits() -> str:
    """The table of the limits above which a run needs a look, in Markdown."""
    rows = ["| figure | above | means | likely cause |", "|---|---|---|---|"]
    for figure in FIGURES:
        if figure.limit:
            limit = figure.limit
            rows.append(f"| `{figure.key}` | {limit.formula(figure.unit)} | {limit.reason} | {limit.cause} |")
    return "\n".join(rows) + "\n"


def page() -> str:
    """The text of the page, with both tables written anew."""
    text = PAGE.read_text("utf-8")
    for begin, rows in ((BEGIN, table()), (BEGIN_LIMITS, limits())):
        before, rest = text.split(begin)
        text = f"{before}{begin}\n{rows}\n{END}{rest.split(END, 1)[1]}"
    return text


def schema() -> str:
    """The text of the schema, with the definitions of figures written anew."""
    document: Json = json.loads(SCHEMA.read_text("utf-8"))
    result = {figure.key: number(figure) for figure in FIGURES}
    source = {figure.key: number(figure) for figure in FIGURES if figure.of_source}
    columns = {
        figure.key + SUFFIXES[side]: number(figure, of_frame=True)
        for figure in FIGURES
        for side in ("source", "result")
        if figure.of_frames and (side == "result" or figure.of_source)
    }
    definitions = document["$defs"]
    definitions["of_result"] = closed(result)
    definitions["of_source"] = closed(source)
    definitions["limits_of_result"] = closed(
        {figure.key: {"type": ["number", "null"] if figure.limit else "null"} for figure in FIGURES}
    )
    definitions["limit"]["properties"]["figure"] = {"enum": [figure.key for figure in FIGURES]}
    others = {key: value for key, value in definitions["frame"]["properties"].items() if key in FRAME}
    definitions["frame"] = closed(others | columns)
    worst = closed({figure.key: {"type": ["integer", "null"], "minimum": 0} for figure in figures_at("worst frames")})
    document["properties"]["worst"] |= worst
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def number(figure: Figure, of_frame: bool = False) -> Json:
    """The schema of a value of a figure: at least 0, null if it may be missing."""
    values: Json = {"type": ["number", "null"] if figure.missing else "number", "minimum": 0}
    return values if of_frame else {"description": figure.explanation("A", "B"), **values}


def closed(properties: Json) -> Json:
    """The schema of an object with all of these properties and no other."""
    return {"type": "object", "required": list(properties), "additionalProperties": False, "properties": properties}


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
    SCHEMA.write_text(schema(), encoding="utf-8", newline="\n")
