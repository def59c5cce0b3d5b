"""Write the table of README.md from the tables of docs/results.md, which the benchmarks write.

python tools/make_front_page.py
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
PAGE, RESULTS = ROOT / "README.md", ROOT / "docs" / "results.md"
PLACE = re.compile(r"(<!-- front: .*? -->\n).*?(<!-- end -->)", re.DOTALL)
COPY, MOTIONBUILDER, PAPER, MINK, RESULT = METHODS = (
    "copied rotations",
    "MotionBuilder",
    "the paper",
    "mink",
    "distretarget",
)

Row = tuple[str, dict[str, str]]  # what was measured, and its value by method


def cells(name: str) -> list[list[str]]:
    """The cells of a table of docs/results.md, without its head."""
    text = RESULTS.read_text("utf-8").partition(f"<!-- {name} -->\n")[2].partition("<!-- end -->")[0]
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def numbers(cell: str) -> list[float]:
    """The numbers in a cell, in their order."""
    return [float(number) for number in re.findall(r"\d+\.?\d*", cell.replace(",", ""))]


def means(rows: Iterable[list[str]], column: int) -> list[float]:
    """The mean over rows of each number in a column; rows with `-` there do not count."""
    return list(np.mean([numbers(row[column]) for row in rows if not row[column].startswith("-")], axis=0))


def rows() -> list[Row]:
    """All rows of the table."""
    return [*_of_summary(), *_of_supports(), *_of_duets(), _of_speed()]


def _of_summary() -> list[Row]:
    """The figures of 90 runs, with those of MotionBuilder for its clips."""
    summary = {row[0]: row[1:] for row in cells("summary")}

    def row(start: str, digits: int = 2, number: int = 0) -> dict[str, str]:
        found = next(values for name, values in summary.items() if name.startswith(start))
        values = [f"{numbers(cell)[number]:.{digits}f}" for cell in found[:3]]
        return dict(zip((COPY, PAPER, RESULT), values, strict=True))

    copied, peer, _ = means(cells("motionbuilder"), 4)
    source_slide, peer_slide, _ = means(cells("motionbuilder"), 5)
    return [
        (
            "error of the distance between body parts that touch, relative to copied rotations",
            {**row("contact error, mean over clips"), MOTIONBUILDER: f"{peer / copied:.2f}"},
        ),
        ("clap on long forearms: gap of the wrists, % of arm (source: 4.0)", row("clap on long forearms", 1)),
        (
            "sliding of resting feet, relative to the source's",
            {**row("slide in stance", number=2), MOTIONBUILDER: f"{peer_slide / source_slide:.2f}"},
        ),
        ("bones off the source's direction, degrees", row("direction error, mean", 1)),
    ]


def _of_supports() -> list[Row]:
    copied, _, result, _ = means(cells("supports"), 1)
    return [("hands and knees on the floor: height off it, % of leg", {COPY: f"{copied:.1f}", RESULT: f"{result:.2f}"})]


def _of_duets() -> list[Row]:
    source, copied, _, together = means(cells("duets"), 2)
    what = f"two dancers: gap of what touches, % of leg (source: {source:.1f})"
    return [(what, {COPY: f"{copied:.1f}", RESULT: f"{together:.1f}"})]


def _of_speed() -> Row:
    speed = {row[0]: row[1] for row in cells("speed")}
    mink = next(value for name, value in speed.items() if name.startswith("mink") and "1 step" in name)
    values = {PAPER: speed["`retarget`, paper"], MINK: mink, RESULT: speed["`retarget`, contact"]}
    return ("frames per second on one core", values)


def page(text: str) -> str:
    """The text of the page, with the table written anew."""
    lines = [f"| | {' | '.join(METHODS)} |", "|---|" + "---|" * len(METHODS)]
    lines += [f"| {what} | {' | '.join(values.get(method, '') for method in METHODS)} |" for what, values in rows()]
    return PLACE.sub(lambda place: place[1] + "\n" + "\n".join(lines) + "\n\n" + place[2], text)


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text("utf-8")), encoding="utf-8", newline="\n")
