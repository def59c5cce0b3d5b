"""A command group that runs a default command when none is named, and commands that are imported when they run."""

from __future__ import annotations

import gc
import os.path
from difflib import get_close_matches
from functools import cached_property
from pkgutil import resolve_name
from typing import Any

import click


class DefaultGroup(click.Group):
    """A group that passes arguments to the `default` command if they do not begin with the name of a command.

    A first argument that is not a file, but nearly the name of a command, is refused.
    """

    def __init__(self, *args: Any, default: str, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.default = default

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and args[0] not in self.commands and not os.path.lexists(args[0]):
            for near in get_close_matches(args[0], self.commands, 1):
                raise click.UsageError(f"there is no command or file {args[0]!r}; did you mean {near!r}?", ctx)
        own = {name for parameter in self.get_params(ctx) for name in parameter.opts}
        if args and args[0] not in self.commands and args[0] not in own:
            args = [self.default, *args]
        return super().parse_args(ctx, args)


class ImportedCommand(click.Command):
    """Stand for a command in a module that is slow to import, and import it when the command is to run.

    Without it the name and the one-line help are known, which is all that the help of a group shows.
    """

    def __init__(self, name: str, place: str, short_help: str) -> None:
        """Stand for the command at a place, such as "package.module:command"."""
        super().__init__(name, short_help=short_help)
        self._place = place

    @cached_property
    def command(self) -> click.Command:
        """The command itself, imported without searching for garbage: what modules hold is kept to the end."""
        gc.disable()
        try:
            command: click.Command = resolve_name(self._place)
        finally:
            gc.enable()
        gc.freeze()
        return command

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        return self.command.make_context(info_name, args, parent, **extra)
