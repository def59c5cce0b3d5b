"""Measure scenes: how near two performers who touch each other stay on other bodies.

    python benchmarks/duets.py DUETS [--markdown docs/results.md]

DUETS is a folder with takes of two performers in one world, `60_NN.bvh` and `61_NN.bvh`, whose first frame is a T-pose
and left out. Each take is retargeted to three pairs of bodies, alone and as a scene.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
from clips import markdown_option
from edits import TARGETS, edited
from tables import publish, several, table

from distretarget import Motion, SceneResult, read_bvh, retarget, retarget_scene
from distretarget.batch.compile_ahead import warm
from distretarget.measure.scene_gaps import body_part, measure_gap

PAIRS = (("its own", "child"), ("H", "its own"), ("H", "child"))  # bodies of lead and follower
COLUMNS = (
    "take, bodies | frames that touch | gap, % of leg: source / rotation copy / each alone / scene | "
    "gap in the world, scene over source | slide of feet (source, strides as in this world) | "
    "foot height, % of leg | jerk / copy's | turn, degrees | snaps | unsolved | "
    "speed against each alone, processor time"
)


def rows(duets: Path) -> Iterator[Iterator[str]]:
    """A row for each take and pair of bodies."""
    warm("contact")
    for number in sorted(path.stem[3:] for path in duets.glob("60_*.bvh")):
        lead, follower = (read_bvh(duets / f"{who}_{number}.bvh") for who in ("60", "61"))
        frames = slice(1, min(len(lead), len(follower)))
        for names in PAIRS:
            yield measure(number, [lead[frames], follower[frames]], names)


def measure(number: str, motions: list[Motion], names: tuple[str, str]) -> Iterator[str]:
    """The row of a take on two bodies."""
    bodies = [edited(m.rigid_skeleton, TARGETS.get(name, {})) for m, name in zip(motions, names, strict=True)]
    began = time.process_time()
    alone = [retarget(motion, body) for motion, body in zip(motions, bodies, strict=True)]
    middle = time.process_time()
    scene = retarget_scene(motions, bodies)
    seconds = middle - began, time.process_time() - middle
    gap, copy, scale = scene.gaps[0, 1], scene.copy_gaps[0, 1], scene.world_scale
    one, other = (body_part(each.matching, each.source.positions, each.motion.positions) for each in alone)
    apart = measure_gap((0, 1), one, other, float(np.mean([result.root_scale for result in alone])))
    if gap is None or copy is None or apart is None:
        raise click.ClickException(f"nothing touches in the take on {names[0]} and {names[1]}")
    # The slide of the source's feet, in the strides that the world's scale asks of each body.
    strides = [(one.figures["source"]["slide"] or 0.0) * scale / one.root_scale for one in scene.results]
    jerks = [np.divide(*(one.figures[v]["jerk"] or 1.0 for v in ("result", "rotation_copy"))) for one in scene.results]
    yield f"{number}, {names[0]} and {names[1]}"
    yield str(gap.frames)
    yield several([100 * mean for mean in (gap.a, copy.b, apart.b, gap.b)], ".1f")
    yield f"{scale * gap.b / gap.a:.2f}"
    yield f"{_both(scene, 'slide', '.3f')} ({several(strides, '.3f')})"
    yield _both(scene, "foot_height", ".2f")
    yield several(jerks, ".2f")
    for key, form in (("turn", ".1f"), ("snap", ".0f"), ("unsolved", ".0f")):
        yield _both(scene, key, form)
    yield f"{seconds[0] / seconds[1]:.2f}"


def _both(scene: SceneResult, key: str, form: str) -> str:
    return several([one.figures["result"][key] or 0.0 for one in scene.results], form)


@click.command(help=__doc__)
@click.argument("duets", type=Path)
@markdown_option
def main(duets: Path, page: Path | None) -> None:
    """Measure, print, and write the table if a page is given."""
    publish({"duets": table(COLUMNS, rows(duets))}, page)


if __name__ == "__main__":
    main()
