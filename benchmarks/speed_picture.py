"""A picture of speeds: a bar for each, beside each other, on a scale of powers of ten."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

OWN, OTHER, LABEL, GRID = "#2a7f9e", "#b8c0ca", "#3b4252", "#dfe3e8"
DOTS = 120  # per inch
WIDTH, HEIGHT = 9.0, 0.34  # of the picture, and of each bar [inch]


class Bar(NamedTuple):
    """A speed.

    Attributes:
        name: what is so fast.
        value: how fast.
        own: whether it is this project.
    """

    name: str
    value: float
    own: bool


def draw_bars(bars: Sequence[Bar], title: str, path: Path) -> None:
    """Draw the bars from top to bottom, each with its name and its value."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure = Figure((WIDTH, HEIGHT * (len(bars) + 2)), dpi=DOTS, layout="constrained")
    ax = figure.add_subplot()
    places = range(len(bars))
    ax.barh(places, [bar.value for bar in bars], color=[OWN if bar.own else OTHER for bar in bars], height=0.72)
    for place, bar in zip(places, bars, strict=True):
        ax.annotate(
            f"{bar.value:,.0f}", (bar.value, place), (4, 0), textcoords="offset points", va="center", color=LABEL
        )
    ax.set_yticks(places, [bar.name for bar in bars], color=LABEL)
    ax.invert_yaxis()
    ax.set_xscale("log")
    ax.set_xlim(min(bar.value for bar in bars) / 3.0, max(bar.value for bar in bars) * 3.0)
    ax.grid(axis="x", color=GRID)
    ax.set_axisbelow(True)
    ax.spines[:].set_visible(False)
    ax.tick_params(length=0, which="both", labelcolor=LABEL)
    ax.set_title(title, loc="left", color=LABEL, fontsize=11)
    figure.savefig(path, facecolor="white")
