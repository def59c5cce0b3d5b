"""The command line: one file per command, with no mathematics in it."""

from __future__ import annotations

import errno
import gc
import io
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import cached_property
from pkgutil import resolve_name
from typing import Any

import click

from distretarget.errors import DistretargetError
from distretarget.io.files import reason_of

COMMANDS = {  # short help by name; each command is the function NAME_command in the module NAME
    "audit": "Find faults in the clips of a folder.",
    "batch": "Retarget many clips to one or several targets.",
    "contacts": "List the contacts that are found in CLIP.",
    "diff": "Measure the motion of B against that of A, the reference.",
    "retarget": "Retarget the motion of SOURCE to the body of TARGET.",
    "scene": "Retarget performers who share a world.",
    "studio": "Retarget on a page in the browser.",
    "skeleton": "Show, edit and match skeletons, and write skeleton files.",
    "view": "Look at motions and characters in the browser.",
}
DEFAULT_COMMAND = "retarget"


class DefaultGroup(click.Group):
    """A group that runs `DEFAULT_COMMAND` if the first word is no command, unless it looks like a misspelt one."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and args[0] not in self.commands and not os.path.lexists(args[0]):
            for near in get_close_matches(args[0], self.commands, 1):
                raise click.UsageError(f"there is no command or file {args[0]!r}; did you mean {near!r}?", ctx)
        options = {name for parameter in self.get_params(ctx) for name in parameter.opts}
        if args and args[0] not in self.commands and args[0] not in options:
            args = [DEFAULT_COMMAND, *args]
        return super().parse_args(ctx, args)


class LazyCommand(click.Command):
    """A command whose module, slow to import, is imported when it runs; until then it has only its short help."""

    @cached_property
    def command(self) -> click.Command:
        """The command itself, imported without garbage collection to save time."""
        gc.disable()
        try:
            command: click.Command = resolve_name(f"distretarget.cli.{self.name}:{self.name}_command")
        finally:
            gc.enable()
        gc.freeze()
        return command

    def make_context(self, *arguments: Any, **extra: Any) -> click.Context:
        return self.command.make_context(*arguments, **extra)


def _say_version(context: click.Context, _: click.Parameter, given: bool) -> None:
    if given:
        from importlib.metadata import version  # here, since these imports are slow

        click.echo(f"distretarget, version {version('distretarget')}")
        if context.params["verbose"]:
            from distretarget.numerics.compiled import LIBRARY, loaded

            click.echo(f"compiled functions for {loaded().cpu}: {LIBRARY}")
        context.exit()


@click.group(cls=DefaultGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("-v", "verbose", is_flag=True, is_eager=True, help="With --version, also show the compiled library.")
@click.option("--version", is_flag=True, expose_value=False, callback=_say_version, help="Show the version and exit.")
def cli(verbose: bool) -> None:
    """Retarget motion to another body. Hands that touch still touch, and feet stay where they stand.

    \b
    distretarget walk.bvh hero.glb -o hero_walk.glb   one clip; short for: distretarget retarget
    distretarget batch FOLDER TARGET -o FOLDER        a folder of clips
    distretarget audit FOLDER                         find faults in the clips
    distretarget scene A.bvh B.bvh -t TARGET -o DUET  performers who share a world
    distretarget contacts CLIP -o FILE                the contacts in a clip, to edit
    distretarget diff A.bvh B.bvh -o REPORT.html      measure B against A
    distretarget skeleton match SOURCE TARGET         the joint that drives each joint
    distretarget skeleton show FILE                   the joints of a file and their bone lengths
    distretarget view FILE                            a motion or character in the browser
    """  # noqa: D301


for name, short_help in COMMANDS.items():
    cli.add_command(LazyCommand(name, short_help=short_help))


def main() -> None:
    """Run the command line. Exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted."""
    _replace_closed_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        with _interruptible():
            status = _run()
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError as error:
        sys.stdout = None  # Python would flush it again at exit
        # An error without a file is about standard output, unless too many files are open.
        place = "" if error.errno in (errno.EMFILE, errno.ENFILE) else "standard output"
        status = _complain(": ".join(filter(None, (error.filename or place, reason_of(error)))), 1)
    sys.exit(status)


def _replace_closed_streams() -> None:
    """Redirect closed standard output and error to the null device; the next opened file would get their numbers."""
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_WRONLY)
            if null != number:
                os.dup2(null, number)
                os.close(null)
            os.set_inheritable(number, True)
            setattr(sys, name, os.fdopen(number, "w", encoding="utf-8", closefd=False))


@contextmanager
def _interruptible() -> Iterator[None]:
    """Handle SIGTERM and SIGHUP like Ctrl-C, unless they are ignored, as under nohup."""
    signals = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in signals}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _run() -> int:
    try:
        status: int | None = cli.main(prog_name="distretarget", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return 2
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "distretarget"
        message = error.format_message()
        return _complain(f"{message}{'' if message.endswith(('.', '?')) else '.'} See '{command} --help'.", 2)
    except click.ClickException as error:
        return _complain(error.format_message(), error.exit_code)
    except DistretargetError as error:
        return _complain(str(error), 1)
    except (click.Abort, KeyboardInterrupt):
        return _complain("interrupted", 130)
    except MemoryError:
        return _complain("out of memory", 1)
    except SystemExit as leaving:
        return int(leaving.code or 0)
    return status or 0


def _complain(message: str, status: int) -> int:
    from distretarget.cli.outputs import complain

    complain("distretarget: " + message.replace("\n", " "))
    return status
