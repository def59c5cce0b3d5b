"""`distretarget diff`: measure one clip or scene against another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import click

from distretarget.cli.diff_scenes import Account, is_scene, measure, measure_scenes, over, over_limits
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
from distretarget.cli.outputs import LISTED, about, aligned, check_outputs, read_input, say, write_outputs
from distretarget.errors import counted, quoted
from distretarget.io.input_file import InputFile
from distretarget.io.motion_file import parse_motion
from distretarget.io.target_file import animations_in
from distretarget.measure.metrics import BY_KEY, METRICS, Metric, metrics_at
from distretarget.motion import Motion
from distretarget.report.clip_page import diff_page
from distretarget.report.csv_table import csv_text
from distretarget.report.diff_document import DiffDocument, MetricValues, Values, document, json_text
from distretarget.report.scene_page import GAP_ERROR

MOST = 5  # frames and contacts that are printed
RATIOS = " and ".join(metric.key for metric in METRICS if metric.judged == "ratio")
FAIL_OVER_HELP = (
    f"Exit with status 1 if a metric is over a limit. METRIC is one of {', '.join(BY_KEY)}. The limit is for the value "
    f"of B; for {RATIOS}, for its ratio to the value of A. In scenes it is for each performer; a whole scene has the "
    f"metric {GAP_ERROR}: the error of the gaps between what touches in A, in % of a leg. May be given several times."
)


def of_metric(text: str) -> tuple[str, float]:
    """The key of a metric and its limit, a number from 0 up, in a text METRIC=LIMIT."""
    name, _, number = text.partition("=")
    known = (*BY_KEY, GAP_ERROR)
    if name not in known:
        raise click.BadParameter(f"expected one of {', '.join(known)}, = and a limit, found {text!r}")
    return name, limit_of(name, number)


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
@click.option("--fail-over", "limits", type=of_metric, multiple=True, metavar="METRIC=LIMIT", help=FAIL_OVER_HELP)
@click.option(
    "--world-scale",
    type=positive,
    metavar="NUMBER",
    help="For scenes: units of B per unit of A along the floor. Default: what the scene file of A says if B is a "
    "folder of results, else what `distretarget scene` would choose.",
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

    Their skeletons, frame times and numbers of frames may differ: A is resampled at B's frame time, and the longer clip
    is cut. - means standard input or output.

    To compare two scenes, give two folders with a file for each performer and prop, with the same names in both, or a
    SCENE.json for either. Each performer is measured, and the gaps in B between what touches in A.

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
        account = measure_scenes(a, b, outputs, map_path, limits, world_scale, overwrite, verbose)
    else:
        if world_scale is not None or any(key == GAP_ERROR for key, _ in limits):
            option = f"--fail-over {GAP_ERROR}" if world_scale is None else "--world-scale"
            raise click.UsageError(f"{option} is for scenes; leave it out to compare two clips.")
        check_outputs(outputs, [a, b, map_path], overwrite)
        account = _measure_clips(a, b, clip, map_path, limits, verbose)
    texts = {report: account.page, json_path: lambda: json_text(account.document), csv_path: account.csv}
    write_outputs(texts, overwrite)
    say(*account.lines)
    if account.faults:
        raise click.ClickException(f"{account.path}: {'; '.join(account.faults)}")


def _measure_clips(
    a: Path, b: Path, clip: str | None, map_path: Path | None, limits: tuple[tuple[str, float], ...], verbose: bool
) -> Account:
    """Measure clip B against clip A."""
    a_text, b_text = read_input(a), read_input(b)
    first, second = (_motion(file, clip) for file in (a_text, b_text))
    result = measure(first, second, a_text.path, b_text.path, map_path)
    metrics = document(result, replace(about(Path(a_text.path), Path(b_text.path)), limits=limits))
    return Account(
        path=b_text.path,
        document=metrics,
        page=lambda: diff_page(result, metrics),
        csv=lambda: csv_text(metrics["frames"]),
        lines=[*_lines(metrics, [] if verbose else [*over_limits(result)], verbose)],
        faults=[*over(metrics["limits"])],
    )


def _motion(file: InputFile, clip: str | None) -> Motion:
    """The motion in a file; `clip` is for one that has several animations."""
    several = clip and len(animations_in(file)) > 1
    return parse_motion(file, clip if several else None)[0]


def _lines(metrics: DiffDocument, verdict: Sequence[str], verbose: bool) -> Iterator[str]:
    """The lines that are printed, with the lines of the verdict, or if `verbose` all metrics and contacts."""
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
    """A line for each metric, with its values in A and B."""
    rows = [("metric", "A", "B", "")]
    for metric in METRICS:
        own = _number(a[metric.key]) if metric.of_source else ""
        rows.append((metric.label, own, _number(b[metric.key]), _meaning(metric, a.get(metric.key), b[metric.key])))
    return aligned(rows, "<>><")


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _meaning(metric: Metric, a: float | None, b: float | None) -> str:
    """What a metric means, its unit and, if its ratio is judged, the ratio of B to A."""
    meaning = metric.meaning.format(source="A", result="B") + (f" [{metric.unit}]" if metric.unit else "")
    judged = metric.judgement(b, a)
    if not metric.of_source or judged is None or a is None or a <= metric.still:
        return meaning
    return f"{meaning}; {metric.comparison('A', 'B')} {judged:.4g}"


def _worst_frames(metric: Metric, frames: Sequence[MetricValues]) -> str:
    """The worst frames by a metric, with its values; empty if it is 0 in all."""
    key = metric.key
    ranked = sorted((frame for frame in frames if frame[key]), key=lambda frame: -(frame[key] or 0.0))
    return ", ".join(f"{frame['frame']} ({frame[key]:.3g})" for frame in ranked[:MOST])


def _contacts(contacts: Sequence[Values]) -> Iterator[str]:
    """A line for each of the first pairs of regions that touch in A."""
    yield "contacts (distance over path length in A, in B):" if contacts else "contacts: none"
    for contact in contacts[:MOST]:
        distances = f"{contact['distance_a']:.3f}, {contact['distance_b']:.3f} in {counted(contact['frames'], 'frame')}"
        yield f"  {contact['regions']}: {distances}; worst in frame {contact['worst_frame']}"
    if len(contacts) > MOST:
        yield f"  and {len(contacts) - MOST} more"
