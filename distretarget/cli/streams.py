"""Files of the command line, and `-` in place of them: standard input, standard output."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from distretarget.errors import FileError
from distretarget.io.files import STANDARD_INPUT, Text, encoded_parts, load_text, reason_of, text_of, write_whole

STANDARD = Path("-")


class FileOrStandard(click.Path):
    """The path of a file; `STANDARD` for the text `-`. A file with that name is given as `./-`."""

    def __init__(self) -> None:
        super().__init__(allow_dash=True, path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        return path.absolute() if path == STANDARD and str(value) != "-" else path


def read_input(path: Path) -> Text:
    """Read a text file, or standard input; errors as in `read_text`."""
    if path != STANDARD:
        return load_text(path)
    if sys.stdin is None:
        raise FileError(STANDARD_INPUT, "is closed")
    try:
        return Text(text_of(sys.stdin.buffer.read(), STANDARD_INPUT), STANDARD_INPUT)
    except OSError as error:
        raise FileError(STANDARD_INPUT, reason_of(error)) from error


def write_output(path: Path, text: str | Iterable[str], overwrite: bool) -> None:
    """Write a text, as a whole or in parts, to a file, as `write_whole` does, or to standard output."""
    if path == STANDARD:
        for part in encoded_parts(text):
            click.echo(part, nl=False)
    else:
        write_whole(path, text, overwrite)
