"""`distretarget audit`: what is wrong with the clips of a folder as they are."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import click
from tqdm import tqdm

from distretarget.batch.audit import AuditedClip, audit, usual_limits
from distretarget.batch.plan import find_clips
from distretarget.cli.options import OVERWRITE_OPTION, PATH, limit_of, quiet
from distretarget.cli.outputs import aligned, check_outputs, check_suffix, complain, is_quiet, say, write_outputs
from distretarget.errors import BatchError, closest, counted
from distretarget.measure.clip_faults import KINDS, Finding

HEAD = ("clip", "frames", "frames/s", "leg", "up", "faults")
SIDES = "<>>><<"


def of_kind(text: str) -> tuple[str, float]:
    """The kind of fault and its limit in a text KIND=LIMIT."""
    name, _, number = text.partition("=")
    if name not in KINDS:
        raise click.BadParameter(f"there is no kind of fault {name!r}; {closest(name, tuple(KINDS))}")
    return name, limit_of(name, number)


@click.command("audit")
@click.argument("sources", nargs=-1, required=True, metavar="FOLDER...", type=PATH)
@click.option(
    "--limit",
    "given",
    type=of_kind,
    multiple=True,
    metavar="KIND=NUMBER",
    help=f"The number above which a clip has this fault; KIND is one of {', '.join(KINDS)}. May be given "
    "several times.",
)
@click.option(
    "--table", type=PATH, metavar="FILE", help="Write a CSV file with a row for each clip and the numbers of all kinds."
)
@click.option("--clip", metavar="NAME", help="The animation of a file that has several; '#2' is the second.")
@OVERWRITE_OPTION
@quiet
def audit_command(
    sources: tuple[Path, ...],
    given: tuple[tuple[str, float], ...],
    table: Path | None,
    clip: str | None,
    overwrite: bool,
) -> None:
    """Say what is wrong with the clips in a folder.

    There is no target: the clips are judged as they are. Found are poses before the motion begins, cuts, joints that
    jump or flip, frozen and repeated frames, feet that skate or go below the floor, bones that stretch, wrong units,
    axes, frame times and sides, duplicates, and files that cannot be read. FOLDER may be a file, too. Exit status 1 if
    a clip has a fault.

    \b
    distretarget audit mocap
    distretarget audit mocap --limit skating=1 --limit first_pose=1
    distretarget audit mocap --table audit.csv
    """  # noqa: D301
    check_suffix(table, ".csv")
    check_outputs([table], [], overwrite)
    if missing := [source for source in sources if not source.exists()]:
        raise click.UsageError(f"{missing[0]}: there is no such file or folder.")
    found, unread = find_clips(sources)
    if not found:
        raise BatchError("there are no clips to audit")
    with tqdm(total=len(found), unit=" clips", disable=is_quiet() or None, leave=False) as bar:
        clips = audit([path for path, _ in found], lambda _path: bar.update(), clip)
    limits = usual_limits() | dict(given)
    write_outputs({table: lambda: _csv(clips, limits)}, overwrite)
    faulty = [each for each in clips if each.faults(limits)]
    if faulty:
        for line in aligned([HEAD, *(_row(each, limits) for each in faulty)], SIDES):
            say(line)
    for line in _summary(clips, limits):
        say(line)
    for error in unread:
        complain(f"not searched: {error}")
    if faulty or unread:
        click.get_current_context().exit(1)


def _row(clip: AuditedClip, limits: Mapping[str, float]) -> tuple[str, ...]:
    faults = "; ".join(_text(kind, found) for kind, found in clip.faults(limits).items())
    if not clip.rig:
        return clip.name, "-", "-", "-", "-", faults
    return clip.name, str(clip.frames), f"{1 / clip.frame_time:.4g}", f"{clip.leg:.3g}", clip.up, faults


def _text(kind: str, found: Finding) -> str:
    """A fault in words: its kind, number and unit, and where it is."""
    unit, where = KINDS[kind].unit, [] if found.frame is None else [f"frame {found.frame}"]
    number = "" if KINDS[kind].plain else f"{found.value:.3g} {unit}".rstrip()
    number = counted(int(found.value), "frame") if unit == "frames" else number
    where += [found.where] if found.where else []
    return f"{kind} {number}".rstrip() + (f" ({', '.join(where)})" if where else "")


def _summary(clips: Sequence[AuditedClip], limits: Mapping[str, float]) -> Iterator[str]:
    """How many clips have faults, and of which kinds."""
    faults = [clip.faults(limits) for clip in clips]
    yield f"{counted(len(clips), 'clip')}: {sum(not each for each in faults)} without faults"
    counts = {kind: sum(kind in each for each in faults) for kind in KINDS}
    for kind, count in counts.items():
        if count:
            yield f"{count} {kind}: {KINDS[kind].meaning}"


def _csv(clips: Sequence[AuditedClip], limits: Mapping[str, float]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("clip", "frames", "frame_time", "leg", "up", "faults", *KINDS))
    for clip in clips:
        numbers = (clip.findings.get(kind) for kind in KINDS)
        size = (clip.frames, clip.frame_time, clip.leg, clip.up) if clip.rig else ("",) * 4
        cells = ("" if found is None else f"{found.value:.6g}" for found in numbers)
        writer.writerow((clip.name, *size, " ".join(clip.faults(limits)), *cells))
    return text.getvalue()
