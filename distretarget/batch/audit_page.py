"""The page on the faults of the clips of a folder, with their worst frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape

from distretarget.batch.audit import AuditedClip
from distretarget.errors import counted
from distretarget.measure.clip_faults import KINDS, Finding
from distretarget.report.page import folder_of, html_page


def audit_page(clips: Sequence[AuditedClip], limits: Mapping[str, float], title: str) -> str:
    """Return the HTML of the page, for limits by kind of fault."""
    summary = "\n".join(f"<p>{escape(line)}</p>" for line in summary_lines(clips, limits))
    worst = sorted((clip for clip in clips if clip.faults(limits)), key=lambda clip: -len(clip.faults(limits)))
    folder = folder_of(clip.name for clip in clips)
    rows = "\n".join(_row(clip, clip.name.removeprefix(folder), limits) for clip in worst)
    return html_page("audit", title, {}, summary=summary, rows=rows)


def _row(clip: AuditedClip, name: str, limits: Mapping[str, float]) -> str:
    faults = "".join(
        f"<div><p>{escape(fault_text(kind, found))}</p>{clip.pictures.get(kind, '')}</div>"
        for kind, found in clip.faults(limits).items()
    )
    size = f"<br><small>{counted(clip.frames, 'frame')}, {1 / clip.frame_time:.4g} frames/s</small>" if clip.rig else ""
    return f'<tr><th scope="row">{escape(name)}{size}</th><td><div>{faults}</div></td></tr>'


def fault_text(kind: str, found: Finding) -> str:
    """Return a fault in words: its kind, number and unit, and where it is."""
    unit, where = KINDS[kind].unit, [] if found.frame is None else [f"frame {found.frame}"]
    number = "" if KINDS[kind].plain else f"{found.value:.3g} {unit}".rstrip()
    number = counted(int(found.value), "frame") if unit == "frames" else number
    where += [found.where] if found.where else []
    return f"{kind} {number}".rstrip() + (f" ({', '.join(where)})" if where else "")


def summary_lines(clips: Sequence[AuditedClip], limits: Mapping[str, float]) -> Iterator[str]:
    """Yield how many clips have faults, and of which kinds."""
    faults = [clip.faults(limits) for clip in clips]
    yield f"{counted(len(clips), 'clip')}: {sum(not each for each in faults)} without faults"
    counts = {kind: sum(kind in each for each in faults) for kind in KINDS}
    for kind, count in counts.items():
        if count:
            yield f"{count} {kind}: {KINDS[kind].meaning}"
