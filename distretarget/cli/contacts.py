"""`distretarget contacts`: list the contacts that are detected in a clip."""

from __future__ import annotations

from pathlib import Path

import click

from distretarget.cli.options import OVERWRITE_OPTION, PATH, FileOrStandard, map_option, quiet, reading_options
from distretarget.cli.outputs import check_outputs, read_input, read_source, say, table_lines, write_outputs
from distretarget.errors import in_file
from distretarget.io.contacts_file import contacts_to_json
from distretarget.io.map_json import joint_map, load_map
from distretarget.io.reading import TargetFile, parse_motion
from distretarget.pipeline.found_contacts import find_contacts


@click.command("contacts")
@click.argument("source", metavar="CLIP", type=FileOrStandard())
@click.argument("target", required=False, type=PATH)
@click.option("-o", "--output", type=FileOrStandard(), help="Write the list to this file, which --contacts takes.")
@OVERWRITE_OPTION
@reading_options
@map_option(help='A JSON file with {"target joint": "source joint"}, as in retarget.')
@quiet
def contacts_command(
    source: Path,
    target: Path | None,
    output: Path | None,
    overwrite: bool,
    clip: str | None,
    fps: float | None,
    skeleton_path: Path | None,
    map_path: Path | None,
) -> None:
    """List the contacts that are found in CLIP.

    A contact is two parts of the body that touch, or a part that rests on the floor or on something else. Frames count
    from 0. Gaps are between skins, of an average body with the performer's bones. Give TARGET, too, if
    its joints have other names. Edit the file that -o writes, and give it to --contacts.

    \b
    distretarget contacts clap.bvh
    distretarget contacts clap.bvh hero.json -o clap.contacts.json
    distretarget clap.bvh hero.json -o clap_hero.bvh --contacts clap.contacts.json
    """  # noqa: D301
    check_outputs([output], [source, target, skeleton_path, map_path], overwrite)
    motion, _ = parse_motion(read_source(source, skeleton_path), clip, fps)
    body = pairs = None
    if target is not None:
        file = TargetFile.of(read_input(target))
        body = file.target.for_source(motion.rigid_skeleton)
        pairs = joint_map(motion.rigid_skeleton, body, file.path, load_map(map_path))
    with in_file(source):
        found = find_contacts(motion, body, joint_map=pairs)
    write_outputs({output: lambda: contacts_to_json(found)}, overwrite)
    spans = ["frames {:.0f}-{:.0f}".format(*(entry.frames or (0, 0))) for entry in found]
    names = [" - ".join(entry.names) for entry in found]
    for line in table_lines([*zip(names, spans, [entry.found for entry in found], strict=True)], "<<<"):
        say(line)
    if not len(found):
        say("no contacts found: no parts of the body touch, and none is planted")
