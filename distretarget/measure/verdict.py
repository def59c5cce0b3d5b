"""The verdict on a result: a plain sentence of what was kept and what changed, and warnings of what needs a look."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from distretarget.measure.figures import BY_KEY, FIGURES, Figure, Figures, Tracks, Variant

SAME = 1.15  # contacts that are kept less than this times better are kept as well as by copied rotations
MOST_TIMES = 100.0  # a larger ratio of contact errors is given as "more than"
STILL = 0.01  # feet slower than this do not slide [leg lengths/s]
UNCHANGED = 0.05  # a smaller error of direction is not mentioned [degrees]
LEAST_BOUND = 0.1  # the least error that is given for the height of the hips [% of leg length]


def what_needs_a_look(figures: Figures, tracks: Mapping[Variant, Tracks]) -> Iterator[str]:
    """Yield a warning for each figure of the result above its limit, with value, worst frame and likely cause; and one
    warning that names the other figures that are worse than the rotation copy's.

    `figures` are of the whole clip, computed from `tracks`.
    """
    for figure in FIGURES:
        if figure.limit and figure.needs_look(figures):
            limit = figure.limit.value(figure.key, figures)
            copy = _number(figure, figures, "rotation_copy")
            better = f" ({copy} in the rotation copy)" if figure.worse_than_copy(figures) else ""
            value = f"{figure.label} {_number(figure, figures, 'result')} {figure.unit}".rstrip()
            frame, part = figure.worst(tracks["result"])
            worst = f"worst in frame {frame}" + (f", {part}" if part else "")
            yield f"{value}{better}, limit {limit:.3g}; {worst}; likely cause: {figure.limit.cause}"
    worse = [figure for figure in FIGURES if figure.worse_than_copy(figures) and not figure.needs_look(figures)]
    if worse:
        yield f"worse than the rotation copy in {', '.join(_against_copy(figure, figures) for figure in worse)}"


def _against_copy(figure: Figure, figures: Figures) -> str:
    """The figure, and its values of result and rotation copy."""
    result, copy = (_number(figure, figures, side) for side in ("result", "rotation_copy"))
    return f"{figure.label} ({result} against {copy} {figure.unit}".rstrip() + ")"


def _number(figure: Figure, figures: Figures, side: Variant) -> str:
    return f"{round(figures[side][figure.key] or 0.0, 4):.3g}"


def verdict(figures: Figures, tracks: Mapping[Variant, Tracks]) -> str:
    """Return a sentence on contacts, skin, feet, other supports, hips and the largest direction error, and the names of
    the figures that need a look.

    `figures` are of the whole clip, computed from `tracks`.
    """
    of_result = tracks["result"]
    parts = [_contacts(figures), *_skin(figures, of_result), _feet(figures), *_supports(figures)]
    parts += [*_hips(figures, of_result), *_turned(of_result)]
    text = f"{'; '.join(parts)}."
    text = text[0].upper() + text[1:]
    looks = [figure.label for figure in FIGURES if figure.needs_look(figures) or figure.worse_than_copy(figures)]
    return f"{text} Needs a look: {', '.join(looks)}." if looks else text


def _contacts(figures: Figures) -> str:
    if figures["result"].get("skin_depth") is not None:
        gap = figures["result"]["skin_gap"]
        return (
            "no skins touch in the source" if gap is None else f"gaps of skins that touch {gap:.1f} % of the height off"
        )
    figure = BY_KEY["contact_error"]
    result, copy = (figures[side][figure.key] for side in ("result", "rotation_copy"))
    if result is None or copy is None:
        return "the source has no self-contacts"
    if figure.worse_than_copy(figures):
        return "contacts kept worse than by copied rotations"
    if copy <= figure.least or copy < SAME * result:
        return "contacts kept as well as by copied rotations"
    if copy > MOST_TIMES * result:
        return f"contacts kept more than {MOST_TIMES:.0f} times better than by copied rotations"
    return f"contacts kept {copy / result:.2g} times better than by copied rotations"


def _skin(figures: Figures, tracks: Tracks) -> Iterator[str]:
    figure = BY_KEY["skin_depth"]
    value = figures["result"][figure.key]
    if value is not None and value > figure.least:
        frame, limb = figure.worst(tracks)
        yield f"{limb} sinks up to {value:.1f} % of the height into the body at frame {frame}"
    elif value is not None:
        yield "skin stays outside"


def _feet(figures: Figures) -> str:
    figure = BY_KEY["slide"]
    slide = figures["result"][figure.key]
    if slide is None:
        return "no foot rests in the source"
    if figure.needs_look(figures):
        return "feet slide more than in the source"
    return "feet do not slide" if slide < STILL else "feet slide no more than in the source"


def _supports(figures: Figures) -> Iterator[str]:
    slide, height = BY_KEY["support_slide"], BY_KEY["support_height"]
    if figures["result"][slide.key] is None:
        return
    if slide.needs_look(figures):
        yield "hands, knees or other supports slide more than in the source"
    elif height.needs_look(figures):
        yield "hands, knees or other supports float over the floor or sink into it"
    else:
        yield "hands, knees or other supports stay in place"


def _hips(figures: Figures, tracks: Tracks) -> Iterator[str]:
    figure, name = BY_KEY["hips_height_largest"], BY_KEY["hips_height"].label
    value = figures["result"][figure.key]
    if value is not None and figure.needs_look(figures):
        yield f"{name} off by up to {value:.0f} % of a leg at frame {figure.worst(tracks)[0]}"
    elif value is not None:
        yield f"{name} kept within {max(math.ceil(10 * value) / 10, LEAST_BOUND):.1f} % of a leg"


def _turned(tracks: Tracks) -> Iterator[str]:
    figure = BY_KEY["direction_error"]
    values = tracks[figure.key].values
    if values.size and values.max() >= UNCHANGED:
        frame, joint = figure.worst(tracks)
        yield f"largest {figure.label}: {joint}, {values.max():.2g} degrees at frame {frame}"
