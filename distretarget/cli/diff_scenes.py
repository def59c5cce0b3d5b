"""Two scenes measured against each other, as `distretarget diff` does for folders and scene files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click

from distretarget.cli.outputs import LISTED, about, check_outputs, number, over, say, write_output
from distretarget.cli.scene_input import SceneInput, is_scene, props_of, read_scene
from distretarget.errors import DistretargetError, FileError, MatchingError, quoted
from distretarget.io.map_json import MapFile, joint_map, load_map
from distretarget.measure.diff import Diff, diff
from distretarget.measure.figures import FIGURES
from distretarget.measure.scene_gaps import SceneDiff, diff_scenes
from distretarget.pipeline.retarget_files import needs_map
from distretarget.report.document import document, json_text
from distretarget.report.document_types import DiffDocument
from distretarget.report.scene_diff import GAP_ERROR, SceneDiffDocument, part, scene_csv, scene_document
from distretarget.report.scene_diff_page import scene_diff_page
from distretarget.target import Target

MOST = 10  # parts that touch which are printed


@dataclass(frozen=True)
class Request:
    """What the command line asks for: scenes A and B, the files to write, and the options of `distretarget diff`."""

    a: Path
    b: Path
    output: Path | None
    json_path: Path | None
    csv_path: Path | None
    map_path: Path | None
    limits: tuple[tuple[str, float], ...]
    world_scale: float | None
    overwrite: bool


def measure_scenes(request: Request) -> None:
    """Measure scene B against scene A, write what is asked for, and print the figures."""
    for path, other in ((request.a, request.b), (request.b, request.a)):
        if not is_scene(path):
            raise FileError(path, f"is not a scene, but {str(other)!r} is; name two scenes or two BVH files")
    a, b = read_scene(request.a), read_scene(request.b)
    inputs = [*a.files.values(), *b.files.values(), request.a, request.b, request.map_path]
    check_outputs([request.output, request.json_path, request.csv_path], inputs, request.overwrite)
    _check_names(a, b)
    result, figures = _compared(a, b, request)
    _write(request, result, figures)
    for line in _account(figures):
        say(line)
    if faults := list(_over(figures)):
        raise click.ClickException(f"{request.b}: {'; '.join(faults)}")


def _compared(a: SceneInput, b: SceneInput, request: Request) -> tuple[SceneDiff, SceneDiffDocument]:
    """The diff of two scenes, and its document."""
    known = props_of(a, b)
    props = [name for name in a.motions if name in known]
    performers = [name for name in a.motions if name not in known]
    results = b.props is None  # a folder of results of a scene file, perhaps, and not another scene
    maps, given = a.maps if results and not request.map_path else {}, load_map(request.map_path)
    measured = _measured(a, b, [(name, maps.get(name, given)) for name in performers])
    told_scale = a.world_scale if results else None
    try:
        pairs = [(a.motions[name], b.motions[name]) for name in props]
        result = diff_scenes(measured, pairs, world_scale=request.world_scale or told_scale)
    except DistretargetError as error:
        raise error.in_file(request.b) from None
    told = about(request.a, request.b)
    of_scene = tuple(limit for limit in request.limits if limit[0] == GAP_ERROR)
    of_each = tuple(limit for limit in request.limits if limit[0] != GAP_ERROR)
    documents = {
        name: document(one, replace(told, a=a.files[name].name, b=b.files[name].name, limits=of_each))
        for name, one in zip(performers, measured, strict=True)
    }
    return result, scene_document(result, documents, props, replace(told, limits=of_scene))


def _check_names(a: SceneInput, b: SceneInput) -> None:
    """Check that both scenes have the same performers and props."""
    for one, other in ((a, b), (b, a)):
        if missing := [name for name in one.motions if name not in other.motions]:
            raise FileError(
                other.path, f"lacks {quoted(missing, LISTED)}, in {str(one.path)!r}; names have to be the same"
            )


def _measured(a: SceneInput, b: SceneInput, performers: Sequence[tuple[str, MapFile]]) -> list[Diff]:
    """Each performer of B, given by name and map, measured against that of A, all with the axes that point up for the
    first.
    """
    measured: list[Diff] = []
    for name, map_file in performers:
        first, second = a.motions[name], b.motions[name]
        goal = Target(second.rigid_skeleton, {}, "")
        pairs = joint_map(first.rigid_skeleton, goal, b.files[name], map_file)
        ups = {"a_up": measured[0].world.source_up, "b_up": measured[0].world.up} if measured else {}
        try:
            measured.append(diff(first, second, pairs, **ups))
        except MatchingError as error:
            raise needs_map(error, a.files[name], b.files[name]) from error
        except DistretargetError as error:
            raise error.in_file(b.files[name]) from None
    return measured


def _write(request: Request, result: SceneDiff, figures: SceneDiffDocument) -> None:
    """Write the files that are asked for."""
    if request.output:
        write_output(request.output, scene_diff_page(result, figures), request.overwrite)
    if request.json_path:
        write_output(request.json_path, json_text(figures), request.overwrite)
    if request.csv_path:
        write_output(request.csv_path, scene_csv(figures), request.overwrite)


def _account(figures: SceneDiffDocument) -> Iterator[str]:
    """The lines that are printed."""
    performers = figures["performers"]
    first = next(iter(performers.values()))
    yield f"A: {figures['a']}, B: {figures['b']}; performers: {', '.join(performers)}"
    if figures["props"]:
        yield f"props: {', '.join(figures['props'])}"
    frames = min(one["frame_count"] for one in performers.values())
    yield f"{frames} {'frame' if frames == 1 else 'frames'} compared, {1 / first['frame_time']:.4g} a second"
    for name, one in performers.items():
        for note in one["notes"]:
            yield f"{name}: {note}"
    yield from ("", *_table(performers), "")
    yield from _gaps(figures)


def _table(performers: dict[str, DiffDocument]) -> Iterator[str]:
    """A line per figure, of the figures of all performers in A, where it has one, and in B."""
    columns = [["figure", *(figure.label for figure in FIGURES)]]
    for name, one in performers.items():
        of_a, of_b = one["figures"]["source"], one["figures"]["result"]
        columns.append([f"{name} A", *(number(of_a[figure.key]) if figure.of_source else "" for figure in FIGURES)])
        columns.append([f"{name} B", *(number(of_b[figure.key]) for figure in FIGURES)])
    columns.append(["", *(f"[{figure.unit}]" if figure.unit else "" for figure in FIGURES)])
    widths = [max(map(len, column)) for column in columns]
    for label, *values, unit in zip(*columns, strict=True):
        numbers = "  ".join(f"{value:>{width}}" for value, width in zip(values, widths[1:-1], strict=True))
        yield f"{label:<{widths[0]}}  {numbers}  {unit}".rstrip()


def _gaps(figures: SceneDiffDocument) -> Iterator[str]:
    """The mean gap of all that touches, and a line for each of the parts that touch longest."""
    gaps = figures["gaps"]
    if not gaps:
        yield "nothing touches between them in A"
        return
    yield (
        f"what touches between them in A: {figures['gap_a']:.1f} % of a leg apart in A, {figures['gap_b']:.1f} in B, "
        f"off by {figures['gap_error']:.1f} on average; a unit of A's world is {figures['world_scale']:.3g} of B's"
    )
    for each in gaps[:MOST]:
        frames = "1 frame" if each["frames"] == 1 else f"{each['frames']} frames"
        yield (
            f"  {part(each['between'], each['regions'])}: {each['gap_a']:.1f}, {each['gap_b']:.1f} in {frames}; "
            f"worst in frame {each['worst_frame']}"
        )
    if len(gaps) > MOST:
        yield f"  and {len(gaps) - MOST} more"


def _over(figures: SceneDiffDocument) -> Iterator[str]:
    """The figures that are over their limits."""
    yield from over(figures["limits"])
    for name, one in figures["performers"].items():
        yield from (f"{name}'s {fault}" for fault in over(one["limits"]))
