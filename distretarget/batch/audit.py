"""Find faults in the clips of a folder, in each alone and against others of its rig; a page shows the worst frames."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from distretarget.batch.pages import folder_of
from distretarget.batch.plan import animations_of
from distretarget.body.body import Body
from distretarget.errors import DistretargetError, counted
from distretarget.io.input_file import load_file
from distretarget.io.reading import parse_motion
from distretarget.measure.clip_faults import KINDS, Finding, Findings, find_faults
from distretarget.motion import Motion
from distretarget.report.page import html_page
from distretarget.stick_figures import stick_figures

LEAST_CLIPS = 3  # clips of a rig that are needed to compare each with most of them
COMPARED_FRAMES = 16  # frames in which two clips are compared
SAME_POSITION = 1e-3  # joints this near to each other are at the same position [leg lengths]
LIMITS = {key: kind.limit for key, kind in KINDS.items()}  # default limits by kind of fault


@dataclass(frozen=True, eq=False, kw_only=True)
class AuditedClip:
    """A clip and its findings."""

    path: Path
    findings: Findings  # by kind of fault, without those that could not be measured
    animation: str | None = None  # one of several in the file, such as "#2"
    rig: tuple[tuple[str, ...], bytes] | None = None  # names and tree of the joints; None if the file cannot be read
    frames: int = 0
    frame_time: float = 0.0  # [s]
    leg: float = 0.0  # the length of a leg [file units]
    up: str = ""  # the axis that points up
    pictures: Mapping[str, str] = field(default_factory=dict)  # SVG of the worst frame and its neighbours, by kind
    # joints in some frames, relative to the root in the first frame, (frames, joints, 3) [leg lengths]
    positions: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0, 3), np.float32))

    @property
    def name(self) -> str:
        """The path of the file, with the animation if it has several."""
        return f"{self.path} {self.animation}" if self.animation else str(self.path)

    def faults(self, limits: Mapping[str, float]) -> Findings:
        """Return the findings above their limits by kind, in the order of `KINDS`."""
        found = self.findings
        return {kind: found[kind] for kind in KINDS if kind in found and found[kind].value > limits[kind]}


def audit(paths: Iterable[Path], clip: str | None = None, pictures: bool = False) -> list[AuditedClip]:
    """Return the audited clips of some files; each animation in a file is a clip, unless `clip` names one."""
    clips = [_audited(path, number, pictures) for path in paths for number in ([clip] if clip else animations_of(path))]
    rigs = defaultdict(list)
    for each in clips:
        if each.rig:
            rigs[each.rig].append(each)
    for of_rig in rigs.values():
        _find_duplicates(of_rig)
        if len(of_rig) >= LEAST_CLIPS:
            _compare(of_rig)
    return clips


def _audited(path: Path, clip: str | None, pictures: bool) -> AuditedClip:
    try:
        motion, _ = parse_motion(load_file(path), clip)
        findings = find_faults(motion)
    except DistretargetError as error:
        findings = {"unreadable": Finding(1.0, None, error.reason)}
    audited = AuditedClip(path=path, animation=clip, findings=findings)
    if "unreadable" in findings:
        return audited
    body = Body.of_motion(motion)
    sampled = np.linspace(0, len(motion) - 1, min(COMPARED_FRAMES, len(motion))).astype(int)
    return replace(
        audited,
        rig=(motion.skeleton.names, motion.skeleton.parents.tobytes()),
        frames=len(motion),
        frame_time=motion.frame_time,
        leg=body.leg,
        up=body.up,
        pictures=dict(_pictures(motion, body, findings)) if pictures else {},
        positions=np.asarray((motion.positions[sampled] - motion.positions[0, 0]) / body.leg, np.float32),
    )


def _pictures(motion: Motion, body: Body, findings: Findings) -> Iterator[tuple[str, str]]:
    """Yield each kind of fault with a picture of its worst frame and the frames before and after it."""
    skeleton = motion.skeleton
    for kind, found in findings.items():
        if found.frame is not None:
            first, end = max(found.frame - 1, 0), min(found.frame + 2, len(motion))
            marked = skeleton.keys.index(found.where) if found.where in skeleton.keys else -1
            label = f"frames {first} to {end - 1}"
            yield kind, stick_figures(skeleton.parents, motion.positions[first:end], body.up_vector, label, marked)


def _find_duplicates(clips: Sequence[AuditedClip]) -> None:
    """Add a finding to each clip of a rig: whether an earlier one has the same motion, at any size and position."""
    seen: dict[int, list[AuditedClip]] = defaultdict(list)
    for clip in clips:
        differences = ((one, np.abs(one.positions - clip.positions).max(initial=0.0)) for one in seen[clip.frames])
        first = next((one for one, difference in differences if difference < SAME_POSITION), None)
        clip.findings["duplicate"] = Finding(float(first is not None), None, f"of {first.name}" if first else "")
        if first is None:
            seen[clip.frames].append(clip)


def _compare(clips: Sequence[AuditedClip]) -> None:
    """Add findings to the clips of a rig whose unit, up axis or frame time differs from that of most."""
    leg = float(np.median([clip.leg for clip in clips]))
    up, most_up = Counter(clip.up for clip in clips).most_common(1)[0]
    rates = Counter(round(1.0 / clip.frame_time, 1) for clip in clips)
    rate, most_rate = rates.most_common(1)[0]
    for clip in clips:
        ratio = clip.leg / leg
        size = f"{ratio:.3g} times as large as most" if ratio < 1 / 1.01 or ratio > 1.01 else ""
        clip.findings["unit"] = Finding(max(ratio, 1.0 / ratio), None, size)
        if clip.up != up and 2 * most_up > len(clips):
            clip.findings["up_axis"] = Finding(1.0, None, f"{clip.up} is up, {up} in most")
        if 2 * most_rate > len(clips) and "frame_time" not in clip.findings:
            off = 100.0 * abs(clip.frame_time * rate - 1.0)
            own = f"{1.0 / clip.frame_time:.4g} frames/s, {rate:.4g} in most" if off > KINDS["frame_time"].limit else ""
            clip.findings["frame_time"] = Finding(off, None, own)


def audit_page(clips: Sequence[AuditedClip], limits: Mapping[str, float], title: str) -> str:
    """Return the HTML page on audited clips, for limits by kind of fault."""
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
    """Return a text on a fault: its kind, value and unit, frame and joint."""
    unit = KINDS[kind].unit
    number = "" if KINDS[kind].plain else f"{found.value:.3g} {unit}".rstrip()
    number = counted(int(found.value), "frame") if unit == "frames" else number
    where = ", ".join(filter(None, ("" if found.frame is None else f"frame {found.frame}", found.where)))
    return f"{kind} {number}".rstrip() + (f" ({where})" if where else "")


def summary_lines(clips: Sequence[AuditedClip], limits: Mapping[str, float]) -> Iterator[str]:
    """Yield lines that count the clips without faults, and those with each kind of fault."""
    faults = [clip.faults(limits) for clip in clips]
    yield f"{counted(len(clips), 'clip')}: {sum(not each for each in faults)} without faults"
    for kind in KINDS:
        if count := sum(kind in each for each in faults):
            yield f"{count} {kind}: {KINDS[kind].meaning}"
