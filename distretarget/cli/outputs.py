"""The outputs of commands: replacing and checking files, printing lines, and what a report says of the run."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path, PurePath

import click

from distretarget.cli.streams import STANDARD
from distretarget.errors import FileError
from distretarget.io.files import check_writable
from distretarget.report.diff_document import About

OVERWRITE_OPTION = click.option(
    "--overwrite", is_flag=True, help="Replace files that exist. An input is never replaced."
)
LISTED = 12  # most joints that are named in a line
QUIET = "distretarget.quiet"  # the key of a context's `meta` for --quiet
OUTPUT_TAKEN = "distretarget.output_taken"  # ... and for a file that goes to standard output


def _be_quiet(context: click.Context, _option: click.Parameter, chosen: bool) -> None:
    context.meta[QUIET] = chosen


quiet = click.option(
    "-q", "--quiet", is_flag=True, expose_value=False, callback=_be_quiet, help="Print nothing but errors."
)


def is_quiet() -> bool:
    """Whether the command that runs has the option --quiet."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(QUIET))


def check_outputs(outputs: Sequence[Path | None], inputs: Sequence[Path | None], overwrite: bool) -> None:
    """Check, before any work, that outputs can be written and are neither inputs nor each other; skips None.

    If one is standard output, lines go to standard error from now on.
    """
    for paths, what in ((inputs, "input"), (outputs, "output")):
        if paths.count(STANDARD) > 1:
            raise click.UsageError(f"- is standard {what}, which can stand for one file only.")
    click.get_current_context().meta[OUTPUT_TAKEN] = STANDARD in outputs
    written = [path for path in outputs if path and path != STANDARD]
    read = [path for path in inputs if path and path != STANDARD]
    for number, path in enumerate(written):
        for other, what in [*((i, "an input") for i in read), *((o, "another output") for o in written[:number])]:
            if _same_file(path, other):
                raise FileError(path, f"is {what} as well; give the output another name")
        check_writable(path, overwrite=overwrite)


def check_suffix(path: Path | None, suffix: str) -> None:
    """Check that the name of an output has the suffix of what it will hold; on a terminal, ask where it has another.

    Raises: FileError: it has another suffix, and nobody says that it is meant.
    """
    if path is None or path == STANDARD or path.suffix.lower() == suffix:
        return
    kind = suffix[1:].upper()
    if sys.stdin and sys.stdin.isatty():
        click.confirm(
            f"{path}: the name does not end in {suffix}; write {kind} to it all the same?", abort=True, err=True
        )
    else:
        better = path.with_suffix(suffix) if path.name else suffix
        raise FileError(path, f"the output is {kind}, so its name has to end in {suffix}, such as {str(better)!r}")


strip_namespace = click.option(
    "--strip-namespace",
    is_flag=True,
    help="Write names of joints without a namespace: Hips for mixamorig:Hips, which three.js cannot play.",
)


def _same_file(path: Path, other: Path) -> bool:
    """Whether two paths lead to the same file; False where permissions hide that: reading or writing will fail then."""
    try:
        return path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other))
    except (OSError, ValueError):
        return False


def say(line: str, err: bool = False) -> None:
    """Print a line, unless --quiet is given."""
    context = click.get_current_context(silent=True)
    taken = context is not None and bool(context.meta.get(OUTPUT_TAKEN))
    if not is_quiet():
        _print(line, err or taken)


def complain(line: str) -> None:
    """Print a line on standard error, also with --quiet."""
    _print(line, err=True)


def _print(line: str, err: bool) -> None:
    """Print a line; characters that UTF-8 cannot encode are escaped."""
    click.echo(line.encode("utf-8", "backslashreplace").decode(), err=err)


def about(a: PurePath, b: PurePath) -> About:
    """Return what a report says of this run: the names of the two clips, their paths if they have the same name, the
    command, the version of the program.
    """
    names = (str(a), str(b)) if a.name == b.name else (a.name, b.name)
    command = shlex.join(["distretarget", *sys.argv[1:]])
    return About(a=names[0], b=names[1], command=command, version=version("distretarget"))
