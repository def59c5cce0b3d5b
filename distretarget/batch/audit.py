"""The clips of a folder as they are: what is wrong with each, by itself and among the others of its rig."""

from __future__ import annotations

import hashlib
import json
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePath

import numpy as np
from numpy.typing import NDArray

from distretarget.batch.plan import animations_of
from distretarget.body.body import Body
from distretarget.errors import DistretargetError
from distretarget.io.input_file import load_file
from distretarget.io.motion_file import parse_motion
from distretarget.measure.clip_faults import KINDS, Finding, Findings, find_faults
from distretarget.motion import Motion
from distretarget.stick_figures import stick_figures

LEAST = 3  # clips of a rig that show what is usual
SAMPLES = 16  # frames by which two clips are compared
ALIKE = 1e-3  # joints this near to each other are at the same place [leg lengths]


@dataclass(frozen=True, eq=False, kw_only=True)
class AuditedClip:
    """A clip, and what was found of each kind of fault.

    Attributes:
        path: of the file.
        animation: which of several in the file, such as "#2"; None for the only one.
        findings: by the key of the kind; kinds that could not be measured are missing.
        rig: a hash of names and tree of the joints; empty if the file cannot be read.
        frames: their number.
        frame_time: [s].
        leg: the length of a leg [file units].
        up: the axis that points up.
        pictures: SVG of the worst frame of each kind of fault, if they are asked for, and the frames around it.
        places: of the joints in some frames, from that of the first joint in the first frame [leg lengths].
    """

    path: Path
    findings: Findings
    animation: str | None = None
    rig: str = ""
    frames: int = 0
    frame_time: float = 0.0
    leg: float = 0.0
    up: str = ""
    pictures: Mapping[str, str] = field(default_factory=dict)
    places: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0, 3), np.float32))

    @property
    def name(self) -> str:
        """The path of the file, and which animation in it."""
        return f"{self.path} {self.animation}" if self.animation else str(self.path)

    def faults(self, limits: Mapping[str, float]) -> Findings:
        """Return the findings above their limits, by kind, in the order of `KINDS`."""
        found = {kind: self.findings[kind] for kind in KINDS if kind in self.findings}
        return {kind: each for kind, each in found.items() if each.value > limits[kind]}


def audit(
    paths: Iterable[Path],
    show: Callable[[Path], object] = lambda _path: None,
    clip: str | None = None,
    pictures: bool = False,
) -> list[AuditedClip]:
    """Return what is wrong with the clips in some files, in their order, with or without pictures.

    Of a file with several animations each is a clip, unless `clip` names one; `show` is called with each path before it
    is read.
    """
    clips = []
    for path in paths:
        show(path)
        numbers = [clip] if clip else [number for _, _, number in animations_of(path, PurePath(path.name))]
        clips += [_audited(path, number, pictures) for number in numbers]
    rigs = defaultdict(list)
    for each in clips:
        if each.rig:
            rigs[each.rig].append(each)
    for of_rig in rigs.values():
        _find_duplicates(of_rig)
        if len(of_rig) >= LEAST:
            _compare(of_rig)
    return clips


def usual_limits() -> dict[str, float]:
    """Return the limit of each kind of fault, by its key."""
    return {key: kind.limit for key, kind in KINDS.items()}


def _audited(path: Path, clip: str | None, pictures: bool) -> AuditedClip:
    try:
        motion, _ = parse_motion(load_file(path), clip)
        findings = find_faults(motion)
    except DistretargetError as error:
        return AuditedClip(path=path, animation=clip, findings={"unreadable": Finding(1.0, None, error.reason)})
    if "unreadable" in findings:
        return AuditedClip(path=path, animation=clip, findings=findings)
    body = Body.of_motion(motion)
    leg = 0.5 * body.unit
    return AuditedClip(
        path=path,
        animation=clip,
        findings=findings,
        rig=_rig(motion),
        frames=len(motion),
        frame_time=motion.frame_time,
        leg=leg,
        up=body.up,
        pictures=dict(_pictures(motion, body, findings)) if pictures else {},
        places=_places(motion, leg),
    )


def _pictures(motion: Motion, body: Body, findings: Findings) -> Iterator[tuple[str, str]]:
    """The worst frame of each kind of fault, between those before and after it."""
    keys = motion.skeleton.keys
    for kind, found in findings.items():
        if found.frame is not None:
            frames = range(max(found.frame - 1, 0), min(found.frame + 2, len(motion)))
            marked = keys.index(found.where) if found.where in keys else -1
            label = f"frames {frames[0]} to {frames[-1]}"
            yield (
                kind,
                stick_figures(
                    motion.skeleton.parents, motion.positions[frames[0] : frames[-1] + 1], body.up_vector, label, marked
                ),
            )


def _rig(motion: Motion) -> str:
    skeleton = motion.skeleton
    text = json.dumps([skeleton.names, skeleton.parents.tolist()])
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def _places(motion: Motion, leg: float) -> NDArray[np.float32]:
    some = np.linspace(0, len(motion) - 1, min(SAMPLES, len(motion))).astype(int)
    places = motion.positions[some] - motion.positions[0, 0]
    return np.asarray(places / leg, np.float32)


def _find_duplicates(clips: Sequence[AuditedClip]) -> None:
    """Note the other clips of a rig that have the same motion, at any size and place, as an earlier one."""
    seen: dict[int, list[AuditedClip]] = defaultdict(list)
    for clip in clips:
        same = (one for one in seen[clip.frames] if np.abs(one.places - clip.places).max(initial=0.0) < ALIKE)
        first = next(same, None)
        clip.findings["duplicate"] = Finding(float(first is not None), None, f"of {first.name}" if first else "")
        if first is None:
            seen[clip.frames].append(clip)


def _compare(clips: Sequence[AuditedClip]) -> None:
    """Compare unit, axis up and frame time of each clip of a rig with what most of them have."""
    leg = float(np.median([clip.leg for clip in clips]))
    up, most_up = Counter(clip.up for clip in clips).most_common(1)[0]
    rates = Counter(round(1.0 / clip.frame_time, 1) for clip in clips)
    rate, most_rate = rates.most_common(1)[0]
    for clip in clips:
        ratio = clip.leg / leg
        unlike = f"{ratio:.3g} times as large as most" if ratio < 1 / 1.01 or ratio > 1.01 else ""
        clip.findings["unit"] = Finding(max(ratio, 1.0 / ratio), None, unlike)
        if clip.up != up and 2 * most_up > len(clips):
            clip.findings["up_axis"] = Finding(1.0, None, f"{clip.up} is up, {up} in most")
        if 2 * most_rate > len(clips):
            off = 100.0 * abs(clip.frame_time * rate - 1.0)
            own = f"{1.0 / clip.frame_time:.4g} frames/s, {rate:.4g} in most" if off > KINDS["frame_time"].limit else ""
            clip.findings["frame_time"] = Finding(off, None, own)
