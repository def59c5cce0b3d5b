"""Options that several commands share, and types of values that click does not have."""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, get_args

import click
from click.core import ParameterSource

from distretarget.body.build import BUILDS, Builds
from distretarget.cli.outputs import QUIET, STANDARD
from distretarget.errors import SettingsError
from distretarget.io.arrays import Precision
from distretarget.io.formats import OUTPUT_FORMATS
from distretarget.io.gltf_writer import Mode
from distretarget.io.map_json import load_map
from distretarget.io.motion_writer import DEFAULT_OUTPUT, OutputSettings
from distretarget.io.target_file import load_build
from distretarget.motion import FASTEST, SLOWEST
from distretarget.numerics.rotations import RotationKind
from distretarget.pipeline.conversion import Recipe
from distretarget.pipeline.edits import MOST_TURN, SPEEDS, Edits
from distretarget.pipeline.options import CHOICES, DEFAULT_OPTIONS, Options, SkinMode
from distretarget.skeleton import LARGEST, SMALLEST

Command = Callable[..., None]
Decorator = Callable[[Command], Command]

PATH = click.Path(path_type=Path)


class FileOrStandard(click.Path):
    """The path of a file; `STANDARD` for the text `-`. A file with that name is given as `./-`."""

    def __init__(self) -> None:
        super().__init__(allow_dash=True, path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        return path.absolute() if path == STANDARD and str(value) != "-" else path


def _be_quiet(context: click.Context, _option: click.Parameter, chosen: bool) -> None:
    context.meta[QUIET] = chosen


quiet = click.option(
    "-q", "--quiet", is_flag=True, expose_value=False, callback=_be_quiet, help="Print nothing but errors."
)
OVERWRITE_OPTION = click.option(
    "--overwrite", is_flag=True, help="Replace files that exist. An input is never replaced."
)
CLIP_OPTION = click.option(
    "--clip", metavar="NAME", help="The animation of a file that has several; '#2' is the second."
)


def _number(text: str, least: float, most: float, expected: str) -> float:
    """The number in the text; an error says what was expected if there is none within bounds."""
    with contextlib.suppress(ValueError):
        if least <= (number := float(text)) <= most:
            return number
    raise click.BadParameter(f"expected {expected}, found {text!r}")


def positive(text: str) -> float:
    """The number above 0 in the text."""
    return _number(text, SMALLEST, LARGEST, f"a number above 0, from {SMALLEST:g} to {LARGEST:g}")


def limit_of(name: str, text: str) -> float:
    """The limit of what has a name, a number from 0 up."""
    return _number(text, 0.0, LARGEST, f"a number from 0 to {LARGEST:g} as limit of {name}")


def of_rate(text: str) -> float:
    """The frame rate in the text [frames/s]."""
    return _number(text, SLOWEST, FASTEST, f"frames per second, from {SLOWEST:g} to {FASTEST:g}")


def of_time(text: str) -> str:
    """The time or the frame in the text."""
    try:
        Edits(start=text)
    except SettingsError as error:
        raise click.BadParameter(f"expected seconds, or a frame such as 90f, found {text!r}") from error
    return text


def of_formats(text: str) -> tuple[str, ...]:
    """The kinds of results in the text, separated by commas."""
    kinds = tuple(text.split(","))
    if wrong := [kind for kind in kinds if kind not in OUTPUT_FORMATS]:
        raise click.BadParameter(
            f"expected one of {', '.join(OUTPUT_FORMATS)}, or several with commas, found {wrong[0]!r}"
        )
    return kinds


def of_reports(text: str) -> int | None:
    """How many reports are wanted, None for all, in a text worst:N, all or none."""
    if text in ("all", "none"):
        return None if text == "all" else 0
    kind, _, number = text.partition(":")
    if kind != "worst" or not number.isdecimal() or not int(number):
        raise click.BadParameter(f"expected all, none or worst:N, such as worst:20, found {text!r}")
    return int(number)


def of_skin(text: str) -> SkinMode | Path:
    """How thick a body is, in the text: a mode, or a build by its name or file."""
    return next((mode for mode in get_args(SkinMode) if mode == text), Path(text))


def _choice(
    name: str, text: str, choices: Sequence[str] = (), settings: Options | OutputSettings = DEFAULT_OPTIONS
) -> Decorator:
    """An option with the choices, by default those of `Options`, and the default of a field of some settings."""
    default = getattr(settings, name)
    kind = click.Choice(choices or [choice for choice in CHOICES[name] if choice is not None])
    flag = f"--{name.replace('_', '-')}"
    return click.option(flag, type=kind, default=default, show_default=default is not None, help=text)


file_option = functools.partial(click.option, type=PATH, metavar="FILE")
map_option = functools.partial(file_option, "--map", "map_path")
contacts_option = functools.partial(file_option, "--contacts", "contacts_path")
rest_option = functools.partial(
    file_option,
    "--rest",
    "rest_path",
    help="For a SOURCE whose rest pose does not stand: a BVH file of its rig that stands in the first frame, in "
    "T-pose, A-pose or with arms down. 'skeleton match' keeps it in a map.",
)
SUPPORTS_OPTION = _choice(
    "supports",
    "What stays in place while it rests. hold: all that rests on the floor or holds on to something, such as feet, "
    "hands and knees. feet: feet alone. free: nothing.",
)
ENVIRONMENT_OPTION = _choice(
    "environment",
    "Where walls, rails and rungs that the body holds on to are in the result. body: where the limbs of TARGET meet "
    "them, on average. scaled: where they are in SOURCE, scaled like the root's path.",
)
STRIP_NAMESPACE_OPTION = click.option(
    "--strip-namespace",
    is_flag=True,
    help="In BVH, write names of joints without a namespace: Hips for mixamorig:Hips, which three.js cannot play.",
)
RETARGETING = (
    map_option(
        help='A JSON file with {"target joint": "source joint"}, null for joints that nothing drives. It overrules '
        "the target's file; other joints are matched by names or shape."
    ),
    rest_option(),
    click.option(
        "--root-scale",
        type=positive,
        metavar="FACTOR",
        help="The scale of the root's path [target units per source unit]. Default: the ratio of leg lengths.",
    ),
    _choice("source_up", "The axis that points up in SOURCE. Default: detected."),
    _choice(
        "target_up", "The axis that points up in TARGET and in the output. Default: what TARGET says, else detected."
    ),
    _choice(
        "root_offset",
        "Whether the position of the source's root replaces its OFFSET or is added to it. Default: whichever puts the "
        "feet on the floor.",
    ),
    _choice(
        "root_follows",
        "What a root of TARGET on the floor follows, as in rigs for game engines. pelvis: it stays under the pelvis "
        "and turns with it. source: it follows SOURCE's root. nothing: it stays at the origin. Default: source if "
        "SOURCE has a root that moves on the floor, else pelvis.",
    ),
    _choice(
        "objective",
        "contact: parts of the body that nearly touch in SOURCE stay as near; all else keeps its rotations. paper: the "
        "method of Mucherino et al. (2017), which holds neither hands nor feet in place.",
    ),
    SUPPORTS_OPTION,
    ENVIRONMENT_OPTION,
    click.option(
        "--skin",
        type=of_skin,
        metavar="[auto|average|BUILD|none|FILE]",
        default="auto",
        show_default=True,
        help="How thick TARGET is, so that skin touches and does not sink in. auto: as its mesh or the radii in its "
        "file show, else not at all. average: as an average adult, child or baby, whichever its bones show. BUILD: "
        f"{', '.join(BUILDS[:-1])} or {BUILDS[-1]}. none: not at all. FILE: as the character in this file, of any size "
        "and names.",
    ),
    click.option(
        "--source-skin",
        type=PATH,
        metavar="[BUILD|FILE]",
        help="How thick the performer of SOURCE is, a BUILD or FILE as in --skin. Default: what the mesh in "
        "SOURCE shows, else an average adult, child or baby.",
    ),
)


READING = (
    CLIP_OPTION,
    click.option(
        "--fps",
        type=of_rate,
        metavar="NUMBER",
        help="Sample SOURCE at this frame rate [frames/s]. Default: at its own keys. Of .npy, its frame rate.",
    ),
    file_option(
        "--skeleton",
        "skeleton_path",
        help="The skeleton of a SOURCE in .npz or .npy: a skeleton file, BVH or character, or .npz with the joints J "
        "of a rest pose, or a model of SMPL.",
    ),
)
EDITING = (
    click.option(
        "--start",
        type=of_time,
        metavar="TIME",
        help="Leave out what is before: seconds, or the number of a frame, as in 90f.",
    ),
    click.option("--end", type=of_time, metavar="TIME", help="Leave out what is after: seconds or a frame."),
    click.option(
        "--speed", type=click.FloatRange(*SPEEDS), metavar="FACTOR", default=1.0, help="How many times as fast it is."
    ),
    click.option("--mirror", is_flag=True, help="Exchange left and right."),
    click.option(
        "--turn",
        type=click.FloatRange(-MOST_TURN, MOST_TURN),
        metavar="DEGREES",
        default=0.0,
        help="Turn the motion to the left, about the vertical through the origin.",
    ),
    click.option("--loop", is_flag=True, help="Bend the motion about its ends so that the end leads to the start."),
)
WRITING = (
    _choice(
        "animations",
        "In a character file: whether the motion is added to the animations in it, or replaces them.",
        get_args(Mode),
        DEFAULT_OUTPUT,
    ),
    click.option(
        "--in-place",
        is_flag=True,
        help="Leave out the root's path along the floor. Character files and .vrma keep it in the animation's extras.",
    ),
    _choice(
        "rotations",
        "In .npz, what rotations are: quaternions x y z w, matrices, or the first two columns of these.",
        get_args(RotationKind),
        DEFAULT_OUTPUT,
    ),
    _choice("precision", "The precision of numbers in .npz.", get_args(Precision), DEFAULT_OUTPUT),
)


def _with(options: Sequence[Decorator], command: Command) -> Command:
    for option in reversed(options):
        command = option(command)
    return command


reading = functools.partial(_with, READING)


@dataclass(frozen=True)
class RecipeFiles:
    """A recipe as the command line gives it, with files by their paths."""

    clip: str | None
    fps: float | None
    skeleton_path: Path | None
    map_path: Path | None
    rest_path: Path | None
    source_skin: Path | None
    skin: Path | None
    options: Options
    edits: Edits
    writing: OutputSettings

    @property
    def paths(self) -> list[Path | None]:
        """The paths of its files."""
        return [self.skeleton_path, self.map_path, self.rest_path, self.source_skin, self.skin]

    def read(self) -> Recipe:
        """Read its files; errors as in `load_map` and `load_build`."""
        builds = Builds(*(load_build(path) if path else None for path in (self.source_skin, self.skin)))
        map_file = load_map(self.map_path, self.rest_path)
        return Recipe(self.options, map_file, self.clip, self.fps, self.writing, builds, self.edits)


def converting(*between: Decorator) -> Decorator:
    """Add all options of a conversion to a command, which receives them as `recipe_files`; the options `between` those
    of retargeting and of writing are its own.
    """

    def with_recipe(command: Command, skin: SkinMode | Path, **given: Any) -> None:
        given["skin"] = "auto" if isinstance(skin, Path) else skin
        if skin == "none" and given["source_skin"]:
            raise click.UsageError("--skin none leaves out all thickness; leave out --source-skin.")
        options, edits, writing = (_taken(kind, given) for kind in (Options, Edits, OutputSettings))
        chosen = click.get_current_context().get_parameter_source("supports") is not ParameterSource.DEFAULT
        if options.objective == "paper" and chosen and options.supports != "free":
            raise click.UsageError(
                f"--supports {options.supports}: the paper's objective holds nothing in its place; use --objective "
                "contact."
            )
        paths = {
            name: given.pop(name) for name in ("clip", "fps", "skeleton_path", "map_path", "rest_path", "source_skin")
        }
        recipe = RecipeFiles(
            **paths, skin=skin if isinstance(skin, Path) else None, options=options, edits=edits, writing=writing
        )
        command(recipe_files=recipe, **given)

    def decorate(command: Command) -> Command:
        own = functools.update_wrapper(functools.partial(with_recipe, command), command)
        return _with((*READING, *EDITING, *RETARGETING, *between, *WRITING), own)

    return decorate


def editing_together(command: Command) -> Command:
    """Add the options that edit all clips of a scene together to a command."""
    return _with(EDITING[1:], command)


def _taken(kind: type[Any], given: dict[str, Any]) -> Any:
    """Some settings, from their fields, which are taken out of what is given."""
    return kind(**{field.name: given.pop(field.name) for field in fields(kind)})
