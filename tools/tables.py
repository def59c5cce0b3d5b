"""Tables in Markdown, and the places in pages that they are written into."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike


def table(head: str | Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table; its head may be given as in Markdown, with ` | ` between the cells."""
    head = head.split(" | ") if isinstance(head, str) else list(head)
    lines = [f"| {' | '.join(cells)} |\n" for cells in (head, *rows)]
    lines.insert(1, f"|{'---|' * len(head)}\n")
    return "".join(lines)


def several(values: Iterable[float | None], form: str) -> str:
    """Numbers in one cell, missing ones as `-`."""
    return " / ".join("-" if value is None else f"{value:{form}}" for value in values)


def mean_and_largest(values: ArrayLike, form: str = ".2f", largest: ArrayLike | None = None) -> str:
    """Mean and largest of the finite values; the largest may be taken from other values. `-` without finite values."""
    values, largest = (np.asarray(each, float) for each in (values, values if largest is None else largest))
    values, largest = values[np.isfinite(values)], largest[np.isfinite(largest)]
    return several([values.mean(), largest.max()], form) if values.size else "-"


def placed(text: str, name: str, rows: str) -> str | None:
    """The text of a page with a table between the lines `<!-- name -->`, or `<!-- name: ... -->`, and `<!-- end -->`;
    None if the page lacks these lines.
    """
    place = re.compile(rf"(<!-- {re.escape(name)}(?:: .*?)? -->\n).*?(<!-- end -->)", re.DOTALL)
    return place.sub(lambda found: f"{found[1]}\n{rows}\n{found[2]}", text) if place.search(text) else None


def publish(tables: Mapping[str, str], page: Path | None) -> None:
    """Print tables, and write each into its place in a page; a page that lacks a place gets the tables alone."""
    everything = "\n".join(tables.values())
    print(everything)
    if page is None:
        return
    text: str | None = page.read_text("utf-8") if page.exists() else ""
    for name, rows in tables.items():
        text = placed(text, name, rows) if text is not None else None
    page.write_text(everything if text is None else text, "utf-8")
