"""`distretarget retarget`: one clip."""

from __future__ import annotations

import json
import time
from pathlib import Path

import click
import numpy as np
from tqdm import tqdm

from distretarget.bvh import read_bvh, write_bvh
from distretarget.errors import FileError
from distretarget.files import check_writable, write_whole
from distretarget.retarget import RetargetResult, retarget
from distretarget.skeleton_json import load_target
from distretarget.spg import Reason


@click.command("retarget")
@click.argument("source", type=click.Path(path_type=Path))
@click.argument("target", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="The BVH file to write.")
@click.option("--overwrite", is_flag=True, help="Replace files that exist. An input is never replaced.")
@click.option(
    "--root-scale",
    type=click.FloatRange(min=0, min_open=True),
    metavar="FACTOR",
    help="Target units per source unit of the root's path. Default: the ratio of leg lengths.",
)
@click.option("--json", "figures", type=click.Path(path_type=Path), help="Write the figures of each frame to this file.")
def retarget_command(
    source: Path, target: Path, output: Path, overwrite: bool, root_scale: float | None, figures: Path | None
) -> None:
    """Carry the motion of SOURCE, a BVH file, over to the body of TARGET.

    TARGET is a skeleton file (.json) or any BVH file with the body wanted.

    \b
    distretarget walk.bvh child.json -o walk_child.bvh
    distretarget walk.bvh hero.bvh -o walk_hero.bvh --json walk_hero.figures.json
    """
    outputs = [path for path in (output, figures) if path]
    _check_outputs(outputs, [source, target], overwrite)
    started = time.perf_counter()
    motion = read_bvh(source)
    goal = load_target(target, motion.rigid_skeleton)
    with tqdm(total=len(motion), unit=" frames", desc=source.name, disable=None, leave=False) as bar:
        result = retarget(
            motion, goal.skeleton, joint_map=goal.map, root_scale=root_scale, progress=bar.update
        )
    write_bvh(output, result.motion, overwrite=overwrite)
    if figures:
        write_whole(figures, json.dumps(_figures(result), indent=1) + "\n", overwrite=overwrite)
    _report_unsolved(result)
    click.echo(_summary(result, time.perf_counter() - started))


def _check_outputs(outputs: list[Path], inputs: list[Path], overwrite: bool) -> None:
    """Refuse, before any work, outputs that cannot be written or are inputs or each other."""
    for number, path in enumerate(outputs):
        for other, what in [*((i, "an input") for i in inputs), *((o, "another output") for o in outputs[:number])]:
            if path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other)):
                raise FileError(path, f"is {what} as well; give the output another name")
        check_writable(path, overwrite=overwrite)


def _report_unsolved(result: RetargetResult) -> None:
    """Say which frames did not converge, and why the solver stopped there."""
    unsolved = result.postures.unsolved
    if len(unsolved):
        reasons = sorted({Reason(int(r)).name.lower().replace("_", " ") for r in result.postures.reasons[unsolved]})
        click.echo(
            f"warning: {len(unsolved)} of {len(result.motion)} frames did not converge "
            f"(first: frame {unsolved[0]}; {', '.join(reasons)})",
            err=True,
        )


def _summary(result: RetargetResult, seconds: float) -> str:
    worst = int(np.argmax(result.written_stress))
    means = (result.copy_stress.mean(), result.free_stress.mean(), result.written_stress.mean())
    copy, free, written = (f"{1e3 * mean:.3g}" for mean in means)
    return (
        f"{len(result.motion)} frames in {seconds:.2f} s; mean stress x 1000: "
        f"rotation copy {copy}, solved points {free}, written {written}; "
        f"worst frame {worst} ({1e3 * result.written_stress[worst]:.3g})"
    )


def _figures(result: RetargetResult) -> dict[str, object]:
    """The figures of the run as JSON: what holds for the clip, then one list per figure, an entry per frame."""
    postures = result.postures
    return {
        "format": "distretarget-figures",
        "version": 1,
        "frame_time": result.motion.frame_time,
        "root_scale": result.root_scale,
        "frames": {
            "stress_rotation_copy": result.copy_stress.tolist(),
            "stress_solved_points": result.free_stress.tolist(),
            "stress_written": result.written_stress.tolist(),
            "iterations": postures.iterations.tolist(),
            "evaluations": postures.evaluations.tolist(),
            "reason": [Reason(int(reason)).name.lower() for reason in postures.reasons],
        },
    }
