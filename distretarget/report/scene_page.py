"""The report on a scene that was retargeted: source and result, and the gaps between what touches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from distretarget.report.together import ShownBody, Stage, Table, together_page
from distretarget.scene.retargeting import SceneResult

NO_GAP = "\u2013"  # where nothing touches


def scene_page(result: SceneResult, names: Sequence[str]) -> str:
    """The HTML of the report on a scene; `names` are those of performers and props."""
    first = result.results[0]
    stage = Stage(
        sides=("Source", "Result"),
        up=first.world.up_vector,
        leg=first.matching.leg_lengths[0] or first.matching.source.unit / 2.0,
        scale=result.world_scale,
    )
    gaps: Table = {
        "title": "What touches: mean gap, % of a leg, in the source\u2019s world",
        "columns": ["between", "frames", "source", "copied rotations", "result"],
        "rows": list(_gaps(result, names)),
    }
    return together_page(" and ".join(names), list(_bodies(result, names)), stage, [gaps])


def _bodies(result: SceneResult, names: Sequence[str]) -> Iterator[ShownBody]:
    for name, one in zip(names, result.results, strict=False):
        joints = one.matching.body_joints
        yield ShownBody(name=name, left=one.source, right=one.motion, joints=(one.drivers[joints], joints))
    for name, prop in zip(names[len(result.results) :], result.props, strict=True):
        joints = np.arange(len(prop.motion.skeleton))
        yield ShownBody(name=name, left=prop.source, right=prop.motion, joints=(joints, joints), prop=True)


def _gaps(result: SceneResult, names: Sequence[str]) -> Iterator[list[str | int]]:
    """The rows of the table of gaps."""
    for (i, j), gap in result.gaps.items():
        copy = result.copy_gaps[i, j]
        numbers = [f"{100 * mean:.1f}" for mean in (gap.a, copy.b, gap.b)] if gap and copy else [NO_GAP] * 3
        yield [f"{names[i]} and {names[j]}", str(gap.frames if gap else 0), *numbers]
