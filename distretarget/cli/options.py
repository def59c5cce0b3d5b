"""Options that several commands share, and parsers for types of values that click does not have."""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, get_args

import click
from click.core import ParameterSource

from distretarget.body.build import BUILDS, Builds
from distretarget.cli.outputs import QUIET, STANDARD
from distretarget.errors import SettingsError
from distretarget.io.arrays import Precision
from distretarget.io.gltf_writer import Mode
from distretarget.io.input_file import OUTPUT_FORMATS
from distretarget.io.map_json import load_map
from distretarget.io.motion_writer import DEFAULT_OUTPUT, OutputSettings
from distretarget.io.reading import load_build
from distretarget.motion import FASTEST, SLOWEST
from distretarget.numerics.rotations import RotationKind
from distretarget.pipeline.edits import MOST_TURN, SPEEDS, Edits
from distretarget.pipeline.options import CHOICES, DEFAULT_OPTIONS, Options, SkinMode
from distretarget.pipeline.retargeting import Recipe
from distretarget.skeleton import LARGEST, SMALLEST

Command = Callable[..., None]
Decorator = Callable[[Command], Command]

PATH = click.Path(path_type=Path)


class FileOrStandard(click.Path):
    """The path of a file, or `STANDARD` for `-`; a file of that name can be given as `./-`."""

    def __init__(self) -> None:
        super().__init__(allow_dash=True, path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        return path.absolute() if path == STANDARD and str(value) != "-" else path


def _be_quiet(context: click.Context, _option: click.Parameter, given: bool) -> None:
    context.meta[QUIET] = given


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
    """The number in a text; an error that says what was `expected` if it is no number from `least` to `most`."""
    with contextlib.suppress(ValueError):
        if least <= (number := float(text)) <= most:
            return number
    raise click.BadParameter(f"expected {expected}, found {text!r}")


def positive(text: str) -> float:
    """The number above 0 in a text."""
    return _number(text, SMALLEST, LARGEST, f"a number above 0, from {SMALLEST:g} to {LARGEST:g}")


def limit_of(known: Sequence[str]) -> Callable[[str], tuple[str, float]]:
    """A parser of texts NAME=LIMIT, with one of the known names of metrics or faults, and a number from 0 up."""

    def parse(text: str) -> tuple[str, float]:
        name, _, number = text.partition("=")
        if name not in known:
            raise click.BadParameter(f"expected one of {', '.join(known)}, = and a limit, found {text!r}")
        return name, _number(number, 0.0, LARGEST, f"a number from 0 to {LARGEST:g} as limit of {name}")

    return parse


def parse_rate(text: str) -> float:
    """The frame rate in a text [frames/s]."""
    return _number(text, SLOWEST, FASTEST, f"frames per second, from {SLOWEST:g} to {FASTEST:g}")


def parse_time(text: str) -> str:
    """The text of a time or a frame, checked."""
    try:
        Edits(start=text)
    except SettingsError as error:
        raise click.BadParameter(f"expected seconds, or a frame such as 90f, found {text!r}") from error
    return text


def parse_formats(text: str) -> tuple[str, ...]:
    """The output formats in a text, separated by commas."""
    kinds = tuple(text.split(","))
    if wrong := [kind for kind in kinds if kind not in OUTPUT_FORMATS]:
        raise click.BadParameter(
            f"expected one of {', '.join(OUTPUT_FORMATS)}, or several with commas, found {wrong[0]!r}"
        )
    return kinds


def parse_reports(text: str) -> int | None:
    """The number of reports, None for all, in a text worst:N, all or none."""
    if text in ("all", "none"):
        return None if text == "all" else 0
    kind, _, number = text.partition(":")
    if kind != "worst" or not number.isdecimal() or not int(number):
        raise click.BadParameter(f"expected all, none or worst:N, such as worst:20, found {text!r}")
    return int(number)


def parse_skin(text: str) -> SkinMode | Path:
    """The mode of skin in a text, or a path that names a build or its file."""
    return next((mode for mode in get_args(SkinMode) if mode == text), Path(text))


def _choice(
    name: str, text: str, choices: Sequence[str] = (), settings: Options | OutputSettings = DEFAULT_OPTIONS
) -> Decorator:
    """The option for a field of some settings, with its default; `choices` are by default those of `Options`."""
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
    help="For a SOURCE whose rest pose is not standing: a BVH file of its rig that stands in the first frame, in "
    "T-pose, A-pose or with arms down. 'skeleton match' stores it in a map.",
)
SUPPORTS_OPTION = _choice(
    "supports",
    "Which parts stay in place while they rest on the floor or hold on to something. hold: all, such as feet, hands "
    "and knees. feet: only feet. free: none.",
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
        help='A JSON file with {"target joint": "source joint"}, null for joints without a driver. It overrides '
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
        "target_up", "The axis that points up in TARGET and in the output. Default: as TARGET states, else detected."
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
        type=parse_skin,
        metavar="[auto|average|BUILD|none|FILE]",
        default="auto",
        show_default=True,
        help="The thickness of TARGET, so that skin touches but does not sink in. auto: from the mesh or the radii in "
        "TARGET, else none. average: of an adult, child or baby, depending on the bones. BUILD: "
        f"{', '.join(BUILDS[:-1])} or {BUILDS[-1]}. none: no thickness. FILE: of the character in this file, with "
        "any size and names.",
    ),
    click.option(
        "--source-skin",
        type=PATH,
        metavar="[BUILD|FILE]",
        help="The thickness of SOURCE's performer, a BUILD or FILE as in --skin. Default: from the mesh in SOURCE, "
        "else of an average adult, child or baby.",
    ),
)


READING = (
    CLIP_OPTION,
    click.option(
        "--fps",
        type=parse_rate,
        metavar="NUMBER",
        help="Sample SOURCE at this frame rate [frames/s]. Default: at its own keys. For .npy, its frame rate.",
    ),
    file_option(
        "--skeleton",
        "skeleton_path",
        help="The skeleton of a SOURCE in .npz or .npy: a skeleton file, BVH or character, .npz with the joints J of a "
        "rest pose, or a model of SMPL.",
    ),
)
EDITING = (
    click.option(
        "--start",
        type=parse_time,
        metavar="TIME",
        help="Cut off everything before this time: seconds, or a frame, as in 90f.",
    ),
    click.option("--end", type=parse_time, metavar="TIME", help="Cut off everything after this time or frame."),
    click.option(
        "--speed",
        type=click.FloatRange(*SPEEDS),
        metavar="FACTOR",
        default=1.0,
        help="Play the motion this many times as fast.",
    ),
    click.option("--mirror", is_flag=True, help="Exchange left and right."),
    click.option(
        "--turn",
        type=click.FloatRange(-MOST_TURN, MOST_TURN),
        metavar="DEGREES",
        default=0.0,
        help="Turn the motion to the left, about the vertical through the origin.",
    ),
    click.option("--loop", is_flag=True, help="Blend the motion near its ends so that it repeats smoothly."),
)
WRITING = (
    _choice(
        "animations",
        "In a character file, whether to add the motion to its animations or replace them.",
        get_args(Mode),
        DEFAULT_OUTPUT,
    ),
    click.option(
        "--in-place",
        is_flag=True,
        help="Leave out the root's path along the floor. Character files and .vrma store it in the animation's extras.",
    ),
    _choice(
        "rotations",
        "In .npz, rotations are quaternions x y z w, matrices, or the first two columns of matrices.",
        get_args(RotationKind),
        DEFAULT_OUTPUT,
    ),
    _choice("precision", "The precision of numbers in .npz.", get_args(Precision), DEFAULT_OUTPUT),
)


def _with(options: Sequence[Decorator], command: Command) -> Command:
    for option in reversed(options):
        command = option(command)
    return command


reading_options = functools.partial(_with, READING)
scene_edit_options = functools.partial(_with, EDITING[1:])  # a scene has --start per clip


@dataclass(frozen=True)
class RecipeFiles:
    """A recipe without map and builds, and the paths of their files."""

    recipe: Recipe
    skeleton_path: Path | None
    map_path: Path | None
    rest_path: Path | None
    source_skin: Path | None
    skin: Path | None

    @property
    def paths(self) -> list[Path | None]:
        """The paths of all files."""
        return [self.skeleton_path, self.map_path, self.rest_path, self.source_skin, self.skin]

    def read(self) -> Recipe:
        """Return the whole recipe; errors as in `load_map` and `load_build`."""
        builds = Builds(*(load_build(path) if path else None for path in (self.source_skin, self.skin)))
        return replace(self.recipe, map_file=load_map(self.map_path, self.rest_path), builds=builds)


def conversion_options(*own: Decorator) -> Decorator:
    """Add the options of a conversion to a command, which receives them as `recipe_files`, and its `own` options."""

    def with_recipe(command: Command, skin: SkinMode | Path, **given: Any) -> None:
        given["skin"] = "auto" if isinstance(skin, Path) else skin
        if skin == "none" and given["source_skin"]:
            raise click.UsageError("--skin none leaves out all thickness; leave out --source-skin.")
        kinds: tuple[type[Any], ...] = (Options, Edits, OutputSettings)
        options, edits, writing = (kind(**{each.name: given.pop(each.name) for each in fields(kind)}) for kind in kinds)
        explicit = click.get_current_context().get_parameter_source("supports") is not ParameterSource.DEFAULT
        if options.objective == "paper" and explicit and options.supports != "free":
            raise click.UsageError(
                f"--supports {options.supports}: the paper's objective holds nothing in its place; use --objective "
                "contact."
            )
        recipe = Recipe(options, clip=given.pop("clip"), fps=given.pop("fps"), writing=writing, edits=edits)
        paths = {name: given.pop(name) for name in ("skeleton_path", "map_path", "rest_path", "source_skin")}
        command(recipe_files=RecipeFiles(recipe, skin=skin if isinstance(skin, Path) else None, **paths), **given)

    def decorate(command: Command) -> Command:
        wrapped = functools.update_wrapper(functools.partial(with_recipe, command), command)
        return _with((*READING, *EDITING, *RETARGETING, *own, *WRITING), wrapped)

    return decorate
