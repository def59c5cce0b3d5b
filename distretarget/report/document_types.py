"""The types of the document of a diff, key by key; `diff.schema.json` describes the same for other languages.

Joints are named by their keys (`Skeleton.keys`). What has the keys of the figures of quality is a mapping, since
`measure.figures.FIGURES` alone lists these with their units.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, TypedDict

FigureValues = Mapping[str, float | None]
"""Figures of quality by key; None where nothing was to be measured."""


class DiffBody(TypedDict):
    """One of the two motions.

    Attributes:
        file: the name of its file.
        joints: the number of its joints, without End Sites.
        convention: the convention of the joints' names; empty if none is recognised.
    """

    file: str
    joints: int
    convention: str


class Program(TypedDict):
    """What made the document.

    Attributes:
        version: the version of this package.
        command: the command line; empty if there was none.
    """

    version: str
    command: str


class DiffFigures(TypedDict):
    """The figures of the whole clip.

    Attributes:
        source: those of A: only figures that a motion has by itself.
        rotation_copy: those of the rotation copy; None unless B was made from A.
        result: those of B.
        needs_look_above: the values of B above which a run needs a look; None where there is no limit, or where it
            depends on a figure that is missing.
    """

    source: FigureValues
    rotation_copy: FigureValues | None
    result: FigureValues
    needs_look_above: FigureValues


class DiffLimit(TypedDict):
    """A limit of a figure, as given to `--fail-over`.

    Attributes:
        figure: the key of the figure.
        limit: the largest value allowed.
        value: the number that the limit is for; None where nothing was to be measured.
        over: whether the value is over the limit; None is not.
    """

    figure: str
    limit: float
    value: float | None
    over: bool


class DiffContact(TypedDict):
    """What became of the contacts between two regions of the body. D is the distance of the nearest two joints in A,
    over the length of the bones between them.

    Attributes:
        regions: the two regions, such as "left hand - right hand".
        joints_a, joints_b: the two joints that are nearest in A in the worst frame, in A and in B.
        frames: the number of frames in which the regions touch in A.
        distance_a, distance_b: mean D in these frames.
        error: mean |D_a - D_b| in these frames.
        worst_frame: the frame of these with the largest |D_a - D_b|.
    """

    regions: str
    joints_a: list[str]
    joints_b: list[str]
    frames: int
    distance_a: float
    distance_b: float
    error: float
    worst_frame: int


class DiffDocument(TypedDict):
    """The numbers of a diff: motion B measured against motion A, the reference.

    Attributes:
        format, version: the name and the version of this format.
        a, b: the two motions.
        program: what made the document.
        verdict: what was kept and what changed, in a plain sentence; empty unless B was made from A.
        warnings: what needs a look, a line each; none unless B was made from A.
        notes: what was done to compare the two motions: resampled, cut, turned.
        frame_time: the time between frames [s].
        frame_count: the number of frames compared.
        unmatched_b: the joints of B without a counterpart in A.
        unmatched_a: the joints of A without a counterpart in B.
        contact_frames: the number of frames in which regions of the body touch in A.
        figures: the figures of the whole clip.
        limits: the limits to stay at or below, in the order given.
        worst: by key, the frame in which the figure of B is largest; None where no frame has a value.
        frames: for each frame its number `frame`, its `time` [s], the numbers of contacts (`contacts`), of foot joints
            at rest (`stance`) and of other joints at rest (`supports`) in A, and the figures of the frame by key, those
            of A with `_source` after it.
        contacts: the regions of the body that touch in A, those of the hands first.
    """

    format: Literal["distretarget-diff"]
    version: Literal[1]
    a: DiffBody
    b: DiffBody
    program: Program
    verdict: str
    warnings: list[str]
    notes: list[str]
    frame_time: float
    frame_count: int
    unmatched_b: list[str]
    unmatched_a: list[str]
    contact_frames: int
    figures: DiffFigures
    limits: list[DiffLimit]
    worst: dict[str, int | None]
    frames: list[FigureValues]
    contacts: list[DiffContact]
