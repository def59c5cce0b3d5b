"""The verdict on a result: a sentence on what was kept and what changed, and warnings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Self

from distretarget.measure.metrics import BY_KEY, METRICS, Metric, Metrics, Tracks, Variant

FindCause = Callable[[Metric, int, str], str]  # from metric, frame and part to a cause; empty if none is found

SAME = 1.15  # contacts whose error is less than this times smaller are kept as well as by copied rotations
MOST_TIMES = 100.0  # a larger ratio of contact errors is given as "more than"
TOUCHES = 0.5  # skins with a gap, or a depth, up to this seem to touch: 9 mm of 1.8 m [% of height]
NO_CONTACTS = "there are no self-contacts to keep"
STILL = 0.01  # feet slower than this do not skate [leg lengths/s]
UNCHANGED = 0.05  # a smaller direction error is not mentioned [degrees]
LEAST_BOUND = 0.1  # smaller errors are given as this [% of height, or of leg length]


class Remark(str):
    """A text on a result, with the frame and the parts of the body that it is about."""

    __slots__ = ("frame", "parts")
    frame: int | None  # None for the whole clip
    parts: tuple[str, ...]  # keys of joints, or names such as "left hand"; none for the whole body

    def __new__(cls, text: str, frame: int | None = None, *parts: str) -> Self:
        """Make it of a text, a frame, and parts; empty names are left out."""
        remark = super().__new__(cls, text)
        remark.frame, remark.parts = frame, (*filter(None, parts),)
        return remark


def limit_warnings(
    metrics: Metrics, tracks: Mapping[Variant, Tracks], cause_of: FindCause | None = None
) -> Iterator[Remark]:
    """Yield a warning for each metric above its limit: value, worst frame, and the cause that `cause_of` finds."""
    for metric, limit, value in _over_limits(metrics):
        better = f" ({_number(metric, metrics, 'rotation_copy')} in the rotation copy)"
        frame, part = metric.worst(tracks["result"])
        worst = f"worst in frame {frame}" + (f", {part}" if part else "")
        cause = cause_of(metric, frame, part) if cause_of else ""
        text = f"{value}{better if metric.worse_than_copy(metrics) else ''}, limit {limit:.3g}; {worst}"
        yield Remark(text + (f"; cause: {cause}" if cause else ""), frame, part)


def faults(metrics: Metrics) -> list[tuple[float, str]]:
    """For each metric above its limit, its ratio to the limit, and its meaning and value in words; the worst first."""
    found = []
    for metric, limit, value in _over_limits(metrics):
        number, reason = metrics["result"][metric.key] or 0.0, metric.limit.reason if metric.limit else ""
        found.append((number / limit if limit else 1.0 + number, f"{reason} ({value})"))
    return sorted(found, reverse=True)


def _over_limits(metrics: Metrics) -> Iterator[tuple[Metric, float, str]]:
    """Each metric of the result above its limit, with the limit, and its name, value and unit."""
    for metric in METRICS:
        if metric.limit and metric.over_limit(metrics):
            value = f"{metric.label} {_number(metric, metrics, 'result')} {metric.unit}".rstrip()
            yield metric, metric.limit.value(metric.key, metrics) or 0.0, value


def _number(metric: Metric, metrics: Metrics, side: Variant) -> str:
    return f"{round(metrics.get(side, {}).get(metric.key) or 0.0, 4):.3g}"


def verdict(metrics: Metrics, tracks: Mapping[Variant, Tracks]) -> Iterator[Remark]:
    """Yield the parts of a sentence on what was kept; then metrics over limits, or worse than with copied rotations."""
    of_result = tracks["result"]
    parts = [Remark(_contacts(metrics)), *_skin(metrics, of_result), Remark(_feet(metrics))]
    parts += map(Remark, _supports(metrics))
    if (floor := BY_KEY["floor"]).over_limit(metrics):
        parts.append(Remark(f"the body is {metrics['result'][floor.key]:.1f} % of a leg {floor.label}"))
    parts += [*_hips(metrics, of_result), *_turned(of_result)]
    for number, part in enumerate(parts, start=1):
        yield part if number > 1 else Remark(part[0].upper() + part[1:], part.frame, *part.parts)
        yield Remark("; " if number < len(parts) else ".")
    over = [metric for metric in METRICS if metric.over_limit(metrics)]
    worse = [metric for metric in METRICS if metric.worse_than_copy(metrics) and metric not in over]
    for words, found in (("Check", over), ("Within limits, but worse than copied rotations", worse)):
        if found:
            yield Remark(f" {words}: {', '.join(metric.label for metric in found)}.")


def _contacts(metrics: Metrics) -> str:
    if metrics["result"].get("skin_depth") is not None:
        gap = metrics["result"]["skin_gap"]
        if gap is None:
            return NO_CONTACTS
        if gap <= TOUCHES:
            return f"skin touches as in the source, within {max(gap, LEAST_BOUND):.1f} % of the height"
        return f"a hand or forearm misses what it touches by {gap:.1f} % of the height on average"
    metric = BY_KEY["contact_error"]
    result, copy = (metrics[side][metric.key] for side in ("result", "rotation_copy"))
    if result is None or copy is None:
        return NO_CONTACTS
    if metric.worse_than_copy(metrics):
        return "contacts kept worse than by copied rotations"
    if copy <= metric.least or copy < SAME * result:
        return "contacts kept as well as by copied rotations"
    if copy > MOST_TIMES * result:
        return f"contacts kept more than {MOST_TIMES:.0f} times better than by copied rotations"
    return f"contacts kept {copy / result:.2g} times better than by copied rotations"


def _skin(metrics: Metrics, tracks: Tracks) -> Iterator[Remark]:
    metric = BY_KEY["skin_depth"]
    value = metrics["result"][metric.key]
    if value is not None and value > TOUCHES:
        frame, limb = metric.worst(tracks)
        text = f"{limb} sinks up to {value:.1f} % of the height into the body at frame {frame}"
        yield Remark(text, frame, limb)
    elif value is not None:
        within = f", within {value:.1f} % of the height" if value > metric.least else ""
        yield Remark(f"skin stays outside{within}")


def _feet(metrics: Metrics) -> str:
    metric = BY_KEY["foot_skate"]
    skate = metrics["result"][metric.key]
    if skate is None:
        return "no foot is planted in the source"
    if metric.over_limit(metrics):
        return "feet skate more than in the source"
    if metric.worse_than_copy(metrics):
        return "feet skate more than with copied rotations"
    return "feet do not skate" if skate < STILL else "feet skate no more than in the source"


def _supports(metrics: Metrics) -> Iterator[str]:
    skate, height = BY_KEY["support_skate"], BY_KEY["support_height"]
    if metrics["result"][skate.key] is None:
        return
    if skate.over_limit(metrics):
        yield "hands, knees or other supports skate more than in the source"
    elif height.over_limit(metrics):
        yield "hands, knees or other supports float over the floor or sink into it"
    elif skate.worse_than_copy(metrics) or height.worse_than_copy(metrics):
        yield "hands, knees or other supports stay in place less than with copied rotations"
    else:
        yield "hands, knees or other supports stay in place"


def _hips(metrics: Metrics, tracks: Tracks) -> Iterator[Remark]:
    metric, mean = BY_KEY["hips_height_largest"], BY_KEY["hips_height"]
    value, name = metrics["result"][metric.key], mean.label
    if value is not None and (metric.over_limit(metrics) or mean.over_limit(metrics)):
        frame, _ = metric.worst(tracks)
        yield Remark(f"{name} off by up to {value:.0f} % of a leg at frame {frame}", frame, "hips")
    elif value is not None:
        yield Remark(f"{name} kept within {max(math.ceil(10 * value) / 10, LEAST_BOUND):.1f} % of a leg")


def _turned(tracks: Tracks) -> Iterator[Remark]:
    metric = BY_KEY["direction_error"]
    values = tracks[metric.key].values
    if values.size and values.max() >= UNCHANGED:
        frame, joint = metric.worst(tracks)
        degrees = f"{values.max():.2g}" if values.max() < 99.5 else f"{values.max():.0f}"
        yield Remark(f"largest {metric.label}: {joint}, {degrees} degrees at frame {frame}", frame, joint)
