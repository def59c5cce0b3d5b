"""Make tables in Markdown, and write them into their places in pages."""

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


def mean_and_largest(values: ArrayLike, form: str) -> str:
    """Mean and largest of the finite values; `-` without finite values."""
    values = np.asarray(values, float)
    finite = values[np.isfinite(values)]
    return several([finite.mean(), finite.max()], form) if finite.size else "-"


def with_tables(page: Path, tables: Mapping[str, str]) -> str:
    """A page with generated parts replaced between `<!-- name -->`, or `<!-- name: ... -->`, and `<!-- end -->`."""
    text = page.read_text("utf-8")
    for name, rows in tables.items():
        place = re.compile(rf"(<!-- {re.escape(name)}(?:: .*?)? -->\n).*?(<!-- end -->)", re.DOTALL)
        if not place.search(text):
            raise ValueError(f"{page.name} has no line <!-- {name} -->, or no <!-- end --> after it")
        text = place.sub(lambda found, rows=rows: f"{found[1]}\n{rows}\n{found[2]}", text)
    return text


def publish(tables: Mapping[str, str], page: Path | None) -> None:
    """Print tables, and write each into its place in a page if one is given."""
    print("\n".join(tables.values()))
    if page is not None:
        page.write_text(with_tables(page, tables), "utf-8")
