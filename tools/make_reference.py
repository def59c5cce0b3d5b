"""Write `docs/command_line.md`: the help text of every command.

python tools/make_reference.py
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click

from distretarget.cli import ImportedCommand, cli

PAGE = Path(__file__).resolve().parents[1] / "docs" / "command_line.md"
WIDTH = 96  # characters of a line, as many as the site shows on a desktop

INTRODUCTION = """\
# The command line

Written by `tools/make_reference.py`: the help texts that the program prints with `--help`.

| exit status | |
|---|---|
| 0 | done |
| 1 | failed: one line on standard error says why, with the file and the place in it |
| 2 | wrong usage: an option or argument that is missing or unknown |
| 130 | interrupted |

Results go to standard output, errors and warnings to standard error. In place of a clip, a skeleton or an output,
`-` means standard input or output; if a result goes to standard output, all lines for the user go to standard error.
For a file that is called `-`, write `./-`. On a terminal a bar counts the frames. A file that exists is replaced only
with `--overwrite`, an input never. A file is written under a temporary name, and gets its own when it is complete.

The first run compiles, which takes about 10 s, and says so in one line. Later runs find the code in the first
of these folders that can be written to: `NUMBA_CACHE_DIR`, where that variable is set; the folder of the package;
`~/.cache/distretarget`; a private folder among the temporary files. If none of them can, each run compiles again. Times
and frames per second do not include compilation.
"""


def contexts(command: click.Command, name: str, parent: click.Context | None = None) -> Iterator[click.Context]:
    """A command and all commands below it, each in its context."""
    context = click.Context(
        command, parent, name, terminal_width=WIDTH, max_content_width=WIDTH, **command.context_settings
    )
    yield context
    if isinstance(command, click.Group):
        for below in command.list_commands(context):
            found = command.commands[below]
            yield from contexts(found.command if isinstance(found, ImportedCommand) else found, below, context)


def reference() -> str:
    """The text of the page."""
    sections = [
        f"## {context.command_path}\n\n```text\n{context.get_help().rstrip()}\n```\n"
        for context in contexts(cli, "distretarget")
    ]
    return "\n".join([INTRODUCTION, *sections])


if __name__ == "__main__":
    PAGE.write_text(reference(), encoding="utf-8", newline="\n")
