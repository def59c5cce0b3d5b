"""The summary of a run: numbers of clips, the worst ones, the failures; and the spread of alignments of one rig with
one target, which should be equal in all clips.

If the rest pose of a rig is not a standing one, each clip's motion decides how its joints are aligned with the
target's, and the posture of head, hands and feet in the clip may get into the alignment.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath

import numpy as np

from distretarget.baseline.rotation_copy import rest_alignment
from distretarget.batch.results import BatchRecord
from distretarget.body.anatomy import ARM, LEG, SIDES
from distretarget.errors import counted
from distretarget.matching.matching import Matching
from distretarget.measure.metrics import of_columns
from distretarget.measure.verdict import faults
from distretarget.numerics.vectors import Array, angles_between, lengths, normalised
from distretarget.skeleton import Skeleton

LISTED = 20  # limit of the clips listed as failed
LOOK_AT = 10  # limit of the clips listed as worth a look
MOST_REASONS = 2  # limit of the reasons given for each of these
SPREAD_ROLES = ("hips", "chest", "neck", "head", *(side + part for side in SIDES for part in (*ARM, *LEG)))
MOST_SPREAD = 8.0  # accepted difference between the alignments of clips of one rig [degrees]
SCALE = 32767.0  # of quaternions stored as int16


@dataclass(kw_only=True)
class Tally:
    """The number of clips in a run by outcome, the worst clips and the failures.

    Attributes:
        clips: clips in the run.
        done: clips retargeted.
        skipped: clips that an earlier run retargeted.
        failed: clips that could not be retargeted.
        warned: clips that are done and have warnings.
        frames: frames retargeted.
        workers: processes used.
        seconds: the time taken, without the start of the processes [s].
        alignments: warnings about alignments that differ, a line each.
    """

    clips: int
    done: int = 0
    skipped: int = 0
    failed: int = 0
    warned: int = 0
    frames: int = 0
    workers: int = 1
    seconds: float = 0.0
    alignments: Sequence[str] = ()
    _look_at: list[tuple[float, str]] = field(default_factory=list)  # of clips with warnings, see `_severity`
    _failures: list[str] = field(default_factory=list)

    def add(self, record: BatchRecord | None) -> None:
        """Count a clip by its record, or None if it was done before."""
        if record is None:
            self.skipped += 1
        elif record["status"] == "done":
            self.done += 1
            self.frames += record["frames"]
            if record["warnings"]:
                self.warned += 1
                self._look_at = sorted([*self._look_at, _severity(record)], reverse=True)[:LOOK_AT]
        else:
            self.failed += 1
            if self.failed <= LISTED:
                clip, error = record["input"], record["error"] or "no reason given"
                self._failures.append(f"  {error}" if error.startswith(clip) else f"  {clip}: {error}")

    @property
    def lines(self) -> list[str]:
        """The summary of the run."""
        counts = [f"{self.done} converted", f"{self.skipped} done before", f"{self.failed} failed"]
        if left := self.clips - self.done - self.skipped - self.failed:
            counts.append(f"{left} left")
        lines = [f"{counted(self.clips, 'clip')}: {', '.join(counts)}"]
        if self.frames:
            frames = "1 frame" if self.frames == 1 else f"{self.frames:,} frames"
            rate = f"{self.frames / self.seconds:,.0f} frames/s with {counted(self.workers, 'job')}"
            lines.append(f"{frames} in {self.seconds:.1f} s, {rate}")
        if self.warned:
            some = f", the worst {LOOK_AT} of which are here" if self.warned > LOOK_AT else ""
            lines.append(f"look at {self.warned} of {self.done} clips, worst first{some}; metrics.csv has the frames:")
            lines += [why for _, why in self._look_at]
        return [*lines, *self.alignments, *self.failures]

    @property
    def failures(self) -> list[str]:
        """The lines on clips that failed, and why."""
        more = self.failed - len(self._failures)
        last = [f"  and {more} more; metrics.csv has them all"] if more else []
        return ["failed:", *self._failures, *last] if self.failed else []


def _severity(record: BatchRecord) -> tuple[float, str]:
    """The largest ratio of a clip's metrics to their limits, 0 if all are within, and the line on it."""
    found = faults(of_columns(record["metrics"]))
    reasons = "; ".join(reason for _, reason in found[:MOST_REASONS]) or record["warnings"][0]
    return found[0][0] if found else 0.0, f"  {record['output']}: {reasons}"


def alignment_text(matching: Matching) -> str:
    """Return the alignment of two bodies as text: a hash of the source's rig, and rotations; empty without anatomy."""
    if matching.target.anatomy is None:
        return ""
    packed = np.round(SCALE * role_rotations(matching)).astype("<i2").tobytes()
    return f"{_rig(matching.source.skeleton)}:{base64.b64encode(packed).decode()}"


def role_rotations(matching: Matching) -> Array:
    """Return the rotations that align the joints of `SPREAD_ROLES`, (len(SPREAD_ROLES), 4); zero for missing ones."""
    roles = matching.target.roles
    alignment, rotations = rest_alignment(matching)[:, 0], np.zeros((len(SPREAD_ROLES), 4))
    for k, role in enumerate(SPREAD_ROLES):
        if role in roles and matching.drivers[roles[role]] >= 0:
            rotations[k] = alignment[roles[role]]
    return rotations


def _rig(skeleton: Skeleton) -> str:
    """A hash of the names, the tree and the rest pose of a rig, independent of bone lengths."""
    directions = np.round(normalised(skeleton.offsets[1:]), 1) + 0.0
    text = json.dumps([skeleton.names, skeleton.parents.tolist(), directions.tolist()])
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def spread_warnings(records: Iterable[BatchRecord]) -> Iterator[str]:
    """Yield a line for each rig and target whose alignments in a batch differ by more than `MOST_SPREAD`."""
    groups: dict[tuple[str, ...], list[tuple[str, Array]]] = defaultdict(list)
    for record in records:
        rig, _, text = record["alignment"].partition(":")
        rotations = _unpacked(text)
        if rotations is not None:
            key = rig, record["target"], record["target_hash"], json.dumps(record["options"])
            groups[key].append((record["output"], rotations))
    for (_, target, *_), clips in groups.items():
        angle, role, one, other = largest_spread(np.array([rotations for _, rotations in clips]))
        if angle > MOST_SPREAD:
            yield (
                f"warning: {len(clips)} clips of one rig are aligned with {PurePath(target).name} in ways that differ "
                f"by up to {angle:.0f} degrees ({SPREAD_ROLES[role]}, {clips[one][0]} and {clips[other][0]}): nobody "
                "can stand in the rest pose, and each clip is aligned by its own motion"
            )


def _unpacked(text: str) -> Array | None:
    """The rotations in an alignment's text, (len(SPREAD_ROLES), 4); None if it is not one."""
    try:
        return np.frombuffer(base64.b64decode(text, validate=True), "<i2").astype(float).reshape(len(SPREAD_ROLES), 4)
    except ValueError:
        return None


def largest_spread(rotations: Array) -> tuple[float, int, int, int]:
    """Return about the largest angle between the rotations of a joint in two clips [degrees], the joint, and the clips.
    `rotations` are (clips, joints, 4), zero if unknown. All are compared with that farthest from the first.
    """
    joints = np.arange(rotations.shape[1])
    one = _angles(rotations, rotations[0]).argmax(axis=0)
    angles = _angles(rotations, rotations[one, joints])
    other, joint = np.unravel_index(angles.argmax(), angles.shape)
    return float(angles[other, joint]), int(joint), int(one[joint]), int(other)


def _angles(rotations: Array, others: Array) -> Array:
    """The angles, (clips, joints), between rotations, (clips, joints, 4), and others, (joints, 4) [degrees]."""
    known = (lengths(rotations) > 0) & (lengths(others) > 0)
    angles = angles_between(rotations, np.broadcast_to(others, rotations.shape))
    return np.asarray(np.where(known, np.degrees(2.0 * np.minimum(angles, np.pi - angles)), 0.0))
