"""Two scenes measured against each other, as `distretarget diff` does for folders and scene files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from distretarget.body.body import Body
from distretarget.cli.outputs import LISTED, about, aligned, check_outputs
from distretarget.errors import DistretargetError, FileError, MatchingError, counted, quoted
from distretarget.io.files import is_folder, reason_of
from distretarget.io.formats import MOTION_SUFFIXES
from distretarget.io.map_json import joint_map, load_map
from distretarget.io.motion_file import read_motion
from distretarget.measure.diff import Diff, diff, diff_scenes
from distretarget.measure.verdict import limit_warnings
from distretarget.motion import Motion
from distretarget.pipeline.retargeting import needs_map
from distretarget.report.diff_document import Table, Values, document
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

MOST = 10  # gaps that are printed


@dataclass(frozen=True)
class SceneInput:
    """The performers and props of a scene, by name."""

    path: Path  # of its file or folder
    motions: Mapping[str, Motion]
    files: Mapping[str, Path]  # where each motion was read
    setup: SceneSetup | None = None  # what the scene file says; None for a folder without one


@dataclass(frozen=True, eq=False, kw_only=True)
class Account:
    """A diff of clips or scenes, to be written and printed."""

    path: str | Path  # of B
    document: Mapping[str, object]
    page: Callable[[], str]  # makes the HTML report
    csv: Callable[[], str]
    lines: Sequence[str]
    faults: Sequence[str]  # metrics over their limits


def over(limits: Iterable[Values]) -> Iterator[str]:
    """Yield a clause for each metric that is over its limit."""
    for limit in limits:
        if limit["over"]:
            yield f"{limit['metric']} is {limit['value']:.6g}, over {limit['limit']:g}"


def over_limits(result: Diff) -> Iterator[str]:
    """Yield the verdict on B: a line for each metric over its limit, with the worst frame, or that there is none."""
    found = [*limit_warnings(result.metrics, {"result": result.tracks})]
    yield from (f"over a limit: {line}" for line in found)
    if not found:
        yield "B is within all limits; -v prints all metrics"


def is_scene(path: Path) -> bool:
    """Return whether a path leads to a scene: a folder, or a file named *.json."""
    return is_folder(path) or path.suffix.lower() == ".json"


def read_recorded_scene(path: Path) -> SceneInput:
    """Read the scene in a file, or in a folder: its scene.json, or else all motion files in it."""
    file = path / SCENE_NAME if is_folder(path) else path
    if file == path or file.is_file():
        setup = load_scene(file)
        sources, props = setup.read()
        motions = [each.looking_ahead() for each in (*sources, *(prop.motion for prop in props))]
        files = {clip.name: clip.file for clip in setup.clips}
        return SceneInput(path, dict(zip(files, motions, strict=True)), files, setup)
    try:
        found = sorted(one for one in path.iterdir() if one.suffix.lower() in MOTION_SUFFIXES and one.name[0] != ".")
    except OSError as error:
        raise FileError(path, reason_of(error)) from error
    if not found:
        raise FileError(path, f"has no motion file and no {SCENE_NAME} in it")
    files = {each.stem: each for each in found}
    return SceneInput(path, {name: read_motion(file).looking_ahead() for name, file in files.items()}, files)


def measure_scenes(
    a_path: Path,
    b_path: Path,
    outputs: Sequence[Path | None],
    map_path: Path | None,
    limits: Sequence[tuple[str, float]],
    world_scale: float | None,
    overwrite: bool,
    verbose: bool,
) -> Account:
    """Measure scene B against scene A, after a check that the outputs can be written."""
    for path, other in ((a_path, b_path), (b_path, a_path)):
        if not is_scene(path):
            raise FileError(path, f"is not a scene, but {str(other)!r} is; name two scenes or two clips")
    a, b = read_recorded_scene(a_path), read_recorded_scene(b_path)
    check_outputs(outputs, [*a.files.values(), *b.files.values(), a_path, b_path, map_path], overwrite)
    for scene, less in ((a, b), (b, a)):
        if missing := [name for name in scene.motions if name not in less.motions]:
            names = quoted(missing, LISTED)
            raise FileError(less.path, f"lacks {names}, in {str(scene.path)!r}; names have to be the same")
    props = _props(a, b)
    setup = a.setup if b.setup is None else None  # B may be a folder of results of A's scene file
    performers = _performers(a, b, [name for name in a.motions if name not in props], setup, map_path)
    try:
        pairs = [(a.motions[name], b.motions[name]) for name in props]
        scale = world_scale or (setup.world_scale if setup else None)
        result = diff_scenes([*performers.values()], pairs, world_scale=scale)
    except DistretargetError as error:
        raise error.in_file(b_path) from None
    run = about(a_path, b_path)
    of_scene, of_each = (tuple(limit for limit in limits if (limit[0] == GAP_ERROR) is own) for own in (True, False))
    documents = {
        name: document(one, replace(run, a=a.files[name].name, b=b.files[name].name, limits=of_each))
        for name, one in performers.items()
    }
    metrics = scene_document(result, documents, props, replace(run, limits=of_scene))
    faults = [f"{name}'s {fault}" for name, one in documents.items() for fault in over(one["limits"])]
    return Account(
        path=b_path,
        document=metrics,
        page=lambda: scene_diff_page(result, metrics),
        csv=lambda: scene_csv(metrics),
        lines=[*_lines(metrics, {} if verbose else {name: [*over_limits(one)] for name, one in performers.items()})],
        faults=[*over(metrics["limits"]), *faults],
    )


def _props(a: SceneInput, b: SceneInput) -> list[str]:
    """The names of the props: those in a scene file; without one, clips of A without legs if others have legs."""
    if setup := a.setup or b.setup:
        names = {prop.name for prop in setup.props}
        return [name for name in a.motions if name in names]
    without_legs = [name for name, motion in a.motions.items() if Body.of_motion(motion).legs is None]
    return without_legs if len(without_legs) < len(a.motions) else []


def _performers(
    a: SceneInput, b: SceneInput, names: Sequence[str], setup: SceneSetup | None, map_path: Path | None
) -> dict[str, Diff]:
    """Each performer of B measured against the same one of A, all with the axes that point up for the first.

    Without a map for all, those of the scene file that made B apply.
    """
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
    try:
        return diff(a, b, pairs, **ups)
    except MatchingError as error:
        raise needs_map(error, a_file, b_file) from error
    except DistretargetError as error:
        raise error.in_file(b_file) from None


def _lines(metrics: Values, verdicts: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """The lines that are printed, with the verdict on each performer, or all metrics if there are none."""
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
    yield from _table_lines(gaps, MOST)
    if (more := len(gaps["rows"]) - MOST) > 0:
        yield f"and {more} more"


def _table_lines(table: Table, most: int | None = None) -> Iterator[str]:
    """A line for the columns of a table and for each of its first rows."""
    rows = [table["columns"], *([str(cell) for cell in row] for row in table["rows"][:most])]
    return aligned(rows, "<" + ">" * (len(rows[0]) - 1))
