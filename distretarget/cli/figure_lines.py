"""How commands print values of figures, and those that are over their limits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from distretarget.report.diff_document import DiffLimit


def number(value: float | None) -> str:
    """A value of a figure; - where nothing was measured."""
    return "-" if value is None else f"{value:.4g}"


def over(limits: Iterable[DiffLimit]) -> Iterator[str]:
    """The figures that are over their limits."""
    for limit in limits:
        if limit["over"]:
            yield f"{limit['figure']} is {limit['value']:.6g}, over {limit['limit']:g}"
