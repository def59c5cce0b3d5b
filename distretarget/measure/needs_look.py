"""What needs a look in a result: the figures above their limits, and those that are worse than the rotation copy's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from distretarget.measure.figures import FIGURES, Figure, Figures, Side, Tracks


def what_needs_a_look(figures: Figures, tracks: Mapping[Side, Tracks]) -> Iterator[str]:
    """Yield a line for each figure of the result that is above its limit: its value, the worst frame and the likely
    cause; and a line with the others that are worse than the rotation copy's.

    `figures` are of the whole clip, `tracks` what they were taken from.
    """
    for figure in FIGURES:
        if figure.limit and figure.needs_look(figures):
            yield f"{_above(figure, figures)}; {_worst(figure, tracks['result'])}; likely cause: {figure.limit.cause}"
    worse = [figure for figure in FIGURES if figure.worse_than_copy(figures) and not figure.needs_look(figures)]
    if worse:
        yield f"worse than the rotation copy in {', '.join(_against_copy(figure, figures) for figure in worse)}"


def _above(figure: Figure, figures: Figures) -> str:
    """The figure, its value and its limit; and the rotation copy's value if that is better."""
    limit = figure.limit.value(figure.key, figures) if figure.limit else None
    better = f" ({_number(figure, figures, 'rotation_copy')} in the rotation copy)"
    copy = better if figure.worse_than_copy(figures) else ""
    return f"{figure.label} {_number(figure, figures, 'result')} {figure.unit}".rstrip() + f"{copy}, limit {limit:.3g}"


def _worst(figure: Figure, tracks: Tracks) -> str:
    """Where the figure is worst."""
    frame, part = figure.worst(tracks)
    return f"worst in frame {frame}" + (f", {part}" if part else "")


def _against_copy(figure: Figure, figures: Figures) -> str:
    """The figure, and its values of result and rotation copy."""
    result, copy = (_number(figure, figures, side) for side in ("result", "rotation_copy"))
    return f"{figure.label} ({result} against {copy} {figure.unit}".rstrip() + ")"


def _number(figure: Figure, figures: Figures, side: Side) -> str:
    return f"{round(figures[side][figure.key] or 0.0, 4):.3g}"
