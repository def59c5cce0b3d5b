"""The figures of quality: what each is called, what it means, and how it is taken from a clip, shown and limited.

Whatever prints, writes or draws figures takes them from `FIGURES`. To add one, add its entry there and its track to
`metrics.Comparison`, or to `RetargetResult.tracks` if it takes more than source and result, and run
`tools/make_figures.py` and `tools/make_reference.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Variant = Literal["source", "rotation_copy", "result"]

# What follows a key where the figures of several motions stand in one list.
SUFFIXES: dict[Variant, str] = {"source": "_source", "rotation_copy": "_copy", "result": ""}


@dataclass(frozen=True, eq=False)
class Track:
    """What was measured over the frames of a clip.

    Attributes:
        values: (frames,) or (frames, parts); fewer rows where a value takes several frames, as a speed does.
        counts: like values: how many measurements each value is the sum of, 0 where nothing was to be measured; None
            where each value is one measurement.
        parts: what the columns of values are of, such as joints; empty if that has no name.
    """

    values: Array
    counts: NDArray[np.intp] | NDArray[np.bool_] | None = None
    parts: tuple[str, ...] = ()

    @property
    def weights(self) -> NDArray[np.intp]:
        """Like values: how many measurements each value is the sum of."""
        if self.counts is None:
            return np.ones(self.values.shape, np.intp)
        return self.counts.astype(np.intp)


Tracks = Mapping[str, Track]  # by the key of what was measured
NOT_RUN: Tracks = {key: Track(np.zeros(0)) for key in ("snap", "unsolved")}  # of a motion that was not solved here
Figures = Mapping[
    Variant, Mapping[str, float | None]
]  # of whole clips, by side and key; None where nothing was measured


@dataclass(frozen=True, kw_only=True)
class Limit:
    """The value above which a figure of a result needs a look: `factor` times that of another motion, plus `margin`.

    Attributes:
        margin: in the unit of the figure.
        factor: times the figure of `of`; 0 where the limit is the margin alone.
        of: the other motion.
        reason: what a value above the limit means.
        cause: what such a value most likely comes from.
    """

    margin: float
    factor: float = 0.0
    of: Literal["source", "rotation_copy"] = "source"
    reason: str
    cause: str

    def value(self, key: str, figures: Figures) -> float | None:
        """The limit of the figure with this key; None where the other motion has no such figure."""
        if not self.factor:
            return self.margin
        other = figures.get(self.of, {}).get(key)
        return None if other is None else self.factor * other + self.margin

    def formula(self, unit: str) -> str:
        """The limit in words, with the unit of the figure."""
        margin = f"{self.margin:g} {unit}".rstrip()
        if not self.factor:
            return margin
        other = f"the {self.of.replace('_', ' ')}'s"
        other = other if self.factor == 1 else f"{self.factor:g} times {other}"
        return f"{other} + {margin}" if self.margin else other


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One figure of quality. Texts name the two motions `{source}` and `{result}`; documents put names in.

    Attributes:
        key: its name in JSON, CSV and `--fail-over`, and that of its track.
        label: its name in prose.
        unit: of the number in files and limits; empty for a plain number.
        meaning: what it measures.
        missing: why a clip may have no value; empty if every clip has one.
        track: the key of the track, if it is that of another figure.
        reduction: what of the track's values is the figure: their mean, the largest (at least 0), the one that a
            hundredth of them exceed, or the number of frames in which any is above 0.
        judged: what is good, and what `--fail-over` is for: the value itself, 0 being best; or, where the source has a
            value too, the result's over the source's.
        still: where the ratio is judged, source values up to this count as nothing, and as this in `--fail-over`.
        limit: above which a run needs a look; None if the figure has no such limit.
        rivals_copy: whether a run says so if it is worse than the rotation copy by more than `least`; false where the
            rotation copy is best by definition.
        factor, symbol: pages and the line of a run show the number times `factor`, in the unit `symbol`.
        decimals: of the number in the line of a run.
        least: values up to this are too small to look at.
        places: where the figure stands besides the lists of all figures: in the line of a run, among the first figures
            of a report, as a curve over time in a report, with pictures of its worst frames in a report, as a column of
            the page over clips, as a list of the worst frames of a diff and the worst clips of a batch.
    """

    key: str
    label: str
    meaning: str
    unit: str = ""
    missing: str = ""
    track: str = ""
    reduction: Literal["mean", "largest", "percentile 99", "frames"] = "mean"
    judged: Literal["value", "ratio"] = "value"
    still: float = 0.0
    limit: Limit | None = None
    rivals_copy: bool = False
    factor: float = 1.0
    symbol: str = ""
    decimals: int = 2
    least: float = 0.0
    places: tuple[Literal["line", "card", "curve", "worst frames", "page over clips", "worst clips"], ...] = ()

    @property
    def of_source(self) -> bool:
        """Whether the source has a value of its own."""
        return self.judged != "value"

    @property
    def of_frames(self) -> bool:
        """Whether each frame has a value of its own, not that of another figure's track."""
        return not self.track

    def of_clip(self, tracks: Tracks) -> float | None:
        """The figure of the whole clip; None where nothing was to be measured."""
        track = tracks[self.track or self.key]
        weights = track.weights
        measured = weights > 0
        values = track.values[measured]
        if not values.size:
            return None
        if self.reduction == "frames":
            return float((np.where(measured, track.values, 0.0).reshape(len(measured), -1) > 0).any(axis=1).sum())
        if self.reduction == "largest":
            return float(values.max(initial=0.0))
        if self.reduction == "percentile 99":
            return float(np.percentile(values, 99))
        return float(values.sum() / weights[measured].sum())

    def over_time(self, tracks: Tracks, frames: int) -> Array:
        """(frames,), the figure of each frame; nan where nothing was to be measured, as in rows that are missing."""
        track = tracks[self.track or self.key]
        values, weights = (a if a.ndim == 2 else a[:, None] for a in (track.values, track.weights))
        column = np.full(frames, np.nan)
        if self.reduction in ("largest", "frames"):
            reduced = np.where(weights > 0, values, 0.0).max(axis=1, initial=0.0)
            reduced = (reduced > 0).astype(np.float64) if self.reduction == "frames" else reduced
        else:
            reduced = np.where(weights > 0, values, 0.0).sum(axis=1) / np.maximum(weights.sum(axis=1), 1)
        column[: len(values)] = np.where(weights.any(axis=1), reduced, np.nan)
        return column

    def worst(self, tracks: Tracks) -> tuple[int, str]:
        """The frame of the largest value, and what it is of; empty if that has no name.

        Raises:
            ValueError: nothing was measured.
        """
        track = tracks[self.track or self.key]
        values = np.where(track.weights > 0, track.values, -np.inf)
        frame, *part = np.unravel_index(values.argmax(), values.shape)
        return int(frame), track.parts[part[0]] if part and track.parts else ""

    def judgement(self, value: float | None, source: float | None) -> float | None:
        """What `--fail-over` is for, of the result's value and the source's; None where nothing was to be measured."""
        if self.judged == "value" or value is None:
            return value
        if source is None:
            return None
        least = max(source, self.still)
        return value / least if least > 0 else None

    def explanation(self, source: str, result: str) -> str:
        """What it measures and in which unit, and what is best, in two sentences with the names of the motions."""
        meaning = self.meaning.format(source=source, result=result)
        unit = f" [{self.unit}]" if self.unit else ""
        best = f"As in {source} is best" if self.of_source else "0 is best"
        return f"{meaning[0].upper()}{meaning[1:]}{unit}. {best}."

    def comparison(self, source: str, result: str) -> str:
        """What `--fail-over` is for, as a formula of the names of the motions; empty where that is the value itself."""
        return f"{result} / {source}" if self.judged == "ratio" else ""

    def needs_look(self, figures: Figures) -> bool:
        """Whether the result's value is above the limit; false where either is missing."""
        value = figures["result"].get(self.key)
        limit = self.limit.value(self.key, figures) if self.limit else None
        return value is not None and limit is not None and value > limit

    def worse_than_copy(self, figures: Figures) -> bool:
        """Whether the result is clearly worse than the rotation copy where it should not be; false where either value
        is missing.
        """
        value, copy = (figures.get(side, {}).get(self.key) for side in ("result", "rotation_copy"))
        return self.rivals_copy and value is not None and copy is not None and value > copy + self.least

    def brief(self, value: float | None) -> str:
        """The number as the line of a run has it."""
        return "-" if value is None else f"{self.factor * value:.{self.decimals}f}"


FIGURES = (  # the most telling first
    Figure(
        key="contact_error",
        label="contact error",
        meaning="how far the distances of regions of the body that touch in {source} are off, over the length of the "
        "bones between",
        missing="no contacts in {source}",
        limit=Limit(
            margin=0.002,
            factor=1.0,
            of="rotation_copy",
            reason="contacts are kept worse than by copied rotations",
            cause="the limbs cannot reach, or contacts contradict each other",
        ),
        rivals_copy=True,
        decimals=4,
        least=0.002,
        places=("line", "card", "curve", "worst frames", "page over clips", "worst clips"),
    ),
    Figure(
        key="direction_error",
        label="direction error",
        unit="degrees",
        meaning="mean angle between the bones of {result} and where {source} points them on that body",
        missing="no bones in common",
        symbol="°",
        decimals=1,
        least=0.2,
        places=("line", "card", "curve", "worst frames", "page over clips", "worst clips"),
    ),
    Figure(
        key="direction_error_p99",
        label="direction p99",
        unit="degrees",
        meaning="angle between the bones of {result} and where {source} points them that 1 in 100 exceeds",
        missing="no bones in common",
        track="direction_error",
        reduction="percentile 99",
        symbol="°",
        decimals=1,
        least=0.2,
    ),
    Figure(
        key="slide",
        label="slide",
        unit="leg lengths/s",
        meaning="horizontal speed of ankles and toes while they rest in {source}",
        missing="no feet at rest in {source}",
        judged="ratio",
        still=1e-3,  # [leg lengths/s]; what is left are rounding errors of the file
        limit=Limit(
            margin=0.01,
            factor=1.05,
            reason="feet slide more than in the source",
            cause="the legs cannot reach the place where the foot rests",
        ),
        rivals_copy=True,
        symbol="legs/s",
        decimals=3,
        least=0.01,
        places=("line", "card", "curve", "worst frames", "page over clips"),
    ),
    Figure(
        key="foot_height",
        label="foot height",
        unit="% of leg length",
        meaning="how far the height of a resting foot's sole is off that in {source}, scaled by leg length",
        missing="no feet at rest in {source}",
        limit=Limit(
            margin=1.0,
            reason="feet float over the floor or sink into it",
            cause="the legs cannot reach the floor, or the rest pose of the feet is not how they stand",
        ),
        rivals_copy=True,
        symbol="% leg",
        least=0.1,
        places=("card", "curve", "worst frames"),
    ),
    Figure(
        key="foot_pitch",
        label="foot pitch",
        unit="degrees",
        meaning="how far the pitch of a resting foot from its flat sole is off that in {source}",
        missing="no flat soles at rest in {source}",
        limit=Limit(
            margin=5.0,
            reason="feet are visibly tilted",
            cause="the rest pose of the feet is not how they stand, or the ankles cannot turn",
        ),
        rivals_copy=True,
        symbol="°",
        decimals=1,
        least=2.0,
        places=("card", "curve", "worst frames", "page over clips"),
    ),
    Figure(
        key="ankle_height",
        label="ankle height",
        unit="% of leg length",
        meaning="how far the height of an ankle over the floor is off that of a flat foot of {result}, while the foot "
        "rests flat in {source}",
        missing="no feet that rest flat in {source}",
        limit=Limit(
            margin=3.0,
            reason="feet lie flat or stand on tiptoe as those of another body",
            cause="the rest pose of the feet is not how they stand, or End Sites of the feet are missing",
        ),
        rivals_copy=True,
        symbol="% leg",
        least=1.0,
        places=("card",),
    ),
    Figure(
        key="hips_height",
        label="hips height",
        unit="% of leg length",
        meaning="how far the height of the hips over a resting ankle is off that in {source}, scaled by leg length",
        missing="no feet at rest in {source}",
        rivals_copy=True,
        symbol="% leg",
        decimals=1,
        least=1.0,
        places=("line", "curve", "worst frames", "page over clips", "worst clips"),
    ),
    Figure(
        key="hips_height_largest",
        label="largest hips height",
        unit="% of leg length",
        meaning="how far the height of the hips over a resting ankle is at most off that in {source}, scaled by leg "
        "length",
        missing="no feet at rest in {source}",
        track="hips_height",
        reduction="largest",
        limit=Limit(
            margin=3.0,
            reason="the body crouches or stretches",
            cause="the legs cannot reach, or the ankles cannot turn",
        ),
        symbol="% leg",
        decimals=1,
        least=1.0,
        places=("card",),
    ),
    Figure(
        key="support_slide",
        label="slide of other supports",
        unit="leg lengths/s",
        meaning="horizontal speed of hands, knees and all other joints but the feet's while they rest on the world in "
        "{source}",
        missing="nothing but feet rests in {source}",
        judged="ratio",
        still=1e-3,  # [leg lengths/s]; what is left are rounding errors of the file
        limit=Limit(
            margin=0.02,
            factor=1.1,
            reason="hands, knees or other resting joints slide more than in the source",
            cause="the body cannot reach all places where it rests",
        ),
        rivals_copy=True,
        symbol="legs/s",
        decimals=3,
        least=0.02,
        places=("curve", "worst frames"),
    ),
    Figure(
        key="support_height",
        label="height of other supports",
        unit="% of leg length",
        meaning="how far the height of a joint other than a foot's that rests on the floor is off that in {source}, "
        "scaled by leg length",
        missing="nothing but feet rests on the floor in {source}",
        limit=Limit(
            margin=1.0,
            reason="hands, knees or other resting joints float over the floor or sink into it",
            cause="the body cannot reach all places where it rests",
        ),
        rivals_copy=True,
        symbol="% leg",
        least=0.3,
        places=("curve", "worst frames"),
    ),
    Figure(
        key="snap",
        label="snaps",
        meaning="in how many frames a joint of {result} moves more than 4 % of a leg in 1/60 s while in the rotation "
        "copy it moves less than 1.5 %",
        missing="no rotation copy, or only one frame",
        reduction="frames",
        limit=Limit(
            margin=0.0,
            reason="a joint jumps that does not in copied rotations",
            cause="a contact or the stance of a foot begins too suddenly, or a limb flips over",
        ),
        decimals=0,
        places=("card", "page over clips"),
    ),
    Figure(
        key="unsolved",
        label="unsolved",
        meaning="how many frames of {result} did not converge",
        missing="not solved here",
        reduction="frames",
        limit=Limit(
            margin=0.0,
            reason="the posture is not the best there is",
            cause="contacts contradict each other, or bone lengths are out of proportion",
        ),
        decimals=0,
        places=("card",),
    ),
    Figure(
        key="stress",
        label="stress",
        meaning="how far the distances of all joints are off, squared, over the squared height of {result} (Eq. 2)",
        factor=1000.0,
        symbol="\N{MULTIPLICATION SIGN} 1000",
        least=1e-4,
        places=("line", "curve", "worst frames", "worst clips"),
    ),
    Figure(
        key="distance_error",
        label="distance error",
        meaning="how far the distances of all joints are off, over the length of the bones between",
        decimals=4,
        least=0.002,
    ),
    Figure(
        key="jerk",
        label="jerk",
        unit="body sizes/s³",
        meaning="roughness: how fast the acceleration of the joints changes",
        missing="under four frames",
        judged="ratio",
        limit=Limit(
            margin=0.0,
            factor=1.5,
            of="rotation_copy",
            reason="the motion shakes or twitches",
            cause="contacts or stances of the feet begin and end too often",
        ),
        symbol="sizes/s³",
        decimals=1,
        least=0.1,
        places=("line", "card", "curve", "page over clips"),
    ),
    Figure(
        key="turn",
        label="turn",
        unit="degrees in 1/60 s",
        meaning="largest angle by which a joint of {result} turns further from one frame to the next than in {source}",
        missing="only one frame",
        reduction="largest",
        limit=Limit(
            margin=12.0,
            reason="a joint pops",
            cause="a contact or the stance of a foot begins too suddenly, or a limb flips over",
        ),
        symbol="°",
        decimals=1,
        least=0.2,
        places=("card",),
    ),
    Figure(
        key="bone_error",
        label="bone error",
        meaning="largest change of a bone's length in {result}, relative to the length in its skeleton",
        reduction="largest",
        factor=100.0,
        symbol="%",
        least=1e-4,
        places=("curve", "worst frames"),
    ),
)
BY_KEY = {figure.key: figure for figure in FIGURES}


def figures_at(place: str) -> tuple[Figure, ...]:
    """The figures that stand in one of the places."""
    return tuple(figure for figure in FIGURES if place in figure.places)


def clip_figures(tracks: Tracks) -> dict[str, float | None]:
    """The figures of a whole clip that the tracks are there for, by key; None where nothing was to be measured."""
    return {figure.key: figure.of_clip(tracks) for figure in FIGURES if (figure.track or figure.key) in tracks}


def clip_limits(figures: Figures) -> dict[str, float | None]:
    """The values above which the figures of a clip need a look, by key; None where there is no limit."""
    return {one.key: one.limit.value(one.key, figures) if one.limit else None for one in FIGURES}


def frame_figures(sides: Mapping[Variant, Tracks], frames: int) -> dict[str, Array]:
    """(frames,) for each figure of each side, by key and suffix; nan where nothing was to be measured."""
    return {
        figure.key + SUFFIXES[side]: figure.over_time(tracks, frames)
        for figure in FIGURES
        for side, tracks in sides.items()
        if figure.of_frames and figure.key in tracks
    }


def as_data(source: str, result: str) -> list[dict[str, Any]]:
    """The figures as JSON values for a page that calls the two motions by these names."""
    return [
        {
            "key": figure.key,
            "label": figure.label[0].upper() + figure.label[1:],
            "symbol": figure.symbol,
            "explanation": figure.explanation(source, result),
            "missing": figure.missing.format(source=source),
            "judged": figure.judged,
            "comparison": figure.comparison(source, result),
            "whole": figure.reduction == "frames",
            "factor": figure.factor,
            "least": figure.least,
            "places": figure.places,
        }
        for figure in FIGURES
    ]
