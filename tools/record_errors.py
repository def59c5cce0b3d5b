"""A plugin for pytest that records all messages of errors that tests produce, for `tools/make_errors.py --missing`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from distretarget.errors import DistretargetError


def pytest_addoption(parser: Any) -> None:
    """Add the option for the file to append to."""
    parser.addoption("--record-errors", type=Path, required=True)


def pytest_configure(config: Any) -> None:
    """Append the message of each error to the file, as it is made."""
    path: Path = config.getoption("--record-errors").absolute()  # tests change the working folder
    for kind in (DistretargetError, click.ClickException):
        _record(kind, path)


def _record(kind: Any, path: Path) -> None:
    make = kind.__init__

    def made(self: Any, message: str, *others: Any) -> None:
        with path.open("a", encoding="utf-8", errors="backslashreplace") as file:
            file.write(f"{message}\n")
        make(self, message, *others)

    kind.__init__ = made
