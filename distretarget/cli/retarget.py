"""`distretarget retarget`: retarget one clip."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import get_args

import click
from tqdm import tqdm

from distretarget.baseline.world import RootOffset
from distretarget.cli.options import (
    OVERWRITE_OPTION,
    STRIP_NAMESPACE_OPTION,
    FileOrStandard,
    RecipeFiles,
    contacts_option,
    conversion_options,
    file_option,
    quiet,
)
from distretarget.cli.outputs import (
    LISTED,
    STANDARD,
    about,
    check_outputs,
    is_quiet,
    read_input,
    read_source,
    say,
    write_outputs,
)
from distretarget.cli.skeleton import headline, unused
from distretarget.contact_entries import NO_CONTACTS
from distretarget.errors import DistretargetError, FileError, in_file, quoted
from distretarget.io.bvh import declared_frames
from distretarget.io.bvh_writer import bvh_parts, python_refusals, refusals
from distretarget.io.contacts_file import load_contacts
from distretarget.io.files import Content, is_folder
from distretarget.io.input_file import OUTPUTS, InputFile, load_file
from distretarget.io.motion_writer import content_of, output_kind
from distretarget.io.reading import CharacterTarget, TargetFile, animations_in
from distretarget.matching.unmatched import others_without_source, parts_without_source
from distretarget.motion import Motion, check_usable
from distretarget.pipeline.result import RetargetResult
from distretarget.pipeline.retargeting import Conversion, Recipe, argument
from distretarget.report.clip_page import run_page
from distretarget.report.diff_document import metrics_json, metrics_line, summary_line
from distretarget.studio.order import Project, load_project


def _take_project(context: click.Context, _option: click.Parameter, path: Path | None) -> Project | None:
    """Take defaults for all other parameters from a project file."""
    project = load_project(path) if path else None
    if project:
        context.default_map = project.defaults
    return project


@click.command("retarget")
@file_option(
    "--project",
    is_eager=True,
    callback=_take_project,
    help="A project file of the studio, beside its clip and its character. It gives SOURCE, TARGET, OUTPUT and all "
    "other settings that are not on the command line.",
)
@click.argument("source", type=FileOrStandard())
@click.argument("target", type=FileOrStandard())
@click.option(
    "-o",
    "--output",
    required=True,
    type=FileOrStandard(),
    help="The file to write: .bvh, .vrma, or TARGET with its motion, .glb, .gltf or .vrm.",
)
@OVERWRITE_OPTION
@click.option("--add", is_flag=True, help="If OUTPUT exists and is a result on the same TARGET, add the motion to it.")
@conversion_options(
    contacts_option(
        help="Contacts to drop, add or change, parts to hold in place, distances and directions to keep. "
        "'distretarget contacts' writes such a file to edit."
    )
)
@STRIP_NAMESPACE_OPTION
@click.option("--json", "metrics", type=FileOrStandard(), help="Write the metrics of each frame to this file.")
@file_option(
    "--report",
    type=FileOrStandard(),
    help="Write an HTML report to this file: result and rotation copy, measured against the source.",
)
@click.option(
    "-v", "--verbose", is_flag=True, help="Print the recognised and matched joints, the axes, OFFSET and scale used."
)
@quiet
def retarget_command(
    project: Project | None,
    source: Path,
    target: Path,
    output: Path,
    overwrite: bool,
    add: bool,
    recipe_files: RecipeFiles,
    contacts_path: Path | None,
    metrics: Path | None,
    report: Path | None,
    strip_namespace: bool,
    verbose: bool,
) -> None:
    """Retarget the motion of SOURCE to the body of TARGET.

    SOURCE is BVH, glTF (.glb, .gltf), VRM, a VRM animation (.vrma), FBX, or arrays (.npz, .npy): parameters of SMPL, or
    positions of joints, with --skeleton. TARGET is a character, in the same formats, or a skeleton file (.json). Names,
    rest pose and axes may differ from SOURCE; 'distretarget skeleton match' shows the pairs of joints. A glTF or VRM
    character can be written with its mesh and the motion. - means standard input or output.

    \b
    distretarget walk.bvh hero.glb -o hero_walk.glb
    distretarget dance.fbx hero.vrm -o hero_dance.vrm
    distretarget run.glb child.json -o run_child.bvh --clip Run
    distretarget walk.bvh hero.bvh -o walk_hero.bvh --json walk_hero.metrics.json
    distretarget walk.bvh hero.bvh -o walk_hero.bvh --report walk_hero.html
    distretarget walk.bvh robot.bvh -o walk_robot.bvh --map walk_robot.map.json -v
    distretarget amass.npz hero.glb -o hero.glb --skeleton smplx_neutral.npz
    distretarget clap.bvh hero.glb -o hero_clap.glb --contacts clap.contacts.json
    distretarget jump.bvh hero.glb -o hero_all.glb --add
    distretarget retarget --project clap_hero.project.json
    cat walk.bvh | distretarget - child.json -o - > walk_child.bvh
    """  # noqa: D301
    if is_folder(source):
        raise click.UsageError(f"{source} is a folder; 'distretarget batch' retargets all clips of a folder.")
    if add and OUTPUTS.get(output.suffix.lower()) != "character":
        raise click.UsageError(f"--add: {output} holds one motion; expected the name of a .glb, .gltf or .vrm file.")
    onto = output if add and output.exists() else None
    check_outputs([output, metrics, report], [source, target, contacts_path, *recipe_files.paths], overwrite, onto)
    started = time.perf_counter()
    source_file, target_file = read_source(source, recipe_files.skeleton_path), read_input(target)
    recipe, contacts = recipe_files.read(), project.order.contacts if project else NO_CONTACTS
    if contacts_path:
        contacts = load_contacts(contacts_path)
    if project and not recipe_files.map_path:
        recipe = project.with_map(recipe)
    motion, lost = _source_motion(source_file, target_file, recipe)
    kind = "BVH" if output == STANDARD else output_kind(output, target_file)
    if source_file.kind == "BVH":
        source_file = replace(source_file, content=b"")  # frees it: the motion has all
    body = TargetFile.of(target_file)
    with tqdm(total=len(motion), unit=" frames", desc=source.name, disable=is_quiet() or None, leave=False) as bar:
        ready = Conversion.of(motion, source_file, body, recipe)
        done = ready.converted(recipe.name_of(source_file), (kind,), contacts, progress=bar.update)
    result, named = done.result, done.clip
    if strip_namespace and kind == "BVH":
        plain = replace(named.motion, skeleton=named.motion.skeleton.without_namespaces)
        named = replace(named, motion=plain)
    before = load_file(onto) if onto else None
    content = bvh_parts(named.motion) if output == STANDARD else content_of(output, named, body, recipe.writing, before)
    seconds = time.perf_counter() - started
    contents: dict[Path | None, Callable[[], Content]] = {
        output: lambda: content,
        metrics: lambda: metrics_json(result),
        report: lambda: run_page(result, about(Path(source_file.path), output), body.target, source_file),
    }
    write_outputs(contents, overwrite, onto)
    content = ()  # frees its numbers before metrics are measured
    left_out = body.target.warnings if isinstance(body.target, CharacterTarget) else ()
    others = (f"{joints}; see -v" for joints in others_without_source(result.matching))
    say(*(_verbose_lines(result) if verbose else others), err=True)
    warnings = (*parts_without_source(result.matching), *done.left_out(lost), *left_out, *result.warnings)
    say(*(f"warning: {warning}" for warning in warnings), err=True)
    if kind == "BVH":
        skeleton = named.motion.skeleton
        say(*refusals(skeleton), *(python_refusals(skeleton) if verbose else ()), err=True)
    say(summary_line(result, seconds))


def _source_motion(source: InputFile, target: InputFile, recipe: Recipe) -> tuple[Motion, tuple[str, ...]]:
    """The motion of the source, and what is left out; if only the target has a motion, the error tells their order."""
    try:
        motion, lost = recipe.read(source)
        with in_file(source.path):
            check_usable(motion, "the source")
        return motion, lost
    except DistretargetError:
        if _has_motion(source) or not _has_motion(target):
            raise
    suffix = ".glb" if source.kind == "glTF" else ".bvh"
    swapped = f"distretarget {argument(target.path)} {argument(source.path)} -o OUT{suffix}"
    raise FileError(
        source.path, f"has no motion, expected one as SOURCE; if it is the target, it comes last: {swapped}"
    )


def _has_motion(file: InputFile) -> bool:
    """Whether a file has frames or animations, or cannot be read."""
    if file.kind == "BVH":
        return declared_frames(file.text) != 0
    return file.kind == "arrays" or bool(animations_in(file))


def _verbose_lines(result: RetargetResult) -> Iterator[str]:
    """The lines of --verbose."""
    yield from headline(result.matching)
    for what, joints in (
        ("joints of the target that follow their parents", result.matching.followers),
        ("joints of the source not used", unused(result.matching)),
    ):
        yield f"{what}: {quoted(joints, LISTED) or 'none'}"
    up, source_up = result.world.up, result.world.source_up
    target_up = "the same in the target" if up == source_up else f"{up} in the target: the world is turned"
    yield f"up: {source_up} in the source, {target_up}"
    yield _root_offset(result)
    yield f"root scale: {result.root_scale:.6g} target units per source unit"
    yield metrics_line(result)


def _root_offset(result: RetargetResult) -> str:
    """The line of --verbose on the OFFSET of the source's root."""
    offset = result.source.skeleton.offsets[0]
    if not offset.any():
        return "the source's root has OFFSET 0, so replacing it and adding to it are the same"
    other = next(choice for choice in get_args(RootOffset) if choice != result.world.root_offset)
    effect = {"replaced": "replaces it", "added": "is added to it"}[result.world.root_offset]
    numbers = " ".join(f"{number:.6g}" for number in offset)
    return f"the source's root has OFFSET {numbers}: its position {effect}; --root-offset {other} for the other reading"
