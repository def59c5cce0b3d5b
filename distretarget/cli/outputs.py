"""The outputs of commands: replacing and checking files, printing lines, and what a report says of the run."""

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

OVERWRITE_OPTION = click.option(
    "--overwrite", is_flag=True, help="Replace files that exist. An input is never replaced."
)
LISTED = 12  # most joints that are named in a line


def check_outputs(outputs: Sequence[Path | None], inputs: Sequence[Path | None], overwrite: bool) -> None:
    """Check, before any work, that outputs can be written and are neither inputs nor each other; skips None."""
    written = [path for path in outputs if path]
    read = [path for path in inputs if path]
    for number, path in enumerate(written):
        for other, what in [*((i, "an input") for i in read), *((o, "another output") for o in written[:number])]:
            if _same_file(path, other):
                raise FileError(path, f"is {what} as well; give the output another name")
        check_writable(path, overwrite=overwrite)


def _same_file(path: Path, other: Path) -> bool:
    """Whether two paths lead to the same file; False where permissions hide that: reading or writing will fail then."""
    try:
        return path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other))
    except (OSError, ValueError):
        return False


def say(line: str, err: bool = False) -> None:
    """Print a line; characters that UTF-8 cannot encode are escaped."""
    click.echo(line.encode("utf-8", "backslashreplace").decode(), err=err)


def about(a: PurePath, b: PurePath) -> About:
    """Return what a report says of this run: the names of the two clips, the command, the version of the program."""
    return About(
        a=a.name, b=b.name, command=shlex.join(["distretarget", *sys.argv[1:]]), version=version("distretarget")
    )
