"""What `distretarget diff` writes and prints."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from distretarget.cli.outputs import LISTED, aligned
from distretarget.errors import counted, quoted
from distretarget.measure.figures import FIGURES, Figure, figures_at
from distretarget.report.diff_document import DiffContact, DiffDocument, DiffLimit, FigureValues
from distretarget.report.scene_diff_document import SceneDiffDocument, Table, figure_table, gap_table

MOST = 5  # frames and contacts that are printed
MOST_GAPS = 10  # gaps of scenes that are printed


@dataclass(frozen=True, eq=False, kw_only=True)
class Account:
    """A diff, to be written and printed."""

    path: str | Path  # of B
    document: Mapping[str, object]
    page: Callable[[], str]  # makes the HTML report
    csv: Callable[[], str]
    lines: Sequence[str]
    faults: Sequence[str]  # figures over their limits


def over(limits: Iterable[DiffLimit]) -> Iterator[str]:
    """Yield a clause for each figure that is over its limit."""
    for limit in limits:
        if limit["over"]:
            yield f"{limit['figure']} is {limit['value']:.6g}, over {limit['limit']:g}"


def clip_lines(figures: DiffDocument) -> Iterator[str]:
    """Yield the lines that are printed of two clips."""
    for name, body in (("A", figures["a"]), ("B", figures["b"])):
        named = f", named as in {body['convention']}" if body["convention"] else ""
        yield f"{name}: {body['file']}, {body['joints']} joints{named}"
    yield f"{counted(figures['frame_count'], 'frame')} compared, {1 / figures['frame_time']:.4g} a second"
    yield from figures["notes"]
    yield from ("", *_table(figures["figures"]["source"], figures["figures"]["result"]), "")
    for figure in figures_at("worst clips"):
        yield _worst_frames(figure, figures["frames"])
    yield from _contacts(figures["contacts"])
    for name, other, joints in (("B", "A", figures["unmatched_b"]), ("A", "B", figures["unmatched_a"])):
        if joints:
            yield f"joints of {name} without a counterpart in {other}: {quoted(joints, LISTED)}"


def _table(a: FigureValues, b: FigureValues) -> Iterator[str]:
    """A line for each figure, with its values in A and B."""
    rows = [("figure", "A", "B", "")]
    for figure in FIGURES:
        own = _number(a[figure.key]) if figure.of_source else ""
        rows.append((figure.label, own, _number(b[figure.key]), _meaning(figure, a.get(figure.key), b[figure.key])))
    return aligned(rows, "<>><")


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _meaning(figure: Figure, a: float | None, b: float | None) -> str:
    """What a figure means, its unit and, if its ratio is judged, the ratio of B to A."""
    meaning = figure.meaning.format(source="A", result="B") + (f" [{figure.unit}]" if figure.unit else "")
    judged = figure.judgement(b, a)
    if not figure.of_source or judged is None or a is None or a <= figure.still:
        return meaning
    return f"{meaning}; {figure.comparison('A', 'B')} {judged:.4g}"


def _worst_frames(figure: Figure, frames: Sequence[FigureValues]) -> str:
    """The worst frames by a figure, with its values."""
    key = figure.key
    ranked = sorted((frame for frame in frames if frame[key]), key=lambda frame: -(frame[key] or 0.0))
    worst = ", ".join(f"{frame['frame']} ({frame[key]:.3g})" for frame in ranked[:MOST])
    return f"worst frames by {figure.label}: {worst or 'none'}"


def _contacts(contacts: Sequence[DiffContact]) -> Iterator[str]:
    """A line for each of the first pairs of regions that touch in A."""
    yield "contacts (distance over path length in A, in B):" if contacts else "contacts: none"
    for contact in contacts[:MOST]:
        distances = f"{contact['distance_a']:.3f}, {contact['distance_b']:.3f} in {counted(contact['frames'], 'frame')}"
        yield f"  {contact['regions']}: {distances}; worst in frame {contact['worst_frame']}"
    if len(contacts) > MOST:
        yield f"  and {len(contacts) - MOST} more"


def scene_lines(figures: SceneDiffDocument) -> Iterator[str]:
    """Yield the lines that are printed of two scenes."""
    performers = figures["performers"]
    first = next(iter(performers.values()))
    yield f"A: {figures['a']}, B: {figures['b']}; performers: {', '.join(performers)}"
    if figures["props"]:
        yield f"props: {', '.join(figures['props'])}"
    frames = min(one["frame_count"] for one in performers.values())
    yield f"{counted(frames, 'frame')} compared, {1 / first['frame_time']:.4g} a second"
    for name, one in performers.items():
        for note in one["notes"]:
            yield f"{name}: {note}"
    yield from ("", *_lines(figure_table(figures)), "")
    gaps = gap_table(figures)
    if not gaps["rows"]:
        yield "nothing touches between them in A"
        return
    yield (
        f"what touches between them in A: {figures['gap_a']:.1f} % of a leg apart in A, {figures['gap_b']:.1f} in B, "
        f"off by {figures['gap_error']:.1f} on average; a unit of A's world is {figures['world_scale']:.3g} of B's"
    )
    yield from _lines(gaps, MOST_GAPS)
    if (more := len(gaps["rows"]) - MOST_GAPS) > 0:
        yield f"and {more} more"


def _lines(table: Table, most: int | None = None) -> Iterator[str]:
    """A line for the columns of a table and for each of its first rows."""
    rows = [table["columns"], *([str(cell) for cell in row] for row in table["rows"][:most])]
    return aligned(rows, "<" + ">" * (len(rows[0]) - 1))
