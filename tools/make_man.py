"""Write the manual pages of the program, `distretarget.1` and one for each command, from their help texts.

python tools/make_man.py FOLDER
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import click

from distretarget.cli import LazyCommand, cli

WIDTH = 96  # characters of a line of help, as many as the site shows on a desktop


def contexts(
    command: click.Command = cli, name: str = "distretarget", parent: click.Context | None = None
) -> Iterator[click.Context]:
    """The contexts of a command and of all its subcommands.

    click caches the help option of a command's first context, so all contexts have the program's own settings.
    """
    context = click.Context(
        command, parent, name, terminal_width=WIDTH, max_content_width=WIDTH, **command.context_settings
    )
    yield context
    if isinstance(command, click.Group):
        for below in command.list_commands(context):
            found = command.commands[below]
            yield from contexts(found.command if isinstance(found, LazyCommand) else found, below, context)


def pages() -> Iterator[tuple[str, str]]:
    """Yield the name of each command, with dashes, and its page."""
    for context in contexts():
        yield context.command_path.replace(" ", "-"), page(context)


def page(context: click.Context) -> str:
    """The page of a command, in the language of man."""
    command, name = context.command, context.command_path
    help_text = command.help or ""
    title = name.replace(" ", "-").upper()
    lines = [f'.TH "{title}" 1 "" "distretarget {version("distretarget")}"', ".SH NAME"]
    lines += [rf"{name} \- {_plain(command.get_short_help_str(limit=200))}", ".SH SYNOPSIS"]
    lines += [rf".B {name}", _plain(" ".join(command.collect_usage_pieces(context))), ".SH DESCRIPTION"]
    for paragraph in re.split(r"\n\s*\n", help_text):
        examples = paragraph.lstrip().startswith("\b")  # click keeps the lines of such a paragraph
        text = [_plain(line.strip()) for line in paragraph.replace("\b", "").strip().splitlines()]
        lines += [".nf", *text, ".fi", ".PP"] if examples else [*text, ".PP"]
    options = (option for option in command.get_params(context) if isinstance(option, click.Option))
    records = [each for each in (option.get_help_record(context) for option in options) if each]
    lines += [".SH OPTIONS"] if records else []
    for names, text in records:
        lines += [".TP", rf"\fB{_plain(names)}\fR", _plain(text)]
    return "\n".join(line or ".PP" for line in lines) + "\n"


def _plain(text: str) -> str:
    """A text with the control characters of man escaped."""
    escaped = text.replace("\\", r"\e").replace("-", r"\-")
    return rf"\&{escaped}" if escaped[:1] in (".", "'") else escaped


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages():
        (folder / f"{name}.1").write_text(text, encoding="utf-8", newline="\n")
