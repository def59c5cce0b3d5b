"""`distretarget diff`: measure one clip or scene against another."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click

from distretarget.body.body import Body
from distretarget.cli.options import (
    CLIP_OPTION,
    OVERWRITE_OPTION,
    FileOrStandard,
    file_option,
    limit_of,
    map_option,
    positive,
    quiet,
)
from distretarget.cli.outputs import LISTED, about, check_outputs, read_input, say, table_lines, write_outputs
from distretarget.errors import FileError, counted, in_file, quoted
from distretarget.io.files import is_folder, reason_of
from distretarget.io.input_file import MOTION_SUFFIXES
from distretarget.io.map_json import joint_map, load_map
from distretarget.io.reading import animations_in, parse_motion, read_motion
from distretarget.measure.diff import Diff, diff, diff_scenes
from distretarget.measure.metrics import BY_KEY, METRICS, Metric, metrics_at
from distretarget.measure.verdict import limit_warnings
from distretarget.motion import Motion
from distretarget.pipeline.retargeting import with_advice
from distretarget.report.clip_page import diff_page
from distretarget.report.diff_document import MetricValues, Table, Values, csv_text, document, json_text
from distretarget.report.scene_page import (
    GAP_ERROR,
    gap_table,
    metric_table,
    scene_csv,
    scene_diff_page,
    scene_document,
)
from distretarget.scene.scene_file import SCENE_NAME, SceneSetup, load_scene
from distretarget.target import Target

MOST_GAPS = 10  # rows of the table of gaps that are printed
MOST = 5  # frames and contacts that are printed
RATIOS = ", ".join(metric.key for metric in METRICS if metric.judged == "ratio")
FAIL_OVER_HELP = (
    f"Exit with status 1 if a metric is over a limit. METRIC is one of {', '.join(BY_KEY)}. The limit is for the value "
    f"of B; for {RATIOS}, for the ratio B / A. In scenes the limit is for each performer; a whole scene has the "
    f"metric {GAP_ERROR}: the error of gaps between parts in contact in A [% of leg]. May be given several times."
)


@dataclass(frozen=True)
class DiffOutputs:
    """The outputs of the command for a diff of two clips or two scenes."""

    document: Values  # the JSON
    page: Callable[[], str]  # makes the HTML report
    csv: Callable[[], str]  # makes the CSV
    lines: Sequence[str]  # to print
    excess: str  # the file and its metrics over their limits; empty if there are none


@click.command("diff")
@click.argument("a", type=FileOrStandard())
@click.argument("b", type=FileOrStandard())
@file_option("-o", "--report", type=FileOrStandard(), help="Write an HTML report to this file: one file, no network.")
@click.option("--json", "json_path", type=FileOrStandard(), help="Write all metrics to this file.")
@click.option("--csv", "csv_path", type=FileOrStandard(), help="Write the metrics to this file, a row for each frame.")
@CLIP_OPTION
@map_option(
    help='A JSON file with {"joint of B": "joint of A"}, null for joints to leave out; the others are matched by names '
    "or shape."
)
@click.option(
    "--fail-over",
    "limits",
    type=limit_of((*BY_KEY, GAP_ERROR)),
    multiple=True,
    metavar="METRIC=LIMIT",
    help=FAIL_OVER_HELP,
)
@click.option(
    "--world-scale",
    type=positive,
    metavar="NUMBER",
    help="For scenes: units of B per unit of A along the floor. Default: that of A's scene file if B is a folder of "
    "results, else the one that `distretarget scene` would choose.",
)
@OVERWRITE_OPTION
@click.option("-v", "--verbose", is_flag=True, help="Print all metrics and what they mean, and contacts.")
@quiet
def diff_command(
    a: Path,
    b: Path,
    report: Path | None,
    json_path: Path | None,
    csv_path: Path | None,
    clip: str | None,
    map_path: Path | None,
    limits: tuple[tuple[str, float], ...],
    world_scale: float | None,
    overwrite: bool,
    verbose: bool,
) -> None:
    """Measure the motion of B against that of A, the reference. Both are files with motions: BVH,
    glTF, VRM, VRMA or FBX.

    Skeletons, frame times and numbers of frames may differ: A is resampled at B's frame time, and the longer clip
    is cut. - means standard input or output.

    To compare two scenes, give two folders with a file for each performer and prop, with the same names in both; or a
    SCENE.json in place of a folder. The metrics are those of each performer, and the gaps in B between parts that touch
    in A.

    \b
    distretarget diff walk.bvh walk_hero.bvh
    distretarget diff walk.bvh walk_hero.bvh -o walk_hero.html --csv walk_hero.csv
    distretarget diff old.bvh new.bvh --fail-over contact_error=0.02 --fail-over foot_skate=1.1
    distretarget diff scene.json duet -o duet.html --fail-over gap_error=2
    """  # noqa: D301
    outputs = (report, json_path, csv_path)
    if is_scene(a) or is_scene(b):
        if clip:
            raise click.UsageError("--clip chooses an animation of a file; leave it out to compare two scenes.")
        one, other = read_scenes(a, b)
        check_outputs(outputs, [*one.files.values(), *other.files.values(), a, b, map_path], overwrite)
        made = _scene_outputs(one, other, map_path, limits, world_scale, verbose)
    else:
        if world_scale is not None or any(key == GAP_ERROR for key, _ in limits):
            option = f"--fail-over {GAP_ERROR}" if world_scale is None else "--world-scale"
            raise click.UsageError(f"{option} is for scenes; leave it out to compare two clips.")
        check_outputs(outputs, [a, b, map_path], overwrite)
        made = _clip_outputs(a, b, clip, map_path, limits, verbose)
    write_outputs({report: made.page, json_path: lambda: json_text(made.document), csv_path: made.csv}, overwrite)
    say(*made.lines)
    if made.excess:
        raise click.ClickException(made.excess)


def _clip_outputs(
    a: Path, b: Path, clip: str | None, map_path: Path | None, limits: tuple[tuple[str, float], ...], verbose: bool
) -> DiffOutputs:
    a_file, b_file = read_input(a), read_input(b)
    clips = (clip if clip and len(animations_in(file)) > 1 else None for file in (a_file, b_file))
    first, second = (parse_motion(file, each)[0] for file, each in zip((a_file, b_file), clips, strict=True))
    result = measure(first, second, a_file.path, b_file.path, map_path)
    metrics = document(result, replace(about(Path(a_file.path), Path(b_file.path)), limits=limits))
    lines = [*_lines(metrics, [] if verbose else [*verdict_lines(result)], verbose)]
    excess = _joined(b_file.path, over(metrics["limits"]))
    return DiffOutputs(metrics, lambda: diff_page(result, metrics), lambda: csv_text(metrics["frames"]), lines, excess)


def _lines(metrics: Values, verdict: Sequence[str], verbose: bool) -> Iterator[str]:
    """The lines to print: with the verdict, or if `verbose` with all metrics and contacts."""
    for name, body in (("A", metrics["a"]), ("B", metrics["b"])):
        named = f", named as in {body['convention']}" if body["convention"] else ""
        yield f"{name}: {body['file']}, {body['joints']} joints{named}"
    yield f"{counted(metrics['frame_count'], 'frame')} compared, {1 / metrics['frame_time']:,.6g} a second"
    yield from metrics["notes"]
    if verbose:
        yield from ("", *_table(metrics["metrics"]["source"], metrics["metrics"]["result"]), "")
    yield from verdict
    for metric in metrics_at("diff"):
        if worst := _worst_frames(metric, metrics["frames"]):
            yield f"worst frames by {metric.label}: {worst}"
    if verbose:
        yield from _contacts(metrics["contacts"])
    for name, other, joints in (("B", "A", metrics["unmatched_b"]), ("A", "B", metrics["unmatched_a"])):
        if joints:
            yield f"joints of {name} without a counterpart in {other}: {quoted(joints, LISTED)}"


def _table(a: MetricValues, b: MetricValues) -> Iterator[str]:
    """The lines of a table of all metrics in A and B."""
    rows = [("metric", "A", "B", "")]
    for metric in METRICS:
        own = _number(a[metric.key]) if metric.of_source else ""
        rows.append((metric.label, own, _number(b[metric.key]), _meaning(metric, a.get(metric.key), b[metric.key])))
    return table_lines(rows, "<>><")


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _meaning(metric: Metric, a: float | None, b: float | None) -> str:
    """The meaning of a metric, its unit and, if its ratio is judged, the ratio of B to A."""
    meaning = metric.meaning.format(source="A", result="B") + (f" [{metric.unit}]" if metric.unit else "")
    judged = metric.judgement(b, a)
    if not metric.of_source or judged is None or a is None or a <= metric.still:
        return meaning
    return f"{meaning}; {metric.comparison('A', 'B')} {judged:.4g}"


def _worst_frames(metric: Metric, frames: Sequence[MetricValues]) -> str:
    """The frames with the largest values of a metric, and the values; empty if all are 0."""
    key = metric.key
    ranked = sorted((frame for frame in frames if frame[key]), key=lambda frame: -(frame[key] or 0.0))
    return ", ".join(f"{frame['frame']} ({frame[key]:.3g})" for frame in ranked[:MOST])


def _contacts(contacts: Sequence[Values]) -> Iterator[str]:
    """A line for each of the first `MOST` contacts in A, pairs of regions of the body."""
    yield "contacts (distance over path length in A, in B):" if contacts else "contacts: none"
    for contact in contacts[:MOST]:
        distances = f"{contact['distance_a']:.3f}, {contact['distance_b']:.3f} in {counted(contact['frames'], 'frame')}"
        yield f"  {contact['regions']}: {distances}; worst in frame {contact['worst_frame']}"
    if len(contacts) > MOST:
        yield f"  and {len(contacts) - MOST} more"


@dataclass(frozen=True)
class SceneInput:
    """The performers and props of a scene, by name."""

    path: Path  # of its file or folder
    motions: Mapping[str, Motion]
    files: Mapping[str, Path]  # of the motions
    setup: SceneSetup | None = None  # the scene file; None for a folder without one


def over(limits: Iterable[Values]) -> Iterator[str]:
    """Yield a clause for each metric that is over its limit."""
    for limit in limits:
        if limit["over"]:
            yield f"{limit['metric']} is {limit['value']:.6g}, over {limit['limit']:g}"


def _joined(path: str | Path, clauses: Iterable[str]) -> str:
    """The clauses on one line that begins with a path; empty without clauses."""
    text = "; ".join(clauses)
    return text and f"{path}: {text}"


def verdict_lines(result: Diff) -> Iterator[str]:
    """Yield the verdict on B: a line for each metric over its limit, with the worst frame, or that all are within."""
    found = [*limit_warnings(result.metrics, {"result": result.tracks})]
    yield from (f"over a limit: {line}" for line in found)
    if not found:
        yield "B is within all limits; -v prints all metrics"


def is_scene(path: Path) -> bool:
    """Return whether a path leads to a scene: a folder, or a file named *.json."""
    return is_folder(path) or path.suffix.lower() == ".json"


def read_recorded_scene(path: Path) -> SceneInput:
    """Read the scene in a file or folder; of a folder, its scene.json, or else all its motion files."""
    file = path / SCENE_NAME if is_folder(path) else path
    if file == path or file.is_file():
        setup = load_scene(file)
        sources, props = setup.read()
        motions = [each.facing_forward() for each in (*sources, *(prop.motion for prop in props))]
        files = {clip.name: clip.file for clip in setup.clips}
        return SceneInput(path, dict(zip(files, motions, strict=True)), files, setup)
    try:
        found = sorted(one for one in path.iterdir() if one.suffix.lower() in MOTION_SUFFIXES and one.name[0] != ".")
    except OSError as error:
        raise FileError(path, reason_of(error)) from error
    if not found:
        raise FileError(path, f"has no motion file and no {SCENE_NAME} in it")
    files = {each.stem: each for each in found}
    return SceneInput(path, {name: read_motion(file).facing_forward() for name, file in files.items()}, files)


def read_scenes(a_path: Path, b_path: Path) -> tuple[SceneInput, SceneInput]:
    """Read two scenes, which must have the same names of performers and props."""
    for path, other in ((a_path, b_path), (b_path, a_path)):
        if not is_scene(path):
            raise FileError(path, f"is not a scene, but {str(other)!r} is; name two scenes or two clips")
    a, b = read_recorded_scene(a_path), read_recorded_scene(b_path)
    for scene, second in ((a, b), (b, a)):
        if missing := [name for name in scene.motions if name not in second.motions]:
            names = quoted(missing, LISTED)
            raise FileError(second.path, f"lacks {names}, in {str(scene.path)!r}; names have to be the same")
    return a, b


def _scene_outputs(
    a: SceneInput,
    b: SceneInput,
    map_path: Path | None,
    limits: Sequence[tuple[str, float]],
    world_scale: float | None,
    verbose: bool,
) -> DiffOutputs:
    props = _props(a, b)
    setup = a.setup if b.setup is None else None  # B may be a folder of results of A's scene file
    performers = _performers(a, b, [name for name in a.motions if name not in props], setup, map_path)
    with in_file(b.path):
        pairs = [(a.motions[name], b.motions[name]) for name in props]
        scale = world_scale or (setup.world_scale if setup else None)
        result = diff_scenes([*performers.values()], pairs, world_scale=scale)
    run = about(a.path, b.path)
    scene_limits = tuple(limit for limit in limits if limit[0] == GAP_ERROR)
    clip_limits = tuple(limit for limit in limits if limit[0] != GAP_ERROR)
    documents = {
        name: document(one, replace(run, a=a.files[name].name, b=b.files[name].name, limits=clip_limits))
        for name, one in performers.items()
    }
    metrics = scene_document(result, documents, props, replace(run, limits=scene_limits))
    verdicts = {} if verbose else {name: [*verdict_lines(one)] for name, one in performers.items()}
    of_performers = [f"{name}'s {clause}" for name, one in documents.items() for clause in over(one["limits"])]
    excess, lines = _joined(b.path, [*over(metrics["limits"]), *of_performers]), [*_scene_lines(metrics, verdicts)]
    return DiffOutputs(metrics, lambda: scene_diff_page(result, metrics), lambda: scene_csv(metrics), lines, excess)


def _props(a: SceneInput, b: SceneInput) -> list[str]:
    """The names of the props, from a scene file; without one, the clips of A without legs, if others have legs."""
    if setup := a.setup or b.setup:
        names = {prop.name for prop in setup.props}
        return [name for name in a.motions if name in names]
    without_legs = [name for name, motion in a.motions.items() if Body.of_motion(motion).legs is None]
    return without_legs if len(without_legs) < len(a.motions) else []


def _performers(
    a: SceneInput, b: SceneInput, names: Sequence[str], setup: SceneSetup | None, map_path: Path | None
) -> dict[str, Diff]:
    """Measure each performer of B against A's, with the up axes of the first; maps are those of `setup` by default."""
    maps = {each.name: each.map_path for each in setup.performers} if setup and not map_path else {}
    measured: dict[str, Diff] = {}
    ups: dict[str, str] = {}
    for name in names:
        files = a.files[name], b.files[name]
        measured[name] = measure(a.motions[name], b.motions[name], *files, maps.get(name, map_path), **ups)
        ups = {"a_up": measured[name].world.source_up, "b_up": measured[name].world.up}
    return measured


def measure(a: Motion, b: Motion, a_file: str | Path, b_file: str | Path, map_path: Path | None, **ups: str) -> Diff:
    """Measure motion B against motion A as `diff` does; errors name the files."""
    pairs = joint_map(a.rigid_skeleton, Target(b.rigid_skeleton, {}, ""), b_file, load_map(map_path))
    with in_file(b_file), with_advice(a_file, b_file):
        return diff(a, b, pairs, **ups)


def _scene_lines(metrics: Values, verdicts: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """The lines to print: with the verdict on each performer, or without verdicts with all metrics."""
    performers = metrics["performers"]
    first = next(iter(performers.values()))
    yield f"A: {metrics['a']}, B: {metrics['b']}; performers: {', '.join(performers)}"
    if metrics["props"]:
        yield f"props: {', '.join(metrics['props'])}"
    frames = min(one["frame_count"] for one in performers.values())
    yield f"{counted(frames, 'frame')} compared, {1 / first['frame_time']:,.6g} a second"
    for name, one in performers.items():
        for note in one["notes"]:
            yield f"{name}: {note}"
    if not verdicts:
        yield from ("", *_table_lines(metric_table(metrics)), "")
    for name, verdict in verdicts.items():
        yield from (f"{name}: {line}" for line in verdict)
    gaps = gap_table(metrics)
    if not gaps["rows"]:
        yield "no contacts between performers and props in A"
        return
    yield (
        f"contacts in A: joints {metrics['gap_a']:.1f} % of a leg apart in A, {metrics['gap_b']:.1f} in B, "
        f"a mean error of {metrics['gap_error']:.1f}; 1 unit of A's world is {metrics['world_scale']:.3g} units of B's"
    )
    yield from _table_lines(gaps, MOST_GAPS)
    if (more := len(gaps["rows"]) - MOST_GAPS) > 0:
        yield f"and {more} more"


def _table_lines(table: Table, most: int | None = None) -> Iterator[str]:
    """The lines of a table's head and first `most` rows."""
    rows = [table["columns"], *([str(cell) for cell in row] for row in table["rows"][:most])]
    return table_lines(rows, "<" + ">" * (len(rows[0]) - 1))
