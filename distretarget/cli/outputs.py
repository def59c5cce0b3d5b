"""Read and write the files of commands, with `-` for standard input and output, and print lines."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePath

import click

from distretarget.errors import FileError, shown
from distretarget.io.files import STANDARD_INPUT, Content, check_writable, encoded_parts, reason_of, write_whole
from distretarget.io.input_file import InputFile, load_file, with_files_beside
from distretarget.report.diff_document import About

STANDARD = Path("-")
LISTED = 12  # limit of names in a line
ARGUMENTS = {  # the options of the program for arguments of Python functions, to be replaced in messages
    "clip=NAME": "--clip NAME",
    "fps=NUMBER": "--fps NUMBER",
    "skeleton=FILE": "--skeleton FILE",
    "overwrite=True": "--overwrite",
}
QUIET = "distretarget.quiet"  # key in a context's `meta`: whether --quiet is given
OUTPUT_TAKEN = "distretarget.output_taken"  # key in a context's `meta`: whether a file goes to standard output


def read_source(path: Path, skeleton: Path | None) -> InputFile:
    """Read a motion's file, and the file with the skeleton of its arrays; errors as in `load_file`."""
    return replace(read_input(path), skeleton=load_file(skeleton) if skeleton else None)


def read_input(path: Path) -> InputFile:
    """Read a file, or standard input; errors as in `load_file`."""
    if path != STANDARD:
        return load_file(path)
    if sys.stdin is None:
        raise FileError(STANDARD_INPUT, "is closed")
    try:
        return with_files_beside(InputFile(sys.stdin.buffer.read(), STANDARD_INPUT))
    except OSError as error:
        raise FileError(STANDARD_INPUT, reason_of(error)) from error


def write_outputs(
    contents: Mapping[Path | None, Callable[[], Content]], overwrite: bool, replaced: Path | None = None
) -> None:
    """Make the contents of all outputs, then write each; skip the path None. The file `replaced` may exist."""
    made = {path: content() for path, content in contents.items() if path}
    for path, content in made.items():
        if path == STANDARD:
            for part in encoded_parts(content):
                click.echo(part, nl=False)
        else:
            write_whole(path, content, overwrite or path == replaced)


def check_outputs(
    outputs: Sequence[Path | None], inputs: Sequence[Path | None], overwrite: bool, replaced: Path | None = None
) -> None:
    """Check, before any work, that outputs can be written and no two files are the same; skip None. The file `replaced`
    may exist. If an output is standard output, `say` prints to standard error from now on.
    """
    for paths, what in ((inputs, "input"), (outputs, "output")):
        if paths.count(STANDARD) > 1:
            raise click.UsageError(f"- is standard {what}, which can be one file only.")
    click.get_current_context().meta[OUTPUT_TAKEN] = STANDARD in outputs
    written, read = ([path for path in paths if path and path != STANDARD] for paths in (outputs, inputs))
    for number, path in enumerate(written):
        for other, what in [*((i, "an input") for i in read), *((o, "another output") for o in written[:number])]:
            if _same_file(path, other):
                raise FileError(path, f"is {what} as well; give the output another name")
        check_writable(path, overwrite=overwrite or path == replaced)


def _same_file(path: Path, other: Path) -> bool:
    """Whether two paths lead to the same file; False if permissions hide it, since reading or writing will fail."""
    try:
        return path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other))
    except (OSError, ValueError):
        return False


def check_suffix(path: Path | None, suffix: str) -> None:
    """Check that an output has the suffix of its format."""
    if path and path != STANDARD and path.suffix.lower() != suffix:
        kind, better = suffix[1:].upper(), path.with_suffix(suffix) if path.name else suffix
        raise FileError(path, f"the output is {kind}, so its name has to end in {suffix}, such as {str(better)!r}")


def is_quiet(key: str = QUIET) -> bool:
    """Whether the running command has the option --quiet, or another key in its `meta`."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(key))


def say(*lines: str, err: bool = False) -> None:
    """Print lines, unless --quiet is given."""
    if not is_quiet():
        _print(lines, err or is_quiet(OUTPUT_TAKEN))


def complain(*lines: str) -> None:
    """Print lines on standard error, even with --quiet."""
    _print(lines, err=True)


def _print(lines: Sequence[str], err: bool) -> None:
    """Print lines, with arguments of Python functions replaced by the program's options."""
    for line in lines:
        for argument, option in ARGUMENTS.items():
            line = line.replace(argument, option)
        click.echo(shown(line), err=err)


def table_lines(rows: Sequence[Sequence[str]], sides: str) -> Iterator[str]:
    """Yield the lines of a table; `sides` has < for each left-aligned column, > for each right-aligned one."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = zip(row, sides, widths, strict=True)
        yield "  ".join(f"{cell:{side}{width}}" for cell, side, width in cells).rstrip()


def about(a: PurePath, b: PurePath) -> About:
    """Return what a report says of this run; absolute paths are reduced to names, so that a report can be shared."""
    names = ["/".join(path.parts[-2:]) if a.name == b.name else path.name for path in (a, b)]
    words = [PurePath(word).name if PurePath(word).is_absolute() else word for word in sys.argv[1:]]
    return About(a=names[0], b=names[1], command=shlex.join(["distretarget", *words]))
