"""Measure what the eye sees, with metrics that the method does not use: gravity, headings, known answers, equal inputs.

    python benchmarks/eye.py CORPUS [DUETS] [--frames N] [--markdown FILE]

CORPUS is a folder with the real clips named in `clips.CLIPS`, and with the same motions in `cmu_mb` and `cmu_daz`;
DUETS one with takes of two performers, as in `duets.py`. What is missing is left out. The lines are about:

- all runs: clips on the bodies of `edits.py`, on a third of the zoo each, and pairs of the zoo, as in `zoo_quality.py`;
- clips without hand contacts: `quality.NO_CONTACT` among them;
- rigs that lie: clips put on rigs in whose rest poses nobody can stand (`zoo.on_member`). Their twins in T-pose are
  known answers for the same motion; between clips of one rig the alignment with a target should be the same;
- known answers: the same motions on the bodies of `cmu_mb` and `cmu_daz`, each retargeted to the other;
- equivalent results: half the frame rate, twice the frame rate, halves of a clip alone, and rotations half a degree off
  against the same result without;
- duets: `duets.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import cycle, product
from pathlib import Path

import click
import duets as scenes
import numpy as np
from clips import CLIPS, SAMPLE_CLIPS, corpus_argument, found, markdown_option
from edits import TARGETS, edited
from numpy.typing import NDArray
from quality import NO_CONTACT
from runs import Run, clip_name, in_processes, pairs, plan, run_of
from scipy.spatial.transform import Rotation
from tables import mean_and_largest, publish, several, table
from zoo import LYING, MEMBERS, member, on_member, on_twin

from distretarget import Body, Motion, RetargetResult, Skeleton, read_bvh, retarget
from distretarget.batch.summary import largest_spread, role_rotations
from distretarget.matching.matching import match
from distretarget.measure.metrics import BY_KEY, Variant
from distretarget.measure.movement import shared_bones
from distretarget.numerics.vectors import angles_between, level

Array = NDArray[np.float64]
Row = tuple[str, str, str]

SPLAYED = 5.0  # legs are spread otherwise than the source's [degrees]
SUNK = 3.0  # hips are off [% of leg length]
ONTO = ("mixamo", "xsens")  # the targets of rigs that lie
FOLDERS = ("cmu_mb", "cmu_daz")  # of the corpus, with the same motions on two bodies
SAME_MOTIONS = ("02_01", "02_03", "02_04", "03_01", "05_03", "05_06", "06_15", "08_07", "09_01", "12_01")
NOISE = np.radians(0.5) / np.sqrt(3)  # standard deviation about each axis [rad]


def edited_run(frames: int, clip: Path, target: str) -> Run:
    """A clip on its own body with some bones scaled."""
    source = read_bvh(clip)[:frames]
    result = retarget(source, edited(source.rigid_skeleton, TARGETS[target]))
    return Run.of(f"{clip_name(clip)} on {target}", result)


# ---- rigs that lie


def lying(frames: int, clips: Sequence[Path], name: str) -> dict[str, list[float]]:
    """How far clips of a member that lies, retargeted, are from the same of its twin in T-pose: the head's axis up, on
    average over frames [degrees]. And the largest angle between the alignments of the clips with a target [degrees].
    """
    sources = [on_member(name, read_bvh(clip)[:frames]) for clip in clips]
    twins = [on_twin(name, read_bvh(clip)[:frames]) for clip in clips]
    heads, spreads = [], []
    for target in map(member, ONTO):
        alignments = [role_rotations(match(Body.of_motion(source), Body.of(target))) for source in sources]
        spreads.append(largest_spread(np.array(alignments))[0])
        for source, twin in zip(sources, twins, strict=True):
            ups = [_head_up(retarget(motion, target)) for motion in (source, twin)]
            heads.append(float(np.degrees(angles_between(*ups)).mean()))
    return {"heads": heads, "spreads": spreads}


def _head_up(result: RetargetResult) -> Array:
    """(frames, 3), the axis up of the head of a result on a target whose rest pose stands."""
    target = result.matching.target
    head = target.anatomy.roles["head"] if target.anatomy else 0
    return np.asarray(Rotation.from_quat(result.motion.world_rotations_of(head)).apply(target.up_vector))


# ---- known answers


def known_answer(frames: int, corpus: Path, way: tuple[str, str], clip: str) -> dict[str, list[float]]:
    """The motion of a file on the body of another, against that file. For rotation copy and result: the mean direction
    of bones [degrees]; while feet rest, their place from the hips [% of height] and the hips' height [% of leg length].
    """
    motion, answer = (read_bvh(corpus / folder / f"{clip}.bvh")[1 : frames + 1] for folder in way)
    result = retarget(motion, answer)
    body, rests = result.matching.target, result.comparison.feet.stance[:, ::2]
    bones = shared_bones(result.matching)
    legs, up = body.legs or (), body.up_vector
    metrics: dict[str, list[float]] = {"direction": [], "foot": [], "hips": []}
    for each in (result.rotation_copy, result.motion):
        off = [_bones(each, bones), _bones(answer, bones)]
        metrics["direction"].append(float(np.degrees(angles_between(*off)).mean()))
        hips = [np.mean([m.positions[:, leg.hip] for leg in legs], axis=0) for m in (each, answer)]
        feet = [np.stack([m.positions[:, leg.ankle] for leg in legs], axis=1) for m in (each, answer)]
        apart = (feet[0] - hips[0][:, None]) - (feet[1] - hips[1][:, None])
        place, height = np.linalg.norm(level(apart, up), axis=-1), np.abs(apart @ up)
        if not rests.any():
            continue
        metrics["foot"].append(float(100 * place[rests].mean() / _height(answer, up)))
        metrics["hips"].append(float(100 * height[rests].mean() / body.leg_length))
    return metrics


def _bones(motion: Motion, lower: NDArray[np.intp]) -> Array:
    """(frames, bones, 3), the bones above some joints."""
    return np.asarray(motion.positions[:, lower] - motion.positions[:, motion.skeleton.parents[lower]])


def _height(motion: Motion, up: Array) -> float:
    """The height of a person in a motion: from the lowest joint to the highest, the median over frames."""
    return float(np.median(np.ptp(motion.positions @ up, axis=1)))


# ---- equivalent results


def equivalent(frames: int, clip: Path, target: str) -> dict[str, tuple[float, float]]:
    """The largest distance of a joint between equivalent results of a clip, and between their rotation copies, by what
    was changed [% of height].
    """
    source = read_bvh(clip)[:frames]
    body = edited(source.rigid_skeleton, TARGETS[target])
    whole, n, time = retarget(source, body), len(source), source.frame_time
    noise = Rotation.from_rotvec(np.random.default_rng(0).normal(0.0, NOISE, (source.rotations.size // 4, 3)))
    noisy = noise * Rotation.from_quat(source.rotations.reshape(-1, 4))
    cases: dict[str, list[tuple[Motion, slice, slice]]] = {  # with the frames of the whole result and of its own
        "half the frame rate": [(replace(source[::2], frame_time_text=f"{2 * time:.9g}"), slice(0, n, 2), slice(None))],
        "twice the frame rate": [(source.resampled(f"{time / 2:.9g}"), slice(0, n), slice(0, 2 * n, 2))],
        "halves": [(source[half], half, slice(None)) for half in (slice(0, n // 2), slice(n // 2, n))],
        "half a degree of noise": [
            (replace(source, rotations=noisy.as_quat().reshape(source.rotations.shape)), slice(0, n), slice(None))
        ],
    }
    return {name: _apart(whole, body, changed) for name, changed in cases.items()}


def _apart(
    whole: RetargetResult, body: Skeleton, changed: Sequence[tuple[Motion, slice, slice]]
) -> tuple[float, float]:
    """The largest distance to the result of a whole clip, and to its copy [% of height]."""
    joints, height = whole.matching.target.regions.of_joint >= 0, whole.matching.target.height
    distances = []
    for motion, frames, own in changed:
        part = retarget(motion, body)
        for one, other in ((whole.motion, part.motion), (whole.rotation_copy, part.rotation_copy)):
            a, b = one.positions[frames][:, joints], other.positions[own][:, joints]
            distances.append(float(100 * np.linalg.norm(a[: len(b)] - b[: len(a)], axis=-1).max() / height))
    return max(distances[::2]), max(distances[1::2])


# ---- the table


def run_rows(runs: Sequence[Run]) -> Iterator[Row]:
    """The lines about runs."""

    def of(key: str, side: Variant = "result", some: Sequence[Run] = runs) -> Array:
        """(runs,), a metric; nan where nothing was measured."""
        return np.array([run.metric(key, side) for run in some])

    def over(most: float, key: str, some: Sequence[Run] = runs) -> str:
        values = of(key, some=some)
        return f"{(values > most).sum()} of {np.isfinite(values).sum()}"

    clips: dict[str, list[Run]] = {}
    for run in runs:
        clips.setdefault(run.name.split(" on ")[0].split(" of ")[0], []).append(run)
    calm = [run for name, some in clips.items() if f"{name}.bvh".endswith(NO_CONTACT) for run in some]
    yield "clips without hand contacts, degrees off the copy", f"{of('direction_error', some=calm).mean():.2f}", "0.4"
    direction = [mean_and_largest(of(key)) for key in ("direction_error", "direction_error_p99")]
    yield "all: degrees off the copy, mean / largest; 99th percentile", "; ".join(direction), "1.0; 8 / 25"
    sides: tuple[Variant, ...] = ("result", "rotation_copy")
    touching = [[run for run in some if np.isfinite(run.metric("contact_error"))] for some in clips.values()]
    errors = [[of("contact_error", side, some).mean() for side in sides] for some in touching if some]
    yield "contact error against the copy's, each clip once", f"{np.divide(*np.sum(errors, axis=0)):.2f}", "0.22"
    gaps = "; ".join(mean_and_largest(of("contact_gap", side), ".1f") for side in sides)
    yield "worst contact gap, % of leg, mean / largest; copy", gaps, ""
    for name, some in (("all", runs), ("pairs of the zoo", [run for run in runs if " of " in run.name])):
        splay = f"{mean_and_largest(of('splay', some=some))}; {over(SPLAYED, 'splay', some)}"
        yield f"splay of the legs, {name}, degrees, mean / largest; runs above 5", splay, "0.7; 2 %"
    for key in ("head_tilt", "palm_turn", "sole_tilt", "heading"):
        metric = BY_KEY[key]
        most = metric.limit.margin if metric.limit else 0.0
        text = f"{mean_and_largest(of(key), '.1f')}; {over(most, key)}"
        yield f"{metric.label}, degrees, mean / largest; runs above {most:g}", text, "15" if key == "head_tilt" else ""
    sunk = f"{over(SUNK, 'hips_height_largest')}; {np.nanmax(of('hips_height_largest')):.1f}"
    yield "hips over resting ankles, % of leg, runs above 3; largest", sunk, "1 %; 6"
    yield "runs with pops", over(0.0, "pop"), "1 %"
    jerk = of("jerk") / of("jerk", "rotation_copy")
    yield "jerk against the copy's, mean / largest", mean_and_largest(jerk), "1.03 / 1.5"


def lying_rows(found: Sequence[dict[str, list[float]]]) -> Iterator[Row]:
    """The lines about rigs that lie."""
    text = mean_and_largest(np.concatenate([each["heads"] for each in found]), ".1f")
    yield "rigs that lie: head's axis up off its standing twin's, degrees, mean / largest", text, "15"
    text = several(np.max([each["spreads"] for each in found], axis=0), ".0f")
    yield f"rigs that lie: alignment between clips, largest, degrees, onto {' / '.join(ONTO)}", text, "8"


def answer_rows(known: dict[tuple[str, str], list[dict[str, list[float]]]]) -> Iterator[Row]:
    """The lines about known answers, by the folders of source and target."""
    for (source, target), many in known.items():
        keys = ("direction", "foot", "hips")
        means = [np.mean([metrics[key] for metrics in many if metrics[key]], axis=0) for key in keys]
        text = "; ".join(several(each, ".2f") for each in means)
        yield f"known answer, {source} on the body of {target}: copy / result", text, "the copy's"


def equivalent_rows(same: Sequence[dict[str, tuple[float, float]]]) -> Iterator[Row]:
    """The lines about equivalent results."""
    for key, goal in zip(same[0], ("3", "", "1", "4"), strict=True):
        values = np.array([each[key] for each in same]).T
        text = "; ".join(several((each.max(), np.median(each)), ".1f") for each in values)
        yield f"equivalent, {key}, {len(same)} cases: worst / median; copies", text, goal


def duet_rows(duets: Sequence[scenes.Duet]) -> Iterator[Row]:
    """The lines about duets, if there are any."""
    if not duets:
        return
    hips, gaps = (
        several(np.max(each, axis=0), ".1f") for each in zip(*((d.hips, d.worst_gaps) for d in duets), strict=True)
    )
    yield "duets: largest hips height, % of leg, worst take: each alone / scene", hips, "- / 4"
    pops = [sum(one.metrics["result"]["pop"] or 0.0 for one in duet.scene.results) for duet in duets]
    yield "duets: pops a take, mean / largest", mean_and_largest(pops, ".1f"), "2"
    yield "duets: worst 1 % of gaps, % of leg, worst take: each alone / scene", gaps, "- / 10"
    ratio = [duet.scene.world_scale * duet.gap.b / duet.gap.a for duet in duets]
    yield "duets: mean gap over the source's in the world, mean / largest", mean_and_largest(ratio), "1.1"


@click.command(help=__doc__)
@corpus_argument
@click.argument("duets", type=Path, required=False)
@click.option("--frames", default=300, show_default=True, help="Of each clip; duets are whole.")
@markdown_option
def main(corpus: Path, duets: Path | None, frames: int, page: Path | None) -> None:
    """Measure, print, and write the table if a page is given."""
    clips = list(found([*SAMPLE_CLIPS, *CLIPS], corpus).values())
    stand = [clip for clip in clips[::2] if Body.of_motion(read_bvh(clip)[:1]).stands_at_rest]
    members, tasks = list(MEMBERS), list(product(clips, TARGETS))
    rigs = [name for name in members if MEMBERS[name].pose in LYING and not MEMBERS[name].builds]
    both = [clip for clip in SAME_MOTIONS if all((corpus / folder / f"{clip}.bvh").is_file() for folder in FOLDERS)]
    takes = product([motions for _, motions in scenes.takes(duets)] if duets else [], scenes.PAIRS)
    of_zoo = in_processes(partial(run_of, frames), [*plan(clips, members), *pairs(clips, members)])
    rows = list(run_rows([*in_processes(partial(edited_run, frames), tasks), *of_zoo]))
    rows += lying_rows(in_processes(partial(lying, frames, stand), product(rigs)))
    ways = [FOLDERS, FOLDERS[::-1]] if both else []
    rows += answer_rows({way: in_processes(partial(known_answer, frames, corpus, way), product(both)) for way in ways})
    rows += equivalent_rows(in_processes(partial(equivalent, frames), zip(clips, cycle(TARGETS), strict=False)))
    rows += duet_rows(in_processes(scenes.solved, takes))
    publish({"eye": table(["metric", "value", "goal: at most"], rows)}, page)


if __name__ == "__main__":
    main()
