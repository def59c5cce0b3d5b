"""Files that commands read and write, with `-` for standard input and output, and lines that they print."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path, PurePath
from typing import Any

import click

from distretarget.errors import FileError
from distretarget.io.files import (
    STANDARD_INPUT,
    Text,
    check_writable,
    encoded_parts,
    load_text,
    reason_of,
    text_of,
    write_whole,
)
from distretarget.report.diff_document import About, DiffLimit

STANDARD = Path("-")
LISTED = 12  # most joints that are named in a line
QUIET = "distretarget.quiet"  # key in a context's `meta`: whether --quiet is given
OUTPUT_TAKEN = "distretarget.output_taken"  # key in a context's `meta`: whether a file goes to standard output


def _be_quiet(context: click.Context, _option: click.Parameter, chosen: bool) -> None:
    context.meta[QUIET] = chosen


quiet = click.option(
    "-q", "--quiet", is_flag=True, expose_value=False, callback=_be_quiet, help="Print nothing but errors."
)
OVERWRITE_OPTION = click.option(
    "--overwrite", is_flag=True, help="Replace files that exist. An input is never replaced."
)


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
    """Write a text, whole or in parts, to a file as `write_whole` does, or to standard output."""
    if path != STANDARD:
        write_whole(path, text, overwrite)
        return
    for part in encoded_parts(text):
        click.echo(part, nl=False)


def check_outputs(outputs: Sequence[Path | None], inputs: Sequence[Path | None], overwrite: bool) -> None:
    """Check, before any work, that outputs can be written and are neither inputs nor each other; skips None.

    If one is standard output, lines go to standard error from now on.
    """
    for paths, what in ((inputs, "input"), (outputs, "output")):
        if paths.count(STANDARD) > 1:
            raise click.UsageError(f"- is standard {what}, which can stand for one file only.")
    click.get_current_context().meta[OUTPUT_TAKEN] = STANDARD in outputs
    written, read = ([path for path in paths if path and path != STANDARD] for paths in (outputs, inputs))
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


def check_suffix(path: Path | None, suffix: str) -> None:
    """Check that the name of an output has the suffix of its format; on a terminal, ask where it has another."""
    if path is None or path == STANDARD or path.suffix.lower() == suffix:
        return
    kind = suffix[1:].upper()
    if sys.stdin and sys.stdin.isatty():
        question = f"{path}: the name does not end in {suffix}; write {kind} to it all the same?"
        click.confirm(question, abort=True, err=True)
    else:
        better = path.with_suffix(suffix) if path.name else suffix
        raise FileError(path, f"the output is {kind}, so its name has to end in {suffix}, such as {str(better)!r}")


def is_quiet() -> bool:
    """Whether the running command has the option --quiet."""
    return _is_set(QUIET)


def _is_set(key: str) -> bool:
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(key))


def say(line: str, err: bool = False) -> None:
    """Print a line, unless --quiet is given."""
    if not is_quiet():
        _print(line, err or _is_set(OUTPUT_TAKEN))


def complain(line: str) -> None:
    """Print a line on standard error, also with --quiet."""
    _print(line, err=True)


def _print(line: str, err: bool) -> None:
    """Print a line; characters that UTF-8 cannot encode are escaped."""
    click.echo(line.encode("utf-8", "backslashreplace").decode(), err=err)


def number(value: float | None) -> str:
    """The value of a figure as text; - where nothing was measured."""
    return "-" if value is None else f"{value:.4g}"


def over(limits: Iterable[DiffLimit]) -> Iterator[str]:
    """The figures that are over their limits, a clause each."""
    for limit in limits:
        if limit["over"]:
            yield f"{limit['figure']} is {limit['value']:.6g}, over {limit['limit']:g}"


def about(a: PurePath, b: PurePath) -> About:
    """What a report says of this run: the names of the two clips, or their paths if the names are the same, the
    command, and the version of the program.
    """
    names = (str(a), str(b)) if a.name == b.name else (a.name, b.name)
    command = shlex.join(["distretarget", *sys.argv[1:]])
    return About(a=names[0], b=names[1], command=command, version=version("distretarget"))
