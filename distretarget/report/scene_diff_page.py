"""The report on the diff of two scenes: both in one player, the gaps between what touches, the performers' figures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from distretarget.measure.figures import FIGURES
from distretarget.measure.scene_gaps import SceneDiff
from distretarget.report.scene_diff import SceneDiffDocument, part
from distretarget.report.together import ShownBody, Stage, Table, together_page


def scene_diff_page(diff: SceneDiff, document: SceneDiffDocument) -> str:
    """The HTML of the report on the diff of two scenes."""
    first = diff.performers[0]
    stage = Stage(
        sides=(f"A: {document['a']}", f"B: {document['b']}"),
        up=first.up,
        leg=first.matching.leg_lengths[0] or first.matching.source.unit / 2.0,
        scale=diff.world_scale,
    )
    title = f"{document['b']} against {document['a']}"
    return together_page(title, list(_bodies(diff, document)), stage, [gap_table(document), figure_table(document)])


def _bodies(diff: SceneDiff, document: SceneDiffDocument) -> Iterator[ShownBody]:
    for name, one in zip(document["performers"], diff.performers, strict=True):
        joints = one.matching.body_joints
        shown = one.a[: len(diff)], one.b[: len(diff)]
        yield ShownBody(name=name, left=shown[0], right=shown[1], joints=(one.matching.drivers[joints], joints))
    for name, (a, b) in zip(document["props"], diff.props, strict=True):
        joints = np.arange(len(a.skeleton))
        yield ShownBody(name=name, left=a, right=b, joints=(joints, joints), prop=True)


def gap_table(document: SceneDiffDocument) -> Table:
    """The gaps between regions that touch in A, those that touch longest first."""
    rows: list[list[str | int]] = [
        [
            part(gaps["between"], gaps["regions"]),
            str(gaps["frames"]),
            *(f"{gaps[key]:.1f}" for key in ("gap_a", "gap_b", "gap_error")),
            gaps["worst_frame"],
        ]
        for gaps in document["gaps"]
    ]
    return {
        "title": "What touches in A: mean gap, % of a leg, in the scale of A\u2019s world",
        "columns": ["between", "frames", "A", "B", "B off A", "worst frame"],
        "rows": rows,
    }


def figure_table(document: SceneDiffDocument) -> Table:
    """The figures of all performers: of B, and of A where it has one."""
    columns, rows = (
        ["figure"],
        [[f"{figure.label} [{figure.unit}]" if figure.unit else figure.label] for figure in FIGURES],
    )
    for name, one in document["performers"].items():
        columns += [f"{name} A", f"{name} B"]
        for figure, row in zip(FIGURES, rows, strict=True):
            values = one["figures"]["source"].get(figure.key), one["figures"]["result"][figure.key]
            row += ["" if value is None else f"{value:.4g}" for value in values]
    return {"title": "Figures of each performer", "columns": columns, "rows": [[*row] for row in rows]}
