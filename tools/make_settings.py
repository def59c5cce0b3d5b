"""Write the table of settings in `docs/method.md` from the docstring of `ContactSettings`.

python tools/make_settings.py
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path

from distretarget.objectives.settings import ContactSettings

PAGE = Path(__file__).resolve().parents[1] / "docs" / "method.md"
BEGIN, END = "<!-- settings -->\n", "<!-- end -->"
ATTRIBUTE = re.compile(r"^ {4}(\w+): \[(.+?)\] (.+(?:\n {8}.+)*)", re.MULTILINE)


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Name, value, unit and meaning of every setting."""
    values = vars(ContactSettings())
    for name, unit, meaning in ATTRIBUTE.findall(inspect.getdoc(ContactSettings) or ""):
        text = " ".join(meaning.removesuffix(".").split())
        yield name, _number(values[name]), unit, text.replace("|P|", r"$\lvert P \rvert$")


def _number(value: float) -> str:
    return str(int(value)) if value == int(value) else f"{value:.4g}"


def table() -> str:
    """The settings as a table."""
    lines = [f"| `{name}` | {value} | {unit} | {meaning} |" for name, value, unit, meaning in rows()]
    return "\n".join(["| setting | value | unit | meaning |", "|---|---|---|---|", *lines])


def page(text: str) -> str:
    """The text of the page, with the table written anew."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    return f"{before}{begin}\n{table()}\n\n{end}{after}"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text("utf-8")), encoding="utf-8", newline="\n")
