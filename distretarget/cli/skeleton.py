"""`distretarget skeleton`: show, edit and match skeletons, and write skeleton files."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import click
import numpy as np

from distretarget.body.body import Body
from distretarget.body.build import age_of, capsules_of, radii_of
from distretarget.body.conventions import convention_of
from distretarget.cli.options import (
    OVERWRITE_OPTION,
    STRIP_NAMESPACE_OPTION,
    FileOrStandard,
    map_option,
    positive,
    quiet,
    rest_option,
)
from distretarget.cli.outputs import STANDARD, check_outputs, check_suffix, read_input, say, table_lines, write_outputs
from distretarget.errors import FileError, closest, counted, cut
from distretarget.io.input_file import InputFile
from distretarget.io.map_json import joint_map, load_map, map_to_json
from distretarget.io.reading import parse_full_target, parse_motion, parse_target
from distretarget.io.skeleton_json import skeleton_to_json
from distretarget.matching.matching import Matching, find_matching, refusal
from distretarget.matching.unmatched import parts_without_source
from distretarget.pipeline.performer import target_capsules
from distretarget.skeleton import Skeleton
from distretarget.skin.capsules import LIMB_SEGMENTS, SEGMENTS, Capsules
from distretarget.target import SkeletonEdit, Target

METHODS = {"map": "map", "name": "equal name", "names": "names", "shape": "shape", "tip": "tip"}  # as printed
MATCHING = ("target joint", "source joint", "confidence", "method")  # the columns of the printed matching


def parse_bone(text: str) -> tuple[str, float]:
    """The name and the positive number in a text NAME=NUMBER."""
    name, _, number = text.rpartition("=")
    if not name:
        raise click.BadParameter(f"expected a bone, = and a number, found {text!r}")
    return name, positive(number)


@click.group("skeleton")
def skeleton_command() -> None:
    """Show, edit and match skeletons, and write skeleton files. - means standard input or output."""


@skeleton_command.command("show")
@click.argument("file", type=FileOrStandard())
def show_command(file: Path) -> None:
    """Print the tree of joints of FILE, a character, BVH or skeleton file, with bone lengths and the thickness of parts
    of the body.

    \b
    distretarget skeleton show hero.glb
    """  # noqa: D301
    target = _target_in(read_input(file))[1]
    skeleton = target.skeleton
    unit = f" {skeleton.units}" if skeleton.units else ""
    ends = int(skeleton.end_sites.sum())
    body = Body.of(skeleton)
    legs = f", legs {body.leg_length:.6g}{unit}" if body.legs else ""
    size = f"height {body.height:.6g}{unit}{legs}"
    say(f"{len(skeleton) - ends} joints, {ends} End Sites; {size}; {recognised(body)}")
    say(*_tree(skeleton))
    say(*_thickness(target, target_capsules(target), body.height))


@skeleton_command.command("export")
@click.argument("file", type=FileOrStandard())
@click.option(
    "-o",
    "--output",
    type=FileOrStandard(),
    default=STANDARD,
    help="The skeleton file to write. Default: standard output.",
)
@STRIP_NAMESPACE_OPTION
@OVERWRITE_OPTION
def export_command(file: Path, output: Path, strip_namespace: bool, overwrite: bool) -> None:
    """Write the skeleton of FILE as a target skeleton file, to edit it or to retarget to it.

    \b
    distretarget skeleton export hero.bvh -o hero.json
    """  # noqa: D301
    check_outputs([output], [file], overwrite)
    check_suffix(output, ".json")
    name, target = _target_in(read_input(file))
    skeleton, joint_map = target.skeleton, target.map
    if strip_namespace:
        skeleton = skeleton.without_namespaces
        joint_map = {skeleton.keys[target.skeleton.index(key)]: driver for key, driver in joint_map.items()}
    write_outputs({output: lambda: skeleton_to_json(skeleton, name, joint_map, _radii(target))}, overwrite)


@skeleton_command.command("edit")
@click.argument("file", type=FileOrStandard())
@click.option("--scale", type=positive, metavar="FACTOR", help="The factor for all bones and the root's offset.")
@click.option(
    "--length",
    "lengths",
    type=parse_bone,
    multiple=True,
    metavar="BONE=LENGTH",
    help="The final length of a bone [file units], not scaled. May be given several times.",
)
@click.option(
    "--factor",
    "factors",
    type=parse_bone,
    multiple=True,
    metavar="BONE=FACTOR",
    help="An additional factor for a bone. May be given several times.",
)
@click.option("-o", "--output", required=True, type=FileOrStandard(), help="The skeleton file to write.")
@OVERWRITE_OPTION
@quiet
def edit_command(
    file: Path,
    scale: float | None,
    lengths: tuple[tuple[str, float], ...],
    factors: tuple[tuple[str, float], ...],
    output: Path,
    overwrite: bool,
) -> None:
    """Write the skeleton of FILE with other bone lengths as a target skeleton file.

    BONE is the name of a bone's lower joint, or a pattern with * and ? for several bones: 'Left*' is every bone whose
    name begins with Left and whose length is not 0. Each bone may be named only once.

    \b
    distretarget skeleton edit hero.bvh --scale 1.1 -o tall_hero.json
    distretarget skeleton edit hero.bvh --length LeftLeg=42 --factor '*ForeArm=1.5' -o other.json
    """  # noqa: D301
    if scale is None and not lengths and not factors:
        raise click.UsageError("nothing to change; give --scale, --length or --factor.")
    check_outputs([output], [file], overwrite)
    check_suffix(output, ".json")
    given = read_input(file)
    name, target = _target_in(given)
    chosen = _bones(given.path, target.skeleton, {"--length": lengths, "--factor": factors})
    edit = SkeletonEdit(1.0 if scale is None else scale, chosen["--length"], chosen["--factor"], given.path)
    radii = {joint: edit.scale * radius for joint, radius in _radii(target).items()}
    edited = edit.apply(target.skeleton)
    write_outputs({output: lambda: skeleton_to_json(edited, name, target.map, radii)}, overwrite)
    changed = counted(int(np.sum(edited.lengths != target.skeleton.lengths)), "bone")
    unit = f" {edited.units}" if edited.units else ""
    say(f"{changed} changed; height {Body.of(target.skeleton).height:.6g} -> {Body.of(edited).height:.6g}{unit}")


@skeleton_command.command("match")
@click.argument("source", type=FileOrStandard())
@click.argument("target", type=FileOrStandard())
@map_option(type=FileOrStandard(), help="A map file whose pairs override all others.")
@rest_option(type=FileOrStandard())
@click.option("-o", "--output", type=FileOrStandard(), help="The map file to write.")
@OVERWRITE_OPTION
@quiet
def match_command(
    source: Path, target: Path, map_path: Path | None, rest_path: Path | None, output: Path | None, overwrite: bool
) -> None:
    """Print which joint of SOURCE drives which joint of TARGET, and write it as a map to edit.

    Both may be files of any kind. The method says how a pair was found: by a map, by equal names, by names or shape
    (both joints are the same part of the body, by their names or by their place in it), or as tips of matched joints.
    If source and target have different numbers of joints in the spine or neck, a target joint may blend two source
    joints.

    Give the map to 'distretarget retarget' with --map. It has null for joints without a driver, and the pose of --rest.

    \b
    distretarget skeleton match walk.bvh robot.bvh
    distretarget skeleton match walk.bvh robot.bvh -o walk_robot.map.json
    distretarget skeleton match walk.bvh hero.bvh --rest t_pose.bvh -o hero.map.json
    """  # noqa: D301
    check_outputs([output], [source, target, map_path, rest_path], overwrite)
    check_suffix(output, ".json")
    source_file, target_file = read_input(source), read_input(target)
    source_body = _body_in(source_file)
    whole_target = parse_target(target_file).for_source(source_body.skeleton)
    map_file = load_map(map_path, rest_path)
    if map_file.rest:
        map_file.rest.on(source_body.skeleton)
    pairs = joint_map(source_body.skeleton, whole_target, target_file.path, map_file)
    matching = find_matching(source_body, Body.of(whole_target.skeleton, whole_target.motion), pairs)
    of_target, joints = matching.target.skeleton, set(matching.target.skeleton.joints)
    rows = [MATCHING, *(_pair(matching, joint) for joint in of_target.depth_first if joint in joints)]
    say(*headline(matching), "", *table_lines(rows, "<<<<"), "", *parts_without_source(matching))
    say(f"joints of the target without a counterpart: {', '.join(matching.without_driver) or 'none'}")
    say(f"joints of the source not used: {', '.join(unused(matching)) or 'none'}")
    write_outputs({output: lambda: map_to_json(matching, map_file.rest)}, overwrite)
    if reason := refusal(matching):
        map_name = str(output) if output else "a map, which -o MAP.json writes,"
        raise FileError(target_file.path, f"{reason}; fill in {map_name} and give it with --map")


def _target_in(file: InputFile) -> tuple[str, Target]:
    """The target in a file, and its name, or else the file's."""
    target = parse_full_target(file)
    return target.name or Path(file.path).stem, target


def _radii(target: Target) -> Mapping[int, float]:
    """The radii of joints in a target's file, or measured on its mesh [file units]."""
    mesh = target.mesh()
    return target.radii if mesh is None else radii_of(capsules_of(Body.of(target.skeleton), mesh))


def _body_in(file: InputFile) -> Body:
    """The body in a source's file, from its motion, or if it has none from its rest pose."""
    if file.kind != "skeleton":
        with contextlib.suppress(FileError):  # no animation, or several
            return Body.of_motion(parse_motion(file)[0])
    return Body.of(_target_in(file)[1].skeleton)


def _bones(
    file: str | Path, skeleton: Skeleton, given: Mapping[str, Sequence[tuple[str, float]]]
) -> dict[str, dict[str, float]]:
    """The numbers `given` to bones, by option and bone; a FileError if a name matches none, or one is named twice."""
    bones = [key for key, length in zip(skeleton.keys, skeleton.lengths, strict=True) if length > 0]
    chosen: dict[str, dict[str, float]] = {option: {} for option in given}
    named_by: dict[str, str] = {}
    for option, name, number in ((option, *each) for option, pairs in given.items() for each in pairs):
        named = [name] if name in skeleton.keys else [key for key in bones if fnmatchcase(key, name)]
        if not named:
            raise FileError(file, f"{option} {name}: no such bone; {closest(name, bones)}")
        for key in named:
            if key in named_by:
                both = f"{named_by[key]} and {option} {name}"
                raise FileError(file, f"{both} are both for the bone {key!r}; each bone may be named only once")
            named_by[key], chosen[option][key] = f"{option} {name}", number
    return chosen


def _thickness(target: Target, capsules: Capsules, height: float) -> Iterator[str]:
    """The lines on a body's thickness: the parts, their mean thickness, and the same in % of the height."""
    if not len(capsules):
        return
    average = f"an average {age_of(Body.of(target.skeleton, target.motion))}"
    source = "its mesh" if target.mesh() else f"its file and {average}" if target.radii else average
    unit = f" [{target.skeleton.units}]" if target.skeleton.units else ""
    yield f"thickness of {source}{unit}, and in % of the height:"
    names = [SEGMENTS[segment].removeprefix("left ").removeprefix("right ") for segment in capsules.segments]
    rows = []
    for name in (*LIMB_SEGMENTS, *SEGMENTS):
        if name in names:
            thick = 2.0 * float(capsules.radii[[each == name for each in names]].mean())
            rows.append((f"  {name}", f"{thick:.4g}", f"{100.0 * thick / height:.1f} %"))
    yield from table_lines(rows, "<>>")


def _tree(skeleton: Skeleton) -> Iterator[str]:
    """The lines of the tree, one for each joint: branches, name, and length of its bone."""
    indents, rows = {0: ""}, [(skeleton.names[0], "")]
    for joint in skeleton.depth_first[1:]:
        parent = int(skeleton.parents[joint])
        last = joint == skeleton.children[parent][-1]
        branch = indents[parent] + ("└─ " if last else "├─ ")
        indents[joint] = indents[parent] + ("   " if last else "│  ")
        end_site = "  End Site" if skeleton.end_sites[joint] else ""
        rows.append((branch + cut(skeleton.names[joint]), f"{skeleton.lengths[joint]:10.4f}{end_site}"))
    return table_lines(rows, "<<")


def recognised(body: Body) -> str:
    """Return a phrase that says how the parts of a body were recognised."""
    if body.anatomy and body.anatomy.method == "humanoid":
        return "joints as the humanoid in the file says"
    if title := convention_of(body.skeleton):
        return f"joints named as in {title}"
    return f"joints recognised by {body.anatomy.method}" if body.anatomy else "no human body recognised"


def headline(matching: Matching) -> Iterator[str]:
    """Yield lines on how source and target were recognised, and how many joints each method matched."""
    for name, body in (("source", matching.source), ("target", matching.target)):
        yield f"{name}: {recognised(body)}"
    joints = matching.target.skeleton.joints
    times = Counter(matching.method[joint] for joint in joints if matching.method[joint])
    counts = ", ".join(f"{times[method]} by {words}" for method, words in METHODS.items() if times[method])
    yield f"matched: {times.total()} of the target's {len(joints)} joints{f' ({counts})' if counts else ''}"


def _pair(matching: Matching, joint: int) -> tuple[str, str, str, str]:
    key, driver = matching.target.skeleton.keys[joint], matching.drivers[joint]
    if driver < 0:
        return cut(key), "-", "", _rotation(matching, joint)
    method = ", ".join(filter(None, (METHODS[matching.method[joint]], _rotation(matching, joint))))
    return cut(key), cut(matching.source.skeleton.keys[driver]), f"{100 * matching.confidence[joint]:.0f} %", method


def _rotation(matching: Matching, joint: int) -> str:
    """A phrase on the source joints whose rotations a joint follows; empty if that is its driver alone."""
    keys, weight = matching.source.skeleton.keys, matching.blend[joint]
    (a, b), driver = matching.rotation_sources[joint], matching.drivers[joint]
    if a == b or weight in (0, 1):
        only = b if weight == 1 else a
        return "" if only == driver else f"rotation of {keys[only]}"
    return f"rotation between {keys[a]} and {keys[b]}"


def unused(matching: Matching) -> list[str]:
    """Return the source's joints that no target joint follows, without End Sites."""
    used = {*matching.drivers.tolist(), *matching.rotation_sources.ravel().tolist()}
    source = matching.source.skeleton
    return [source.keys[joint] for joint in source.joints if joint not in used]
