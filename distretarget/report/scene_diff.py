"""The diff of two scenes as one document, to be written as JSON or, frame by frame, as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Literal, TypedDict

from distretarget.measure.scene_gaps import Gap, SceneDiff
from distretarget.report.document import DECIMALS, About
from distretarget.report.document_types import DiffDocument, DiffLimit, Program

GAP_ERROR = "gap_error"  # the figure of a whole scene


class DiffGaps(TypedDict):
    """The gaps between two parts of a scene that touch in A [% of leg length].

    Attributes:
        between: the names of the two performers, or of a performer and a prop.
        regions: the region of the body of each; empty for a prop.
        joints: the joints of A between which a gap is furthest off ...
        worst_frame: ... and the frame in which it is.
        frames: in how many frames they touch.
        gap_a, gap_b: the mean gap in A and in B.
        gap_error: how far a gap in B is off that in A, on average.
    """

    between: list[str]
    regions: list[str]
    joints: list[str]
    worst_frame: int
    frames: int
    gap_a: float
    gap_b: float
    gap_error: float


class SceneDiffDocument(TypedDict):
    """The numbers of a diff of two scenes.

    Attributes:
        format, version: the name and the version of this format.
        a, b: the names of the files or folders of the scenes.
        program: what made the document.
        world_scale: units of B per unit of A along the floor.
        gap_a, gap_b, gap_error: as in `DiffGaps`, of all that touches; None where nothing does [% of leg length].
        limits: those of `gap_error`, in the order given; those of other figures stand with the performers.
        performers: the diff of each performer, by name.
        props: the names of the props.
        gaps: between what touches in A, those that touch longest first.
    """

    format: Literal["distretarget-scene-diff"]
    version: Literal[1]
    a: str
    b: str
    program: Program
    world_scale: float
    gap_a: float | None
    gap_b: float | None
    gap_error: float | None
    limits: list[DiffLimit]
    performers: dict[str, DiffDocument]
    props: list[str]
    gaps: list[DiffGaps]


def scene_document(
    diff: SceneDiff, performers: Mapping[str, DiffDocument], props: Sequence[str], about: About
) -> SceneDiffDocument:
    """The diff of two scenes as JSON values that follow `scene_diff.schema.json`.

    `performers` are the documents of the performers by name, `props` the names of the props; `about` has the limits
    of `GAP_ERROR`.
    """
    gap_a, gap_b, error = (None if gap is None else _percent(gap) for gap in diff.mean_gaps or (None, None, None))
    names = [*performers, *props]
    return {
        "format": "distretarget-scene-diff",
        "version": 1,
        "a": about.a,
        "b": about.b,
        "program": {"version": about.version, "command": about.command},
        "world_scale": diff.world_scale,
        "gap_a": gap_a,
        "gap_b": gap_b,
        "gap_error": error,
        "limits": [
            {"figure": key, "limit": limit, "value": error, "over": error is not None and error > limit}
            for key, limit in about.limits
        ],
        "performers": dict(performers),
        "props": list(props),
        "gaps": [_gaps(gaps, names) for gaps in diff.gaps],
    }


def scene_csv(document: SceneDiffDocument) -> str:
    """The frames of all performers as CSV: a row of keys, then a row per performer and frame; None is an empty cell."""
    rows = [{"performer": name, **frame} for name, one in document["performers"].items() for frame in one["frames"]]
    text = io.StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue()


def part(between: Sequence[str], regions: Sequence[str]) -> str:
    """What touches, in words: "lead's left hand - chair"."""
    return " - ".join(f"{name}'s {region}" if region else name for name, region in zip(between, regions, strict=True))


def _gaps(gaps: Gap, names: Sequence[str]) -> DiffGaps:
    return {
        "between": [names[number] for number in gaps.between],
        "regions": list(gaps.regions),
        "joints": list(gaps.joints),
        "worst_frame": gaps.worst_frame,
        "frames": gaps.frames,
        "gap_a": _percent(gaps.a),
        "gap_b": _percent(gaps.b),
        "gap_error": _percent(gaps.error),
    }


def _percent(gap: float) -> float:
    return round(100.0 * gap, DECIMALS) + 0.0
