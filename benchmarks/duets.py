"""Measure scenes: how near two performers stay who touch each other, on other bodies.

    python benchmarks/duets.py DUETS [--markdown docs/results.md]

DUETS is a folder with takes of two performers in one world, `60_NN.bvh` and `61_NN.bvh`, whose first frame is a T-pose
and left out. Each take is retargeted to three pairs of bodies, alone and as a scene, one after the other.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from edits import TARGETS, edited
from tables import insert

from distretarget import Motion, RetargetResult, SceneResult, read_bvh, retarget, retarget_scene
from distretarget.batch.compile_ahead import warm
from distretarget.measure.scene_gaps import body_part, measure_gap

PAIRS = (("its own", "child"), ("H", "its own"), ("H", "child"))  # bodies of lead and follower


def take(duets: Path, number: str) -> tuple[Motion, Motion]:
    """Both performers of a take, without the first frame, cut to the same frames."""
    lead, follower = (read_bvh(duets / f"{who}_{number}.bvh") for who in ("60", "61"))
    frames = slice(1, min(len(lead), len(follower)))
    return lead[frames], follower[frames]


def rows(duets: Path) -> Iterator[str]:
    """A row for each take and pair of bodies."""
    warm("contact")
    for number in sorted(path.stem[3:] for path in duets.glob("60_*.bvh")):
        motions = take(duets, number)
        for names in PAIRS:
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
                raise SystemExit(f"nothing touches in take {number}")
            gaps = [100 * mean for mean in (gap.a, copy.b, apart.b, gap.b)]
            yield (
                f"| {number}, {names[0]} and {names[1]} | {gap.frames} | "
                f"{' / '.join(f'{mean:.1f}' for mean in gaps)} | {scale * gap.b / gap.a:.2f} | "
                f"{_both(scene.results, 'slide', 3)} ({_strides(scene)}) | "
                f"{_both(scene.results, 'foot_height', 2)} | {_jerks(scene.results)} | "
                f"{_both(scene.results, 'turn', 1)} | {_both(scene.results, 'snap', 0)} | "
                f"{_both(scene.results, 'unsolved', 0)} | "
                f"{seconds[0] / seconds[1]:.2f} |"
            )


def _both(results: tuple[RetargetResult, ...], key: str, decimals: int) -> str:
    return " / ".join(f"{result.figures['result'][key] or 0.0:.{decimals}f}" for result in results)


def _strides(scene: SceneResult) -> str:
    """The slide of the source's feet, in the strides that the world's scale asks of each body."""
    return " / ".join(
        f"{(one.figures['source']['slide'] or 0.0) * scene.world_scale / one.root_scale:.3f}" for one in scene.results
    )


def _jerks(results: tuple[RetargetResult, ...]) -> str:
    jerks = [[result.figures[side]["jerk"] or 1.0 for side in ("result", "rotation_copy")] for result in results]
    return " / ".join(f"{now / copy:.2f}" for now, copy in jerks)


def main() -> None:
    """Measure, print, and write the table where the command line says so."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("duets", type=Path, metavar="DUETS")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="write the table into this page")
    arguments = parser.parse_args()
    columns = [
        "take, bodies",
        "frames that touch",
        "gap, % of leg: source / rotation copy / each alone / scene",
        "gap in the world, scene over source",
        "slide of feet (source, strides as in this world)",
        "foot height, % of leg",
        "jerk / copy's",
        "turn, degrees",
        "snaps",
        "unsolved",
        "speed against each alone, processor time",
    ]
    table = f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|\n" + "".join(
        f"{row}\n" for row in rows(arguments.duets)
    )
    print(table)
    if arguments.markdown:
        insert(arguments.markdown, {"duets": table})


if __name__ == "__main__":
    main()
