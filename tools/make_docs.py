"""Write the generated parts of the documentation: help texts, settings, metrics, and measured numbers.

python tools/make_docs.py
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
from tables import table, with_tables

from distretarget.cli import ImportedCommand, cli
from distretarget.measure.faults import KINDS
from distretarget.measure.metrics import METRICS, SUFFIXES, Metric, metrics_at
from distretarget.objectives.settings import ContactSettings

ROOT = Path(__file__).resolve().parents[1]
README, DOCS = ROOT / "README.md", ROOT / "docs"
SCHEMA = ROOT / "distretarget" / "report" / "diff.schema.json"

Json = dict[str, Any]


def documents() -> dict[Path, str]:
    """The text of every file that has generated parts."""
    return {
        DOCS / "command_line.md": with_tables(DOCS / "command_line.md", {"commands": reference()}),
        DOCS / "method.md": with_tables(DOCS / "method.md", {"settings": settings_table()}),
        DOCS / "diff.md": with_tables(DOCS / "diff.md", {"metrics": metric_table(), "limits": limit_table()}),
        DOCS / "data_sets.md": with_tables(DOCS / "data_sets.md", {"faults": fault_table()}),
        README: with_tables(README, {"front": front_table()}),
        SCHEMA: schema(),
    }


# ---- docs/command_line.md: the help texts

WIDTH = 96  # characters of a line, as many as the site shows on a desktop


def reference() -> str:
    """The help text of every command."""
    sections = [
        f"## {context.command_path}\n\n```text\n{context.get_help().rstrip()}\n```\n"
        for context in contexts(cli, "distretarget")
    ]
    return "\n".join(sections)


def contexts(command: click.Command, name: str, parent: click.Context | None = None) -> Iterator[click.Context]:
    """The contexts of a command and of all its subcommands."""
    context = click.Context(
        command, parent, name, terminal_width=WIDTH, max_content_width=WIDTH, **command.context_settings
    )
    yield context
    if isinstance(command, click.Group):
        for below in command.list_commands(context):
            found = command.commands[below]
            yield from contexts(found.command if isinstance(found, ImportedCommand) else found, below, context)


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
    """The metrics, and what `--fail-over` compares."""
    rows = []
    for metric in METRICS:
        formula = metric.comparison("A", "B").replace("|", r"\|") or "B"
        rows.append((f"`{metric.key}`", metric.explanation("A", "B"), formula))
    return table(("metric", "", "`--fail-over` is for"), rows)


def limit_table() -> str:
    """The limits above which a run has a warning."""
    rows = (
        (f"`{metric.key}`", limit.formula(metric.unit), limit.reason, limit.cause)
        for metric in METRICS
        if (limit := metric.limit)
    )
    return table(("metric", "above", "means", "likely cause"), rows)


def fault_table() -> str:
    """The kinds of faults that `audit` finds."""
    rows = (
        (f"`{key}`", kind.meaning, "" if kind.plain else f"{kind.limit:g} {kind.unit}") for key, kind in KINDS.items()
    )
    return table(("fault", "", "above"), rows)


def schema() -> str:
    """The schema, with the definitions of metrics written anew."""
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


# ---- README.md: numbers from the tables of docs/results.md, which the benchmarks write

COPY, PEER, PAPER, MINK, RESULT = METHODS = ("copied rotations", "MotionBuilder", "the paper", "mink", "distretarget")


def front_table() -> str:
    """What was measured, and its value by method."""
    rows = [*_skin_rows(), *_summary_rows(), *_other_rows()]
    return table(("", *METHODS), ([what, *(values.get(method, "") for method in METHODS)] for what, values in rows))


def cells(name: str) -> list[list[str]]:
    """The cells of a table of docs/results.md, without its head."""
    text = (DOCS / "results.md").read_text("utf-8").partition(f"<!-- {name} -->\n")[2].partition("<!-- end -->")[0]
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def numbers(cell: str) -> list[float]:
    """The numbers in a cell, in their order."""
    return [float(number) for number in re.findall(r"\d+\.?\d*", cell.replace(",", ""))]


def means(rows: Iterable[list[str]], column: int) -> list[float]:
    """The mean over rows of each number in a column; rows with `-` there do not count."""
    return list(np.mean([numbers(row[column]) for row in rows if not row[column].startswith("-")], axis=0))


def _skin_rows() -> Iterator[tuple[str, dict[str, str]]]:
    """What the scoreboard of characters says of their skin."""
    rows = {row[0]: row[1:] for row in cells("scoreboard")}
    starts = {COPY: COPY, PAPER: "paper", MINK: "mink", RESULT: RESULT}
    # `--skin none` comes before the result with skin, and mink's hands and feet before GMR's recipe
    found = {method: [row for name, row in rows.items() if name.startswith(start)] for method, start in starts.items()}
    own = {method: rows[-1] if method == RESULT else rows[0] for method, rows in found.items() if rows}
    for what, column in (
        ("hands and forearms inside the body, % of their skin", 0),
        ("deepest of that, % of height", 2),
    ):
        yield f"ten characters: {what}", {method: f"{numbers(row[column])[-1]:.2f}" for method, row in own.items()}


def _summary_rows() -> Iterator[tuple[str, dict[str, str]]]:
    """The metrics of 90 runs, with those of MotionBuilder for its clips."""
    summary = {row[0]: row[1:] for row in cells("summary")}

    def row(start: str, digits: int = 2, number: int = 0) -> dict[str, str]:
        found = next(values for name, values in summary.items() if name.startswith(start))
        values = [f"{numbers(cell)[number]:.{digits}f}" for cell in found[:3]]
        return dict(zip((COPY, PAPER, RESULT), values, strict=True))

    copied, peer, _ = means(cells("motionbuilder"), 4)
    source_slide, peer_slide, _ = means(cells("motionbuilder"), 5)
    what = "error of the distance between body parts that touch, relative to copied rotations"
    yield what, {**row("contact error, mean over clips"), PEER: f"{peer / copied:.2f}"}
    yield "clap on long forearms: gap of the wrists, % of arm (source: 4.0)", row("clap on long forearms", 1)
    what = "foot skate of planted feet, relative to the source's"
    yield what, {**row("foot skate in stance", number=2), PEER: f"{peer_slide / source_slide:.2f}"}
    yield "bones off the source's direction, degrees", row("direction error, mean", 1)


def _other_rows() -> Iterator[tuple[str, dict[str, str]]]:
    """Supports, duets and speed."""
    copied, _, result, _ = means(cells("supports"), 1)
    yield "hands and knees on the floor: height off it, % of leg", {COPY: f"{copied:.1f}", RESULT: f"{result:.2f}"}
    source, copied, _, together = means(cells("duets"), 2)
    what = f"two dancers: gap of what touches, % of leg (source: {source:.1f})"
    yield what, {COPY: f"{copied:.1f}", RESULT: f"{together:.1f}"}
    speed = {row[0]: row[1] for row in cells("speed")}
    mink = next(value for name, value in speed.items() if name.startswith("mink") and "1 step" in name)
    values = {PAPER: speed["`retarget`, paper"], MINK: mink, RESULT: speed["`retarget`, contact"]}
    yield "frames per second on one core", values


if __name__ == "__main__":
    for path, text in documents().items():
        path.write_text(text, encoding="utf-8", newline="\n")
