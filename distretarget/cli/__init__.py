"""The command line: plumbing only, one file per command."""

from __future__ import annotations

import sys

import click

from distretarget.cli.batch import batch_command
from distretarget.cli.diff import diff_command
from distretarget.cli.group import DefaultGroup
from distretarget.cli.retarget import retarget_command
from distretarget.cli.skeleton import skeleton_group
from distretarget.errors import DistretargetError


@click.group(cls=DefaultGroup, default="retarget", context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="distretarget")
def cli() -> None:
    """Retarget BVH motion to another body by normalised joint distances.

    \b
    distretarget SOURCE.bvh TARGET -o OUT.bvh       the same as: distretarget retarget ...
    distretarget batch FOLDER TARGET -o FOLDER      a folder of clips
    distretarget diff A.bvh B.bvh -o REPORT.html    how far B is from A
    distretarget skeleton match SOURCE.bvh TARGET   which joint drives which
    distretarget skeleton show FILE
    """  # noqa: D301


cli.add_command(retarget_command)
cli.add_command(batch_command)
cli.add_command(diff_command)
cli.add_command(skeleton_group)


def main() -> None:
    """Run the command line. Exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted; errors are one line."""
    try:
        status = cli.main(prog_name="distretarget", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        sys.exit(2)
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "distretarget"
        sys.exit(_complain(f"{error.format_message()} See '{command} --help'.", 2))
    except click.ClickException as error:
        sys.exit(_complain(error.format_message(), error.exit_code))
    except DistretargetError as error:
        sys.exit(_complain(str(error), 1))
    except (click.Abort, KeyboardInterrupt):
        sys.exit(_complain("interrupted; nothing was written", 130))
    except MemoryError:
        sys.exit(_complain("out of memory", 1))
    sys.exit(status)


def _complain(message: str, status: int) -> int:
    line = " ".join(message.split("\n"))
    click.echo(f"distretarget: {line}".encode("utf-8", "backslashreplace").decode(), err=True)
    return status
