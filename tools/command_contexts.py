"""click's contexts of the program's commands, as the program itself makes them."""

from __future__ import annotations

from collections.abc import Iterator

import click

from distretarget.cli import ImportedCommand, cli

WIDTH = 96  # characters of a line of help, as many as the site shows on a desktop


def contexts(
    command: click.Command = cli, name: str = "distretarget", parent: click.Context | None = None
) -> Iterator[click.Context]:
    """The contexts of a command and of all its subcommands.

    click keeps the help option that a command's first context asks for, so all have the program's own settings.
    """
    context = click.Context(
        command, parent, name, terminal_width=WIDTH, max_content_width=WIDTH, **command.context_settings
    )
    yield context
    if isinstance(command, click.Group):
        for below in command.list_commands(context):
            found = command.commands[below]
            yield from contexts(found.command if isinstance(found, ImportedCommand) else found, below, context)
