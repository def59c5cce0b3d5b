"""`distretarget view`: look at motions and characters in the browser."""

from __future__ import annotations

import tempfile
import webbrowser
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import click

from distretarget.cli.options import OVERWRITE_OPTION, FileOrStandard, quiet
from distretarget.cli.outputs import STANDARD, check_outputs, read_input, say, write_outputs
from distretarget.errors import DistretargetError, FileError, counted
from distretarget.io.files import is_folder
from distretarget.io.input_file import ARRAYS, FORMATS
from distretarget.report.actors import Actor
from distretarget.report.stage import MOST, actors_of, view_page

SUFFIXES = tuple(  # of the files in a folder that are shown
    suffix for each in FORMATS if each is not ARRAYS for suffix in each.motions + each.others
)


@click.command("view")
@click.argument("files", nargs=-1, required=True, type=FileOrStandard())
@click.option("-o", "--output", type=FileOrStandard(), help="Write the page to this file, and open no browser.")
@click.option("--clip", metavar="NAME", help="Only this animation of files that have several; '#2' is the second.")
@OVERWRITE_OPTION
@quiet
def view_command(files: tuple[Path, ...], output: Path | None, clip: str | None, overwrite: bool) -> None:
    """Look at motions and characters in the browser.

    FILES are BVH, glTF, VRM, VRMA, FBX and skeleton files, or folders of them. A character is shown with its mesh, any
    other body with an average thickness. All animations of a file are shown, or only that of --clip. The page is a
    single file that loads nothing from the network. - means standard input or output.

    \b
    distretarget view walk.bvh
    distretarget view hero.glb walk.bvh
    distretarget view clips -o clips.html
    """  # noqa: D301
    chosen = [*_chosen(files)]
    check_outputs([output], chosen, overwrite)
    shown = [*_actors(chosen[:MOST], {*files}, clip)]
    actors = [actor for actors in shown for actor in actors][:MOST]
    if len(chosen) > MOST or sum(map(len, shown)) > MOST:
        say(f"the first {MOST} are shown; name fewer files, or one animation with --clip, to see the others", err=True)
    # A motion that was retargeted to a character is the last of its animations.
    first = min(len(shown[0]), len(actors)) - 1
    page = view_page(actors, Path(chosen[0]).name if len(shown) == 1 else counted(len(shown), "file"), first)
    if output:
        write_outputs({output: lambda: page}, overwrite)
        return
    with tempfile.NamedTemporaryFile("wb", prefix="distretarget_", suffix=".html", delete=False) as file:
        file.write(page.encode("utf-8"))
    if not webbrowser.open(Path(file.name).as_uri()):
        raise FileError(file.name, "no browser could be opened; open this page in one yourself")
    say(file.name)


def _chosen(files: Sequence[Path]) -> list[Path]:
    """The files, with folders replaced by the files in them; a FileError if a folder has none to show."""
    found: list[Path] = []
    for path in files:
        inside = [path]
        if path != STANDARD and is_folder(path):
            inside = sorted(file for file in path.rglob("*") if file.suffix.lower() in SUFFIXES and file.is_file())
            if not inside:
                raise FileError(path, f"has no motion or character in it, a file that ends in {', '.join(SUFFIXES)}")
        found += inside
    return found


def _actors(chosen: Sequence[Path], named: Collection[Path], clip: str | None) -> Iterator[list[Actor]]:
    """Yield the actors of each file; of files not `named` themselves, errors are warnings, unless none can be read."""
    side, fault = 0, None
    for path in chosen:
        try:
            actors = actors_of(read_input(path), side, clip)
        except DistretargetError as error:
            if path in named:
                raise
            fault = error
            say(f"warning: {error}", err=True)
        else:
            side += len(actors)
            yield actors
    if fault and not side:
        raise fault
