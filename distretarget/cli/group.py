"""A command group that runs a default command when none is named."""

from __future__ import annotations

import os.path
from difflib import get_close_matches
from typing import Any

import click


class DefaultGroup(click.Group):
    """A group that passes arguments to the `default` command if they do not begin with the name of a command.

    A first argument that is no file, and nearly the name of a command, is refused.
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
