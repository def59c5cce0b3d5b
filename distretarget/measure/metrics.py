"""The metrics: their names and meanings, how they are computed from a clip, and their limits.

Everything that prints, writes or draws metrics takes them from `METRICS`, the entries of `metrics.toml`. To add one,
add its entry there and its track to those of `Comparison`, or to `RetargetResult.tracks` if it takes more than source
and result, and run `tools/make_docs.py`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Any, Literal

import numpy as np

from distretarget.numerics.time_series import spans_of
from distretarget.numerics.vectors import Array, Flags, Numbers

Variant = Literal["source", "rotation_copy", "result"]

# What follows a key where the metrics of several motions stand in one list.
SUFFIXES: dict[Variant, str] = {"source": "_source", "rotation_copy": "_copy", "result": ""}
SYMBOLS = {  # short forms of units
    "degrees": "°",
    "degrees in 1/60 s": "°",
    "% of leg length": "% leg",
    "leg lengths/s": "legs/s",
    "leg lengths/s²": "legs/s²",
    "% of height": "% height",
    "% of frames": "% frames",
    "body sizes/s³": "sizes/s³",
}


@dataclass(frozen=True, eq=False)
class Track:
    """The measurements of the frames of a clip."""

    values: Array  # (frames,) or (frames, parts); fewer rows if a value takes several frames, as a speed does
    counts: Numbers | Flags | None = None  # the number of measurements in each value; None for one in each
    parts: tuple[str, ...] = ()  # the names of the columns, such as joints

    @property
    def weights(self) -> Numbers:
        """The number of measurements in each value, in the shape of `values`."""
        return np.ones(self.values.shape, np.intp) if self.counts is None else self.counts.astype(np.intp)


def middle_thirds(counts: Numbers) -> Numbers:
    """Return the counts, (frames, parts), in the middle third of each run of counts above 0; else 0."""
    within = np.zeros(counts.shape, np.intp)
    for part, column in enumerate(counts.T):
        for first, end in spans_of(column > 0):
            third = (end - first - 1) // 3
            within[first + third : end - third, part] = column[first + third : end - third]
    return within


Tracks = Mapping[str, Track]  # by key
NOT_RUN: Tracks = {
    key: Track(np.zeros(0)) for key in ("turned", "arm_deviation", "shaking", "pop", "not_converged")
}  # of a motion that was not solved here
Metrics = Mapping[Variant, Mapping[str, float | None]]  # of whole clips, by key; None where nothing was measured


@dataclass(frozen=True, kw_only=True)
class Limit:
    """The value above which a metric of a result is too high: `factor` times that of another motion, plus `margin`."""

    margin: float = 0.0  # in the unit of the metric
    factor: float = 0.0  # 0 if the limit is the margin alone
    of: Literal["source", "rotation_copy"] = "source"  # the other motion
    reason: str  # what a value above the limit means

    def value(self, key: str, metrics: Metrics) -> float | None:
        """The limit of the metric with this key; None where the other motion has no such metric."""
        other = metrics.get(self.of, {}).get(key) if self.factor else 0.0
        return None if other is None else self.factor * other + self.margin

    def formula(self, unit: str) -> str:
        """The limit in words, with the unit of the metric."""
        margin = f"{self.margin:g} {unit}".rstrip()
        if not self.factor:
            return margin
        times = "" if self.factor == 1 else f"{self.factor:g} times "
        return f"{times}the {self.of.replace('_', ' ')}'s" + (f" + {margin}" if self.margin else "")


@dataclass(frozen=True, kw_only=True)
class Metric:
    """One metric. Texts call the two motions `{source}` and `{result}`; documents replace these by names.

    Attributes:
        key: its name in JSON, CSV and `--fail-over`, and that of its track.
        label: its name in prose.
        meaning: what it measures.
        unit: of the number in files and limits; empty for a plain number.
        missing: why a clip may have no value; empty if every clip has one.
        track: the key of its track, if that is another metric's.
        worst_by: the key of the metric whose worst frame and part are given, if values of this one are yes or no.
        middle_of_touches: whether only the middle third of each touch counts; the rest depends on its timing.
        reduction: how the track's values become the metric; "worst part" is the part with the largest mean.
        judged: what `--fail-over` limits: the value, of which 0 is best, or its ratio to the source's value.
        still: source values up to this are rounding errors; ratios divide by at least this.
        limit: the value above which a run has a warning; None for no limit.
        compared_with_copy: whether a run has a remark if the rotation copy is better by more than `least`.
        superseded_by: the key of the metric that is judged in place of this one, if it has a value.
        factor: pages and the line of a run show the number times this.
        decimals: of the number in the line of a run.
        least: values up to this do not matter.
        places: where it is shown: in the line of a run; in a report as a card, a curve, or with its worst frames; as a
            column of the page over clips; among the worst frames that a diff prints.
    """

    key: str
    label: str
    meaning: str
    unit: str = ""
    missing: str = ""
    track: str = ""
    worst_by: str = ""
    middle_of_touches: bool = False
    reduction: Literal["mean", "worst part", "largest", "percentile 99", "frames"] = "mean"
    judged: Literal["value", "ratio"] = "value"
    still: float = 0.0
    limit: Limit | None = None
    compared_with_copy: bool = False
    superseded_by: str = ""
    factor: float = 1.0
    decimals: int = 2
    least: float = 0.0
    places: tuple[Literal["line", "card", "curve", "worst frames", "page over clips", "diff"], ...] = ()

    @property
    def symbol(self) -> str:
        """The unit in which pages and the line of a run show the number."""
        return SYMBOLS.get(self.unit) or {100.0: "%", 1000.0: "\N{MULTIPLICATION SIGN} 1000"}.get(self.factor, "")

    @property
    def of_source(self) -> bool:
        """Whether the source has a value, too."""
        return self.judged != "value"

    @property
    def of_frames(self) -> bool:
        """Whether frames have values of it: it has a track of its own."""
        return not self.track

    def of_clip(self, tracks: Tracks) -> float | None:
        """The metric of the whole clip; None if nothing was measured."""
        track = self._judged_track(tracks)
        values = track.values if track.counts is None else track.values[track.counts > 0]
        if not values.size:
            return None
        if self.reduction == "frames":
            positive = (track.values > 0.0) & (track.weights > 0)
            return float(np.count_nonzero(positive.reshape(len(positive), -1).any(axis=1)))
        if self.reduction == "largest":
            return float(values.max(initial=0.0))
        if self.reduction == "percentile 99":
            return float(np.percentile(values, 99))
        if self.reduction == "worst part":
            sums, counts = np.where(track.weights > 0, track.values, 0.0).sum(axis=0), track.weights.sum(axis=0)
            return float(np.max(sums / np.maximum(counts, 1)))
        return float(values.sum() / (values.size if track.counts is None else track.counts.sum()))

    def over_time(self, tracks: Tracks, frames: int) -> Array:
        """(frames,), the metric of each frame; nan where nothing was measured, as in rows that a track lacks."""
        track = self._judged_track(tracks)
        values, weights = (a if a.ndim == 2 else a[:, None] for a in (track.values, track.weights))
        values = np.where(weights > 0, values, 0.0)
        if self.reduction in ("largest", "worst part", "frames"):
            reduced = values.max(axis=1, initial=0.0)
            reduced = np.sign(reduced) if self.reduction == "frames" else reduced
        else:
            reduced = values.sum(axis=1) / np.maximum(weights.sum(axis=1), 1)
        column = np.full(frames, np.nan)
        column[: len(values)] = np.where(weights.any(axis=1), reduced, np.nan)
        return column

    def worst(self, tracks: Tracks) -> tuple[int, str]:
        """The frame of the largest value, and the name of its part, if any; something must have been measured."""
        track = (BY_KEY[self.worst_by] if self.worst_by else self)._judged_track(tracks)
        values = np.where(track.weights > 0, track.values, -np.inf)
        frame, *part = np.unravel_index(values.argmax(), values.shape)
        return int(frame), track.parts[part[0]] if part and track.parts else ""

    def _judged_track(self, tracks: Tracks) -> Track:
        """The track, with `middle_of_touches` only the middle thirds of touches."""
        track = tracks[self.track or self.key]
        return replace(track, counts=middle_thirds(track.weights)) if self.middle_of_touches else track

    def judgement(self, value: float | None, source: float | None) -> float | None:
        """The number that `--fail-over` limits, from the values of result and source; None if it is not known."""
        if self.judged == "value" or value is None:
            return value
        least = 0.0 if source is None else max(source, self.still)
        return value / least if least > 0 else None

    def explanation(self, source: str, result: str) -> str:
        """What it measures, its unit, and which value is best, in two sentences."""
        meaning = self.meaning.format(source=source, result=result)
        unit = f" [{self.unit}]" if self.unit else ""
        best = f"The same as in {source} is best" if self.of_source else "0 is best"
        return f"{meaning[0].upper()}{meaning[1:]}{unit}. {best}."

    def comparison(self, source: str, result: str) -> str:
        """The ratio that `--fail-over` limits, as a formula; empty if it limits the value itself."""
        return f"{result} / {source}" if self.judged == "ratio" else ""

    def over_limit(self, metrics: Metrics) -> bool:
        """Whether the result's value is above the limit; false if either is missing, or superseded."""
        value, limit = self._judged(metrics), self.limit.value(self.key, metrics) if self.limit else None
        return value is not None and limit is not None and value > limit

    def worse_than_copy(self, metrics: Metrics) -> bool:
        """Whether the rotation copy is better by more than `least`, if that matters; false if superseded."""
        value, copy = self._judged(metrics), metrics.get("rotation_copy", {}).get(self.key)
        return self.compared_with_copy and value is not None and copy is not None and value > copy + self.least

    def _judged(self, metrics: Metrics) -> float | None:
        """The result's value; None if it is missing, or the metric has a value that supersedes it."""
        of_result = metrics["result"]
        return of_result.get(self.key) if of_result.get(self.superseded_by) is None else None

    def brief(self, value: float | None) -> str:
        """The number as the line of a run shows it."""
        return "-" if value is None else f"{self.factor * value:.{self.decimals}f}"


_REGISTRY = tomllib.loads(files(__package__).joinpath("metrics.toml").read_text("utf-8"))


def _metric(key: str, entry: Mapping[str, Any]) -> Metric:
    limit = Limit(**entry["limit"]) if "limit" in entry else None
    return Metric(**{**entry, "key": key, "limit": limit, "places": tuple(entry.get("places", ()))})


METRICS = tuple(_metric(key, entry) for key, entry in _REGISTRY.items())  # the most telling first
BY_KEY = {metric.key: metric for metric in METRICS}
# The metrics of all sides in one list, by these names: `jerk_source`, `jerk_copy`, `jerk`.
COLUMNS: dict[str, tuple[Variant, Metric]] = {
    metric.key + suffix: (side, metric)
    for metric in METRICS
    for side, suffix in SUFFIXES.items()
    if side != "source" or metric.of_source
}


def in_columns(metrics: Metrics) -> dict[str, float | None]:
    """Return the metrics of a clip, by `COLUMNS`; None where nothing was measured."""
    return {name: metrics.get(side, {}).get(metric.key) for name, (side, metric) in COLUMNS.items()}


def of_columns(values: Mapping[str, float | None]) -> Metrics:
    """Return the metrics of a clip from those in one list, the inverse of `in_columns`."""
    sides: dict[Variant, dict[str, float | None]] = {side: {} for side in SUFFIXES}
    for name, (side, metric) in COLUMNS.items():
        sides[side][metric.key] = values.get(name)
    return sides


def metrics_at(place: str) -> tuple[Metric, ...]:
    """The metrics shown in one of the places."""
    return tuple(metric for metric in METRICS if place in metric.places)


def clip_metrics(tracks: Tracks) -> dict[str, float | None]:
    """The metrics of a whole clip for which there are tracks, by key; None where nothing was measured."""
    return {metric.key: metric.of_clip(tracks) for metric in METRICS if (metric.track or metric.key) in tracks}


def clip_limits(metrics: Metrics) -> dict[str, float | None]:
    """The values above which the metrics of a clip are over their limits, by key; None where there is no limit."""
    return {one.key: one.limit.value(one.key, metrics) if one.limit else None for one in METRICS}


def frame_metrics(sides: Mapping[Variant, Tracks], frames: int) -> dict[str, Array]:
    """(frames,) for each metric of each side, by key and suffix; nan where nothing was measured."""
    return {
        metric.key + SUFFIXES[side]: metric.over_time(tracks, frames)
        for metric in METRICS
        for side, tracks in sides.items()
        if metric.of_frames and metric.key in tracks
    }


def as_data(source: str, result: str) -> list[dict[str, Any]]:
    """The metrics as JSON values for a page that calls the two motions by these names."""
    return [
        {
            "key": metric.key,
            "label": metric.label[0].upper() + metric.label[1:],
            "symbol": metric.symbol,
            "explanation": metric.explanation(source, result),
            "missing": metric.missing.format(source=source),
            "judged": metric.judged,
            "supersededBy": metric.superseded_by,
            "comparison": metric.comparison(source, result),
            "whole": metric.reduction == "frames",
            "factor": metric.factor,
            "least": metric.least,
            "places": metric.places,
        }
        for metric in METRICS
    ]
