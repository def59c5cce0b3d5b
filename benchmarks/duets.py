"""Measure scenes: the gaps between two performers in contact, on other bodies.

    python benchmarks/duets.py DUETS [--markdown docs/results.md]

DUETS is a folder with takes of two performers in one world, `60_NN.bvh` and `61_NN.bvh`, whose first frame is a T-pose
and left out. Each take is retargeted to three pairs of bodies, each performer alone and both as a scene.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
from clips import TARGETS, edited, markdown_option
from tables import publish, several, table

from distretarget import Motion, read_bvh, retarget, retarget_scene
from distretarget.measure.gaps import body_part, measure_gap

PAIRS = (("its own", "child"), ("H", "its own"), ("H", "child"))  # bodies of lead and follower
COLUMNS = (
    "take, bodies | gap, % of leg: source / rotation copy / each alone / scene | "
    "gap in units of the world, scene / source | foot skate over the source's, strides as in this world | "
    "foot height, % of leg, larger | direction p99, degrees | jerk / copy's | turn, degrees | "
    "worst 1 % of gaps, % of leg: each alone / scene | largest hips height, % of leg: each alone / scene | "
    "speed against each alone, processor time"
)


def takes(duets: Path) -> Iterator[tuple[str, list[Motion]]]:
    """The number of each take, and the motions of its performers."""
    for number in sorted(path.stem[3:] for path in duets.glob("60_*.bvh")):
        lead, follower = (read_bvh(duets / f"{who}_{number}.bvh") for who in ("60", "61"))
        frames = slice(1, min(len(lead), len(follower)))
        yield number, [lead[frames], follower[frames]]


def cells(number: str, motions: list[Motion], names: tuple[str, str]) -> Iterator[str]:
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

    # The slide of the source's feet, for the strides of each body at the world's scale.
    strides = [(one.metrics["source"]["foot_skate"] or 0.0) * scale / one.root_scale for one in scene.results]
    jerks = [np.divide(*(one.metrics[v]["jerk"] or 1.0 for v in ("result", "rotation_copy"))) for one in scene.results]
    yield f"{number}, {names[0]} and {names[1]}"
    yield several([100 * mean for mean in (gap.a, copy.b, apart.b, gap.b)], ".1f")
    yield f"{scale * gap.b / gap.a:.2f}"
    skates = [one.metrics["result"]["foot_skate"] or 0.0 for one in scene.results]
    yield several(np.divide(skates, strides), ".2f")
    yield f"{max(one.metrics['result']['foot_height'] or 0.0 for one in scene.results):.2f}"
    yield several([one.metrics["result"]["direction_error_p99"] or 0.0 for one in scene.results], ".1f")
    yield several(jerks, ".2f")
    yield several([one.metrics["result"]["turn"] or 0.0 for one in scene.results], ".1f")
    yield several([100 * each.worst for each in (apart, gap)], ".1f")
    hips = [[one.metrics["result"]["hips_height_largest"] or 0.0 for one in many] for many in (alone, scene.results)]
    yield several(map(max, hips), ".1f")
    yield f"{seconds[0] / seconds[1]:.2f}"


@click.command(help=__doc__)
@click.argument("duets", type=Path)
@markdown_option
def main(duets: Path, page: Path | None) -> None:
    """Measure, print, and write the table if a page is given."""
    rows = (cells(number, motions, names) for number, motions in takes(duets) for names in PAIRS)
    publish({"duets": table(COLUMNS, rows)}, page)


if __name__ == "__main__":
    main()
