"""Write tables into a Markdown page."""

from __future__ import annotations

from pathlib import Path


def insert(page: Path, tables: dict[str, str]) -> None:
    """Put each table into a page, between the lines `<!-- its name -->` and `<!-- end -->`; write the tables alone if
    the page lacks these lines.
    """
    text = page.read_text("utf-8") if page.exists() else ""
    for name, table in tables.items():
        before, begin, rest = text.partition(f"<!-- {name} -->\n")
        _, end, after = rest.partition("<!-- end -->")
        if not end:
            text = "\n".join(tables.values())
            break
        text = f"{before}{begin}\n{table}\n{end}{after}"
    page.write_text(text, "utf-8")
