"""`distretarget audit`: find faults in the clips of a folder."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path

import click
from tqdm import tqdm

from distretarget.batch.audit import LIMITS, AuditedClip, audit, audit_page, fault_text, summary_lines
from distretarget.batch.plan import find_clips
from distretarget.cli.options import CLIP_OPTION, OVERWRITE_OPTION, PATH, file_option, limit_of, quiet
from distretarget.cli.outputs import check_outputs, check_suffix, complain, is_quiet, say, table_lines, write_outputs
from distretarget.errors import BatchError
from distretarget.measure.clip_faults import KINDS
from distretarget.report.diff_document import csv_lines


@click.command("audit")
@click.argument("sources", nargs=-1, required=True, metavar="FOLDER...", type=PATH)
@click.option(
    "--limit",
    "given",
    type=limit_of(tuple(KINDS)),
    multiple=True,
    metavar="KIND=NUMBER",
    help=f"The value above which a clip has this fault; KIND is one of {', '.join(KINDS)}. May be given several times.",
)
@file_option("--table", help="Write a CSV file with a row for each clip and a column for each kind of fault.")
@file_option("--report", help="Write an HTML page with the worst frame of each fault.")
@CLIP_OPTION
@OVERWRITE_OPTION
@quiet
def audit_command(
    sources: tuple[Path, ...],
    given: tuple[tuple[str, float], ...],
    table: Path | None,
    report: Path | None,
    clip: str | None,
    overwrite: bool,
) -> None:
    """Find faults in the clips of a folder.

    Faults are poses before the motion begins, cuts, joints that jump or flip, frozen and repeated frames, feet
    that skate or go below the floor, bones that stretch, wrong units, axes, frame times and sides, duplicates, and
    files that cannot be read. FOLDER may also be a file. If a clip has a fault, the exit status is 1.

    \b
    distretarget audit mocap
    distretarget audit mocap --limit skating=1 --limit first_pose=1
    distretarget audit mocap --table audit.csv --report audit.html
    """  # noqa: D301
    check_suffix(table, ".csv")
    check_suffix(report, ".html")
    check_outputs([table, report], [], overwrite)
    if missing := [source for source in sources if not source.exists()]:
        raise click.UsageError(f"{missing[0]}: there is no such file or folder.")
    found, unread = find_clips(sources)
    if not found:
        raise BatchError("there are no clips to audit")
    bar = tqdm([path for path, _ in found], unit=" clips", disable=is_quiet() or None, leave=False)
    clips = audit(bar, clip, pictures=report is not None)
    limits = LIMITS | dict(given)
    title = f"Audit of {', '.join(source.resolve().name for source in sources)}"
    columns = ("clip", "frames", "frame_time", "leg", "up", "faults", *KINDS)
    rows = csv_lines(columns, (_cells(clip, limits) for clip in clips))
    write_outputs({table: lambda: rows, report: lambda: audit_page(clips, limits, title)}, overwrite)
    faulty = [each for each in clips if each.faults(limits)]
    if faulty:
        head = ("clip", "frames", "frames/s", "leg", "up", "faults")
        shown = [head]
        for each in faulty:
            faults = "; ".join(fault_text(kind, found) for kind, found in each.faults(limits).items())
            rig = (str(each.frames), f"{1 / each.frame_time:.4g}", f"{each.leg:.3g}", each.up) if each.rig else "----"
            shown.append((each.name, *rig, faults))
        say(*table_lines(shown, "<>>><<"))
    say(*summary_lines(clips, limits))
    complain(*(f"not searched: {error}" for error in unread))
    if faulty or unread:
        click.get_current_context().exit(1)


def _cells(clip: AuditedClip, limits: Mapping[str, float]) -> dict[str, object]:
    size = {"frames": clip.frames, "frame_time": clip.frame_time, "leg": clip.leg, "up": clip.up} if clip.rig else {}
    found = {kind: Decimal(f"{each.value:.6g}") for kind, each in clip.findings.items()}
    return {"clip": clip.name, "faults": " ".join(clip.faults(limits)), **size, **found}
