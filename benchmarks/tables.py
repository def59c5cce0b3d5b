"""Tables in Markdown, and the pages they are written into; the options of the command lines that several share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import click
import numpy as np
from numpy.typing import ArrayLike

corpus_argument = click.argument("corpus", type=Path)
markdown_option = click.option("--markdown", "page", type=Path, help="Write the tables into this page.")
PROCESSES = 2  # of benchmarks that measure no times


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table."""
    lines = [list(head), *map(list, rows)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def several(values: Iterable[float | None], form: str) -> str:
    """Numbers in one cell; - for those that there are not."""
    return " / ".join("-" if value is None else f"{value:{form}}" for value in values)


def mean_and_largest(values: ArrayLike, form: str = ".2f", largest: ArrayLike | None = None) -> str:
    """Mean and largest of the values that are finite, the largest perhaps of others; - if there are none."""
    values, largest = (np.asarray(each, float) for each in (values, values if largest is None else largest))
    values, largest = values[np.isfinite(values)], largest[np.isfinite(largest)]
    return several([values.mean(), largest.max()], form) if values.size else "-"


def publish(tables: Mapping[str, str], page: Path | None) -> None:
    """Print tables, and put each into a page, between the lines `<!-- its name -->` and `<!-- end -->`; write the
    tables alone if the page lacks these lines.
    """
    print("\n".join(tables.values()))
    if page is None:
        return
    text = page.read_text("utf-8") if page.exists() else ""
    for name, rows in tables.items():
        before, begin, rest = text.partition(f"<!-- {name} -->\n")
        _, end, after = rest.partition("<!-- end -->")
        if not end:
            text = "\n".join(tables.values())
            break
        text = f"{before}{begin}\n{rows}\n{end}{after}"
    page.write_text(text, "utf-8")
