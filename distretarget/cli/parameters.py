"""Values on the command line that click has no type for."""

from __future__ import annotations

import click

from distretarget.json_node import LARGEST


def positive(text: str) -> float:
    """The number above 0 in the text."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number <= LARGEST:
        raise click.BadParameter(f"expected a number above 0 and at most {LARGEST:g}, found {text!r}")
    return number


def of_bone(text: str) -> tuple[str, float]:
    """The name and the number above 0 in a text NAME=NUMBER."""
    name, _, number = text.rpartition("=")
    if not name:
        raise click.BadParameter(f"expected a bone, = and a number, found {text!r}")
    return name, positive(number)
