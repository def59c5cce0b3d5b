"""Values on the command line that click has no type for."""

from __future__ import annotations

import click

from distretarget.measure.figures import BY_KEY
from distretarget.report.scene_diff_document import GAP_ERROR
from distretarget.skeleton import LARGEST, SMALLEST


def positive(text: str) -> float:
    """The number above 0 in the text."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not SMALLEST <= number <= LARGEST:
        raise click.BadParameter(f"expected a number above 0, from {SMALLEST:g} to {LARGEST:g}, found {text!r}")
    return number


def of_bone(text: str) -> tuple[str, float]:
    """The name and the number above 0 in a text NAME=NUMBER."""
    name, _, number = text.rpartition("=")
    if not name:
        raise click.BadParameter(f"expected a bone, = and a number, found {text!r}")
    return name, positive(number)


def of_reports(text: str) -> int | None:
    """How many reports are wanted, None for all, in a text worst:N, all or none."""
    if text in ("all", "none"):
        return None if text == "all" else 0
    kind, _, number = text.partition(":")
    if kind != "worst" or not number.isdecimal() or not int(number):
        raise click.BadParameter(f"expected worst:N with N above 0, all or none, found {text!r}")
    return int(number)


def of_figure(text: str) -> tuple[str, float]:
    """The key of a figure and its limit, a number from 0 up, in a text FIGURE=LIMIT."""
    name, _, number = text.partition("=")
    known = (*BY_KEY, GAP_ERROR)
    if name not in known:
        raise click.BadParameter(f"expected one of {', '.join(known)}, = and a limit, found {text!r}")
    try:
        limit = float(number)
    except ValueError:
        limit = -1.0
    if not 0 <= limit <= LARGEST:
        raise click.BadParameter(f"expected a number from 0 to {LARGEST:g} as limit of {name}, found {number!r}")
    return name, limit
