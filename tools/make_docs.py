"""Write the generated parts of the documentation: help texts, settings, metrics, and measured numbers.

python tools/make_docs.py
"""

from __future__ import annotations

import inspect
import json
import re
from copy import copy
from pathlib import Path
from typing import Any

import click
from make_man import contexts
from tables import table, with_tables

from distretarget.measure.clip_faults import KINDS
from distretarget.measure.metrics import METRICS, SUFFIXES, Metric, metrics_at
from distretarget.objectives.activation import ContactSettings

ROOT = Path(__file__).resolve().parents[1]
README, DOCS = ROOT / "README.md", ROOT / "docs"
SCHEMA = ROOT / "distretarget" / "report" / "diff.schema.json"

Json = dict[str, Any]


def documents() -> dict[Path, str]:
    """The text of every file that has generated parts."""
    return {
        DOCS / "command_line.md": with_tables(DOCS / "command_line.md", {"commands": reference()}),
        DOCS / "method.md": with_tables(DOCS / "method.md", {"settings": settings_table()}),
        DOCS / "diff.md": with_tables(DOCS / "diff.md", {"metrics": metric_table()}),
        DOCS / "data_sets.md": with_tables(DOCS / "data_sets.md", {"faults": fault_table()}),
        README: with_tables(README, {"front": front_table()}),
        SCHEMA: schema(),
    }


# ---- docs/command_line.md: the help texts


EXAMPLES = re.compile(r"^(?:  (?:\w+ [^\n|]+\| )?distretarget [^\n]+\n)+\n", re.MULTILINE)
COMMANDS = re.compile(r"\n\nCommands:\n.*", re.DOTALL)  # the page's headings have these


def reference() -> str:
    """The help texts of all commands, without examples and lists of commands; options in common are listed once."""
    first: dict[tuple[str, str], str] = {}  # the first command with an option and its text
    sections = []
    for context in sorted(contexts(), key=lambda each: (each.parent is not None, each.info_name != "retarget")):
        path, shared = context.command_path, dict[str, list[str]]()
        own = copy(context.command)
        own.params, own.add_help_option = [], context.parent is None
        for param in context.command.params:
            record = param.get_help_record(context) if isinstance(param, click.Option) else None
            if record is None or (where := first.setdefault(record, path)) == path:
                own.params.append(param)
            else:
                shared.setdefault(where, []).append(f"`{param.opts[-1]}`")
        context.command = own
        text = COMMANDS.sub("", context.get_help().rstrip())
        section = f"## {path}\n\n```text\n{EXAMPLES.sub('', text) if context.parent else text}\n```\n"
        also = (f"{', '.join(names)} as in `{where}`" for where, names in shared.items())
        sections.append(section + (f"\nAlso {'; '.join(also)}.\n" if shared else ""))
    return "\n".join(sections)


# ---- docs/method.md: the settings, from the docstring of `ContactSettings`

ATTRIBUTE = re.compile(r"^ {4}(\w+): \[(.+?)\] (.+(?:\n {8}.+)*)", re.MULTILINE)


def settings_table() -> str:
    """Name, value, unit and meaning of every setting."""
    values, rows = vars(ContactSettings()), []
    for name, unit, meaning in ATTRIBUTE.findall(inspect.getdoc(ContactSettings) or ""):
        text = " ".join(meaning.removesuffix(".").split()).replace("|P|", r"$\lvert P \rvert$")
        value = values[name]
        rows.append((f"`{name}`", str(int(value)) if value == int(value) else f"{value:.4g}", unit, text))
    return table(("setting", "value", "unit", "meaning"), rows)


# ---- docs/diff.md and the schema of a diff: the metrics

FRAME = ("frame", "time", "contacts", "stance", "supports")  # keys of a frame in the document besides its metrics


def metric_table() -> str:
    """The metrics, and the limits above which a run has a warning."""
    rows = []
    for metric in METRICS:
        meaning = metric.explanation("A", "B").removesuffix(" 0 is best.").replace("The same as in A is", "As in A is")
        limit = metric.limit.formula("").strip() if metric.limit else ""
        rows.append((f"`{metric.key}`", meaning, limit))
    return table(("metric", "", "limit"), rows)


def fault_table() -> str:
    """The kinds of faults that `audit` finds."""
    rows = (
        (f"`{key}`", kind.meaning, "" if kind.plain else f"{kind.limit:g} {kind.unit}") for key, kind in KINDS.items()
    )
    return table(("fault", "", "above"), rows)


def schema() -> str:
    """The schema, with updated definitions of metrics."""
    document: Json = json.loads(SCHEMA.read_text("utf-8"))
    columns = {
        metric.key + SUFFIXES[side]: number(metric, of_frame=True)
        for metric in METRICS
        for side in ("source", "result")
        if metric.of_frames and (side == "result" or metric.of_source)
    }
    definitions = document["$defs"]
    definitions["of_result"] = closed({metric.key: number(metric) for metric in METRICS})
    definitions["of_source"] = closed({metric.key: number(metric) for metric in METRICS if metric.of_source})
    definitions["limits_of_result"] = closed(
        {metric.key: {"type": ["number", "null"] if metric.limit else "null"} for metric in METRICS}
    )
    definitions["limit"]["properties"]["metric"] = {"enum": [metric.key for metric in METRICS]}
    others = {key: value for key, value in definitions["frame"]["properties"].items() if key in FRAME}
    definitions["frame"] = closed(others | columns)
    worst = closed({metric.key: {"type": ["integer", "null"], "minimum": 0} for metric in metrics_at("worst frames")})
    document["properties"]["worst"] |= worst
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def number(metric: Metric, of_frame: bool = False) -> Json:
    """The schema of a value of a metric: at least 0, null if it may be missing."""
    values: Json = {"type": ["number", "null"] if metric.missing else "number", "minimum": 0}
    return values if of_frame else {"description": metric.explanation("A", "B"), **values}


def closed(properties: Json) -> Json:
    """The schema of an object with all of these properties and no other."""
    return {"type": "object", "required": list(properties), "additionalProperties": False, "properties": properties}


# ---- README.md: the scoreboard of docs/results.md in short, which a benchmark writes

METHODS = {  # patterns for the beginnings of the scoreboard's columns, by their names on the front page
    "copied rotations": "copied rotations",
    "three.js": "three.js",
    "mink": r"mink.*hands and feet",
    "GMR's recipe": r"mink.*GMR's recipe",
    "the paper": "paper's objective",
    "distretarget": "distretarget$",
}
FRONT = {  # patterns for the beginnings of its lines, by their names on the front page
    "skin of hands and forearms that is inside the body [%]": "skin inside",
    "hand touches of the source that are lost [%]": "touches missed",
    "foot sliding, relative to the source's [times]": "foot skate",
    "error of limb directions against the source [degrees]": "direction",
    "frames per second on one core": "frames/s$",
}


def front_table() -> str:
    """The table of the front page: a line for each measure, a column for each method."""
    head, *rows = lines("scoreboard")

    def place(start: str, names: list[str]) -> int:
        return next(place for place, name in enumerate(names) if re.match(start, name))

    shown = [rows[place(start, [row[0] for row in rows])] for start in FRONT.values()]
    columns = [place(start, head) for start in METHODS.values()]
    return table(("", *METHODS), ([what, *(row[c] for c in columns)] for what, row in zip(FRONT, shown, strict=True)))


def lines(name: str) -> list[list[str]]:
    """The cells of a table of docs/results.md, its head first."""
    text = (DOCS / "results.md").read_text("utf-8").partition(f"<!-- {name} -->\n")[2].partition("<!-- end -->")[0]
    head, _, *rows = (line for line in text.splitlines() if line.startswith("|"))
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in (head, *rows)]


if __name__ == "__main__":
    for path, text in documents().items():
        path.write_text(text, encoding="utf-8", newline="\n")
