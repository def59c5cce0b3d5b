"""What a command writes: files that may be written, lines that any stream can hold, what a report says of the run."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path, PurePath

import click

from distretarget.errors import FileError
from distretarget.io.files import check_writable
from distretarget.report.document import About


def check_outputs(outputs: Sequence[Path | None], inputs: Sequence[Path | None], overwrite: bool) -> None:
    """Refuse, before any work, outputs that cannot be written or are inputs or each other; None is no file."""
    written = [path for path in outputs if path]
    read = [path for path in inputs if path]
    for number, path in enumerate(written):
        for other, what in [*((i, "an input") for i in read), *((o, "another output") for o in written[:number])]:
            if _are_one(path, other):
                raise FileError(path, f"is {what} as well; give the output another name")
        check_writable(path, overwrite=overwrite)


def _are_one(path: Path, other: Path) -> bool:
    """Whether two paths lead to one file; False where nobody may look, which writing or reading will tell."""
    try:
        return path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other))
    except (OSError, ValueError):
        return False


def say(line: str, err: bool = False) -> None:
    """Print a line; what UTF-8 has no character for is escaped."""
    click.echo(line.encode("utf-8", "backslashreplace").decode(), err=err)


def about(a: PurePath, b: PurePath) -> About:
    """What a report says of this run of the program: the names of its two clips, its arguments, its version."""
    return About(a.name, b.name, shlex.join(["distretarget", *sys.argv[1:]]), version("distretarget"))
