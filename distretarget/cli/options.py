"""The options shared by the commands that retarget."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

import click
from click.core import ParameterSource

from distretarget.baseline.engine_root import RootFollows
from distretarget.baseline.world import RootOffset
from distretarget.cli.parameters import positive
from distretarget.objectives.resting_joints import Environment
from distretarget.pipeline.options import OBJECTIVES, HoldMode, Options
from distretarget.skeleton import AXES

SUPPORTS_OPTION = click.option(
    "--supports",
    type=click.Choice(get_args(HoldMode)),
    default="hold",
    show_default=True,
    help="What stays where it rests. hold: feet, hands, knees and all else that rests on the floor or holds on to "
    "something. feet: feet alone. free: nothing.",
)
ENVIRONMENT_OPTION = click.option(
    "--environment",
    type=click.Choice(get_args(Environment)),
    default="body",
    show_default=True,
    help="Where walls, rails, rungs and all else that the body holds on to are in the result. body: where the limbs of "
    "TARGET meet them, on average. scaled: where they are in SOURCE, scaled like the root's path, for a set that is "
    "scaled with the body.",
)
OPTIONS = (
    click.option(
        "--map",
        "map_path",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help='A JSON file with {"target joint": "source joint"}, null for joints that nothing drives. Its pairs '
        "overrule those in the target's file; joints in neither are matched by names or shape.",
    ),
    click.option(
        "--root-scale",
        type=positive,
        metavar="FACTOR",
        help="The scale of the root's path [target units per source unit]. Default: the ratio of leg lengths.",
    ),
    click.option("--source-up", type=click.Choice(AXES), help="The axis that points up in SOURCE. Default: detected."),
    click.option(
        "--target-up",
        type=click.Choice(AXES),
        help="The axis that points up in TARGET and in the output. Default: what TARGET says, else detected.",
    ),
    click.option(
        "--root-offset",
        type=click.Choice(get_args(RootOffset)),
        help="Whether the position of the source's root replaces its OFFSET or is added to it. Default: whichever puts "
        "the feet on the floor.",
    ),
    click.option(
        "--root-follows",
        type=click.Choice(get_args(RootFollows)),
        help="What the root of TARGET follows if it is on the floor, as in rigs for game engines. pelvis: it stays on "
        "the floor under the pelvis and turns with it. source: it follows the root of SOURCE. nothing: it stays at the "
        "origin. Default: source, if SOURCE has a root that moves on the floor, else pelvis.",
    ),
    click.option(
        "--objective",
        type=click.Choice(OBJECTIVES),
        default="contact",
        show_default=True,
        help="contact: parts of the body that nearly touch in SOURCE stay as near, all else keeps its rotations. "
        "paper: the method of Mucherino et al. (2017), which holds neither hands nor feet in place.",
    ),
    SUPPORTS_OPTION,
    ENVIRONMENT_OPTION,
)


def retargeting(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of retargeting to a command, which receives `map_path`, and all others as `options`."""

    @functools.wraps(command)
    def with_options(**given: Any) -> None:
        options = Options(**{field.name: given.pop(field.name) for field in fields(Options)})
        chosen = click.get_current_context().get_parameter_source("supports") is not ParameterSource.DEFAULT
        if options.objective == "paper" and chosen and options.supports != "free":
            raise click.UsageError(
                f"--supports {options.supports}: the paper's objective holds nothing in its place; use --objective "
                "contact."
            )
        command(options=options, **given)

    for option in reversed(OPTIONS):
        with_options = option(with_options)
    return with_options
