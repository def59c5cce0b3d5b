"""The verdict on a result: a plain sentence of what was kept and what changed. It claims only what was measured."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from distretarget.measure.figures import BY_KEY, FIGURES, Figure, Figures, Tracks, Variant


def what_needs_a_look(figures: Figures, tracks: Mapping[Variant, Tracks]) -> Iterator[str]:
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


def _number(figure: Figure, figures: Figures, side: Variant) -> str:
    return f"{round(figures[side][figure.key] or 0.0, 4):.3g}"


SAME = 1.15  # contacts that are kept less than this times better are kept as well as by copied rotations
MOST_TIMES = 100.0  # a larger ratio of contact errors is given as "more than"
STILL = 0.01  # feet slower than this do not slide [leg lengths/s]
UNCHANGED = 0.05  # a smaller change of direction is none [degrees]
LEAST_BOUND = 0.1  # the least distance that hips are said to be within [% of leg length]


def verdict(figures: Figures, tracks: Mapping[Variant, Tracks]) -> str:
    """Return the sentence on contacts, feet, other supports, hips and the largest change of direction, and the names of
    the figures that need a look. What was not measured is said to be missing, or left out.

    `figures` are of the whole clip, `tracks` what they were taken from.
    """
    of_result = tracks["result"]
    parts = [_contacts(figures), _feet(figures), *_supports(figures), *_hips(figures, of_result), *_change(of_result)]
    text = f"{'; '.join(parts)}."
    text = text[0].upper() + text[1:]
    looks = [figure.label for figure in FIGURES if figure.needs_look(figures) or figure.worse_than_copy(figures)]
    return f"{text} Needs a look: {', '.join(looks)}." if looks else text


def _contacts(figures: Figures) -> str:
    figure = BY_KEY["contact_error"]
    result, copy = (figures[side][figure.key] for side in ("result", "rotation_copy"))
    if result is None or copy is None:
        return "nothing touches in the source"
    if figure.worse_than_copy(figures):
        return "contacts kept worse than by copied rotations"
    if copy <= figure.least or copy < SAME * result:
        return "contacts kept as well as by copied rotations"
    if copy > MOST_TIMES * result:
        return f"contacts kept more than {MOST_TIMES:.0f} times better than by copied rotations"
    return f"contacts kept {copy / result:.2g} times better than by copied rotations"


def _feet(figures: Figures) -> str:
    figure = BY_KEY["slide"]
    slide = figures["result"][figure.key]
    if slide is None:
        return "no foot rests in the source"
    if figure.needs_look(figures):
        return "feet slide more than the source's"
    return "feet do not slide" if slide < STILL else "feet slide no more than the source's"


def _supports(figures: Figures) -> Iterator[str]:
    slide, height = (BY_KEY[key] for key in ("support_slide", "support_height"))
    if figures["result"][slide.key] is None:
        return
    if slide.needs_look(figures):
        yield "hands, knees or whatever else rests slides more than the source's"
    elif height.needs_look(figures):
        yield "hands, knees or whatever else rests on the floor is off its height"
    else:
        yield "what else rests on the world stays in its place"


def _hips(figures: Figures, tracks: Tracks) -> Iterator[str]:
    figure = BY_KEY["hips_height_largest"]
    value = figures["result"][figure.key]
    if value is None:
        return
    if figure.needs_look(figures):
        yield f"hips up to {value:.0f} % of a leg off their height at frame {figure.worst(tracks)[0]}"
    else:
        yield f"hips within {max(math.ceil(10 * value) / 10, LEAST_BOUND):.1f} % of a leg"


def _change(tracks: Tracks) -> Iterator[str]:
    figure = BY_KEY["direction_error"]
    values = tracks[figure.key].values
    if values.size and values.max() >= UNCHANGED:
        frame, joint = figure.worst(tracks)
        yield f"largest change: {joint} {values.max():.2g} degrees at frame {frame}"
