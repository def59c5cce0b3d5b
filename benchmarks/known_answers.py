"""Measure results with known answers: one motion on two bodies, on rigs with a misleading rest pose, equivalent inputs.

    python benchmarks/known_answers.py CORPUS [--frames N] [--markdown FILE]

CORPUS is a folder with the real clips named in `clips.CLIPS`, and with the same motions in `cmu_mb` and `cmu_daz`;
missing ones are left out. The lines are about:

- rigs that lie: clips on rigs whose rest pose is not a standing one (`zoo.on_member`). The results of the same rigs in
  T-pose are the known answers; and all clips of one rig should have the same alignment with a target;
- known answers: the same motions on the bodies of `cmu_mb` and `cmu_daz`, each retargeted to the other. Those of
  `cmu_daz` were made by MotionBuilder from those of `cmu_mb`;
- own motions: what a character with a mesh did as the result of a clip, retargeted to the same character;
- equivalent results: half the frame rate, twice the frame rate, halves of a clip alone, and noise of half a degree on
  rotations, against the result of the clip as it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import cycle, product
from pathlib import Path

import click
import numpy as np
from clips import CLIPS, HERO, SAMPLE_CLIPS, TARGETS, corpus_argument, edited, found, markdown_option
from numpy.typing import NDArray
from runs import in_processes
from scipy.spatial.transform import Rotation
from tables import mean_and_largest, publish, several, table
from zoo import LYING, MEMBERS, member, on_member, on_twin

from distretarget import Body, Motion, RetargetResult, Skeleton, load_target, read_bvh, retarget
from distretarget.batch.summary import largest_spread, role_rotations
from distretarget.matching.matching import match
from distretarget.measure.comparison import shared_bones
from distretarget.measure.metrics import BY_KEY
from distretarget.numerics.vectors import Array, angles_between, level

Row = tuple[str, str, str]

ONTO = ("mixamo", "xsens")  # the targets of rigs that lie
HELD = ("cmu_mb/05_06.bvh", "cmu_mb/05_12.bvh", "cmu_daz/13_18.bvh", "animated_drawings/wave_hello.bvh")
"""Clips that hold hands, head, elbows or a leg turned all the time, as if the rig were built so."""
TILTS = ("head_tilt", "heading", "sole_tilt")
FOLDERS = ("cmu_mb", "cmu_daz")  # of the corpus, with the same motions on two bodies
SAME_MOTIONS = ("02_01", "02_03", "02_04", "03_01", "05_03", "05_06", "06_15", "08_07", "09_01", "12_01")
NOISE = np.radians(0.5) / np.sqrt(3)  # standard deviation about each axis [rad]


# ---- rigs that lie


def lying(frames: int, clips: Sequence[Path], name: str) -> dict[str, list[float]]:
    """Results on a member that lies against those on its twin: angles between heads' up axes [degrees], warnings of
    `TILTS` that the twin's do not have, and the largest angle between alignments with a target [degrees].
    """
    sources = [on_member(name, read_bvh(clip)[:frames]) for clip in clips]
    twins = [on_twin(name, read_bvh(clip)[:frames]) for clip in clips]
    heads, spreads, warned = [], [], []
    for target in map(member, ONTO):
        alignments = [role_rotations(match(Body.of_motion(source), Body.of(target))) for source in sources]
        spreads.append(largest_spread(np.array(alignments))[0])
        for source, twin in zip(sources, twins, strict=True):
            results = [retarget(motion, target) for motion in (source, twin)]
            body, head = results[0].matching.target, results[0].matching.target.roles.get("head", 0)
            turns = (Rotation.from_quat(each.motion.world_rotations_of(head)) for each in results)
            ups = [turn.apply(body.up_vector) for turn in turns]  # the heads' up axes
            heads.append(float(np.degrees(angles_between(*ups)).mean()))
            own, of_twin = ({key for key in TILTS if BY_KEY[key].over_limit(each.metrics)} for each in results)
            warned.append(float(bool(own - of_twin)))
    return {"heads": heads, "spreads": spreads, "warned": warned}


# ---- known answers


def known_answer(frames: int, corpus: Path, folders: tuple[str, str], clip: str) -> dict[str, list[float]]:
    """Errors of copy and result against the file for the other body: directions [degrees], and while feet rest their
    positions relative to the hips [% of height] and the hips' height [% of leg length].
    """
    motion, answer = (read_bvh(corpus / folder / f"{clip}.bvh")[1 : frames + 1] for folder in folders)
    result = retarget(motion, answer)
    body, rests = result.matching.target, result.comparison.stance[:, ::2]
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
        tall = np.median(np.ptp(answer.positions @ up, axis=1))
        metrics["foot"].append(float(100 * place[rests].mean() / tall))
        metrics["hips"].append(float(100 * height[rests].mean() / body.leg_length))
    return metrics


def own_motion(frames: int, hero: Path, clip: Path) -> float:
    """The largest distance of a joint when the result of a clip is retargeted to its own character [% of height]."""
    target = load_target(hero)
    motion = retarget(read_bvh(clip)[:frames], target).motion
    again = retarget(motion, target)
    off = np.linalg.norm(again.motion.positions - motion.positions, axis=-1)
    return float(100 * off.max() / again.matching.target.height)


def _bones(motion: Motion, lower: NDArray[np.intp]) -> Array:
    """The bones that end at some joints, (frames, bones, 3)."""
    return np.asarray(motion.positions[:, lower] - motion.positions[:, motion.skeleton.parents[lower]])


# ---- equivalent results


def equivalent(frames: int, clip: Path, target: str) -> dict[str, tuple[float, float]]:
    """The largest distance of a joint between equivalent results, and between copies, by the change [% of height]."""
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
    """The largest distance of changed results to the whole clip's, and of their copies [% of height]."""
    joints, height = whole.matching.target.regions.of_joint >= 0, whole.matching.target.height
    distances = []
    for motion, frames, own in changed:
        part = retarget(motion, body)
        for one, other in ((whole.motion, part.motion), (whole.rotation_copy, part.rotation_copy)):
            a, b = one.positions[frames][:, joints], other.positions[own][:, joints]
            distances.append(float(100 * np.linalg.norm(a[: len(b)] - b[: len(a)], axis=-1).max() / height))
    return max(distances[::2]), max(distances[1::2])


# ---- the table


def lying_rows(found: Sequence[dict[str, list[float]]]) -> Iterator[Row]:
    """The lines about rigs that lie."""
    text = mean_and_largest(np.concatenate([each["heads"] for each in found]), ".1f")
    yield "rigs that lie: head's axis up off its standing twin's, degrees, mean / largest", text, "15"
    text = several(np.max([each["spreads"] for each in found], axis=0), ".0f")
    yield f"rigs that lie: alignment between clips, largest, degrees, onto {' / '.join(ONTO)}", text, "8"
    warned = np.concatenate([each["warned"] for each in found])
    text = f"{warned.sum():.0f} of {len(warned)}"
    yield "rigs that lie: runs with a warning of head or feet that their standing twins' have not", text, "0"


def answer_rows(known: dict[tuple[str, str], list[dict[str, list[float]]]]) -> Iterator[Row]:
    """The lines about known answers, by the folders of source and target."""
    for (source, target), many in known.items():
        keys = ("direction", "foot", "hips")
        means = [np.mean([metrics[key] for metrics in many if metrics[key]], axis=0) for key in keys]
        text = "; ".join(several(each, ".2f") for each in means)
        yield f"same motions, {source} on the body of {target}: copy / result", text, "the copy's"


def equivalent_rows(same: Sequence[dict[str, tuple[float, float]]]) -> Iterator[Row]:
    """The lines about equivalent results."""
    for key, goal in zip(same[0], ("3", "", "1", "4"), strict=True):
        values = np.array([each[key] for each in same]).T
        text = "; ".join(several((each.max(), np.median(each)), ".1f") for each in values)
        yield f"equivalent, {key}, {len(same)} cases: worst / median; copies", text, goal


@click.command(help=__doc__)
@corpus_argument
@click.option("--frames", default=300, show_default=True, help="Of each clip.")
@markdown_option
def main(corpus: Path, frames: int, page: Path | None) -> None:
    """Measure, print, and write the table if a page is given."""
    clips = list(found([*SAMPLE_CLIPS, *CLIPS], corpus).values())
    some = {*clips[::2], *found(HELD, corpus).values()}
    stand = [clip for clip in sorted(some) if Body.of_motion(read_bvh(clip)[:1]).stands_at_rest]
    rigs = [name for name, each in MEMBERS.items() if each.pose in LYING and not each.builds]
    both = [clip for clip in SAME_MOTIONS if all((corpus / folder / f"{clip}.bvh").is_file() for folder in FOLDERS)]
    pairs = [FOLDERS, FOLDERS[::-1]] if both else []
    rows = [*lying_rows(in_processes(partial(lying, frames, stand), product(rigs)))]
    rows += answer_rows({p: in_processes(partial(known_answer, frames, corpus, p), product(both)) for p in pairs})
    off = in_processes(partial(own_motion, frames, HERO), product(clips))
    text = several((max(off), np.median(off)), ".2f")
    rows.append((f"own motions of a character with a mesh, {len(off)} clips: worst / median", text, "0.2"))
    rows += equivalent_rows(in_processes(partial(equivalent, frames), zip(clips, cycle(TARGETS), strict=False)))
    publish({"known answers": table(["known answer", "off it", "goal: at most"], rows)}, page)


if __name__ == "__main__":
    main()
